"""The Virtual Motion Capture protocol (VMC): performers' humanoid bones and tracked devices by OSC, in and out.

What VSeeFace, SlimeVR, Warudo and Unity speak: every frame, the pose of each bone in its parent's space, seen from a
T-pose in which nothing is turned; then the time. Unity's axes are left-handed, y up, z forward; a performer that looks
along z there looks along -y in Blender, as characters do. Metres.
Source: https://protocol.vmc.info/marionette-spec
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Hashable, Iterable, Mapping, Sequence, Set
from itertools import islice
from typing import Any

import numpy as np

from ..motion import Poses
from ..motion.humanoid import HUMANOID, alignments, beside, humanoid_bones
from ..motion.poses import joined
from ..motion.quaternions import conjugate, multiply
from .bodies import LONGEST_NAME, Body
from .osc import Message, read, write_bundle, write_message
from .paths import Path, transposed
from .playing import SET, Playing
from .receiver import Stream, Streams

PORT = 39539
"""That programs which show a performer listen on."""

ROOT, PERFORMER = "Root", "VMC"
"""The joint that the hips hang on; and the name of a performer's body."""

JOINTS = (ROOT, *HUMANOID)
PARENTS = {ROOT: "", **{bone: above or ROOT for bone, above in HUMANOID.items()}}

Joint = tuple[bool, str]
"""Whether it is a device, and the name of the bone or its serial number."""

DEVICES = {f"/VMC/Ext/{kind}/Pos" for kind in ("Tra", "Con", "Hmd")}
"""Trackers, controllers and headsets: rigid bodies in the world, by their serial numbers."""

MOST_SOURCES, MOST_DEVICES, MOST_SAMPLES = 16, 32, 512
"""Programs; devices of each, and samples that wait to be shown or to be recorded."""

SILENT, FURTHEST, AT_ONCE = 2.0, 1e5, 12
"""Seconds after which a performer, who is sent on every frame, has gone; metres beyond which there is only damage; and
bones of a datagram, which stays below what networks carry in one piece."""

_TO_BLENDER = np.array(((-1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)))
"""Unity's axes as Blender's: a mirror."""


def from_unity(poses: Poses) -> Poses:
    """Poses in Unity's axes as poses in Blender's."""
    return _changed(poses, _TO_BLENDER)


def to_unity(poses: Poses) -> Poses:
    """Poses in Blender's axes as poses in Unity's."""
    return _changed(poses, _TO_BLENDER.T)


def _changed(poses: Poses, change: np.ndarray) -> Poses:
    turned = -poses.quaternions[..., 1:] @ change.T
    return Poses(poses.positions @ change.T, np.concatenate((poses.quaternions[..., :1], turned), axis=-1))


def write(time: float, poses: Mapping[str, Poses]) -> list[bytes]:
    """Return the datagrams of a frame: the pose () of each bone in its parent's space, with that of `ROOT`."""
    root = [_pose("/VMC/Ext/Root/Pos", "root", poses[ROOT])] if ROOT in poses else []
    bones = [_pose("/VMC/Ext/Bone/Pos", bone, poses[bone]) for bone in HUMANOID if bone in poses]
    return _bundles([*root, *bones, write_message("/VMC/Ext/OK", 1), write_message("/VMC/Ext/T", float(time))])


def write_trackers(poses: Mapping[str, Poses]) -> list[bytes]:
    """Return the datagrams of the poses () of trackers in the world, by their names."""
    return _bundles([_pose("/VMC/Ext/Tra/Pos", name, pose) for name, pose in poses.items()])


def _pose(address: str, name: str, pose: Poses) -> bytes:
    unity = to_unity(pose)
    w, *xyz = unity.quaternions.tolist()
    return write_message(address, name, *unity.positions.tolist(), *xyz, w)


def _bundles(messages: list[bytes]) -> list[bytes]:
    return [write_bundle(messages[first : first + AT_ONCE]) for first in range(0, len(messages), AT_ONCE)]


class Performer:
    """A skeleton of any kind as VMC.

    Parameters
    ----------
    joints : sequence of str
        Parents first.
    rest : Poses, shape (joints,)
        In the space of the roots.
    """

    def __init__(self, joints: tuple[str, ...], rest: Poses) -> None:
        self.bones = humanoid_bones(joints)
        """The joint that each humanoid bone is."""
        self._numbers = list(self.bones.values())
        aligned = alignments(self.bones, rest.positions)
        turns = np.array([conjugate(aligned[bone]) if bone in aligned else (1.0, 0.0, 0.0, 0.0) for bone in self.bones])
        self._from_rest = multiply(conjugate(rest.quaternions[self._numbers]), turns.reshape(-1, 4))
        self._follows = np.array(_parents(list(self.bones)))

    def __call__(self, poses: Poses) -> dict[str, Poses]:
        """Return the pose () of each bone in its parent's space, of poses (joints,) in the space of the roots."""
        there = poses[self._numbers]
        local = beside(Poses(there.positions, multiply(there.quaternions, self._from_rest)), self._follows)
        return {ROOT: Poses(np.zeros(3), [1.0, 0.0, 0.0, 0.0]), **dict(zip(self.bones, local, strict=True))}


def _parents(names: Sequence[str]) -> list[int]:
    """Return which of some joints each of them hangs on, -1 for none."""
    result = []
    for name in names:
        while (name := PARENTS[name]) and name not in names:
            pass
        result.append(names.index(name) if name else -1)
    return result


class VmcReceiver(Streams):
    """Shows performers and their devices a delay later: what `Receiver` is for the codec. Its keys are all samples."""

    def __init__(self, delay: float = 0.1) -> None:
        super().__init__(SILENT)
        self.delay = delay

    def take(self, datagram: bytes, arrival: float, source: Hashable = None) -> None:
        """Take a datagram that came at a time, by the clock of `show`, from somewhere."""
        stream = Stream(source, b"VMC")
        for message in read(datagram):
            if message.address.startswith("/VMC/Ext/"):
                if stream not in self._streams and len(self._streams) < MOST_SOURCES:
                    self._streams[stream] = _Source(self.delay)
                if stream in self._streams:
                    self._streams[stream].hear(message, arrival)


class _Source:
    """What one program sends: a performer, devices, or both."""

    def __init__(self, delay: float) -> None:
        self.heard = -np.inf
        self.bodies: tuple[Body, ...] = ()
        self._playing = Playing(delay)
        self._newest: dict[Joint, list[float]] = {(False, ROOT): [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]}
        """Place and turn of all that was ever said, in Unity's axes."""
        self._rows: dict[str, list[int]] = {}
        """Which of these each body is."""
        self._frame: dict[Joint, list[float]] = {}
        """What was said of this frame, and when it began."""
        self._begun = 0.0
        self._samples: deque[tuple[float, Poses]] = deque(maxlen=MOST_SAMPLES)
        self._unkept: deque[tuple[float, Poses]] = deque(maxlen=MOST_SAMPLES)
        self._has_time = False

    def hear(self, message: Message, arrival: float) -> None:
        """Take one message."""
        address, (name, *numbers) = message.address, message.arguments or (None,)
        if address == "/VMC/Ext/Root/Pos":
            self._place((False, ROOT), numbers, arrival)
        elif address == "/VMC/Ext/Bone/Pos" and name in HUMANOID:
            self._place((False, str(name)), numbers, arrival)
        elif address in DEVICES and isinstance(name, str) and name != PERFORMER:
            known = {serial for is_device, serial in (*self._newest, *self._frame) if is_device}
            if 0 < len(name.encode()) <= LONGEST_NAME and (name in known or len(known) < MOST_DEVICES):
                self._place((True, name), numbers, arrival)
        elif address == "/VMC/Ext/T" and not numbers and isinstance(name, float | int) and math.isfinite(name):
            self._has_time = True
            self._sample(float(name), arrival)

    def _place(self, joint: Joint, numbers: list[Any], arrival: float) -> None:
        try:
            x, y, z, w = numbers[3:7]
            length = math.sqrt(x * x + y * y + z * z + w * w)
            is_sound = 0.5 < length < 2.0 and all(-FURTHEST < number < FURTHEST for number in numbers[:3])
        except (TypeError, ValueError, OverflowError):
            is_sound = False
        if not is_sound:
            return
        if joint in self._frame and not self._has_time:
            self._sample(self._begun, self._begun)
        if not self._frame:
            self._begun = arrival
        self._frame[joint] = [*numbers[:3], w / length, x / length, y / length, z / length]

    def _sample(self, moment: float, arrival: float) -> None:
        """Take the frame that is complete."""
        if not self._frame.keys() - {(False, ROOT)}:
            return
        new = self._frame.keys() - self._newest.keys()
        self._newest |= self._frame
        self._frame = {}
        rows = np.array(list(self._newest.values()))
        poses = from_unity(Poses(rows[:, :3], rows[:, 3:]))
        if new:
            self._describe(new, poses)
        last = self._samples[-1][0] if self._samples else -np.inf
        if new or abs(moment - last) > SET:
            self._samples.clear()
        elif moment <= last:
            return
        self._samples.append((moment, poses))
        self._unkept.append((moment, poses))
        self._playing.heard(moment, arrival)
        self.heard = arrival

    def _describe(self, new: Set[Joint], poses: Poses) -> None:
        """Have bodies for what was never said before; the others stay the same."""
        self._unkept.clear()
        numbers = {joint: row for row, joint in enumerate(self._newest)}
        bodies = {body.name: body for body in self.bodies}
        if not all(is_device for is_device, _ in new):
            names = tuple(name for name in JOINTS if (False, name) in numbers)
            rows = self._rows[PERFORMER] = [numbers[False, name] for name in names]
            rest = Poses(poses.positions[rows], np.tile((1.0, 0.0, 0.0, 0.0), (len(names), 1)))
            sliding = np.array([name in (ROOT, "Hips") for name in names])
            performer = Body(PERFORMER, names, np.array(_parents(names)), rest, sliding=sliding)
            bodies = {PERFORMER: performer} | {name: body for name, body in bodies.items() if name != PERFORMER}
        for joint, row in numbers.items():
            if joint in new and joint[0]:
                bodies[joint[1]], self._rows[joint[1]] = Body.rigid(joint[1], poses[row : row + 1]), [row]
        self.bodies = tuple(bodies.values())

    def _of_bodies(self, samples: Iterable[tuple[float, Poses]]) -> tuple[np.ndarray, dict[str, Poses]]:
        """Return the moments (n,) of samples, and poses (joints, n) of each body."""
        moments, poses = zip(*samples, strict=True)
        every = joined([own[:, None] for own in poses], axis=1)
        return np.array(moments), {body.name: every[self._rows[body.name]] for body in self.bodies}

    def show(self, now: float) -> tuple[float, dict[str, Poses]] | None:
        moment = self._playing.moment(now)
        if moment is None or not self._samples:
            return None
        while len(self._samples) > 2 and self._samples[1][0] <= moment:
            self._samples.popleft()
        moments, bodies = self._of_bodies(islice(self._samples, 2))
        return moment, {name: Path(moments, poses).pose(moment) for name, poses in bodies.items()}

    def keys(self) -> tuple[np.ndarray, dict[str, Poses]]:
        if not self._unkept:
            return np.empty(0), {}
        moments, bodies = self._of_bodies(self._unkept)
        self._unkept.clear()
        return moments, {name: transposed(poses) for name, poses in bodies.items()}
