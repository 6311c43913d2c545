"""Write a comparison as an Open Job Description bundle, for render farms to run.

Its steps are the stages of a comparison, each split into tasks that may run at the same time, fail, be killed and be
run again. It takes the options of compare.py.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from rigid_motion_batch.cli.compare_options import parse as parse_comparison
from rigid_motion_batch.cli.compare_options import without
from rigid_motion_batch.command_line import complain, parser_of, program_of, whole
from rigid_motion_batch.files import write_text
from rigid_motion_batch.pipeline.comparison_steps import STAGES
from rigid_motion_batch.pipeline.steps import VERSION_VARIABLE, version_here
from rigid_motion_batch.places import PACKAGE, output_folder

SCRIPT = "job_bundle.py"
PROGRAM = program_of(SCRIPT)

DEFAULT_TASKS = 16
"""Default number of tasks per stage."""

MOST_PARTS = 1024
"""Limit of Open Job Description for the values of a parameter."""

FILM_STAGES = ("build", "render", "encode")
"""The stages that make films."""

WHOLE_STAGES = ("slip", "report")
"""The stages that are not split into tasks."""

INPUTS = "{{Param.Inputs}}"
"""The job's input folder, as it appears in arguments."""

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
    if options.only:
        complain(PROGRAM, "--only is for a run of compare.py itself; leave it out")
        return 2
    output = (options.output or output_folder("comparison")).absolute()
    stages = [stage for stage in STAGES if options.stage or stage not in FILM_STAGES]
    parts = {stage: 1 if stage in WHOLE_STAGES else own.parts for stage in stages}
    try:
        rest, inputs = below_inputs(without(rest, "-o", "--output"))
        values = write_bundle(own.bundle.absolute(), rest, inputs, output, parts)
    except ValueError as error:
        complain(PROGRAM, error)
        return 2
    except OSError as error:
        complain(PROGRAM, error, own.bundle)
        return 2
    given = (f"-p {shlex.quote(f'{name}={value}')}" for name, value in values.items())
    print("openjd run", shlex.quote(os.fspath(own.bundle.absolute() / "template.json")), *given)
    return 0


def write_bundle(
    folder: Path, arguments: Sequence[str], inputs: Path, output: Path, parts: Mapping[str, int]
) -> dict[str, str]:
    """Write the files of a bundle; return the job's parameters for a farm where all paths are as on this machine.

    `arguments` are those of the comparison without `--output`, with files relative to `INPUTS`. `parts` maps each stage
    to its number of tasks. The bundle has no list of tasks: each task plans the comparison anew, and does its share.
    """
    template = json.loads(Path(__file__).with_name("job_template.json").read_text(encoding="utf-8"))
    template["name"] = output.name
    template["jobEnvironments"][0]["variables"][VERSION_VARIABLE] = version_here()
    for before, (stage, count) in zip(["", *parts], parts.items(), strict=False):
        share = "--output", "{{Param.Output}}", "--only", stage, "--part", f"{{{{Task.Param.Part}}}}/{count}"
        command = ["-m", "rigid_motion_batch", "compare", *arguments, *share]
        step = {
            "name": stage.capitalize(),
            "parameterSpace": {"taskParameterDefinitions": [{"name": "Part", "type": "INT", "range": f"1-{count}"}]},
            "script": {"actions": {"onRun": {"command": "{{Param.Python}}", "args": command}}},
        }
        template["steps"].append(step | ({"dependencies": [{"dependsOn": before.capitalize()}]} if before else {}))
    values = {"Program": str(PACKAGE.parent), "Python": sys.executable, "Inputs": str(inputs), "Output": str(output)}
    given = {"parameterValues": [{"name": parameter, "value": value} for parameter, value in values.items()]}
    for file, content in (("parameter_values.json", given), ("template.json", template)):
        write_text(folder / file, json.dumps(content, indent=2, ensure_ascii=False) + "\n")
    return values


def below_inputs(arguments: Sequence[str]) -> tuple[list[str], Path]:
    """Return arguments with their files as the job finds them, below `INPUTS`, and the folder of the inputs.

    A file may be given as FILE, FILE:BODY or --option=FILE. The program of `--blender` is not an input. Raises
    ValueError if an argument contains "{{", which a template would take for an expression, or if no folder contains all
    inputs (on Windows).
    """
    if braced := next((argument for argument in arguments if "{{" in argument), None):
        raise ValueError(f"{braced!r}: a job cannot have this name, for its braces; rename it")
    parts = [_file_in(one, before) for before, one in pairwise(["", *arguments])]
    places = [os.path.abspath(file) for _, file, _ in parts if file]
    inputs = Path(os.path.commonpath([Path(place).parent for place in places])) if places else Path.cwd()

    def moved(file: str) -> str:
        return f"{INPUTS}/{Path(os.path.abspath(file)).relative_to(inputs).as_posix()}" if file else ""

    return [option + moved(file) + rest for option, file, rest in parts], inputs


def _file_in(argument: str, before: str) -> tuple[str, str, str]:
    """Return the text before the file in an argument, the file or folder, and the text after it; "" for none."""
    option, equals, value = argument.partition("=") if argument.startswith("-") else ("", "", argument)
    # A number is not a file, even if the current folder has a file of that name.
    if "--blender" in (option, before) or "\0" in value or value.replace(".", "").isdigit():
        return argument, "", ""
    ends = [len(value), *(place for place in range(len(value) - 1, 0, -1) if value[place] == ":")]
    end = next((end for end in ends if os.path.exists(value[:end])), 0)
    return option + equals, value[:end], value[end:]


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
        default=DEFAULT_TASKS,
        metavar="N",
        help=f"tasks that each stage is split into, at most {MOST_PARTS} (%(default)s)",
    )
    return parser.parse_known_args(arguments)
