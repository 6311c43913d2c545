"""Reproduce the paper: its figures, its table and its example, from this program, with the paper's numbers beside them.

Kamarianakis, Lydatakis, Papagiannakis, "Never 'Drop the Ball' in the Operating Room", 2021. The table is made from the
clips in assets/, and with --recordings also from those in a folder. The section on whole bodies uses the bodies in that
folder, and those that --bodies names.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path

from rigid_motion_batch.command_line import complain, parser_of, path_line, program_of
from rigid_motion_batch.system_libraries import missing_for_rendering, require_blender, way_out

SCRIPT = "research paper"
PROGRAM = program_of(SCRIPT)

require_blender(SCRIPT)

from research.paper.bodies import body_files
from research.paper.motions import recordings_in
from research.paper.page import with_section
from research.paper.steps import PAGE, SECTIONS, plan, plan_bodies, plan_sending
from research.paper.timing import ROUNDS
from research.study import Study
from rigid_motion_batch.files import write_text, written_beside
from rigid_motion_batch.pipeline.performing import Executor
from rigid_motion_batch.pipeline.running import Outcome, run
from rigid_motion_batch.pipeline.store import FolderInUse, OutputError, Store
from rigid_motion_batch.places import ASSETS, CHECKOUT, from_here, output_folder
from rigid_motion_batch.progress import Progress
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.supervising import report

EPILOG = """
examples:
  python scripts/research paper
  python scripts/research paper --recordings ../recordings
  python scripts/research paper --recordings ../recordings --docs
  python scripts/research paper --recordings ../recordings --bodies ../rigs run.fbx
  python scripts/research paper --bodies ../rigs --only-bodies --docs
  python scripts/research paper --recordings ../recordings --only-sending --docs
  python scripts/research paper --no-video --output /tmp/paper
  blender --background --python scripts/research/__main__.py -- paper --no-pictures

It writes the page, OUTPUT/paper.md, with its pictures in OUTPUT/paper/ and all of its numbers in OUTPUT/*.csv. Nothing
is done twice: after Ctrl-C, or with more recordings, the same command continues. A second run gives the same numbers,
except those of timing.csv. The two sections that take longest can be written alone: --only-bodies writes the section on
whole bodies, OUTPUT/bodies.md, and --only-sending that on live streams, OUTPUT/sending.md. --docs then replaces this
section of the page there, and leaves the others. The last line printed is the path of the page.
Exit code: 0 done, 1 a part of it failed (the page holds the others), 2 a wrong input or option, 130 stopped by Ctrl-C.
"""


def parse(arguments: list[str]) -> argparse.Namespace:
    """The options; a wrong one ends the program with code 2 and a line that says what is wrong."""
    parser = parser_of(SCRIPT, __doc__, EPILOG)
    parser.add_argument("--recordings", type=Path, metavar="FOLDER", help="more recordings for the table")
    parser.add_argument(
        "--bodies", type=Path, nargs="+", default=[], metavar="PATH", help="whole bodies, or folders of them"
    )
    alone = parser.add_mutually_exclusive_group()
    for section, what in (("bodies", "whole bodies"), ("sending", "streams that are sent when needed")):
        alone.add_argument(
            f"--only-{section}",
            dest="only",
            action="store_const",
            const=section,
            help=f"write only the section on {what}",
        )
    parser.add_argument(
        "--output", type=Path, default=output_folder("paper"), help="folder to write to (renders/paper)"
    )
    parser.add_argument(
        "--docs",
        type=Path,
        nargs="?",
        const=(CHECKOUT or Path()) / "docs",
        metavar="FOLDER",
        help="copy the page and its pictures to this folder (docs)",
    )
    parser.add_argument("--no-video", action="store_true", help="make pictures, but no film")
    parser.add_argument("--no-pictures", action="store_true", help="make nothing that Blender has to render")
    parser.add_argument("--rounds", type=_count, default=ROUNDS, metavar="N", help="rounds of the timing (%(default)s)")
    parser.add_argument("--force", action="store_true", help="do everything again")
    return parser.parse_args(arguments)


def main(arguments: list[str]) -> int:
    """Reproduce the paper, and return the exit code."""
    options = parse(arguments)
    missing = None if options.no_pictures or options.only else missing_for_rendering()
    if missing:
        print(f"{PROGRAM}: {way_out(missing)}\nOr go without pictures: --no-pictures", file=sys.stderr)
        return 2
    page = options.output / SECTIONS.get(options.only, PAGE)
    try:
        if options.only and options.docs and not (options.docs / PAGE).is_file():
            raise ValueError(f"{options.docs / PAGE}: there is no page to put the section into; leave --docs out")
        with Store(options.output, overwrite=True) as store, Executor() as executor:
            tasks = list(_studied(options, store).tasks.values())
            if options.force:
                for task in tasks:
                    store.discard(task.key)
            outcome = run(lambda: tasks, store, executor, progress=Progress(program=PROGRAM), title="Reproducing")
            there = [path for task in tasks if store.result(task.key) for path in task.publish]
        if options.docs and not (outcome.interrupted or outcome.problem):
            if options.only:
                section, whole = page.read_text(encoding="utf-8"), (options.docs / PAGE).read_text(encoding="utf-8")
                write_text(options.docs / PAGE, with_section(whole, section))
            else:
                copy_page([*there, PAGE], options.output, options.docs)
            page = options.docs / PAGE
    except (TrajectoryError, ValueError, FolderInUse, OutputError) as error:
        complain(PROGRAM, error)
        return 2
    except OSError as error:
        complain(PROGRAM, error, options.output)
        return 2
    return _report(outcome, page)


def copy_page(there: Iterable[str], output: Path, docs: Path) -> None:
    """Copy the page, and the pictures that it shows, of the files that are there, to another folder."""
    for path in dict.fromkeys(there):
        if path == PAGE or path.startswith("paper/"):
            with written_beside(docs / path) as beside:
                shutil.copyfile(output / path, beside)


def _studied(options: argparse.Namespace, store: Store) -> Study:
    study = Study(store)
    recordings = recordings_in(options.recordings) if options.recordings else []
    bodies = body_files(options.bodies)
    own = sorted(from_here(ASSETS).glob("*.csv"))
    if options.only == "bodies":
        plan_bodies(study, recordings, bodies)
    elif options.only == "sending":
        plan_sending(study, own, recordings)
    else:
        rendered, film = not options.no_pictures, not options.no_video
        plan(study, own, recordings, bodies, rendered=rendered, film=film, rounds=options.rounds)
    return study


def _report(outcome: Outcome, page: Path) -> int:
    """Say how it went, and where the page is."""
    for name, problem in outcome.failures.items():
        complain(PROGRAM, f"{name}: {problem}")
    print(f"{outcome}.", file=sys.stderr)
    if outcome.problem:
        complain(PROGRAM, outcome.problem)
        return 2
    if outcome.interrupted:
        report(ended=True)
        print("Stopped; the same call goes on from here.", file=sys.stderr)
    if page.is_file():
        print(path_line(page.resolve()), flush=True)
    return 130 if outcome.interrupted else int(bool(outcome.failures))


def _count(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and 2 <= int(text) <= 10_000):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of rounds; give 2 to 10000")
    return int(text)
