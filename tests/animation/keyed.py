"""What is keyed of objects and bones, read from their F-curves with nothing of the extension."""

from __future__ import annotations

import bpy
import numpy as np
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from rigid_motion.motion import KEYFRAME_MODES

Carrier = bpy.types.Object | bpy.types.PoseBone
"""What has location, rotation and scale. Pose bones have no delta transforms of their own."""

MODE_IDS = ("BLENDER", *KEYFRAME_MODES)
WIDTHS = {"location": 3, "rotation_quaternion": 4, "rotation_euler": 3, "scale": 3}
KEY_FIELDS = (
    *("interpolation", "easing", "back", "amplitude", "period", "type"),
    *("handle_left_type", "handle_right_type"),
)


def curves_of(carrier: Carrier) -> dict[tuple[str, int], bpy.types.FCurve]:
    """The F-curves of an object's slot, or those of a pose bone in it. Data paths are from object or bone on."""
    channelbag, prefix = _channelbag(carrier), _prefix(carrier)
    curves = () if channelbag is None else ((curve.data_path, curve) for curve in channelbag.fcurves)
    return {(path.removeprefix(prefix), c.array_index): c for path, c in curves if path.startswith(prefix)}


def curve_of(carrier: Carrier, path: str, index: int = 0) -> bpy.types.FCurve | None:
    """One of them, which Blender finds much sooner than all."""
    channelbag = _channelbag(carrier)
    return None if channelbag is None else channelbag.fcurves.find(f"{_prefix(carrier)}{path}", index=index)


def _channelbag(carrier: Carrier) -> bpy.types.ActionChannelbag | None:
    data = carrier.id_data.animation_data
    if data is None or data.action is None or data.action_slot is None:
        return None
    return action_get_channelbag_for_slot(data.action, data.action_slot)


def _prefix(carrier: Carrier) -> str:
    """What the data paths of a pose bone begin with."""
    return "" if isinstance(carrier, bpy.types.Object) else f"{carrier.path_from_id()}."


def rotation_path(obj: Carrier) -> str:
    return "rotation_quaternion" if obj.rotation_mode == "QUATERNION" else "rotation_euler"


def transform_paths(obj: Carrier) -> tuple[str, str, str]:
    return "location", rotation_path(obj), "scale"


def snapshot(obj: Carrier) -> dict[tuple[str, int], tuple]:
    """All that the animator keyed, to the last handle: every channel but the in-betweens."""
    return {
        name: (
            fcurve.extrapolation,
            fcurve.mute,
            tuple((modifier.type, modifier.mute) for modifier in fcurve.modifiers),
            tuple(
                (*key.co, *key.handle_left, *key.handle_right, *(getattr(key, field) for field in KEY_FIELDS))
                for key in fcurve.keyframe_points
            ),
        )
        for name, fcurve in curves_of(obj).items()
        if not name[0].startswith("delta_") and 'constraints["Rigid Motion' not in name[0]
    }


def key_frames(obj: Carrier) -> np.ndarray:
    """Where any transform channel has a key; keys less than a hundredth of a frame apart are one."""
    curves = (curve_of(obj, path, index) for path in transform_paths(obj) for index in range(WIDTHS[path]))
    frames = sorted({key.co[0] for curve in curves if curve and not curve.mute for key in curve.keyframe_points})
    return np.array([frame for i, frame in enumerate(frames) if i == 0 or frame - frames[i - 1] > 0.01])


def mode_at(obj: Carrier, frame: float) -> str:
    """The mode of the segment that begins on this frame."""
    fcurve = curve_of(obj, "rigid_motion.mode")
    if fcurve is None or fcurve.mute or not len(fcurve.keyframe_points):
        return obj.rigid_motion.mode
    return MODE_IDS[round(fcurve.evaluate(frame + 0.002))]


def turns_at(obj: Carrier, first: float) -> float:
    """The turns of the channel in the segment that begins on this frame."""
    fcurve = curve_of(obj, "rigid_motion.turns")
    if fcurve is None or fcurve.mute or mode_at(obj, first) == "BLENDER":
        return 0.0
    return next((key.co[1] for key in reversed(fcurve.keyframe_points) if key.co[0] < first + 0.005), 0.0)
