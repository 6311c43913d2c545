"""What goes out: rigs as VMC performers, all other objects as VMC trackers, as the screen shows them."""

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
    """Objects that are sent to an address. Raises OSError where that is none, and NotAllowed."""

    def __init__(self, host: str, port: int, objects: Iterable[bpy.types.Object]) -> None:
        self._names = [obj.name for obj in objects]
        check_access(host)
        self._outlet = Outlet(host, port)
        self._performers: dict[str, tuple[int, Performer]] = {}
        """The number of bones that each rig had."""
        self._begun = time.monotonic()

    def tick(self, now: float) -> None:
        """Send where everything is."""
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
    """Return where the bones of a rig are in the world, in the order of its armature."""
    matrices = np.array([pose_bones(obj)[bone.name].matrix for bone in armature(obj).bones])
    return unscaled(np.array(obj.matrix_world) @ matrices)


running = Ticking("What is selected cannot be sent")


def sending() -> LiveSending | None:
    """Return what is sent, if anything is."""
    return running.thing


def start(host: str, port: int, objects: Iterable[bpy.types.Object]) -> LiveSending:
    """Send objects, and nothing else any more. Raises OSError where the address is none, and NotAllowed."""
    return running.start(lambda: LiveSending(host, port, objects))


def stop() -> None:
    """Send no more."""
    running.stop()
