"""Take the trembling and the spikes out of recordings, and move nothing by more than is allowed.

Nothing has to be set: what no motion explains is found in each recording. Every file comes back in its own format, with
other numbers where something was moved and the same text everywhere else. Of each body the program says by how much it
trembles, how far anything was moved, and which rows were spikes.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

from rigid_motion_batch.analysis.choices import Tolerance, radius_in_metres
from rigid_motion_batch.command_line import INSTALLED, Parser, bounded, not_empty
from rigid_motion_batch.keying.cleaning import SUFFIX, TABLES, Cleaning, do_cleaning
from rigid_motion_batch.keying.options import EXIT_CODES, add_dry_run, add_file_options
from rigid_motion_batch.keying.planning import InputJob, file_and_body, named_file, planned
from rigid_motion_batch.keying.records import is_made
from rigid_motion_batch.keying.reductions import name_of
from rigid_motion_batch.keying.sessions import do_all
from rigid_motion_batch.keying.work import RunningJob, Work
from rigid_motion_batch.places import CHECKOUT
from rigid_motion_batch.recordings.gltf import ENDINGS as GLTF
from rigid_motion_batch.recordings.options import add_reading_options, reading_options

PROGRAM = f"{'python scripts/bootstrap.py' if CHECKOUT else INSTALLED} clean"

IN_FOLDERS = (".bvh", ".chan", ".csv", ".g2o", ".tsv", ".tum")
"""Endings of the files that are taken of a folder. What else it reads may be anything: .json, .txt."""

ANIMATED = (".blend", ".fbx", *GLTF)

DEFAULT_FOCAL_PX = 2667.0
"""Pixels: a lens of 50 mm on 36 mm, 1920 pixels wide, as cameras in Blender begin."""

EPILOG = f"""
examples:
  {PROGRAM} hand.csv
  {PROGRAM} hand.csv --tolerance 2mm --output clean/hand.csv
  {PROGRAM} walk.bvh --tolerance 1cm
  {PROGRAM} camera.tum --pixels 0.5 --nearest 2m --focal 1400
  {PROGRAM} takes --output clean --jobs 4 --dry-run

what is written:
  hand.csv becomes hand-cleaned.csv beside it or in --output, which for a single input may be the name of the file: with
  all its columns, comments and bodies, and FILE:BODY with that body alone cleaned. A .csv or .tum file may be made of
  any rigid motion: poses alone, in the axes and units of the recording. Other columns, such as velocities, stay as they
  were recorded, and so do Qualisys's angles beside its matrices. Files of Blender, FBX and glTF are animated and not
  recorded: there is Clean Motion in Blender.

  No row is moved by more than the tolerance but those that are listed, as spikes or as repeats of the row before, and
  the joints that hang on them. They are counted from 0, without headers. Where the clock trembles the times are written
  in steady steps, if they are numbers in a single column of that body alone. Gaps stay gaps. What was cleaned before
  is left alone. A folder stands for the files in it and below that end in {", ".join(IN_FOLDERS)}; the same command
  again does what is new or has changed.
"""


def main(arguments: list[str]) -> int:
    """Clean all inputs, and return the exit code."""
    options = _parse(arguments)
    return do_all(PROGRAM, options.todo, options.work, options.jobs)


@dataclass(frozen=True)
class Clean(Work):
    """Cleaning."""

    doing, done = "Cleaning", "cleaned"
    how: Cleaning

    def needs_blender(self, job: InputJob) -> bool:  # noqa: ARG002 - none does
        return False

    def do(self, doing: RunningJob) -> None:
        do_cleaning(doing, self.how)


def _parse(arguments: list[str]) -> argparse.Namespace:
    formatter = argparse.RawDescriptionHelpFormatter
    parser = Parser(prog=PROGRAM, description=__doc__, epilog=EPILOG + EXIT_CODES, formatter_class=formatter)
    parser.set_defaults(objects=None)
    parser.add_argument("inputs", nargs="+", type=not_empty, metavar="INPUT", help="recordings, folders")
    add_dry_run(parser)
    moved = parser.add_argument_group("how far")
    moved.add_argument(
        "--tolerance",
        type=Tolerance,
        metavar="LENGTH",
        help="how far any point may be moved: 2mm, 0.2cm; a plain number is in the unit of the file (any length)",
    )
    moved.add_argument(
        "--radius",
        type=radius_in_metres,
        metavar="LENGTH",
        help="of the ball around each body and joint whose points count (10cm for rigid bodies, 3cm for joints)",
    )
    moved.add_argument(
        "--pixels",
        type=bounded("number of pixels", 0.0, 100.0, above=True),
        metavar="N",
        help="of a camera: how far anything may be moved in its picture, near the middle of it",
    )
    moved.add_argument(
        "--nearest", type=radius_in_metres, metavar="LENGTH", help="with --pixels: how near to the camera anything is"
    )
    moved.add_argument(
        "--focal",
        type=bounded("focal length", 1.0, 1e6),
        metavar="PIXELS",
        help=f"with --pixels: the focal length in pixels ({DEFAULT_FOCAL_PX:.0f}, for 50 mm on 36 mm and 1920 pixels)",
    )
    add_reading_options(parser)
    add_file_options(parser, blend=False)
    options = parser.parse_args(arguments)
    try:
        options.reading = reading_options(options)
        options.work = Clean.of(options, how=Cleaning(*_how_far(options), options.axes, options.reading))
        options.todo = _planned(options)
    except ValueError as error:
        parser.error(str(error))
    return options


def _how_far(options: argparse.Namespace) -> tuple[Tolerance | None, float | None]:
    """Return the tolerance and the radius. Raises ValueError for options that do not go together."""
    if options.pixels is None:
        if options.nearest or options.focal:
            raise ValueError("--nearest and --focal say how large a pixel is: add --pixels, or leave them out")
        return options.tolerance, options.radius
    if options.tolerance or options.radius:
        raise ValueError("--pixels is a tolerance itself: leave out --tolerance and --radius")
    if not options.nearest:
        raise ValueError("--pixels needs to know how near anything is: --nearest 2m")
    length = options.pixels * options.nearest / (options.focal or DEFAULT_FOCAL_PX)
    return Tolerance(f"{1e3 * length:.6f}mm"), options.nearest


def _planned(options: argparse.Namespace) -> list[InputJob]:
    first, _ = file_and_body(options.inputs[0])
    named = named_file(options.output, options.inputs, (first.suffix.lower(), *TABLES))

    def job_of(source: str, folder: Path) -> InputJob:
        file, body = file_and_body(source)
        made = named or folder / f"{name_of(file, body)}{SUFFIX}{file.suffix}"
        problem = ""
        if file.suffix.lower() in ANIMATED:
            problem = "this is animated, and not recorded: open or import it in Blender, and use Clean Motion"
        return InputJob(source, made.parent, made, is_recording=True, problem=problem)

    def is_result(path: Path) -> bool:
        return path.stem.endswith(SUFFIX) or is_made(path)

    return planned(options.inputs, None if named else options.output, IN_FOLDERS, is_result, job_of)
