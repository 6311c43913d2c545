"""Files that are to be written: why one cannot be, said before hours go into it. No Blender is needed here."""

from __future__ import annotations

import os
from pathlib import Path

LONGEST_NAME = 255
"""Bytes of the name of a file."""


class FileProblem(Exception):
    """Why a file cannot be done, and the way out."""


class Unreadable(FileProblem):
    """Why a file cannot be opened, and the way out."""


def not_written(path: str | Path, reason: object) -> FileProblem:
    """Return why a file was begun, and is not there."""
    return FileProblem(f"{path} could not be written ({reason}): write elsewhere with --output")


def changed_at(path: Path) -> int | None:
    """Return when a file was changed last, in nanoseconds; None where there is none."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return None


def refuse_long_name(path: Path) -> None:
    """Raise `FileProblem` where a file system allows no name that is as long as this one."""
    length = len(os.fsencode(path.name))
    if length > LONGEST_NAME:
        raise FileProblem(
            f"the name {path.name} has {length} bytes, of which file systems allow {LONGEST_NAME}: "
            "give the input a shorter name"
        )


def refuse_read_only(path: Path) -> None:
    """Raise `FileProblem` where a file or its folder cannot be written: better said before hours go into it."""
    place = Path(os.path.realpath(path))
    if not os.path.exists(place):
        place = next(parent for parent in place.parents if os.path.exists(parent))
        if not os.path.isdir(place):
            raise FileProblem(f"{place} is a file, and {path} cannot be written in it: give another --output")
    elif os.access(place, os.W_OK):
        place = place.parent
    if not os.access(place, os.W_OK):
        raise FileProblem(
            f"{path} cannot be written, for {place} is read-only: allow it, or write elsewhere with --output"
        )
