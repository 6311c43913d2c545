"""Keys that were inserted where a mode acts: what else is keyed there, so that the motion goes on as it did.

A key that is inserted takes the value that is seen, for that is what its channel has. Auto Key and buttons key single
components, though, and without a key of its own on that frame another component of the same location or rotation would
be Blender's in-between there. So it gets one, with the value that is seen. The other of location and rotation goes on
between keys of its own; but how far a body has come all of its channels say together, and where it would be elsewhere
without those of the others, it gets a key as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import bpy
import numpy as np

from ..actions.reading import added_values
from ..actions.slots import Binding
from ..evaluation.components import DEPENDS_ON_KEYS, PART_OF, SCALE
from ..evaluation.differences import seen_values
from ..evaluation.sources import SAME_FRAME, Source
from ..evaluation.turning import needs_turning
from .kept_timing import Insertion, nearest_key

SAME_VALUE = 1e-5
"""Values that differ by less, relative or absolute below 1, are the same in single precision."""


def key_fellows(binding: Binding, new: Source, old: Source) -> bool:
    """Key the fellows of components that were keyed on frames where these have an in-between of a mode.

    `old` is what was keyed before, which the terms that are there are of. Returns whether any was keyed.
    """
    curves = _curves_of(binding)
    times, before, result = _times_of(new), _times_of(old), False
    for part in new.keyed if old.is_live else ():
        rows = [row for row in times if PART_OF[row] == part and row in before]
        if part == SCALE and not old.uniform_scale:
            continue
        for frame in _inserted(rows, times, before).tolist():
            lacking = [row for row in rows if np.abs(times[row] - frame).min() >= SAME_FRAME]
            if lacking and _is_in_between(old, frame):
                on_top = added_values(binding, binding.users[0], old, np.array([frame]))[:, 0]
                for row in lacking:
                    set_key(curves[row], frame, curves[row].evaluate(frame) - on_top[row])
                    result = True
    return result


def key_other_parts(binding: Binding, new: Source, old: Source) -> bool:
    """Key those of location, rotation and scale, on frames where others were keyed, that would be elsewhere otherwise.

    `old` is what was keyed before. Returns whether any was keyed.
    """
    if not (old.is_live and new.is_live) or old.order != new.order:
        return False
    times, times_before = _times_of(new), _times_of(old)
    frames = _inserted([row for row in times if row in times_before], times, times_before)
    frames = _without(frames, old.keyed_frames)
    if not len(frames):
        return False
    before, now, curves, result = seen_values(old, frames), seen_values(new, frames), _curves_of(binding), False
    off = np.abs(now - before) > SAME_VALUE * np.maximum(1.0, np.abs(before))
    for part, keyed in new.frames_of.items():
        rows = [row for rows, _ in new.channels for row in rows if PART_OF[row] == part]
        chosen = off[rows].any(axis=0) & np.isin(frames, _without(frames, keyed))
        for number in np.flatnonzero(chosen).tolist():
            for row in rows if _is_in_between(old, frame := float(frames[number])) else ():
                set_key(curves[row], frame, before[row, number])
                result = True
    return result


def divided(binding: Binding, new: Source, old: Source) -> Insertion | None:
    """Return the insertion of a single key of all channels that has the pose of the motion as it was, if it is one."""
    before, after = old.keyed_frames, new.keyed_frames
    added = _without(after, before)
    if len(added) != 1 or len(after) != len(before) + 1 or old.order != new.order:
        return None
    frame = float(added[0])
    if not (_is_in_between(old, frame) and old.keyed_range[0] < frame < old.keyed_range[1]):
        return None
    seen, curves = seen_values(old, added)[:, 0], _curves_of(binding)
    for rows, keys in new.channels:
        at = int(np.abs(keys.times - frame).argmin())
        # What had no keys until now rests where it is.
        was_keyed = [PART_OF[row] in old.keyed for row in rows]
        off = np.abs(keys.values[:, at] - seen[rows]) > SAME_VALUE * np.maximum(1.0, np.abs(seen[rows]))
        if abs(keys.times[at] - frame) >= SAME_FRAME or np.any(off & was_keyed):
            return None
    if not needs_turning(old):
        _mark_breakdown(curves, old, frame)
    return Insertion(curves, old, frame)


def _curves_of(binding: Binding) -> dict[int, bpy.types.FCurve]:
    channels = binding.users[0].channels
    return {row: binding.curves[channel] for row, channel in channels.items() if channel in binding.curves}


Times = dict[int, np.ndarray]
"""Frames of keys by the rows of their components."""


def _times_of(source: Source) -> Times:
    return {row: keys.times for rows, keys in source.channels for row in rows}


def _inserted(rows: Iterable[int], times: Times, before: Times) -> np.ndarray:
    """Return the frames on which any of these components has a key more, (k,). Keys that were moved are none more."""
    added = [_without(times[row], before[row]) for row in rows if len(times[row]) > len(before[row])]
    return np.unique(np.concatenate([np.empty(0), *added]))


def _is_in_between(source: Source, frame: float) -> bool:
    """Return whether a mode acts on a frame: between two keys, and outside where the motion goes on."""
    first, last = source.keyed_range
    return (first < frame < last or source.goes_on) and source.mode_at(frame) != 0


def _without(frames: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return the frames that are none of the others; both rise."""
    indices = np.clip(np.searchsorted(others, frames)[:, None] - (0, 1), 0, len(others) - 1)
    return frames[np.abs(others[indices] - frames[:, None]).min(axis=1) >= SAME_FRAME]


def _mark_breakdown(curves: Mapping[int, bpy.types.FCurve], old: Source, frame: float) -> None:
    """Make a new key a breakdown, where the path would be another one with a key more that shapes it."""
    if old.cyclic is None and old.mode_at(frame) in DEPENDS_ON_KEYS:
        for fcurve in curves.values():
            number, points = nearest_key(fcurve, frame)
            if len(points) and abs(points[number, 0] - frame) < SAME_FRAME:
                fcurve.keyframe_points[number].type = "BREAKDOWN"


def set_key(fcurve: bpy.types.FCurve, frame: float, value: float) -> None:
    """Give a key this value, handles along with it; insert one that the channel lacks."""
    keys, (number, points) = fcurve.keyframe_points, nearest_key(fcurve, frame)
    times = points[:, 0]
    if len(times) and abs(times[number] - frame) < SAME_FRAME:
        keys[number].co_ui.y = value
    else:
        before = keys[int(np.where(times < frame, times, -np.inf).argmax())] if (times < frame).any() else None
        # Read first: an insertion moves the other keys elsewhere in memory.
        eased = None if before is None else (before.interpolation, before.easing)
        key = keys.insert(frame, value)
        if eased is not None:
            key.interpolation, key.easing = eased
    fcurve.update()
