"""The way from `FILE`, `FILE:BODY` or `FILE:*` to trajectories: the table of formats, and which one reads a file."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses, Skeleton
from rigid_motion.motion.repair import LARGEST

from . import aframe, blend, bvh, euroc, fbx, gltf, motive, named_csv, tum
from .clips import ClipWarning
from .options import AS_THE_FILE_SAYS, ReadingOptions
from .recordings import Recording, Selection, Trajectory, TrajectoryError, shown
from .rest_bodies import NOTHING, PLAUSIBLE, size_of, sureness, unit_of
from .sense import doubts
from .tables import encoding_of

LOOKED_AT = 64
"""Samples at once among which the first without damage is looked for."""

HEAD = 65536
"""Bytes of a file that are looked at to tell its format."""


@dataclass(frozen=True)
class Format:
    """A kind of file."""

    label: str
    extensions: tuple[str, ...]
    read: Callable[..., list[Trajectory]]
    """A function of the path, the bodies that are requested and, where it honours any, the options."""

    recognises: Callable[[list[str]], bool] | None = None
    """A function of the first lines. None where the extension is enough."""

    honours: tuple[str, ...] = ()
    """The options that it takes: for what its files do not say themselves. The scale is applied to all formats, and
    the part to take when clips are made."""

    measured: bool = True
    """True if it holds what devices measured, and not what was animated, which may go at any speed."""

    axes: str = "blender"
    """The convention of its files, where nothing says otherwise: a name in `axes.AXES`."""

    in_metres: bool = True
    """True if its files say how long the unit of a body is, or the format prescribes it. It may still be wrong."""

    says_unit: bool = True
    """True if it has a unit for lengths, or its files always say theirs."""


# Of the formats that share an extension the first that recognises the content reads it. The last one needs not: it
# takes the rest, and says what is wrong with it.
FORMATS = (
    Format("Motive CSV", (".csv",), motive.read, motive.recognises),
    Format("EuRoC CSV", (".csv",), euroc.read, euroc.recognises),
    Format("TUM", (".csv", ".txt", ".tum"), tum.read, tum.recognises, ("time_unit", "frame_rate")),
    Format(
        "CSV with named columns",
        (".csv", ".tsv", ".txt"),
        named_csv.read,
        honours=("columns", "time_unit", "frame_rate", "euler", "degrees"),
        says_unit=False,
    ),
    Format("A-Frame recording", (".json",), aframe.read),
    Format("BVH", (".bvh",), bvh.read, axes="opengl", in_metres=False),
    Format("FBX", (".fbx",), fbx.read, honours=("scale",), measured=False),
    Format("glTF", gltf.ENDINGS, gltf.read, honours=("scale",), measured=False),
    Format("Blender file", (".blend",), blend.read, honours=("scale",), measured=False),
)


def read_trajectories(source: str, options: ReadingOptions = AS_THE_FILE_SAYS) -> Recording:
    """Read a recording.

    Parameters
    ----------
    source : str
        A path; with `:BODY` behind it for one body by name, with `:*` for all bodies. A path alone asks for the first
        body, such as the first animated object of a .blend, or for the whole skeleton: of a BVH, an FBX or a glTF, and
        of an armature whose bones move.
    options : ReadingOptions
        What the file does not say of itself.

    Returns
    -------
    Recording
        The trajectories as recorded, the names of the bodies that were left, and what there is to say of them.

    Raises
    ------
    TrajectoryError
        One line: the file, the line in it, what is wrong and the way out. Also where no body has two samples, where an
        option is given that means nothing to the format, and where a recording cannot be meant as it is read.

    Notes
    -----
    Tables take memory for their numbers and not for their text, JSON up to 30 times its size. Files beyond the limits
    in `tables`, `bvh` and `aframe` are refused. Blender itself reads .blend, FBX and glTF files, and may crash on a
    damaged one: where that must not happen, read them in a process of their own.
    """
    path, body = split_source(source)
    selection = Selection(path, body)
    try:
        result = format_of(path)
        trajectories = _read(result, path, selection, options)
    except OSError as error:
        problem = f"this file cannot be read ({error.strerror})"
        raise TrajectoryError(path, problem, "check its permissions") from None
    if all(len(trajectory.times) < 2 for trajectory in trajectories):
        problem = ", ".join(f"{shown(item.name)} has {len(item.times)} samples" for item in trajectories[:3])
        raise TrajectoryError(path, problem, "a trajectory needs at least 2")
    return replace(selection.recording(trajectories), axes=result.axes, measured=result.measured)


def _read(result: Format, path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    for name in options.given:
        if name not in ("scale", "start", "end") and name not in result.honours:
            labels = " and ".join(known.label for known in FORMATS if name in known.honours)
            problem = f"--{name.replace('_', '-')} is for {labels}, and this is {result.label}"
            raise TrajectoryError(path, problem, "leave it out; its files say that themselves")
    trajectories = result.read(path, selection, options) if result.honours else result.read(path, selection)
    if options.scale is not None:
        trajectories = [replace(trajectory, metres_per_unit=options.scale) for trajectory in trajectories]
    else:
        trajectories = [_sized(path, trajectory, unit_given=result.in_metres) for trajectory in trajectories]
    if not result.measured:
        return trajectories
    takes_unit = "time_unit" in result.honours
    found = [doubts(trajectory, time_unit=takes_unit and not trajectory.dated) for trajectory in trajectories]
    return [replace(item, warnings=(*item.warnings, *more)) for item, more in zip(trajectories, found, strict=True)]


def _sized(path: Path, trajectory: Trajectory, *, unit_given: bool) -> Trajectory:
    """Return a whole body in the unit that it is likely to be in by its size, where that is not given or cannot be."""
    if trajectory.rest_body is None:
        return trajectory
    places = _first_whole(trajectory.rest_body.skeleton, trajectory.poses)
    if places is None:
        return trajectory
    size = size_of(trajectory.rest_body.parents, places) * trajectory.metres_per_unit
    unit, length = unit_of(size)
    metres = size * length
    if size < NOTHING or (unit_given and length == 1.0):
        return trajectory
    remark, warnings = trajectory.remark, trajectory.warnings
    if length != 1.0:
        taken = f"{shown(path.name)} is {size:.4g} units large, which are taken for {unit}: {metres:.3g} m"
        taken += f", {sureness(size, length)} (otherwise: --scale METRES)"
        remark = "; ".join(filter(None, (taken, remark)))
    if not PLAUSIBLE[0] <= metres <= PLAUSIBLE[1]:
        doubt = f"it is {metres:.3g} m large if its unit, which the file does not tell, is that of {unit}"
        warnings += (ClipWarning(doubt, "if not, say how long it is: --scale METRES"),)
    return replace(trajectory, metres_per_unit=trajectory.metres_per_unit * length, remark=remark, warnings=warnings)


def _first_whole(skeleton: Skeleton, poses: Poses) -> np.ndarray | None:
    """Return where the joints of a body (joints, n) are in the first sample without damage, shape (joints, 3)."""
    for first in range(0, poses.shape[1], LOOKED_AT):
        # What is not finite, or far beyond all measure, is for the repair to say.
        with np.errstate(invalid="ignore", over="ignore"):
            places = skeleton.in_root_space(poses[:, first : first + LOOKED_AT]).positions
        whole = np.flatnonzero((np.abs(places) < LARGEST).all(axis=(0, 2)))
        if len(whole):
            return places[:, whole[0]]
    return None


def files_of(source: str) -> list[str]:
    """Return what a source stands for: of a folder the files that may be recordings, in the order of their names."""
    try:
        if not os.path.isdir(source):
            return [source]
        names = sorted(entry.name for entry in os.scandir(source) if entry.is_file())
    except (OSError, ValueError):
        return [source]  # What is wrong with it is said when it is read.
    known = tuple(extension for known in FORMATS for extension in known.extensions)
    return [os.path.join(source, name) for name in names if name.lower().endswith(known)] or [source]


def split_source(source: str) -> tuple[Path, str | None]:
    """Return the file and the body. Both may have colons in their names, and a Windows path begins with a drive's.

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
    for end in [len(source), *reversed(colons)]:
        if result := _what_is_no_file(source[:end]):
            raise TrajectoryError(source[:end], *result)
    raise TrajectoryError(source, "no such file", "check the path")


def _what_is_no_file(path: str) -> tuple[str, str] | None:
    """Return what is at a path that is no file, and the way out; None for nothing. It is looked at, and not opened."""
    if os.path.isdir(path):
        return "this is a folder without recordings", "name a file, or a folder that has some"
    if os.path.exists(path) and not os.path.isfile(path):
        return "this is a pipe or a device, not a file", "write what comes out of it to a file, and name that"
    if os.path.islink(path):
        return f"this is a symbolic link to {shown(os.readlink(path))}, where nothing is", "name the file itself"
    return None


def format_of(path: Path) -> Format:
    """Return the format that reads a file, by its name and, where several share that, by how it begins."""
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
            if candidate.recognises and candidate.recognises(lines):
                return candidate
    return candidates[-1]
