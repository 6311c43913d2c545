"""Keys that were inserted all along Blender's own in-betweens get the motion that was seen.

*Bake Keyframes* (Dope Sheet) and *Bake Channels* read the F-curves, which have nothing of a mode. Afterwards the keys
are so close that no in-betweens are left, and the motion would silently be Blender's. Such keys are known by their
values: they are on the curves that were there before. They get the values that were seen, in all keyed channels.

Of *Bake Channels* Blender tells nobody before the next edit. By then some may be off the curves, and stay as far off.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..actions.channels import key_points
from ..actions.reading import added_values
from ..actions.slots import Binding
from ..compute.differences import in_betweens
from ..compute.source_cache import cached_source
from ..compute.sources import SAME_FRAME, Source
from ..writers.channel_values import channel_values
from .inserted_keys import TOLERANCE


def keep_motion(binding: Binding, before: str, source: Source) -> bool:
    """Give keys that were inserted along Blender's own in-betweens the motion that was seen.

    Parameters
    ----------
    binding, source
        As they are now, with the new keys.
    before : str
        The digest of the source that the slot is filled in from.

    Returns
    -------
    bool
        Whether there were such keys.
    """
    old = cached_source(before)
    if old is None or source.key_count <= old.key_count or old.order != source.order or old.keyed != source.keyed:
        return False
    inserted = _without(source.keyed_frames, old.keyed_frames)
    first, last = old.keyed_range
    inserted = inserted[(inserted > first) & (inserted < last)]
    inserted = inserted[old.modes_at(inserted) != 0]
    if len(inserted) < 2:
        return False
    off = _off_curves(source, old, inserted, binding)
    if np.count_nonzero(~off.any(axis=0)) < max(2, 0.5 * len(inserted)):
        return False
    frames = np.union1d(inserted, old.keyed_frames)
    user = binding.users[0]
    values = channel_values(user, old, in_betweens(old, frames))
    chosen, bounds = np.searchsorted(frames, inserted), _bounds(old.keyed_frames, inserted)
    for row, (path, index) in user.channels.items():
        if path in values and (fcurve := binding.curves.get((path, index))) is not None:
            _set_keys(fcurve, inserted, values[path][chosen, index] + off[row], bounds)
    return True


def _without(frames: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return the frames that are none of the others; both rise."""
    indices = np.clip(np.searchsorted(others, frames)[:, None] - (0, 1), 0, len(others) - 1)
    return frames[np.abs(others[indices] - frames[:, None]).min(axis=1) >= SAME_FRAME]


def _bounds(keyed: np.ndarray, inserted: np.ndarray) -> np.ndarray:
    """Return the keyed frames that have inserted ones on one side alone."""
    is_dense = np.diff(np.searchsorted(inserted, keyed)) > 0
    return keyed[np.diff(is_dense.astype(int), prepend=0, append=0) != 0]


def _off_curves(new: Source, old: Source, frames: np.ndarray, binding: Binding) -> np.ndarray:
    """Return how far keys on these frames (m,) are off the curves that were there, 0 without keys, (10, m)."""
    off = np.zeros((10, len(frames)))
    for rows, keys in new.channels:
        indices = np.clip(np.searchsorted(frames, keys.times - SAME_FRAME), 0, len(frames) - 1)
        here = np.abs(frames[indices] - keys.times) < SAME_FRAME
        shown = old.held(keys.times[here])
        had = (old.values_at(shown) + added_values(binding, binding.users[0], new, keys.times[here]))[rows]
        by = keys.values[:, here] - had
        by[np.abs(by) <= TOLERANCE * np.maximum(1.0, np.abs(had))] = 0.0
        off[np.ix_(rows, indices[here])] = by
    return off


def _set_keys(fcurve: bpy.types.FCurve, frames: np.ndarray, values: np.ndarray, bounds: np.ndarray) -> None:
    """Give the keys on these frames these values, handles along with them; insert those that the channel lacks.

    The keys on the bounds keep their handles, which shape the segments outside.
    """
    keys = fcurve.keyframe_points
    ends = np.searchsorted(key_points(fcurve)[:, 0], bounds - SAME_FRAME)
    for end, frame in zip(ends.tolist(), bounds.tolist(), strict=True):
        if end < len(keys) and abs(keys[end].co.x - frame) < SAME_FRAME:
            keys[end].handle_left_type = keys[end].handle_right_type = "FREE"
    for frame in _without(frames, key_points(fcurve)[:, 0].astype(np.float64)).tolist():
        keys.insert(frame, fcurve.evaluate(frame), options={"FAST"})
    fcurve.update()
    times = key_points(fcurve)[:, 0]
    indices = np.clip(np.searchsorted(times, frames - SAME_FRAME), 0, len(times) - 1)
    moved = values - key_points(fcurve)[indices, 1]
    for name in ("co", "handle_left", "handle_right"):
        points = key_points(fcurve, name)
        points[indices, 1] += moved
        keys.foreach_set(name, points.ravel())
    fcurve.update()
