"""Oracle for one carrier: which of its channels modes fill, between which keys, and along what path.

It uses `FCurve.evaluate` for keys and timing, and `interpolate` for the motion of each segment. Terms must be muted.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Euler, Quaternion

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import multiply
from tests.animation.keyed import (
    WIDTHS,
    Carrier,
    curve_of,
    distinct,
    key_frames,
    mode_at,
    moving_in,
    muted_in,
    rotation_path,
    transform_paths,
    turns_at,
)
from tests.animation.path_oracle import Path
from tests.animation.spin_oracle import Spin, about_one_axis, spin_and_end
from tests.animation.timing_oracle import evaluated, progress

DEPENDS_ON_KEYS = {"pga_lerp", "cga_lerp", "motor_spline"}
"""In these modes a further key on the path would change the path."""


class Own(NamedTuple):
    """Delta transforms of an object."""

    location: tuple[float, ...]
    quaternion: tuple[float, ...]
    scale: tuple[float, ...]


def own_deltas(obj: Carrier) -> Own:
    """Return the delta transforms of an object; bones have none."""
    if not isinstance(obj, bpy.types.Object):
        return Own((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    turned = Quaternion()
    if obj.rotation_mode == "QUATERNION":
        turned = obj.delta_rotation_quaternion.normalized()
    elif obj.rotation_mode != "AXIS_ANGLE":
        turned = Euler(obj.delta_rotation_euler, obj.rotation_mode).to_quaternion()
    return Own(tuple(obj.delta_location), tuple(turned), tuple(obj.delta_scale))


class Body:
    """The channels of a carrier that modes fill, and the frames of the keys between which segments run.

    `keys` replaces the frames of the channels' own keys: cycles have more.
    """

    def __init__(self, obj: Carrier, keys: np.ndarray | None = None) -> None:
        self.obj, self.own, self.scaled = obj, own_deltas(obj), _scales_evenly(obj)
        self.muted = [muted_in(obj, path) for path in transform_paths(obj)]
        curves = {path: moving_in(obj, path) for path in transform_paths(obj)}
        changing = [path for path, of_path in curves.items() if any(map(_changes, of_path.values()))]
        if _has_turns(obj) and not self.muted[1]:
            changing.append(rotation_path(obj))
        filled = [path for path in curves if path in changing and (path != "scale" or self.scaled)]
        self.curves = {(path, index): curve for path in filled for index, curve in curves[path].items()}
        frames = distinct(key.co[0] for curve in self.curves.values() for key in curve.keyframe_points)
        if keys is None:
            keys = frames if len(frames) > 1 else key_frames(obj)
        if not self.curves:
            self.curves = {(path, index): curve for path in curves for index, curve in curves[path].items()}
        self.is_filled, self.keys, self.is_uneven = bool(filled), keys, "scale" in changing and not self.scaled
        self.shaping = np.array([key for number, key in enumerate(keys) if not self._is_without_influence(number)])

    def components(self, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return location, quaternion and scale on frames."""
        location, quaternion, scale = self.native(frames)
        location = location + self.own.location
        quaternion = multiply(np.array(self.own.quaternion), quaternion)
        scale = scale * self.own.scale
        keys = self.keys if self.is_filled else ()
        for first, last in itertools.pairwise(keys):
            mode = mode_at(self.obj, first)
            inside = frames > first if first > keys[0] else frames != first
            inside = inside & (frames < last if last < keys[-1] else frames != last)
            if mode == "BLENDER" or not inside.any():
                continue
            share = progress(self.curves, first, last, frames[inside], self.turns(first))
            path = Path(self, first, mode)
            if (path.first, path.last) != (first, last):
                poses = path.beside(np.array((first, last)), share)
            else:
                poses = path.poses(share, np.clip((frames[inside] - first) / (last - first), 0.0, 1.0))
            location[inside], quaternion[inside] = poses.positions @ location_axes(self.obj), poses.quaternions
            if self.scaled:
                scale[inside] = poses.scales[:, None] * self.own.scale
        # Muted channels do not move. A rotation or scale with a muted component is Blender's own.
        places, turned, sizes = native(self.obj, frames)
        fixed, is_turn_muted, is_scale_muted = self.muted
        location[:, fixed] = (places + self.own.location)[:, fixed]
        quaternion = multiply(np.array(self.own.quaternion), turned) if is_turn_muted else quaternion
        return location, quaternion, sizes * self.own.scale if is_scale_muted else scale

    def native(self, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return location, unit quaternion and scale of the unmuted channels."""
        location, quaternion, scale = native(self.obj, frames)
        if self.muted[1]:
            quaternion[:] = 1.0, 0.0, 0.0, 0.0
        return location, quaternion, np.ones_like(scale) if self.muted[2] else scale

    def key_poses(self, frames: np.ndarray) -> Poses:
        positions, quaternions, scales = self.native(frames)
        return Poses(
            (positions + self.own.location) @ location_axes(self.obj).T,
            multiply(np.array(self.own.quaternion), quaternions),
            scales[:, 0] if self.scaled else None,
        )

    def turns(self, first: float) -> float:
        """Return the turns of the channel in the segment that begins on this frame."""
        turns = 0.0 if self.muted[1] else turns_at(self.obj, first)
        return turns if abs(turns - round(turns)) >= 1e-5 else round(turns)

    def may_spin(self) -> bool:
        """Whether it has turns, or an angle that changes by half a turn or more between two keys."""
        turns = curve_of(self.obj, "rigid_motion.turns")
        if turns is not None and len(turns.keyframe_points) and not turns.mute:
            return True
        path, order = rotation_path(self.obj), self.obj.rotation_mode
        if order == "QUATERNION" or self.muted[1]:
            return False
        pairs = itertools.pairwise(channels(self.obj, path, self.keys))
        changes = [about_one_axis(*pair) if order == "AXIS_ANGLE" else np.subtract(*pair) for pair in pairs]
        return max((np.abs(change).max() for change in changes), default=0.0) >= np.pi - 1e-4

    def _is_without_influence(self, number: int) -> bool:
        """Whether a key is a breakdown: on the path, but without influence on its shape."""
        keys = self.keys
        before, mode = (mode_at(self.obj, frame) for frame in keys[[number - 1, number]])
        if not 0 < number < len(keys) - 1 or before != mode or mode not in DEPENDS_ON_KEYS or self.may_spin():
            return False
        curves = self.curves.values()
        types = {key.type for curve in curves for key in curve.keyframe_points if key.co[0] == keys[number]}
        repeats = any(item.type == "CYCLES" and not item.mute for curve in curves for item in curve.modifiers)
        return not repeats and types == {"BREAKDOWN"}

    def is_beside_path(self, frame: float) -> bool:
        """Whether a breakdown beside this frame has a pose off the path of the surrounding keys."""
        before, behind = self.keys[self.keys < frame], self.keys[self.keys > frame]
        if not len(before) or not len(behind):
            return False
        around = np.array((before[-1], behind[0]))
        path = Path(self, around[0], mode_at(self.obj, around[0]))
        # Rounding errors alone do not count.
        return (path.first, path.last) != (*around,) and bool(np.abs(path.nearest(around)[1]).max() > 1e-4)

    def spin(self, first: float, last: float, *, channel: bool = True) -> Spin:
        """Return the additional whole turns from one key to the next, of the angles and of the channel."""
        return self.spin_and_end(first, last, channel=channel, whole=True)[0]

    def spin_and_end(
        self, first: float, last: float, *, channel: bool = True, whole: bool = False
    ) -> tuple[Spin, np.ndarray]:
        """Return the additional turns from one key to the next, and the end rotation without them."""
        ends, order = np.array((first, last)), self.obj.rotation_mode
        by_angles = {}
        if order != "QUATERNION" and not self.muted[1]:
            by_angles = {"angles": channels(self.obj, rotation_path(self.obj), ends), "order": order}
        turns = self.turns(first) if channel else 0.0
        return spin_and_end(self.key_poses(ends).quaternions, turns, **by_angles, own=self.own.quaternion, whole=whole)

    def codes(self, frame: float) -> set[str]:
        """Return the interpolations of all channels in the segment that begins on this frame."""
        result = set()
        for fcurve in self.curves.values():
            points = fcurve.keyframe_points
            earlier = [point for point in points if point.co[0] < frame + 0.005]
            result.add((earlier[-1] if earlier else points[0]).interpolation)
        return result


def _changes(fcurve: bpy.types.FCurve) -> bool:
    values = [
        value
        for key in fcurve.keyframe_points
        for value in (key.co[1], *((key.handle_left[1], key.handle_right[1]) if key.interpolation == "BEZIER" else ()))
    ]
    return len(fcurve.keyframe_points) > 1 and max(values) > min(values)


def _has_turns(obj: Carrier) -> bool:
    turns = curve_of(obj, "rigid_motion.turns")
    return turns is not None and not turns.mute and any(key.co[1] for key in turns.keyframe_points)


def location_axes(obj: Carrier) -> np.ndarray:
    """Return the axes of location as columns, in the body's axes: a bone may use its parent's axes."""
    if isinstance(obj, bpy.types.Object) or obj.bone.use_local_location:
        return np.eye(3)
    above = obj.bone.parent.matrix_local.to_3x3() if obj.bone.parent else np.eye(3)
    return np.linalg.inv(np.array(obj.bone.matrix_local.to_3x3())) @ np.array(above)


def native(obj: Carrier, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return location, unit quaternion and scale from the object's channels alone."""
    location, turned, scale = (channels(obj, path, frames) for path in transform_paths(obj))
    if obj.rotation_mode == "QUATERNION":
        lengths = np.linalg.norm(turned, axis=1)
        # Blender's own rule for a quaternion of length zero.
        turned[lengths == 0.0] = (0.0, 1.0, 0.0, 0.0)
        turned /= np.where(lengths == 0.0, 1.0, lengths)[:, None]
    elif obj.rotation_mode == "AXIS_ANGLE":
        quaternions = [Quaternion(axis, angle) if any(axis) else Quaternion() for angle, *axis in turned]
        turned = np.reshape(quaternions, (-1, 4))
    else:
        turned = _from_eulers(turned, obj.rotation_mode)
    return location, turned, scale


def _from_eulers(angles: np.ndarray, order: str) -> np.ndarray:
    """Rotate about one axis after the other, in their order."""
    turned = np.zeros((len(angles), 4))
    turned[:, 0] = 1.0
    for axis in map("XYZ".index, order):
        about = np.zeros_like(turned)
        about[:, 0], about[:, 1 + axis] = np.cos(0.5 * angles[:, axis]), np.sin(0.5 * angles[:, axis])
        turned = multiply(about, turned)
    return turned


def channels(obj: Carrier, path: str, frames: np.ndarray) -> np.ndarray:
    values = np.empty((len(frames), WIDTHS[path]))
    for index, rest in enumerate(getattr(obj, path)):
        fcurve = curve_of(obj, path, index)
        keyed = fcurve is not None and len(fcurve.keyframe_points) and not fcurve.mute
        values[:, index] = [evaluated(fcurve, frame) for frame in frames] if keyed else rest
    return values


def _scales_evenly(obj: Carrier) -> bool:
    """Whether scale is animated, and positive and the same along all axes on every key."""
    curves = moving_in(obj, "scale").values()
    scales = channels(obj, "scale", key_frames(obj) if any(map(_changes, curves)) else np.empty(0))
    return len(scales) > 1 and bool(
        np.allclose(scales, scales[:, :1]) and np.all(scales > 0.0) and np.ptp(scales[:, 0]) > 0.0
    )
