"""Command-line options shared by the commands that key files. No Blender is needed here."""

from __future__ import annotations

import argparse

from rigid_motion_batch.command_line import folder_path, whole

EXIT_CODES = """
Exit code: 0 all done, or nothing to do, 1 some objects, bones or files could not be done, and are named with the reason
(the others are done), 2 a wrong option, or no file could be read, 130 stopped by Ctrl-C, and 143 by SIGTERM, within
2 s: the files written by then are complete, nothing else was changed.
"""
"""The last paragraph of the help of these commands."""


def add_target_options(parser: argparse.ArgumentParser, which: str) -> None:
    """Add --objects, whose help says with `which` what "all" means, and --dry-run."""
    parser.add_argument(
        "--objects",
        type=_names,
        metavar="NAME,...",
        help="only these objects, and of rigs all of their bones; Rig/Hand is one bone; * and ? stand for any letters, "
        f"as in 'Tool*' and 'Rig/*' (all with {which})",
    )
    add_dry_run(parser)


def add_dry_run(parser: argparse.ArgumentParser) -> None:
    """Add --dry-run."""
    parser.add_argument("--dry-run", action="store_true", help="do everything but write, and say what would be written")


def add_file_options(parser: argparse.ArgumentParser, *, blend: bool = True) -> None:
    """Add a group of options that say where to write."""
    places = parser.add_argument_group("files")
    places.add_argument(
        "--output",
        type=folder_path,
        metavar="FOLDER",
        help="where to write (beside each file); for a single input also the name of a file",
    )
    places.add_argument(
        "--overwrite", action="store_true", help="replace files that were edited, or that this program did not write"
    )
    if blend:
        places.add_argument("--in-place", action="store_true", help="save the .blend files themselves")
    places.add_argument(
        "--jobs",
        type=whole("number of processes", 0, 999),
        metavar="N",
        help="worker processes for several inputs; 0 to work in this one (one for each processor)",
    )


def refuse_odd_places(options: argparse.Namespace) -> None:
    """Raise ValueError if the options for places contradict each other."""
    if options.in_place and options.output:
        raise ValueError("--in-place saves the files themselves, --output writes others: give one of them")


def _names(text: str) -> list[str]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise ValueError("name an object, or several as in Camera,'Tool*','Rig/*'")
    return names
