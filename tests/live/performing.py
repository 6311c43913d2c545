"""A performer for tests: a dancing skeleton, the datagrams it sends, and a rig that it can drive."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterable

import bpy
import numpy as np

from rigid_motion.live import receiving
from rigid_motion.motion import Poses, Skeleton
from rigid_motion.motion.quaternions import turned
from rigid_motion.streams import StreamBody
from rigid_motion.streams.vmc import Performer, write
from tests.animation.bones import rigs
from tests.animation.bones.rigs import Rest

JOINTS = ("Hips", "Spine", "Neck", "Head", "LeftUpperArm", "LeftLowerArm", "LeftHand", "LeftUpperLeg", "LeftLowerLeg")
JOINTS += ("LeftFoot",)
PARENTS = np.array([-1, 0, 1, 2, 1, 4, 5, 0, 7, 8])
PLACES = np.array(
    [
        *([0.0, 0.0, 0.9], [0.0, 0.0, 0.2], [0.0, 0.0, 0.3], [0.0, 0.0, 0.1], [0.2, 0.0, 0.2]),
        *([0.3, 0.0, 0.0], [0.25, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, -0.4], [0.0, 0.0, -0.4]),
    ]
)
STILL = np.tile((1.0, 0.0, 0.0, 0.0), (len(JOINTS), 1))
REST = Poses(PLACES, STILL)
BODY = StreamBody("dancer", JOINTS, PARENTS, REST)
SKELETON = Skeleton(PARENTS)
TIMES_OF_A_SECOND = np.arange(60) / 60.0

FPS, FIRST, BEGINS = 30, 10, 30
"""Frames per second, the first frame of a recording, and the sample that is shown on it."""


def dance(times: np.ndarray) -> Poses:
    """Return poses (joints, n) in their parents' space at times (n,), in seconds."""
    phases = np.random.default_rng(2).uniform(0.0, 6.0, (len(JOINTS), 1, 3))
    angles = 0.5 * np.sin(2.0 * times[:, None] + phases)
    positions = np.repeat(PLACES[:, None], len(times), axis=1)
    positions[0] += 0.3 * np.sin(times[:, None] * (1.0, 1.4, 0.5))
    return Poses(positions, np.array(turned(np.repeat(STILL[:, None], len(times), axis=1), angles)))


def in_world(poses: Poses) -> Poses:
    return SKELETON.in_root_space(poses)


def frames_of_vmc(times: np.ndarray) -> list[list[bytes]]:
    """Return the datagrams of VMC for each time."""
    performer, world = Performer(JOINTS, in_world(REST[:, None])[:, 0]), in_world(dance(times))
    return [write(moment, performer(world[:, row])) for row, moment in enumerate(times.tolist())]


class Sent:
    """The socket of a sending program; it also sets the time of the listener."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._to = ("127.0.0.1", port)

    def send(self, datagrams: Iterable[bytes], now: float) -> None:
        """Send datagrams, and let Blender read its port at the time `now`."""
        for datagram in datagrams:
            self._socket.sendto(datagram, self._to)
        time.sleep(0.001)
        receiving.listening().tick(now)

    def dance(self, first: int, last: int, now: float = 50.0) -> None:
        """Send the frames of a dance from `first` up to `last`."""
        for row, datagrams in enumerate(frames_of_vmc(np.arange(first, last) / 60.0), first):
            self.send(datagrams, now + row / 60.0)

    def close(self) -> None:
        self._socket.close()


def record(
    sent: Sent, clock: list[float], frames: Iterable[list[bytes]], on_row: Callable[[int], None] = lambda row: None
) -> None:
    """Send the datagrams of 60 samples a second, and record them from sample BEGINS on; `on_row` follows each."""
    for row, datagrams in enumerate(frames):
        clock[0] += 1.0 / 60.0
        sent.send(datagrams, clock[0])
        if row == BEGINS:
            assert bpy.ops.rigid_motion.live_record() == {"FINISHED"}
        on_row(row)
    assert bpy.ops.rigid_motion.live_finish("EXEC_DEFAULT", True) == {"FINISHED"}


def frame_of(row: float, delay: float) -> float:
    """Return the frame of a recording that shows a sample, if what is shown is this many seconds late."""
    return round(FIRST + ((row - BEGINS) / 60.0 + delay) * FPS, 9)


def show(row: float, delay: float) -> None:
    """Set the scene to the frame that shows a sample."""
    frame = frame_of(row, delay)
    bpy.context.scene.frame_set(int(np.floor(frame)), subframe=frame % 1.0)


def new_rig(prefix: str = "", larger: float = 1.0, turned_by: float = 0.3) -> bpy.types.Object:
    """Return an armature of the dancer, scaled and with a name prefix, its bones rolled by `turned_by`."""
    heads, bones = in_world(REST[:, None])[:, 0].positions * larger, []
    for joint, (name, parent) in enumerate(zip(JOINTS, PARENTS.tolist(), strict=True)):
        children = heads[joint == PARENTS]
        tail = children.mean(axis=0) if len(children) else heads[joint] + np.array((0.0, 0.05, 0.1))
        bones.append(Rest(prefix + name, heads[joint], tail, prefix + JOINTS[parent] if parent >= 0 else "", turned_by))
    return rigs.new_rig("Rig", bones)


def heads_of(rig: bpy.types.Object) -> np.ndarray:
    """Return the heads of a rig's bones in the world, shape (joints, 3)."""
    bpy.context.view_layer.update()
    return np.array([rig.matrix_world @ bone.head for bone in rig.pose.bones])
