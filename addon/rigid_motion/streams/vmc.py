"""The Virtual Motion Capture protocol (VMC): performers' humanoid bones and tracked devices by OSC, in and out.

What VSeeFace, SlimeVR, Warudo and Unity speak: every frame, the pose of each bone in its parent's space, seen from a
T-pose in which nothing is turned; then the time. Unity's axes are left-handed, y up, z forward; a performer that looks
along z there looks along -y in Blender, as characters do. Metres.
Source: https://protocol.vmc.info/marionette-spec
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Hashable, Iterable, Mapping
from itertools import islice
from typing import Any

import numpy as np

from ..motion import Poses
from ..motion.poses import joined
from ..motion.quaternions import conjugate, multiply
from .bodies import LONGEST_NAME, Body
from .humanoid import HUMANOID, alignments, beside, humanoid_bones
from .osc import Message, read, write_bundle, write_message
from .paths import Path, transposed
from .playing import SET, Playing
from .receiver import Shown, Stream, Streams

PORT = 39539
"""That programs which show a performer listen on."""

ROOT = "Root"
"""The joint that the hips hang on."""

JOINTS = (ROOT, *HUMANOID)
NUMBERS = {name: number for number, name in enumerate(JOINTS) if number}
PARENTS = {ROOT: "", **{bone: above or ROOT for bone, above in HUMANOID.items()}}

DEVICES = {f"/VMC/Ext/{kind}/Pos" for kind in ("Tra", "Con", "Hmd")}
"""Trackers, controllers and headsets: rigid bodies in the world, by their serial numbers."""

PERFORMER = "VMC"
"""The name of a performer's body."""

MOST_SOURCES, MOST_DEVICES, MOST_SAMPLES = 16, 32, 512
"""Programs; devices of each, and samples that wait to be shown or to be recorded."""

SILENT = 2.0
"""Seconds after which a performer, who is sent on every frame, has gone."""

FURTHEST = 1e5
"""Metres; what is further away is damage."""

AT_ONCE = 12
"""Bones of a datagram: it stays below what networks carry in one piece."""

_TO_BLENDER = np.array(((-1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)))
"""Unity's axes as Blender's: a mirror."""


def from_unity(poses: Poses) -> Poses:
    """Poses in Unity's axes as poses in Blender's."""
    return _mirrored(poses, _TO_BLENDER)


def to_unity(poses: Poses) -> Poses:
    """Poses in Blender's axes as poses in Unity's."""
    return _mirrored(poses, _TO_BLENDER.T)


def _mirrored(poses: Poses, change: np.ndarray) -> Poses:
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


def _parents(names: list[str]) -> list[int]:
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
            if not message.address.startswith("/VMC/Ext/"):
                continue
            if stream not in self._streams:
                if len(self._streams) >= MOST_SOURCES:
                    return
                self._streams[stream] = _Source(self.delay)
            self._streams[stream].hear(message, arrival)


class _Source:
    """What one program sends: a performer, devices, or both."""

    def __init__(self, delay: float) -> None:
        self.heard = -np.inf
        self.bodies: tuple[Body, ...] = ()
        self._playing = Playing(delay)
        count = len(JOINTS) + MOST_DEVICES
        self._unity = Poses(np.zeros((count, 3)), np.tile((1.0, 0.0, 0.0, 0.0), (count, 1)))
        """The newest poses, in Unity's axes: of `JOINTS`, and of each device."""
        self._rows: dict[str, list[int]] = {}
        """The joints of each body."""
        self._devices: dict[str, int] = {}
        self._known = {0}
        """Joints that were ever said."""
        self._said: set[int] = set()
        """Those of this frame, and when it began."""
        self._begun = 0.0
        self._samples: deque[tuple[float, Poses]] = deque(maxlen=MOST_SAMPLES)
        self._unkept: deque[tuple[float, Poses]] = deque(maxlen=MOST_SAMPLES)
        self._has_time = False

    def hear(self, message: Message, arrival: float) -> None:
        """Take one message."""
        address, (name, *numbers) = message.address, message.arguments or (None,)
        if address == "/VMC/Ext/Bone/Pos" and name in NUMBERS:
            self._place(NUMBERS[name], numbers, arrival)
        elif address == "/VMC/Ext/Root/Pos":
            self._place(0, numbers, arrival)
        elif address in DEVICES and (joint := self._device(name)):
            self._place(joint, numbers, arrival)
        elif address == "/VMC/Ext/T" and not numbers and isinstance(name, float | int) and math.isfinite(name):
            self._has_time = True
            self._sample(float(name), arrival)

    def _device(self, serial: object) -> int | None:
        """Return the joint of a device; None for what is no name, and for too many."""
        if isinstance(serial, str) and serial not in self._devices:
            is_name = serial != PERFORMER and 0 < len(serial.encode()) <= LONGEST_NAME
            if is_name and len(self._devices) < MOST_DEVICES:
                self._devices[serial] = len(JOINTS) + len(self._devices)
        return self._devices.get(serial) if isinstance(serial, str) else None

    def _place(self, joint: int, numbers: list[Any], arrival: float) -> None:
        try:
            x, y, z, w = numbers[3:7]
            length = math.sqrt(x * x + y * y + z * z + w * w)
            is_sound = 0.5 < length < 2.0 and all(-FURTHEST < number < FURTHEST for number in numbers[:3])
        except (TypeError, ValueError, OverflowError):
            is_sound = False
        if not is_sound:
            return
        if joint in self._said and not self._has_time:
            self._sample(self._begun, self._begun)
        if not self._said:
            self._begun = arrival
        self._said.add(joint)
        self._unity.positions[joint] = numbers[:3]
        self._unity.quaternions[joint] = w / length, x / length, y / length, z / length

    def _sample(self, moment: float, arrival: float) -> None:
        """Take the frame that is complete."""
        if not self._said - {0}:
            return
        poses = from_unity(self._unity)
        if new := self._said - self._known:
            self._known |= new
            self._describe(new, poses)
        self._said = set()
        last = self._samples[-1][0] if self._samples else -np.inf
        if abs(moment - last) > SET:
            self._samples.clear()
        elif moment <= last:
            return
        self._samples.append((moment, poses))
        self._unkept.append((moment, poses))
        self._playing.heard(moment, arrival)
        self.heard = arrival

    def _describe(self, new: set[int], poses: Poses) -> None:
        """Have bodies for joints that were never said before; the others stay the same."""
        bodies = {body.name: body for body in self.bodies}
        if min(new) < len(JOINTS):
            rows = self._rows[PERFORMER] = sorted(joint for joint in self._known if joint < len(JOINTS))
            names = [JOINTS[joint] for joint in rows]
            rest = Poses(poses.positions[rows], np.tile((1.0, 0.0, 0.0, 0.0), (len(names), 1)))
            sliding = np.array([name in (ROOT, "Hips") for name in names])
            performer = Body(PERFORMER, tuple(names), np.array(_parents(names)), rest, sliding=sliding)
            bodies.pop(PERFORMER, None)
            bodies = {PERFORMER: performer, **bodies}
        for serial, joint in self._devices.items():
            if joint in new:
                bodies[serial], self._rows[serial] = Body.rigid(serial, poses[joint : joint + 1]), [joint]
        self.bodies = tuple(bodies.values())

    def _of_bodies(self, samples: Iterable[tuple[float, Poses]]) -> tuple[np.ndarray, dict[str, Poses]]:
        """Return the moments (n,) of samples, and poses (joints, n) of each body."""
        moments, poses = zip(*samples, strict=True)
        every = joined([own[:, None] for own in poses], axis=1)
        return np.array(moments), {body.name: every[self._rows[body.name]] for body in self.bodies}

    def show(self, now: float) -> Shown | None:
        moment = self._playing.moment(now)
        if moment is None or not self._samples:
            return None
        while len(self._samples) > 2 and self._samples[1][0] <= moment:
            self._samples.popleft()
        moments, bodies = self._of_bodies(islice(self._samples, 2))
        return Shown(moment, {name: Path(moments, poses).pose(moment) for name, poses in bodies.items()})

    def keys(self) -> tuple[np.ndarray, dict[str, Poses]]:
        if not self._unkept:
            return np.empty(0), {}
        moments, bodies = self._of_bodies(self._unkept)
        self._unkept.clear()
        return moments, {name: transposed(poses) for name, poses in bodies.items()}
