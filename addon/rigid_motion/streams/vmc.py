"""The Virtual Motion Capture protocol (VMC): performers' humanoid bones and tracked devices by OSC, in and out.

What VSeeFace, SlimeVR, Warudo and Unity speak: every frame, the pose of each bone in its parent's space, seen from a
T-pose in which nothing is turned; then the time. Unity's axes are left-handed, y up, z forward; a performer that looks
along z there looks along -y in Blender, as characters do. Metres.
Source: https://protocol.vmc.info/marionette-spec
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Hashable, Mapping
from typing import Any, cast

import numpy as np

from ..motion import Poses
from ..motion.quaternions import conjugate, multiply, rotate
from .bodies import LONGEST_NAME, Body
from .humanoid import HUMANOID, alignments, humanoid_bones
from .osc import Message, read, write_bundle, write_message
from .paths import Path
from .playing import SET, Playing
from .receiver import Keys, Shown, Stream

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

MOST_SOURCES, MOST_DEVICES = 16, 32
MOST_SAMPLES = 512
"""Of a source that wait to be shown, or to be recorded."""

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
    there = [name for name in JOINTS if name in poses]
    both = Poses(
        np.array([poses[name].positions for name in there]), np.array([poses[name].quaternions for name in there])
    )
    unity = to_unity(both)
    messages = []
    for name, place, (w, *xyz) in zip(there, unity.positions.tolist(), unity.quaternions.tolist(), strict=True):
        is_root = name == ROOT
        address = "/VMC/Ext/Root/Pos" if is_root else "/VMC/Ext/Bone/Pos"
        messages.append(write_message(address, "root" if is_root else name, *place, *xyz, w))
    messages += [write_message("/VMC/Ext/OK", 1), write_message("/VMC/Ext/T", float(time))]
    return [write_bundle(messages[first : first + AT_ONCE]) for first in range(0, len(messages), AT_ONCE)]


def write_trackers(poses: Mapping[str, Poses]) -> list[bytes]:
    """Return the datagrams of the poses () of trackers in the world, by their names."""
    messages = []
    for name, pose in poses.items():
        unity = to_unity(pose)
        w, *xyz = unity.quaternions.tolist()
        messages.append(write_message("/VMC/Ext/Tra/Pos", name, *unity.positions.tolist(), *xyz, w))
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
        aligned = alignments(self.bones, rest.positions)
        numbers = list(self.bones.values())
        turns = np.array([conjugate(aligned[bone]) if bone in aligned else (1.0, 0.0, 0.0, 0.0) for bone in self.bones])
        self._from_rest = multiply(conjugate(rest.quaternions[numbers]), turns.reshape(-1, 4))
        self._numbers = numbers
        order = list(self.bones)
        self._above = [order.index(above) if (above := self._parent(bone)) else -1 for bone in order]

    def _parent(self, bone: str) -> str:
        while (bone := HUMANOID[bone]) and bone not in self.bones:
            pass
        return bone

    def __call__(self, poses: Poses) -> dict[str, Poses]:
        """Return the pose () of each bone in its parent's space, of poses (joints,) in the space of the roots."""
        places = poses.positions[self._numbers]
        turns = multiply(poses.quaternions[self._numbers], self._from_rest)
        above = np.array(self._above)
        hanging = (above >= 0)[:, None]
        back = np.where(hanging, conjugate(turns[above]), (1.0, 0.0, 0.0, 0.0))
        local = Poses(rotate(back, places - np.where(hanging, places[above], 0.0)), multiply(back, turns))
        return {ROOT: Poses(np.zeros(3), [1.0, 0.0, 0.0, 0.0]), **dict(zip(self.bones, local, strict=True))}


class VmcReceiver:
    """Shows performers and their devices a delay later: what `Receiver` is for the codec."""

    def __init__(self, delay: float = 0.1) -> None:
        self.delay = delay
        self._sources: dict[Stream, _Source] = {}

    def take(self, datagram: bytes, arrival: float, source: Hashable = None) -> None:
        """Take a datagram that came at a time, by the clock of `show`, from somewhere."""
        stream = Stream(source, b"VMC")
        for message in read(datagram):
            if not message.address.startswith("/VMC/Ext/"):
                continue
            known = self._sources.get(stream)
            if known is None:
                if len(self._sources) >= MOST_SOURCES:
                    return
                known = self._sources[stream] = _Source(self.delay)
            known.hear(message, arrival)

    def show(self, now: float) -> dict[Stream, Shown]:
        """Return what every performer does now."""
        self._sources = {stream: it for stream, it in self._sources.items() if -SILENT < now - it.heard < SILENT}
        shown = {stream: it.show(now) for stream, it in self._sources.items()}
        return {stream: what for stream, what in shown.items() if what is not None}

    def bodies(self, stream: Stream) -> tuple[Body, ...]:
        """Return the performer of a stream, at rest, and its devices."""
        known = self._sources.get(stream)
        return known.bodies if known else ()

    def keys(self) -> list[Keys]:
        """All samples that came since the last call."""
        result = [it.keys(stream) for stream, it in self._sources.items()]
        return [keys for keys in result if len(keys.moments)]


class _Source:
    """What one program sends: a performer, devices, or both."""

    def __init__(self, delay: float) -> None:
        self.heard = -np.inf
        self.bodies: tuple[Body, ...] = ()
        self._playing = Playing(delay)
        self._positions = np.zeros((len(JOINTS) + MOST_DEVICES, 3))
        self._quaternions = np.tile((1.0, 0.0, 0.0, 0.0), (len(self._positions), 1))
        self._rows: dict[str, list[int]] = {}
        """The joints of each body: those of `JOINTS`, and one for each device."""
        self._devices: dict[str, int] = {}
        self._known = {0}
        """Joints that were ever said."""
        self._said: set[int] = set()
        """Those of this frame."""
        self._begun = 0.0
        self._samples: deque[tuple[float, np.ndarray, np.ndarray]] = deque(maxlen=MOST_SAMPLES)
        self._unkept: deque[tuple[float, np.ndarray, np.ndarray]] = deque(maxlen=MOST_SAMPLES)
        self._has_time = False

    def hear(self, message: Message, arrival: float) -> None:
        """Take one message."""
        arguments = message.arguments
        if message.address == "/VMC/Ext/Bone/Pos" and arguments and arguments[0] in NUMBERS:
            self._place(NUMBERS[arguments[0]], arguments[1:], arrival)
        elif message.address == "/VMC/Ext/Root/Pos":
            self._place(0, arguments[1:], arrival)
        elif message.address in DEVICES and arguments and (joint := self._device(arguments[0])):
            self._place(joint, arguments[1:], arrival)
        elif message.address == "/VMC/Ext/T" and len(arguments) == 1 and _is_finite(arguments[0]):
            self._has_time = True
            self._sample(float(cast(float, arguments[0])), arrival)

    def _device(self, serial: object) -> int | None:
        """Return the joint of a device; None for what is no name, and for too many."""
        if not isinstance(serial, str):
            return None
        if serial not in self._devices:
            is_name = serial != PERFORMER and 0 < len(serial.encode()) <= LONGEST_NAME
            if not is_name or len(self._devices) == MOST_DEVICES:
                return None
            self._devices[serial] = len(JOINTS) + len(self._devices)
        return self._devices[serial]

    def _place(self, joint: int, numbers: tuple[Any, ...], arrival: float) -> None:
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
        self._positions[joint] = numbers[:3]
        self._quaternions[joint] = w / length, x / length, y / length, z / length

    def _sample(self, moment: float, arrival: float) -> None:
        """Take the frame that is complete."""
        if not self._said - {0}:
            return
        if new := self._said - self._known:
            self._known |= new
            self._describe(new)
        self._said = set()
        last = self._samples[-1][0] if self._samples else -np.inf
        if abs(moment - last) > SET:
            self._samples.clear()
        elif moment <= last:
            return
        poses = from_unity(Poses(self._positions, self._quaternions))
        sample = moment, poses.positions, poses.quaternions
        self._samples.append(sample)
        self._unkept.append(sample)
        self._playing.heard(moment, arrival)
        self.heard = arrival

    def _describe(self, new: set[int]) -> None:
        """Have bodies for joints that were never said before; the others stay the same."""
        bodies = {body.name: body for body in self.bodies}
        if min(new) < len(JOINTS):
            bodies = {PERFORMER: self._performer()} | {name: it for name, it in bodies.items() if name != PERFORMER}
        places = from_unity(Poses(self._positions, self._quaternions))
        for serial, joint in self._devices.items():
            if joint in new:
                bodies[serial] = Body.rigid(serial, places[joint : joint + 1])
                self._rows[serial] = [joint]
        self.bodies = tuple(bodies.values())

    def _performer(self) -> Body:
        rows = self._rows[PERFORMER] = sorted(joint for joint in self._known if joint < len(JOINTS))
        names = [JOINTS[joint] for joint in rows]
        rest = from_unity(Poses(self._positions[rows], np.tile((1.0, 0.0, 0.0, 0.0), (len(names), 1))))
        parents = []
        for name in names:
            above = PARENTS[name]
            while above and above not in names:
                above = PARENTS[above]
            parents.append(names.index(above) if above else -1)
        sliding = np.array([name in (ROOT, "Hips") for name in names])
        return Body(PERFORMER, tuple(names), np.array(parents), rest, sliding=sliding)

    def _poses(self, positions: np.ndarray, quaternions: np.ndarray) -> dict[str, Poses]:
        """Of each body, of arrays (n, all joints, ...)."""
        return {
            body.name: Poses(positions[..., rows, :], quaternions[..., rows, :])
            for body in self.bodies
            for rows in (self._rows[body.name],)
        }

    def show(self, now: float) -> Shown | None:
        moment = self._playing.moment(now)
        if moment is None or not self._samples:
            return None
        while len(self._samples) > 2 and self._samples[1][0] <= moment:
            self._samples.popleft()
        few = [self._samples[0], self._samples[min(1, len(self._samples) - 1)]][: len(self._samples)]
        moments, positions, quaternions = (np.array(part) for part in zip(*few, strict=True))
        still = np.zeros_like(self._positions)
        poses = Path(moments, positions, quaternions, still, still).at(np.array([moment]))[:, 0]
        return Shown(moment, self._poses(poses.positions, poses.quaternions))

    def keys(self, stream: Stream) -> Keys:
        if not self._unkept:
            return Keys(stream, np.empty(0), {})
        moments, positions, quaternions = (np.array(part) for part in zip(*self._unkept, strict=True))
        self._unkept.clear()
        return Keys(stream, moments, self._poses(positions, quaternions))


def _is_finite(number: object) -> bool:
    return isinstance(number, float | int) and math.isfinite(number)
