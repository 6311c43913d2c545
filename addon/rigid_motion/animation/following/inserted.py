"""Keys inserted where a mode acts: fellow keys in the other channels, so that the motion continues unchanged.

An inserted key takes the visible value, because that is its channel's value. But Auto Key and buttons key single
components, while a key in any channel is a key of the whole body: without keys of their own on that frame, the other
channels would be Blender's in-betweens there. So all channels that modes fill get keys with the visible values. If they
have no keys on the body's keys before and after, they get them there, too, as the new keys would change these poses.
"""

from __future__ import annotations

from collections.abc import Mapping

import bpy
import numpy as np

from ...blender import existing
from ..actions.slots import Binding
from ..evaluation.components import DEPENDS_ON_KEYS
from ..evaluation.differences import seen_values
from ..evaluation.marks import SAME_VALUE, near, without
from ..evaluation.sources import SAME_FRAME, KeyedTransform
from ..evaluation.turning import needs_turning
from .kept_runs import keep_run
from .kept_timing import Insertion, nearest_key


def key_fellows(binding: Binding, new: KeyedTransform, old: KeyedTransform) -> bool:
    """Key all filled channels on frames where any of them was keyed on an in-between of a mode, and on the keys around.

    `old` is the source before the edit. Returns whether any key was inserted.
    """
    if not old.is_live or old.order != new.order:
        return False
    times, before, none = _times_of(new), _times_of(old), np.empty(0)
    rows = sorted({*old.filled_rows, *new.filled_rows} & times.keys())
    # If keys were moved or replaced, or channels came with others in their place, no key was inserted.
    if any(len(without(before.get(row, none), times[row])) for row in rows):
        return False
    added = [none, *(without(times[row], before.get(row, none)) for row in rows)]
    # Channels created for terms have a key on the first frame of all.
    frames = without(np.unique(np.concatenate(added)), np.union1d(old.key_frames, old.keyed_range[0]))
    frames = frames[[_is_in_between(old, frame) for frame in frames.tolist()]] if len(frames) else frames
    if not len(frames):
        return False
    behind = np.searchsorted(old.key_frames, frames)
    around = old.key_frames[np.clip((behind - 1, behind), 0, len(old.key_frames) - 1)]
    frames = np.union1d(frames, around)
    curves, seen, result = _curves_of(binding), seen_values(old, frames), False
    for row in rows:
        lacking = ~near(frames, times[row])
        for number in np.flatnonzero(lacking).tolist():
            set_key(curves[row], float(frames[number]), seen[row, number])
            result = True
    return result


def divided(binding: Binding, new: KeyedTransform, old: KeyedTransform) -> Insertion | None:
    """Return the insertion if a single key of all channels was inserted that has the previous pose of the motion."""
    added = without(new.key_frames, old.key_frames)
    if len(added) != 1 or len(new.key_frames) != len(old.key_frames) + 1 or old.order != new.order:
        return None
    frame, run = float(added[0]), None
    if old.switches:
        run = old.run_at(frame)
        old, new = run.source, new.run_at(frame).source
        if frame < old.key_frames[0]:
            return None
    elif not (_is_in_between(old, frame) and old.key_frames[0] < frame < old.key_frames[-1]):
        return None
    seen = seen_values(old, added if run is None else run.moments(added))[:, 0]
    curves, mode = _curves_of(binding), old.mode_at(frame) if len(old.key_frames) > 1 else 0
    filled = {*old.filled_rows, *new.filled_rows}
    for rows, keys in new.channels:
        at = int(np.argmin(np.abs(keys.times - frame)))
        off = np.abs(keys.values[:, at] - seen[rows]) > SAME_VALUE * np.maximum(1.0, np.abs(seen[rows]))
        if abs(keys.times[at] - frame) >= SAME_FRAME:
            # Blender's own in-betweens treat each channel separately.
            off[:] = mode != 0
        if np.any(off & [row in filled for row in rows]):
            return None
    is_divided = frame < old.key_frames[-1] and mode != 0
    if run is not None:
        keep_run(curves, old, new, frame, may_free=is_divided)
    is_at_rest = run is not None and frame > old.key_frames[-1] and not run.stretch.goes
    if old.cyclic is None and mode in DEPENDS_ON_KEYS and (is_at_rest or (is_divided and not needs_turning(old))):
        _mark_breakdown(curves, frame)
    return Insertion(curves, old, frame)


def _curves_of(binding: Binding) -> dict[int, bpy.types.FCurve]:
    channels = binding.users[0].channels
    return {row: binding.curves[channel] for row, channel in channels.items() if channel in binding.curves}


Times = dict[int, np.ndarray]
"""Frames of keys by row of the component."""


def _times_of(source: KeyedTransform) -> Times:
    return {row: keys.times for rows, keys in source.channels for row in rows}


def _is_in_between(source: KeyedTransform, frame: float) -> bool:
    """Return whether a mode acts on a frame: between two keys, and outside of them if the motion continues."""
    first, last = source.key_frames[[0, -1]]
    return (first < frame < last or source.goes_on) and source.mode_at(frame) != 0


def _mark_breakdown(curves: Mapping[int, bpy.types.FCurve], frame: float) -> None:
    """Turn a new key into a breakdown, for a mode whose path changes with one more shaping key."""
    for fcurve in curves.values():
        number, points = nearest_key(fcurve, frame)
        if len(points) and abs(points[number, 0] - frame) < SAME_FRAME:
            fcurve.keyframe_points[number].type = "BREAKDOWN"


def set_key(fcurve: bpy.types.FCurve, frame: float, value: float) -> None:
    """Set the value of a key, moving its handles along; insert the key if the channel lacks it."""
    keys, (number, points) = fcurve.keyframe_points, nearest_key(fcurve, frame)
    times = points[:, 0]
    if len(times) and abs(times[number] - frame) < SAME_FRAME:
        keys[number].co_ui.y = value
    else:
        before = keys[int(np.argmax(np.where(times < frame, times, -np.inf)))] if (times < frame).any() else None
        # Read first: an insertion moves the other keys in memory.
        eased = None if before is None else (before.interpolation, before.easing)
        key = existing(keys.insert(frame, value))
        if eased is not None:
            key.interpolation, key.easing = eased
    fcurve.update()
