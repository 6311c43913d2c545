"""BVH files: a hierarchy of joints with offsets and channels, and one row of channel values per frame.

Without a name, the whole body is read. Named joints are read as world poses: a joint without any rotation has the axes
of the world. Positions are in the unit of the file, which BVH does not state. Angles are degrees, applied in the order
of the channels. Position channels replace the offset of the joint, as in Blender's importer, unless they are clearly
meant to be added to it. Blender's importer itself is not used: it works in single precision, needs Blender, and a file
that it cannot read ends in an IndexError or in an unnoticed wrong skeleton.
Source: Meredith and Maddock, Motion capture file formats explained, Sheffield 2001.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import NoReturn

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import align_signs

from .clips import ClipWarning
from .euler import quaternions_from_intrinsic_eulers
from .recordings import Cells, Selection, Trajectory, TrajectoryError, refuse_too_many, shown, unique
from .rest_bodies import RestBody, tails_of
from .rewriting import eulers_near, write_text
from .sizing import sized
from .tables import HeaderLine, lines_of

CHANNELS = {f"{axis}{kind}": (axis.upper(), kind) for kind in ("position", "rotation") for axis in "xyz"}

AXES = "opengl"
"""Usual axes of BVH files: a name in `axes.AXES`."""

MOST_JOINTS = 3000
"""Joints of a body, three times as many as the most detailed rigs have. Later steps would take minutes with more."""

MAX_JOINT_DEPTH = 500
"""Depth of the joint hierarchy, five times that of the longest tails."""

ADDED_OFFSET_RATIO = 0.5
"""Positions nearer to 0 than this fraction of their distance from the OFFSET are meant to be added to it."""

LONGEST_NAME = 100
"""Maximum number of words in the name of a joint."""


@dataclass
class Joint:
    """One joint of the hierarchy."""

    name: str
    parent: int | None
    """The index of the parent, lower than the joint's own index. None for a root."""

    offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    channels: list[tuple[str, str]] = field(default_factory=list)
    """Axis and kind of each channel, in the order of the file: ("Z", "rotation")."""

    end: tuple[float, ...] | None = None
    """The offset of the end site, if there is one."""


def read(path: Path, selection: Selection) -> list[Trajectory]:
    """Read the whole body, or the named joints, or all joints in the order of the file.

    A single joint is not a whole body.
    """
    joints, motion = _read_hierarchy(path)
    names = [joint.name for joint in joints]
    as_body = selection.requested is None and len(joints) > 1
    taken = names if as_body else selection.of(names)
    header, frame_time, values, warnings = _read_motion(path, motion, joints)
    refuse_too_many(path, len(joints), len(values))
    # Non-finite numbers of the file stay non-finite in the poses, without warnings.
    with np.errstate(invalid="ignore", over="ignore"):
        times, as_read = np.arange(len(values)) * frame_time, values[0].copy()
        if count := _add_offsets(joints, values):
            text = (
                f"positions of {count} joint{'s' * (count > 1)} below the root are near 0 and not near their OFFSETs: "
            )
            text += "read as added to these, where Blender would put such joints into one another"
            warnings += (ClipWarning(text),)
        rest_body, poses = _rest_body(joints), _poses(joints, values)
        body = Trajectory(path.stem, times, poses, rest_body=rest_body, warnings=warnings)
        if as_body:
            return [replace(body, cells=_cells(header, joints, values, values[0] - as_read))]
        body = sized(path, body, AXES, unit_given=False)
        world = rest_body.skeleton.in_root_space(poses)
    first, *others = (Trajectory(name, times, world[names.index(name)], body.metres_per_unit) for name in taken)
    return [replace(first, remark=body.remark, warnings=body.warnings), *others]


def _cells(header: HeaderLine, joints: list[Joint], values: np.ndarray, added: np.ndarray) -> Cells:
    """Return where the file has the numbers of a body. `added` (channels,) was added to the values (n, channels)."""

    def numbers(poses: Poses) -> dict[int, np.ndarray]:
        result, column = {}, 0
        for joint, positions, quaternions in zip(joints, poses.positions, poses.quaternions, strict=True):
            turns = []
            for axis, kind in joint.channels:
                if kind == "position":
                    result[column] = positions[:, "XYZ".index(axis)] - added[column]
                else:
                    turns.append((column, axis))
                column += 1
            if len(turns) == 3:
                columns, order = zip(*turns, strict=True)
                angles = eulers_near(quaternions, "".join(order), np.radians(values[:, columns]))
                result |= zip(columns, np.degrees(angles).T, strict=True)
        return result

    return Cells(np.arange(len(values)), values.shape, numbers, partial(write_text, header))


def _rest_body(joints: list[Joint]) -> RestBody:
    """Return the rest body of a hierarchy, with unrotated joints: bones end at end sites or amid their children."""
    parents = np.array([-1 if joint.parent is None else joint.parent for joint in joints])
    places = np.array([joint.offset for joint in joints])
    for index in np.flatnonzero(parents >= 0).tolist():
        places[index] += places[parents[index]]
    rest = Poses(places, np.tile((1.0, 0.0, 0.0, 0.0), (len(joints), 1)))
    sites = np.array([joint.end or (0.0, 0.0, 0.0) for joint in joints])
    ends = np.linalg.norm(sites, axis=1)
    tails = np.where((ends > 0.0)[:, None], sites, tails_of(rest, parents))
    return RestBody(tuple(joint.name for joint in joints), parents, rest, tails, ends=ends)


def _add_offsets(joints: list[Joint], values: np.ndarray) -> int:
    """Add the OFFSET to position channels of joints below the root, in values (n, channels), if the file means it so.

    It does if, for most joints, the positions are nearer to 0 than to the OFFSET. Returns the number of these joints,
    or 0.
    """
    column, near = 0, []
    places: list[tuple[int, float]] = []
    for joint in joints:
        own = [
            (column + number, joint.offset["XYZ".index(axis)])
            for number, (axis, kind) in enumerate(joint.channels)
            if kind == "position" and joint.parent is not None
        ]
        column += len(joint.channels)
        if any(offset for _, offset in own):
            places += own
            columns, offsets = [place for place, _ in own], np.array([offset for _, offset in own])
            away = [np.median(np.abs(values[:, columns] - some), axis=0).sum() for some in (0.0, offsets)]
            near.append(away[0] < ADDED_OFFSET_RATIO * away[1])
    if 2 * sum(near) <= len(near):
        return 0
    for place, offset in places:
        values[:, place] += offset
    return len(near)


def _poses(joints: list[Joint], values: np.ndarray) -> Poses:
    """Return the joints in their parents' space, shape (joints, n), from values (n, channels of all joints).

    Quaternion signs are aligned, as Euler angles do not determine them.
    """
    begins = np.cumsum([0, *(len(joint.channels) for joint in joints)]).tolist()
    poses = Poses(np.empty((len(joints), len(values), 3)), np.empty((len(joints), len(values), 4)))
    for number, joint in enumerate(joints):
        poses[number] = _local(joint, values[:, begins[number] : begins[number + 1]])
    return Poses(poses.positions, align_signs(poses.quaternions))


def _local(joint: Joint, own: np.ndarray) -> Poses:
    """Return the poses of a joint in its parent's space, from its own channels (n, channels)."""
    positions = np.tile(joint.offset, (len(own), 1))
    turns = []
    for column, (axis, kind) in enumerate(joint.channels):
        if kind == "position":
            positions[:, "XYZ".index(axis)] = own[:, column]
        else:
            turns.append(column)
    order = "".join(joint.channels[column][0] for column in turns)
    return Poses(positions, quaternions_from_intrinsic_eulers(np.radians(own[:, turns]), order))


class _Words:
    """Words of the hierarchy, read one by one, with the line of the last word read."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.line = 1
        self._words = self._split()

    def _split(self) -> Iterator[str]:
        for number, line in lines_of(self.path):
            self.line = number
            yield from line.replace("{", " { ").replace("}", " } ").split()

    def next(self, expected: str) -> str:
        word = next(self._words, None)
        if word is None:
            self.fail(f"the file ends where {expected} is expected")
        return word

    def number(self, expected: str) -> float:
        word = self.next(expected)
        try:
            number = float(word)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            self.fail(f"{shown(word)} where {expected} is expected")
        return number

    def until_brace(self) -> str:
        words = []
        while (word := self.next("{")) != "{":
            words.append(word)
            if len(words) > LONGEST_NAME:
                self.fail("a { is missing after a name")
        return " ".join(words)

    def fail(self, problem: str, way_out: str = "export the BVH again") -> NoReturn:
        raise TrajectoryError(self.path, problem, way_out, self.line)


def _read_hierarchy(path: Path) -> tuple[list[Joint], int]:
    """Read the joints with unique names, and the line number of the word MOTION."""
    words = _Words(path)
    first = words.next("HIERARCHY")
    if first.upper() != "HIERARCHY":
        words.fail(f"a BVH file begins with HIERARCHY, not with {shown(first)}")
    joints: list[Joint] = []
    # The joints whose braces are open, innermost last. None stands for an end site, which has no pose of its own.
    opened: list[int | None] = []
    while (word := words.next("MOTION")).upper() != "MOTION":
        if len(joints) > MOST_JOINTS:
            words.fail(f"more than {MOST_JOINTS} joints", "export fewer, such as one body at a time")
        if len(opened) > MAX_JOINT_DEPTH:
            words.fail(f"more than {MAX_JOINT_DEPTH} joints hang on one another", "export a shorter chain")
        joint = joints[opened[-1]] if opened and opened[-1] is not None else None
        match word.upper():
            case "ROOT" if not opened:
                joints.append(Joint(words.until_brace(), None))
                opened.append(len(joints) - 1)
            case "JOINT" if joint:
                joints.append(Joint(words.until_brace(), opened[-1]))
                opened.append(len(joints) - 1)
            case "END" if joint:
                words.until_brace()
                opened.append(None)
            case "OFFSET" if opened:
                offset = tuple(words.number("a number of the OFFSET") for _ in range(3))
                if joint:
                    joint.offset = offset
                elif (carrier := opened[-2]) is not None:
                    joints[carrier].end = offset
            case "CHANNELS" if joint and not joint.channels:
                joint.channels = _read_channels(words)
            case "}" if opened:
                opened.pop()
            case _:
                words.fail(f"{shown(word)} is out of place")
    if opened:
        words.fail("a } is missing before MOTION")
    if not joints:
        words.fail("no ROOT before MOTION")
    for joint, name in zip(joints, unique([joint.name or "joint" for joint in joints]), strict=True):
        joint.name = name
    return joints, words.line


def _read_channels(words: _Words) -> list[tuple[str, str]]:
    count = words.number("the number of CHANNELS")
    if count not in range(len(CHANNELS) + 1):
        words.fail(f"{count:g} CHANNELS for a joint")
    names = [words.next("the name of a channel") for _ in range(int(count))]
    for name in names:
        if name.lower() not in CHANNELS:
            words.fail(f"{shown(name)} is not a channel")
    channels = [CHANNELS[name.lower()] for name in names]
    if len(set(channels)) < len(channels):
        words.fail("a channel occurs twice in a joint")
    return channels


def _read_motion(
    path: Path, motion: int, joints: list[Joint]
) -> tuple[HeaderLine, float, np.ndarray, tuple[ClipWarning, ...]]:
    """Read the part of the file after the line `motion`.

    Returns
    -------
    header : HeaderLine
        The last line before the frames, with a name for each channel.
    frame_time : float
        Seconds between frames.
    values : array, shape (frames, channels)
    warnings : tuple of ClipWarning
        A warning if the number of frames differs from the one that the file states.
    """
    rows = ((number, text) for number, line in lines_of(path, after=motion) if (text := line.strip()))
    settings = list(islice(rows, 2))
    count = _read_setting(path, settings[:1], "Frames:", motion)
    frame_time = _read_setting(path, settings[1:], "Frame Time:", motion)
    labels = [f"{joint.name} {axis}{kind}" for joint in joints for axis, kind in joint.channels]
    if not labels:
        raise TrajectoryError(path, "no joint has CHANNELS", "export the BVH again", motion)
    header = HeaderLine(path, settings[1][0], None, labels)
    values = header.numbers_below({label: index for index, label in enumerate(labels)})
    warnings: tuple[ClipWarning, ...] = ()
    if count != len(values):
        text = f"Frames: says {count:g} and {len(values)} whole rows follow, which are read"
        way_out = "export the BVH again if that is not all"
        warnings = (ClipWarning(f"{path.name}:{settings[0][0]}: {text}", way_out),)
    return header, frame_time, values, warnings


def _read_setting(path: Path, row: list[tuple[int, str]], name: str, motion: int) -> float:
    """Read the positive number after `name` in a row. The row is empty if the file ends at the line `motion`."""
    number, text = row[0] if row else (motion, "")
    label, _, value = text.partition(":")
    try:
        setting = float(value)
    except ValueError:
        setting = math.nan
    if " ".join(label.split()).lower() != name.lower().rstrip(":") or not 0.0 < setting < math.inf:
        problem = f"{shown(text)} where {name} and a positive number are expected"
        raise TrajectoryError(path, problem, "export the BVH again", number)
    return setting
