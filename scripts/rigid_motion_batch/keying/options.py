"""What is to be done, and where the result goes, as the commands that key files are told. No Blender is needed here."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rigid_motion_batch.command_line import folder_path

NAMES_OF_FILES = {".blend", ".csv", ".glb", ".gltf", ".tum"}
"""What a folder is not called."""


@dataclass(frozen=True)
class Job:
    """A file to be done."""

    source: Path
    output: Path
    """The same where it is done in place."""

    @property
    def title(self) -> str:
        return self.source.name


def jobs_of(
    files: Sequence[Path], suffix: str, folder: Path | None, *, in_place: bool, ending: str | None = None
) -> list[Job]:
    """What to read and where to write it, with an ending of its own; a file that is named twice is one.

    Raises
    ------
    ValueError
        Where two files would be written to one place, or one over another that is to be read.
    """
    sources: dict[str, Path] = {}
    for path in files:
        sources.setdefault(place_of(path), path)
    jobs, places = [], {}
    for path in sources.values():
        output = path if in_place else (folder or path.parent) / f"{path.stem}{suffix}{ending or path.suffix.lower()}"
        place = place_of(output)
        if place in places:
            raise ValueError(
                f"{places[place]} and {path} would both be written to {output}: do them one after the other, with "
                "another --output"
            )
        if not in_place and place in sources:
            raise ValueError(f"{path} would be written over {output}, which is to be read too: leave one of them out")
        places[place] = path
        jobs.append(Job(path, output))
    return jobs


def place_of(path: Path) -> str:
    """Where a path leads to; the same for all paths that lead there."""
    return os.path.normcase(os.path.realpath(path))  # Path.resolve of Python 3.11 fails where links go in circles.


def add_target_options(parser: argparse.ArgumentParser, which: str) -> None:
    """Add --objects, which says of "all" bones which those are, and --dry-run."""
    parser.add_argument(
        "--objects",
        type=_names,
        metavar="NAME,...",
        help="only these objects, and of rigs all of their bones; Rig/Hand is one bone; * and ? stand for any letters, "
        f"as in 'Tool*' and 'Rig/*' (all with {which})",
    )
    parser.add_argument("--dry-run", action="store_true", help="do everything but write, and say what would be written")


def add_file_options(parser: argparse.ArgumentParser) -> None:
    """Add a group of options that say where to write."""
    places = parser.add_argument_group("files")
    places.add_argument("--output", type=folder_path, metavar="FOLDER", help="where to write (beside each file)")
    places.add_argument("--overwrite", action="store_true", help="replace files of an earlier run")
    places.add_argument("--in-place", action="store_true", help="save the .blend files themselves")


def refuse_odd_places(options: argparse.Namespace) -> None:
    """Raise ValueError where the options of that group do not go together, or say no folder."""
    if options.in_place and options.output:
        raise ValueError("--in-place saves the files themselves, --output writes others: give one of them")
    if options.output and options.output.exists() and not options.output.is_dir():
        raise ValueError(f"--output {options.output} is a file: give a folder")
    if options.output and options.output.suffix.lower() in NAMES_OF_FILES and not options.output.exists():
        raise ValueError(f"--output {options.output} is the name of a file: give a folder")


def _names(text: str) -> list[str]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise argparse.ArgumentTypeError("name an object, or several as in Camera,'Tool*','Rig/*'")
    return names
