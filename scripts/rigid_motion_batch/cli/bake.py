"""Bake rigid in-betweens to real keys, or undo that, in .blend files and without a window.

In each file, every object and every pose bone with rigid-motion modes gets keys that any program can play. The original
keys stay in the file for un-baking. The result is a new file next to the old one, which does not change.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

from rigid_motion_batch.command_line import bounded, not_empty, parser_of, program_of
from rigid_motion_batch.system_libraries import require_blender

SCRIPT = "bake.py"
PROGRAM = program_of(SCRIPT)

from rigid_motion_batch.keying.options import EXIT_CODES, add_file_options, add_target_options, refuse_odd_places
from rigid_motion_batch.keying.planning import InputJob, named_file, planned
from rigid_motion_batch.keying.records import is_made
from rigid_motion_batch.keying.sessions import do_all
from rigid_motion_batch.keying.work import RunningJob, Work

BAKED, UNBAKED = "-baked", "-unbaked"
"""Suffixes of the names of written files."""

STEP_RANGE_FRAMES = 0.01, 1e6
"""Allowed range of frames between keys: Blender treats keys closer than the minimum as one key."""

EPILOG = """
examples:
  python scripts/bake.py shot.blend
  python scripts/bake.py shots --output farm --jobs 4
  python scripts/bake.py shot.blend --objects 'Camera,Tool*,Rig/Hand*' --step 0.25
  python scripts/bake.py shot.blend --dry-run
  python scripts/bake.py farm/shot-baked.blend --unbake
  blender --background --python scripts/bake.py -- shot.blend

what is written:
  NAME-baked.blend or NAME-unbaked.blend, beside the file or in --output, which for a single input may be the name of
  the file; nothing if there is nothing to do. A file that was edited since, or that the program did not write, is
  replaced only with --overwrite. With --in-place the program replaces the file itself, and keeps the one before as
  NAME.blend1. The paths of the results are printed on standard output, one a line; everything else goes to standard
  error. Relative paths of renders and caches depend on the place of the file, as after Save As. A folder stands for the
  .blend files in it and below, but for results of this program. The same command again does what is new or has changed.

what is run:
  Nothing in the files: scripts and Python expressions stay in them, switched off. An object counts as not done if it
  is missing from a library, overrides a missing one or moves by a missing Action, and so does a file that lacks a
  collection or a scene, unless --objects says which ones you mean.
"""


def parse(arguments: list[str]) -> argparse.Namespace:
    """Return the options; a wrong option ends the program with exit code 2 and one line of explanation."""
    parser = parser_of(SCRIPT, __doc__, EPILOG + EXIT_CODES)
    parser.add_argument("files", nargs="+", type=not_empty, metavar="FILE.blend", help="files to bake, folders")
    parser.add_argument("--unbake", action="store_true", help="restore the original keys of baked objects and bones")
    add_target_options(parser, "modes")
    keys = parser.add_argument_group("keys")
    keys.add_argument(
        "--step",
        type=bounded("number of frames", *STEP_RANGE_FRAMES),
        metavar="N",
        help="frames between keys; 0.25 for keys between frames (1)",
    )
    keys.add_argument(
        "--hold",
        action="store_true",
        default=None,
        help="hold each pose until the next key: with --step 2 the motion is on twos (straight lines)",
    )
    add_file_options(parser)
    options = parser.parse_args(arguments)
    if options.unbake:
        for option in ("step", "hold"):
            if getattr(options, option) is not None:
                parser.error(f"--{option} is for baking, and says nothing to --unbake: leave it out")
    try:
        refuse_odd_places(options)
        given = {"step": options.step or 1.0, "interpolation": "CONSTANT" if options.hold else "LINEAR"}
        options.work = Unbake.of(options) if options.unbake else Bake.of(options, **given)
        options.todo = _planned(options)
    except ValueError as error:
        parser.error(str(error))
    return options


def main(arguments: list[str]) -> int:
    """Do all files, and return the exit code."""
    options = parse(arguments)
    require_blender(SCRIPT)
    return do_all(PROGRAM, options.todo, options.work, options.jobs)


@dataclass(frozen=True)
class Bake(Work):
    """Baking keys."""

    doing, done = "Baking", "baked"
    step: float
    interpolation: str

    def do(self, doing: RunningJob) -> None:
        from rigid_motion_batch.keying.baking import baking
        from rigid_motion_batch.keying.jobs import do_blend

        do_blend(doing, baking(self.step, self.interpolation))


class Unbake(Work):
    """Un-baking: restoring the original keys."""

    doing, done = "Un-baking", "un-baked"

    def do(self, doing: RunningJob) -> None:
        from rigid_motion_batch.keying.baking import unbaking
        from rigid_motion_batch.keying.jobs import do_blend

        do_blend(doing, unbaking())


def _planned(options: argparse.Namespace) -> list[InputJob]:
    suffix = UNBAKED if options.unbake else BAKED
    named = named_file(options.output, options.files, (".blend",))

    def job_of(source: str, folder: Path) -> InputJob:
        file = Path(source)
        made = file if options.in_place else named or folder / f"{file.stem}{suffix}{file.suffix.lower()}"
        return InputJob(source, made.parent, made)

    def is_result(path: Path) -> bool:
        if options.unbake:
            return not path.stem.endswith(BAKED)
        return path.stem.endswith((BAKED, UNBAKED)) or is_made(path)

    return planned(options.files, None if named else options.output, (".blend",), is_result, job_of)
