"""Sending live motion: rigs as VMC performers and all other objects as VMC trackers, as evaluated on screen."""

from __future__ import annotations

import time
from collections.abc import Iterable

import bpy
import numpy as np

from ..blender import armature, pose_bones
from ..motion import Poses
from ..streams.vmc import Performer, write, write_trackers
from .driving import unscaled
from .sockets import Outlet, check_access
from .ticking import Ticking


class LiveSending:
    """Objects being sent to an address. Raises OSError if the address is invalid, and NotAllowed."""

    def __init__(self, host: str, port: int, objects: Iterable[bpy.types.Object]) -> None:
        self._names = [obj.name for obj in objects]
        check_access(host)
        self._outlet = Outlet(host, port)
        self._performers: dict[str, tuple[int, Performer]] = {}
        """The performer of each rig, and the number of bones that the rig had."""
        self._begun = time.monotonic()

    def tick(self, now: float) -> None:
        """Send the poses of all objects."""
        depsgraph = bpy.context.evaluated_depsgraph_get()
        trackers: dict[str, Poses] = {}
        for name in self._names:
            obj = bpy.data.objects.get((name, None))
            if obj is None:
                continue
            evaluated = obj.evaluated_get(depsgraph)
            if obj.type == "ARMATURE":
                performer = self._performer(obj)
                for datagram in write(now - self._begun, performer(_bones(evaluated))) if performer.bones else ():
                    self._outlet.say(datagram)
            else:
                trackers[name] = unscaled(np.array(evaluated.matrix_world))
        for datagram in write_trackers(trackers):
            self._outlet.say(datagram)

    def _performer(self, obj: bpy.types.Object) -> Performer:
        bones = armature(obj).bones
        known = self._performers.get(obj.name)
        if known is None or known[0] != len(bones):
            matrices = np.array([bone.matrix_local for bone in bones])
            rest = unscaled(np.array(obj.matrix_basis.to_quaternion().to_matrix().to_4x4()) @ matrices)
            known = len(bones), Performer(tuple(bone.name for bone in bones), rest)
            self._performers[obj.name] = known
        return known[1]

    def close(self) -> None:
        self._outlet.close()


def _bones(obj: bpy.types.Object) -> Poses:
    """Return the world poses of a rig's bones, in the order of its armature."""
    matrices = np.array([pose_bones(obj)[bone.name].matrix for bone in armature(obj).bones])
    return unscaled(np.array(obj.matrix_world) @ matrices)


running = Ticking("What is selected cannot be sent")


def sending() -> LiveSending | None:
    """Return the objects being sent, None if nothing is sent."""
    return running.thing


def start(host: str, port: int, objects: Iterable[bpy.types.Object]) -> LiveSending:
    """Send only these objects. Raises OSError if the address is invalid, and NotAllowed."""
    return running.start(lambda: LiveSending(host, port, objects))


def stop() -> None:
    """Stop sending."""
    running.stop()
