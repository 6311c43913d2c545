"""What goes out: rigs as VMC performers, all other objects as VMC trackers, as the screen shows them."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ..animation.handlers import append_handlers, remove_handlers
from ..motion import Poses
from ..streams.vmc import Performer, write, write_trackers
from .driving import unscaled
from .sockets import Outlet

log = logging.getLogger(__package__)

RATE = 60
"""Frames a second."""


class Sending:
    """Objects that are sent to an address. Raises OSError where that is none, and NotAllowed."""

    def __init__(self, host: str, port: int, objects: Iterable[bpy.types.Object]) -> None:
        self._names = [obj.name for obj in objects]
        self._outlet = Outlet(host, port)
        self._performers: dict[str, tuple[int, Performer]] = {}
        """Of each rig, how many bones it had."""
        self._begun = time.monotonic()

    def tick(self, now: float) -> None:
        """Send where everything is."""
        depsgraph = bpy.context.evaluated_depsgraph_get()
        trackers = {}
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
        bones = obj.data.bones
        count, performer = self._performers.get(obj.name, (0, None))
        if count != len(bones):
            matrices = np.array([bone.matrix_local for bone in bones])
            rest = unscaled(np.array(obj.matrix_basis.to_quaternion().to_matrix().to_4x4()) @ matrices)
            performer = Performer(tuple(bone.name for bone in bones), rest)
            self._performers[obj.name] = len(bones), performer
        return performer

    def close(self) -> None:
        self._outlet.close()


def _bones(obj: bpy.types.Object) -> Poses:
    """Where the bones of a rig are in the world, in the order of its armature."""
    matrices = np.array([obj.pose.bones[bone.name].matrix for bone in obj.data.bones])
    return unscaled(np.array(obj.matrix_world) @ matrices)


_sending: Sending | None = None


def sending() -> Sending | None:
    """What is sent, if anything is."""
    return _sending


def start(host: str, port: int, objects: Iterable[bpy.types.Object]) -> Sending:
    """Send objects, and nothing else any more. Raises OSError where the address is none, and NotAllowed."""
    global _sending
    stop()
    _sending = Sending(host, port, objects)
    append_handlers(HANDLERS)
    bpy.app.timers.register(_look)
    return _sending


def stop() -> None:
    """Send no more."""
    global _sending
    if _sending is not None:
        _sending.close()
        _sending = None
        remove_handlers(HANDLERS)
        if bpy.app.timers.is_registered(_look):
            bpy.app.timers.unregister(_look)


def _look() -> float | None:
    if _sending is None:
        return None
    try:
        _sending.tick(time.monotonic())
    except Exception:
        # Blender would only drop the timer, and leave the port open.
        log.exception("What is selected cannot be sent")
        stop()
        return None
    return 1.0 / RATE


@persistent
def _on_load(*_: object) -> None:
    stop()


HANDLERS = {"load_pre": _on_load}
