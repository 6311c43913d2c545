"""Remove jitter and spikes from recordings, and move nothing by more than the tolerance.

There is nothing else to set: the jitter of each recording is estimated. Every file keeps its format, with other numbers
where something was moved and the same text everywhere else. For each body the program reports its jitter, how
far anything was moved, and which rows were spikes.
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
"""Extensions of the files that are taken from a folder. Other readable files may be anything: .json, .txt."""

ANIMATED = (".blend", ".fbx", *GLTF)

DEFAULT_FOCAL_PX = 2667.0
"""In pixels: Blender's default camera, a lens of 50 mm on a sensor of 36 mm, 1920 pixels wide."""

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
  were recorded, and so do Qualisys's angles next to its matrices. Blender, FBX and glTF files are animations, not
  recordings: use Clean Motion in Blender.

  Only listed rows, spikes or repeats of the row before, and the joints below them are moved by more than the tolerance.
  They are counted from 0, without headers. If the clock jitters the times are written in steady steps, if they are
  numbers in a single column of that body alone. Gaps stay gaps. Cleaned files are left alone.
  A folder stands for the files in it and below that end in {", ".join(IN_FOLDERS)}; the same command
  again does only what is new or changed.
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
        help="radius of the ball around each body and joint (10cm for rigid bodies, 3cm for joints)",
    )
    moved.add_argument(
        "--pixels",
        type=bounded("number of pixels", 0.0, 100.0, above=True),
        metavar="N",
        help="for a camera: how far anything may move in its picture, near the middle",
    )
    moved.add_argument(
        "--nearest",
        type=radius_in_metres,
        metavar="LENGTH",
        help="with --pixels: distance of the nearest thing from the camera",
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
        options.work = Clean.of(options, how=Cleaning(*_tolerance_and_radius(options), options.axes, options.reading))
        options.todo = _planned(options)
    except ValueError as error:
        parser.error(str(error))
    return options


def _tolerance_and_radius(options: argparse.Namespace) -> tuple[Tolerance | None, float | None]:
    """Return the tolerance and the radius. Raises ValueError for options that exclude each other."""
    if options.pixels is None:
        if options.nearest or options.focal:
            raise ValueError("--nearest and --focal say how large a pixel is: add --pixels, or leave them out")
        return options.tolerance, options.radius
    if options.tolerance or options.radius:
        raise ValueError("--pixels is a tolerance itself: leave out --tolerance and --radius")
    if not options.nearest:
        raise ValueError("--pixels needs the distance of the nearest thing: --nearest 2m")
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
            problem = "this is an animation, not a recording: open or import it in Blender, and use Clean Motion"
        return InputJob(source, made.parent, made, is_recording=True, problem=problem)

    def is_result(path: Path) -> bool:
        return path.stem.endswith(SUFFIX) or is_made(path)

    return planned(options.inputs, None if named else options.output, IN_FOLDERS, is_result, job_of)
