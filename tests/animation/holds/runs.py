"""The motion of a prop in one holder, from a copy with only the keys of that hold."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion.animation import channelbag_of
from tests.animation.holds.oracle import Motion
from tests.animation.keyed import WIDTHS, Carrier, curves_of, key_frames
from tests.animation.oracle import expected_bases

AUTOMATIC = {"AUTO", "AUTO_CLAMPED"}
TURNS = "rigid_motion.turns"


def motion_of(prop: Carrier, first: float, until: float, *, comes: bool, goes: bool) -> Motion:
    """Return the motion of the keys from one frame until another. Outside them it extrapolates, or rests."""
    copy = copy_of(prop, first, until, comes=comes, goes=goes)
    frames = key_frames(copy)
    low, high = -np.inf if comes else frames[0], np.inf if goes else frames[-1]

    def motion(at: np.ndarray) -> np.ndarray:
        return expected_bases(copy, np.clip(at, low, high))

    return motion


def copy_of(prop: Carrier, first: float, until: float, *, comes: bool, goes: bool) -> Carrier:
    """Return another object that has only these keys."""
    copy, own = bpy.data.objects.new("Copy", None), prop.id_data.animation_data
    copy.rotation_mode = prop.rotation_mode
    data = copy.animation_data_create()
    data.action = own.action.copy()
    data.action_slot = data.action.slots[own.action_slot.identifier]
    paths = {curve.data_path: path for (path, _), curve in curves_of(prop).items() if path in (*WIDTHS, TURNS)}
    fcurves = channelbag_of(copy).fcurves
    for other in [curve for curve in fcurves if curve.data_path not in paths]:
        fcurves.remove(other)
    for curve in fcurves:
        path, keys = paths[curve.data_path], curve.keyframe_points
        curve.data_path, curve.extrapolation, at_first = path, "CONSTANT", curve.evaluate(first)
        if path == TURNS:
            continue
        for key in reversed(keys):
            if not first - 0.005 < key.co.x < until - 0.005:
                keys.remove(key)
        if not len(keys):
            getattr(copy, path)[curve.array_index] = at_first
            continue
        curve.update()
        if (comes or goes) and len(keys) > 1:
            # Inner keys stay unchanged where the motion rests at both ends.
            automatic = [{key.handle_left_type, key.handle_right_type} <= AUTOMATIC for key in keys]
            for key in curve.keyframe_points:
                key.handle_left_type = key.handle_right_type = "FREE"
            first_two, last_two = curve.keyframe_points[:2], curve.keyframe_points[:][-2:]
            if automatic[0]:
                _aim(first_two[0], first_two[1], level=not comes)
            if automatic[-1]:
                _aim(last_two[1], last_two[0], level=not goes)
            curve.extrapolation = "LINEAR"
    return copy


def _aim(key: bpy.types.Keyframe, other: bpy.types.Keyframe, *, level: bool) -> None:
    """Align both handles of a key with another key, or make them level."""
    third, rise = (other.co.x - key.co.x) / 3, 0.0 if level else (other.co.y - key.co.y) / 3
    near, far = ("right", "left") if third > 0.0 else ("left", "right")
    setattr(key, f"handle_{near}", (key.co.x + third, key.co.y + rise))
    setattr(key, f"handle_{far}", (key.co.x - third, key.co.y - rise))
