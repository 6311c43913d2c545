"""The motion of a prop in one holder, from a copy with only the keys of that hold."""

from __future__ import annotations

import bpy
import numpy as np

from tests.animation.holds.oracle import Carrier, Motion
from tests.animation.keyed import WIDTHS, curves_of
from tests.animation.oracle import expected_bases

COPIED = (
    "co",
    "handle_left_type",
    "handle_right_type",
    "handle_left",
    "handle_right",
    *("interpolation", "easing", "period", "type", "back", "amplitude"),
)


AUTOMATIC = {"AUTO", "AUTO_CLAMPED"}


def motion_of(prop: Carrier, first: float, until: float, *, comes: bool, goes: bool) -> Motion:
    """Return the motion of the keys from one frame until another. Outside them it extrapolates, or rests."""
    copy = copy_of(prop, first, until, comes=comes, goes=goes)
    frames = [key.co.x for curve in curves_of(copy).values() for key in curve.keyframe_points]
    low, high = -np.inf if comes else min(frames), np.inf if goes else max(frames)

    def motion(at: np.ndarray) -> np.ndarray:
        return expected_bases(copy, np.clip(at, low, high))

    return motion


def copy_of(prop: Carrier, first: float, until: float, *, comes: bool, goes: bool) -> Carrier:
    """Return another object that has only these keys."""
    copy = bpy.data.objects.new("Copy", None)
    copy.rotation_mode = prop.rotation_mode
    action = bpy.data.actions.new("Copy")
    data = copy.animation_data_create()
    data.action = action
    data.action_slot = slot = action.slots.new("OBJECT", "Copy")
    bag = action.layers.new("Layer").strips.new(type="KEYFRAME").channelbag(slot, ensure=True)
    for (path, index), curve in curves_of(prop).items():
        if path in (*WIDTHS, "rigid_motion.turns"):
            everywhere = path not in WIDTHS
            keys = [key for key in curve.keyframe_points if everywhere or first - 0.005 < key.co.x < until - 0.005]
            if not keys:
                getattr(copy, path)[index] = curve.evaluate(first)
                continue
            made = bag.fcurves.new(path, index=index)
            made.keyframe_points.add(len(keys))
            for key, new in zip(keys, made.keyframe_points, strict=True):
                for name in COPIED:
                    setattr(new, name, getattr(key, name))
            made.update()
            if (comes or goes) and len(keys) > 1 and not everywhere:
                # Inner keys stay unchanged where the motion rests at both ends.
                automatic = [{key.handle_left_type, key.handle_right_type} <= AUTOMATIC for key in keys]
                for key in made.keyframe_points:
                    key.handle_left_type = key.handle_right_type = "FREE"
                first_two, last_two = made.keyframe_points[:2], made.keyframe_points[:][-2:]
                if automatic[0]:
                    _aim(first_two[0], first_two[1], level=not comes)
                if automatic[-1]:
                    _aim(last_two[1], last_two[0], level=not goes)
                made.extrapolation = "LINEAR"
    return copy


def _aim(key: bpy.types.Keyframe, other: bpy.types.Keyframe, *, level: bool) -> None:
    """Align both handles of a key with another key, or make them level."""
    third, rise = (other.co.x - key.co.x) / 3, 0.0 if level else (other.co.y - key.co.y) / 3
    near, far = ("right", "left") if third > 0.0 else ("left", "right")
    setattr(key, f"handle_{near}", (key.co.x + third, key.co.y + rise))
    setattr(key, f"handle_{far}", (key.co.x - third, key.co.y - rise))
