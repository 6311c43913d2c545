"""The Virtual Motion Capture protocol (VMC): sends and receives humanoid bones and tracked devices over OSC.

VSeeFace, SlimeVR, Warudo and Unity use it: for every frame, the pose of each bone in its parent's space, relative to a
T-pose without rotations; then the time. Unity's axes are left-handed, y up, z forward; a performer that looks along z
there looks along -y in Blender, as characters do. Metres.
Source: https://protocol.vmc.info/marionette-spec
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..motion import Poses
from ..motion.humanoid import HUMANOID, alignments, humanoid_bones, relative_to_followed
from ..motion.poses import in_other_axes
from ..motion.quaternions import conjugate, multiply
from .bodies import LONGEST_NAME, MAX_CLOCK_S, MAX_LENGTH_M, MIN_SAMPLE_GAP_S, Forest, StreamBody
from .osc import OscMessage, read, write_bundle, write_message
from .paths import KnotPath
from .playing import CLOCK_SET_S, Playback, Stream

VMC_PORT = 39539
"""The port that programs which show a performer listen on."""

VMC, ROOT, PERFORMER = b"/VMC", "Root", "VMC"
"""The identity of all VMC streams; the parent joint of the hips; and the name of a performer's body."""

JOINTS = (ROOT, *HUMANOID)
PARENTS = {ROOT: "", **{bone: above or ROOT for bone, above in HUMANOID.items()}}

Joint = tuple[str, str]
"""Name of the body, which for a device is its serial number, and name of the joint."""

DEVICES = {f"/VMC/Ext/{kind}/Pos" for kind in ("Tra", "Con", "Hmd")}
"""Trackers, controllers and headsets: rigid bodies in world space, by serial number."""

MOST_DEVICES, AT_ONCE = 32, 12
"""Most devices of a program; and bones per datagram, small enough for networks to send it in one piece."""

MAX_FRAMES, MAX_LATE_FRAMES = 8, 3
"""Most frames of a datagram: the rest is dropped. And late frames in a row, in sending order, after which the
sender's clock counts as set back."""

_TO_BLENDER = np.array(((-1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)))
"""From Unity's axes to Blender's: a mirror."""


def write(time: float, poses: Mapping[str, Poses]) -> list[bytes]:
    """Return the datagrams of a frame: the pose () of each bone in its parent's space, and of `ROOT`."""
    root = [_pose("/VMC/Ext/Root/Pos", "root", poses[ROOT])] if ROOT in poses else []
    bones = [_pose("/VMC/Ext/Bone/Pos", bone, poses[bone]) for bone in HUMANOID if bone in poses]
    return _bundles([*root, *bones, write_message("/VMC/Ext/OK", 1), write_message("/VMC/Ext/T", float(time))])


def write_trackers(poses: Mapping[str, Poses]) -> list[bytes]:
    """Return the datagrams with the world-space poses () of trackers, by name."""
    return _bundles([_pose("/VMC/Ext/Tra/Pos", name, pose) for name, pose in poses.items()])


def _pose(address: str, name: str, pose: Poses) -> bytes:
    unity = in_other_axes(pose, _TO_BLENDER.T)
    w, *xyz = unity.quaternions.tolist()
    return write_message(address, name, *unity.positions.tolist(), *xyz, w)


def _bundles(messages: list[bytes]) -> list[bytes]:
    return [write_bundle(messages[first : first + AT_ONCE]) for first in range(0, len(messages), AT_ONCE)]


class Performer:
    """A skeleton of any kind as VMC: joints, parents first, with rest poses (joints,) in the space of the roots."""

    def __init__(self, joints: tuple[str, ...], rest: Poses) -> None:
        self.bones = humanoid_bones(joints)
        """The joint for each humanoid bone."""
        self._numbers = list(self.bones.values())
        aligned = alignments(self.bones, rest.positions)
        turns = np.array([conjugate(aligned[bone]) if bone in aligned else (1.0, 0.0, 0.0, 0.0) for bone in self.bones])
        self._from_rest = multiply(conjugate(rest.quaternions[self._numbers]), turns.reshape(-1, 4))
        self._follows = np.array(_parents(list(self.bones)))

    def __call__(self, poses: Poses) -> dict[str, Poses]:
        """Return the pose () of each bone in its parent's space, given poses (joints,) in the space of the roots."""
        there = poses[self._numbers]
        local = relative_to_followed(
            Poses(there.positions, multiply(there.quaternions, self._from_rest)), self._follows
        )
        return {ROOT: Poses(np.zeros(3), [1.0, 0.0, 0.0, 0.0]), **dict(zip(self.bones, local, strict=True))}


def _parents(names: Sequence[str]) -> list[int]:
    """Return the number of each joint's nearest ancestor among these joints, -1 for none."""
    result = []
    for name in names:
        while (name := PARENTS.get(name, "")) and name not in names:
            pass
        result.append(names.index(name) if name else -1)
    return result


class Performance(Playback):
    """The stream of one program: a performer, devices, or both. All of its samples are keys."""

    silent = 2.0

    def __init__(self, stream: Stream, delay: float, heard: float) -> None:
        super().__init__(stream, delay, heard)
        self._newest: dict[Joint, list[float]] = {(PERFORMER, ROOT): [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]}
        """Latest position and rotation of every joint received so far, in Unity's axes."""
        self._joints: list[Joint] = []
        """The joints of all bodies, in order."""
        self._frame: dict[Joint, list[float]] = {}
        """Joints of the current frame; `_begun` is when it began."""
        self._begun = 0.0
        self._has_time = False
        self._slip = self._sent = 0.0
        """Seconds added to the sender's times, changed whenever its clock is set; and the last sent time."""
        self._late = self._frames = 0
        """Consecutive frames older than received ones; and frames of this datagram."""

    def take(self, datagram: bytes, arrival: float) -> None:
        """Process a datagram."""
        self._frames = 0
        for message in read(datagram):
            if self._frames < MAX_FRAMES:
                self._take_message(message, arrival)

    def _take_message(self, message: OscMessage, arrival: float) -> None:
        address, (name, *numbers) = message.address, message.arguments or (None,)
        if address == "/VMC/Ext/Root/Pos":
            self._store_joint((PERFORMER, ROOT), numbers, arrival)
        elif address == "/VMC/Ext/Bone/Pos" and name in HUMANOID:
            self._store_joint((PERFORMER, str(name)), numbers, arrival)
        elif address in DEVICES and isinstance(name, str) and name != PERFORMER:
            devices = {body for body, _ in (*self._newest, *self._frame)} - {PERFORMER}
            if 0 < len(name.encode()) <= LONGEST_NAME and (name in devices or len(devices) < MOST_DEVICES):
                self._store_joint((name, name), numbers, arrival)
        elif address == "/VMC/Ext/T" and not numbers and isinstance(name, float | int) and abs(name) <= MAX_CLOCK_S:
            self._has_time = True
            self._finish_frame(float(name), arrival)

    def _store_joint(self, joint: Joint, numbers: list[Any], arrival: float) -> None:
        try:
            x, y, z, w = numbers[3:7]
            length = math.sqrt(x * x + y * y + z * z + w * w)
            is_sound = 0.5 < length < 2.0 and all(-MAX_LENGTH_M < number < MAX_LENGTH_M for number in numbers[:3])
        except (TypeError, ValueError, OverflowError):
            is_sound = False
        if not is_sound:
            return
        if joint in self._frame and not self._has_time:
            self._finish_frame(self._begun, self._begun)
        if not self._frame:
            self._begun = arrival
        self._frame[joint] = [*numbers[:3], w / length, x / length, y / length, z / length]

    def _finish_frame(self, sent: float, arrival: float) -> None:
        """Add the completed frame to the path."""
        self._frames += 1
        if not self._frame.keys() - {(PERFORMER, ROOT)}:
            return
        is_new = bool(self._frame.keys() - self._newest.keys())
        self._newest |= self._frame
        self._frame = {}
        if is_new:
            self._describe()
            self.path, self.kept = None, -np.inf
        moment = self._moment(sent, arrival)
        if moment is None:
            return
        poses = self._poses(self._joints)
        self.put(self.path.extended(moment, poses) if self.path else KnotPath(np.array([moment]), poses[:, None]))
        self.playing.heard(moment, arrival)
        self.heard = arrival

    def _moment(self, sent: float, arrival: float) -> float | None:
        """Return the time of a frame, by a clock that is never set; None for a late or duplicate frame."""
        is_next, self._sent = sent > self._sent, sent
        if self.path is None:
            return sent + self._slip
        last, self._slip = float(self.path.moments[-1]), self._slip - self.playing.set_ahead(sent + self._slip, arrival)
        self._late = (self._late * is_next + 1) if sent + self._slip < last + MIN_SAMPLE_GAP_S else 0
        if self._late >= MAX_LATE_FRAMES or sent + self._slip < last - CLOCK_SET_S:
            # Its distance from the last frame is the difference of their arrivals.
            self._slip, self._late = last + max(arrival - self.heard, MIN_SAMPLE_GAP_S) - sent, 0
        moment = sent + self._slip
        return moment if moment > last and not self._late else None

    def _poses(self, joints: list[Joint]) -> Poses:
        rows = np.array([self._newest[joint] for joint in joints])
        return in_other_axes(Poses(rows[:, :3], rows[:, 3:]), _TO_BLENDER)

    def _describe(self) -> None:
        """Create bodies for all joints received so far; unchanged bodies are kept."""
        before = {(body.name, body.joints): body for body in self.forest.bodies} if self.forest else {}
        bones = [bone for bone in JOINTS if (PERFORMER, bone) in self._newest]
        bodies = [StreamBody.rigid(name) for name, _ in self._newest if name != PERFORMER]
        if len(bones) > 1:
            places = self._poses([(PERFORMER, bone) for bone in bones]).positions
            rest = Poses(places, np.tile((1.0, 0.0, 0.0, 0.0), (len(bones), 1)))
            sliding = np.isin(bones, (ROOT, "Hips"))
            bodies.insert(0, StreamBody(PERFORMER, tuple(bones), np.array(_parents(bones)), rest, sliding=sliding))
        self._joints = [(body.name, joint) for body in bodies for joint in body.joints]
        self.forest = Forest([before.get((body.name, body.joints), body) for body in bodies])
