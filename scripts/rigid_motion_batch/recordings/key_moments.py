"""Frames of the keys that move an object or the bones of a rig, from its Action, NLA strips and parents.

Frames are those of the scene: keys in strips are at their frames after scaling, repeating and reversing.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import bpy

TRANSFORMS = ("location", "rotation_", "scale", "delta_")
"""Starts of the data paths of channels that move an object."""

BONE_CHANNEL = re.compile(r'pose\.bones\["(?P<name>(?:\\.|[^"\\])*)"\]\.(?:location|rotation_|scale)', re.DOTALL)
"""Data paths of channels that move a pose bone; the bone's name is escaped in them."""

CONSTANT_CODE, LINEAR_CODE = 0, 1
"""Blender's numbers for the interpolation of keys."""

MOST_KEYS = 1_000_000
"""Keys of a strip with all its repeats; with more, the keys are ignored, and sampling relies on checks of the gaps."""


MAX_SAME_VALUE_RATIO = 1e-5
"""Values count as equal if they differ by less than this fraction of the curve's largest value, or of 1."""


@dataclass(frozen=True, eq=False)
class CurveKeys:
    """The keys of an F-curve."""

    frames: np.ndarray
    """Shape (n,), increasing."""

    jumps: np.ndarray
    """Shape (n,): whether the curve jumps to this key from a different constant value."""

    straight: bool
    """True if all interpolation between the keys is linear or constant."""

    varies: bool
    """True if the values of the keys differ."""


def fcurves_of(action: bpy.types.Action | None, slot: bpy.types.ActionSlot | None) -> Iterator[bpy.types.FCurve]:
    """Yield the F-curves of an Action's slot."""
    from bpy_extras.anim_utils import action_get_channelbag_for_slot

    if action is not None and slot is not None:
        channelbag = action_get_channelbag_for_slot(action, slot)
        yield from channelbag.fcurves if channelbag else ()


def curves_that_move(
    action: bpy.types.Action | None, slot: bpy.types.ActionSlot | None, *, bones: bool
) -> Iterator[bpy.types.FCurve]:
    """Yield the F-curves of a slot that move its object and, with `bones`, its pose bones."""
    for fcurve in fcurves_of(action, slot):
        if fcurve.data_path.startswith(TRANSFORMS) or (bones and BONE_CHANNEL.match(fcurve.data_path)):
            yield fcurve


def keys_of(fcurve: bpy.types.FCurve) -> CurveKeys:
    """Return the keys of an F-curve, sorted by frame."""
    points = fcurve.keyframe_points
    places, kinds = np.empty(2 * len(points), dtype=np.float32), np.empty(len(points), dtype=np.int32)
    points.foreach_get("co", places)
    points.foreach_get("interpolation", kinds)
    frames, values = places.reshape(-1, 2).T.astype(np.float64)
    order = np.argsort(frames, kind="stable")
    frames, values, kinds = frames[order], values[order], kinds[order]
    changes = np.abs(np.diff(values)) > MAX_SAME_VALUE_RATIO * np.abs(values).max(initial=1.0)
    jumps = np.append(False, (kinds[:-1] == CONSTANT_CODE) & changes)[: len(frames)]
    return CurveKeys(frames, jumps, bool(np.isin(kinds, (CONSTANT_CODE, LINEAR_CODE)).all()), bool(changes.any()))


def with_parents(obj: bpy.types.Object) -> Iterator[bpy.types.Object]:
    """Yield an object and its ancestors."""
    one: bpy.types.Object | None = obj
    while one is not None:
        yield one
        one = one.parent


def moments_of(obj: bpy.types.Object, lead: float) -> tuple[np.ndarray, bool]:
    """Return the frames at which F-curves of an object, its bones or its parents may bend or jump.

    Parameters
    ----------
    obj : bpy.types.Object
    lead : float
        A further moment is added this many frames before each jump.

    Returns
    -------
    frames : array, shape (n,)
        In any order, possibly with repeats.
    straight : bool
        Whether there are only straight lines and steps between the frames.
    """
    result, straight = [np.empty(0)], True
    for parent in with_parents(obj):
        if data := parent.animation_data:
            for fcurve in curves_that_move(data.action, data.action_slot, bones=True):
                keys = keys_of(fcurve)
                result += [keys.frames, keys.frames[keys.jumps] - lead]
                straight &= keys.straight and not fcurve.modifiers
            for track in data.nla_tracks:
                result += _strip_moments(track.strips, lead)
                straight = False
    return np.concatenate(result), straight


def _strip_moments(strips: Iterable[bpy.types.NlaStrip], lead: float) -> Iterator[np.ndarray]:
    for strip in strips:
        yield np.array([strip.frame_start - lead, strip.frame_start, strip.frame_end])
        yield np.array([strip.frame_start + strip.blend_in, strip.frame_end - strip.blend_out])
        if strip.type == "META":
            yield from _strip_moments(strip.strips, lead)
        elif strip.action is not None and not strip.use_animated_time:
            for fcurve in curves_that_move(strip.action, strip.action_slot, bones=True):
                yield _strip_keys(strip, keys_of(fcurve), lead)


def _strip_keys(strip: bpy.types.NlaStrip, keys: CurveKeys, lead: float) -> np.ndarray:
    """Return the frames of an Action's keys in a strip, in each repeat. A repeat usually begins with a jump."""
    first, last, scale = strip.action_frame_start, strip.action_frame_end, abs(strip.scale)
    length = (last - first) * scale
    rows = (keys.frames >= first) & (keys.frames <= last)
    if not length > 0.0 or strip.repeat * np.count_nonzero(rows) > MOST_KEYS:
        return np.empty(0)
    begins = strip.frame_start + length * np.arange(np.ceil(strip.repeat))
    frames, jumps = keys.frames[rows], keys.frames[rows & keys.jumps]
    places = (last - frames if strip.use_reverse else frames - first) * scale
    around = (last - jumps) * scale + lead if strip.use_reverse else (jumps - first) * scale - lead
    moments = np.add.outer(begins, np.concatenate((places, around, [0.0, -lead]))).ravel()
    return moments[(moments >= strip.frame_start - lead) & (moments <= strip.frame_end)]
