"""Keys and F-curves of objects and bones, read without the extension's code."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.modified import is_term

Carrier = bpy.types.Object | bpy.types.PoseBone
"""An object or pose bone with location, rotation and scale. Pose bones have no delta transforms of their own."""

MODE_IDS = ("BLENDER", *KEYFRAME_MODES)
BY_NUMBER = {0: "BLENDER", **{mode.number: name for name, mode in KEYFRAME_MODES.items()}}
WIDTHS = {"location": 3, "rotation_quaternion": 4, "rotation_euler": 3, "rotation_axis_angle": 4, "scale": 3}
KEY_FIELDS = "interpolation", "easing", "period", "type", "handle_left_type", "handle_right_type"
MARKED_FIELDS = "back", "amplitude"
"""The lowest six bits of these fields store the mode of a key: in `back` the number plus 16, and plus 32 if `period`
stores a holder; in `amplitude` always 42."""

HOLD_BITS = 16383
"""These bits of `period` store the holder, if `back` has the additional 32."""


def curves_of(carrier: Carrier) -> dict[tuple[str, int], bpy.types.FCurve]:
    """Return the F-curves of an object's slot, or of a pose bone in it. Data paths start at the object or bone."""
    channelbag, prefix = _channelbag(carrier), _prefix(carrier)
    curves = () if channelbag is None else ((curve.data_path, curve) for curve in channelbag.fcurves)
    return {(path.removeprefix(prefix), c.array_index): c for path, c in curves if path.startswith(prefix)}


def curve_of(carrier: Carrier, path: str, index: int = 0) -> bpy.types.FCurve | None:
    """Return one F-curve, which Blender finds much faster than all of them."""
    channelbag = _channelbag(carrier)
    return None if channelbag is None else channelbag.fcurves.find(f"{_prefix(carrier)}{path}", index=index)


def _channelbag(carrier: Carrier) -> bpy.types.ActionChannelbag | None:
    data = carrier.id_data.animation_data
    if data is None or data.action is None or data.action_slot is None:
        return None
    return action_get_channelbag_for_slot(data.action, data.action_slot)


def _prefix(carrier: Carrier) -> str:
    """Return the prefix of a pose bone's data paths."""
    return "" if isinstance(carrier, bpy.types.Object) else f"{carrier.path_from_id()}."


def rotation_path(obj: Carrier) -> str:
    return {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}.get(
        obj.rotation_mode, "rotation_euler"
    )


def transform_paths(obj: Carrier) -> tuple[str, str, str]:
    return "location", rotation_path(obj), "scale"


def snapshot(obj: Carrier) -> dict[tuple[str, int], tuple]:
    """Return all that the animator keyed, including handles, but no modes: every channel without its in-betweens."""
    return {
        name: (
            fcurve.extrapolation,
            fcurve.mute,
            tuple((modifier.type, modifier.mute) for modifier in fcurve.modifiers if not is_term(modifier)),
            tuple(
                (
                    *(*key.co, *key.handle_left, *key.handle_right),
                    *(getattr(key, field) for field in KEY_FIELDS),
                    *(_bits(key, field) & ~63 for field in MARKED_FIELDS),
                )
                for key in fcurve.keyframe_points
            ),
        )
        for name, fcurve in curves_of(obj).items()
    }


def _bits(key: bpy.types.Keyframe, field: str) -> int:
    return int(np.float32(getattr(key, field)).view(np.int32))


def mark_of(key: bpy.types.Keyframe) -> int:
    """Return the mode number stored in a key, from 1 on, or 0."""
    back, amplitude = (_bits(key, field) & 63 for field in MARKED_FIELDS)
    return back % 32 - 16 if amplitude == 42 and back % 32 > 16 else 0


def moving_curves(obj: Carrier) -> list[bpy.types.FCurve]:
    """Return the F-curves with keys of its location, rotation and scale, in this order."""
    return [curve for path in transform_paths(obj) for curve in moving_in(obj, path).values()]


def moving_in(obj: Carrier, path: str) -> dict[int, bpy.types.FCurve]:
    """Return the unmuted keyed F-curves of a property by index; none for a rotation or scale with a muted channel."""
    curves = {index: curve_of(obj, path, index) for index in range(WIDTHS[path])}
    if path != "location" and muted_in(obj, path):
        return {}
    return {index: c for index, c in curves.items() if c is not None and len(c.keyframe_points) and not c.mute}


def muted_in(obj: Carrier, path: str) -> list[int]:
    """Return the indices of the muted channels of a property."""
    curves = ((index, curve_of(obj, path, index)) for index in range(WIDTHS[path]))
    return [index for index, curve in curves if curve is not None and curve.mute]


def distinct(frames: Iterable[float]) -> np.ndarray:
    """Return key frames in ascending order. Frames less than a hundredth of a frame apart are merged."""
    frames = sorted(set(frames))
    return np.array([frame for i, frame in enumerate(frames) if i == 0 or frame - frames[i - 1] > 0.01])


def key_frames(obj: Carrier) -> np.ndarray:
    """Return the frames on which any transform channel has a key."""
    return distinct(key.co[0] for curve in moving_curves(obj) for key in curve.keyframe_points)


def mode_at(obj: Carrier, frame: float) -> str:
    """Return the mode of the segment that begins on this frame: from the last key with a mode, or else the first."""
    said = [
        (key.co[0], -number, mark)
        for number, curve in enumerate(moving_curves(obj))
        for key in curve.keyframe_points
        if (mark := mark_of(key))
    ]
    if not said:
        return "BLENDER"
    # On the same frame, the first channel counts.
    *_, mark = max((key for key in said if key[0] < frame + 0.005), default=min(said))
    return BY_NUMBER[mark - 1]


def turns_at(obj: Carrier, first: float) -> float:
    """Return the turns of the channel in the segment that begins on this frame."""
    fcurve = curve_of(obj, "rigid_motion.turns")
    if fcurve is None or fcurve.mute or mode_at(obj, first) == "BLENDER":
        return 0.0
    return next((key.co[1] for key in reversed(fcurve.keyframe_points) if key.co[0] < first + 0.005), 0.0)
