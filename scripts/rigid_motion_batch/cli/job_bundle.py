"""Write a comparison as an Open Job Description bundle, for render farms to run.

Its steps are the stages of a comparison, each split into tasks that may run at the same time, fail, be killed and be
run again. It takes the options of compare.py.
"""

from __future__ import annotations

import argparse
import os
import shlex
from pathlib import Path

from rigid_motion_batch.cli.compare_options import parse as parse_comparison
from rigid_motion_batch.cli.compare_options import without
from rigid_motion_batch.command_line import complain, parser_of, program_of, whole
from rigid_motion_batch.pipeline.bundle import MOST_PARTS, STAGES, write_bundle
from rigid_motion_batch.places import output_folder

SCRIPT = "job_bundle.py"
PROGRAM = program_of(SCRIPT)

PARTS = 16
"""Tasks that a stage is split into, unless requested otherwise."""

FILMING = ("build", "render", "encode")
"""The stages at the end of which there are films."""

EPILOG = """
It writes a folder with template.json (jobtemplate-2023-09) and parameter_values.json. The last line printed is a
command that runs the job on this machine. docs/farm.md says what a farm needs, and how to submit it.
Exit code: 0 written, 2 not written.

examples:
  python scripts/job_bundle.py hand_left.csv hand_right.csv --axes unity --output renders/hands
  python scripts/job_bundle.py takes/ --parts 200 --no-video --bundle jobs/takes
"""


def main(arguments: list[str]) -> int:
    """Write a bundle, and return the exit code."""
    own, rest = _parse(arguments)
    options = parse_comparison(rest)
    if options.scheduler or options.only or options.explain:
        complain(PROGRAM, "--scheduler, --only and --explain are for a run of compare.py itself; leave them out")
        return 2
    output = (options.output or output_folder("comparison")).absolute()
    stages = [stage for stage in STAGES if options.stage or stage not in FILMING]
    parts = {stage: 1 if stage == "report" else own.parts for stage in stages}
    try:
        values = write_bundle(own.bundle.absolute(), without(rest, "-o", "--output"), output, parts, output.name)
    except ValueError as error:
        complain(PROGRAM, error)
        return 2
    except OSError as error:
        complain(PROGRAM, error, own.bundle)
        return 2
    given = (f"-p {shlex.quote(f'{name}={value}')}" for name, value in values.items())
    print("openjd run", shlex.quote(os.fspath(own.bundle.absolute() / "template.json")), *given)
    return 0


def _parse(arguments: list[str]) -> tuple[argparse.Namespace, list[str]]:
    """Return the options of the bundle, and the arguments of the comparison."""
    usage = "%(prog)s [-h] [--bundle FOLDER] [--parts N] [options of compare.py] [INPUT ...]"
    parser = parser_of(SCRIPT, __doc__, EPILOG, usage=usage, allow_abbrev=False)
    parser.add_argument(
        "--bundle", type=Path, default=output_folder("job_bundle"), help="folder to write (renders/job_bundle)"
    )
    parser.add_argument(
        "--parts",
        type=whole("number of tasks", 1, MOST_PARTS),
        default=PARTS,
        metavar="N",
        help=f"tasks that each stage is split into, at most {MOST_PARTS} (%(default)s)",
    )
    return parser.parse_known_args(arguments)
