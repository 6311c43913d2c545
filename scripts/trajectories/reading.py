"""The way from `FILE`, `FILE:BODY` or `FILE:*` to trajectories: the table of formats, and which one reads a file."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from . import aframe, blend, bvh, euroc, motive, named_csv, tum
from .recordings import Recording, Selection, Trajectory, TrajectoryError, shown
from .tables import encoding_of

HEAD = 65536
"""How many bytes of a file are looked at to tell its format."""


@dataclass(frozen=True)
class Format:
    """A kind of file."""

    label: str
    extensions: tuple[str, ...]
    read: Callable[[Path, Selection], list[Trajectory]]
    recognises: Callable[[list[str]], bool] | None = None
    """Given the first lines. None where the extension is enough."""


# Of the formats that share an extension the first that recognises the content reads it. The last one needs not: it
# takes the rest, and says what is wrong with it.
FORMATS = (
    Format("Motive CSV", (".csv",), motive.read, motive.recognises),
    Format("EuRoC CSV", (".csv",), euroc.read, euroc.recognises),
    Format("TUM", (".csv", ".txt", ".tum"), tum.read, tum.recognises),
    Format("CSV with named columns", (".csv", ".tsv", ".txt"), named_csv.read),
    Format("A-Frame recording", (".json",), aframe.read),
    Format("BVH", (".bvh",), bvh.read),
    Format("Blender file", (".blend",), blend.read),
)


def read_trajectories(source: str) -> Recording:
    """Read a recording.

    Parameters
    ----------
    source : str
        A path; with `:BODY` behind it for one body by name, with `:*` for all bodies. A path alone asks for the first
        body: a BVH's root, the first animated object of a .blend. A bone of a .blend is `:OBJECT/BONE`.

    Returns
    -------
    Recording
        The trajectories as recorded, the names of the bodies that were left, and what there is to say of them.

    Raises
    ------
    TrajectoryError
        One line: the file, the line in it, what is wrong and the way out. Also where no body has two samples.

    Notes
    -----
    Tables take memory for their numbers and not for their text, JSON up to 30 times its size. Files beyond the limits
    in `tables`, `bvh` and `aframe` are refused. Blender itself reads .blend files, and may crash on a damaged one:
    where that must not happen, read them in a process of their own.
    """
    path, body = split_source(source)
    selection = Selection(path, body)
    try:
        trajectories = _format_of(path).read(path, selection)
    except OSError as error:
        problem = f"this file cannot be read ({error.strerror})"
        raise TrajectoryError(path, problem, "check its permissions") from None
    if all(len(trajectory.times) < 2 for trajectory in trajectories):
        problem = ", ".join(f"{shown(one.name)} has {len(one.times)} samples" for one in trajectories[:3])
        raise TrajectoryError(path, problem, "a trajectory needs at least 2")
    return selection.recording(trajectories)


def split_source(source: str) -> tuple[Path, str | None]:
    """The file and the body. Files and bodies may have colons in their names, and a Windows path begins with one.

    Raises
    ------
    TrajectoryError
        Where no part of `source` before a colon, nor the whole, is a file.
    """
    colons = [index for index, character in enumerate(source) if character == ":"]
    for end in [len(source), *reversed(colons)]:
        # "C:" of "C:\take.csv" is no file of its own, whatever lies in the current folder.
        drive = end == 1 and source[:1].isalpha() and source[2:3] in ("\\", "/")
        if not drive and os.path.isfile(source[:end]):
            return Path(source[:end]), source[end + 1 :] if end < len(source) else None
    if os.path.isdir(source):
        raise TrajectoryError(source, "this is a folder", "name a file in it")
    raise TrajectoryError(source, "no such file", "check the path")


def _format_of(path: Path) -> Format:
    candidates = [known for known in FORMATS if path.suffix.lower() in known.extensions]
    if not candidates:
        extensions = dict.fromkeys(extension for known in FORMATS for extension in known.extensions)
        problem = f"unknown extension {shown(path.suffix)}"
        raise TrajectoryError(path, problem, f"known are {', '.join(extensions)}")
    if len(candidates) > 1:
        with path.open("rb") as file:
            head = file.read(HEAD)
        lines = head.decode(encoding_of(head), errors="replace").splitlines() or [""]
        for candidate in candidates[:-1]:
            if candidate.recognises(lines):
                return candidate
    return candidates[-1]
