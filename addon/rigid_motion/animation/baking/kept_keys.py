"""Keys that stay on their frames, with their modes and handles, plus extra keys only where the motion needs them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import bpy
import numpy as np

from ..evaluation.sources import SAME_FRAME, KeyedTransform, Marks
from ..fcurves.keys import BEZIER, Keys
from ..transforms import Transform
from .fewer_keys import FewerKeys
from .search import Members, SearchedBody

Kept = tuple[np.ndarray, KeyedTransform | None]
"""The frames (k,) of the keys that stay, and the base with their modes and handles: None for Blender's own."""


def kept_keys(
    obj: bpy.types.Object,
    members: Members,
    kept: Mapping[Transform, Kept],
    tolerance: float,
    radius: float | None,
    places: np.ndarray,
) -> dict[Transform, FewerKeys]:
    """Return plans with these keys, by members, plus extra keys where the error is too large, only on `places`.

    Places are frames (m,). The tolerance is kept on places, and on all other samples as far as keys on places can;
    `between` is the error there. Around added keys there are Blender's own curves, with handles fitted to the samples.
    """
    body = SearchedBody(obj, members, tolerance, radius, hold=False, space=None, places=places)
    curves, joints = body.curves(tolerance, every=True), body.motion.joints

    def keyed(number: int, frames: np.ndarray) -> KeyedTransform:
        (own, base), result = kept[joints[number]], curves[number].keyed(frames, 1.0)
        if base is None:
            return result
        spans = np.searchsorted(own, frames, side="right") - 1
        is_added = np.bincount(spans)[spans] > 1
        modes = base.modes_at(frames + 0.5 * SAME_FRAME)
        at = np.flatnonzero(~is_added[:-1])
        channels = [(rows, _with_handles(rows, keys, base, at)) for rows, keys in result.channels]
        return replace(result, channels=tuple(channels), mode=Marks(frames, np.where(is_added, 0, modes)))

    chosen = {number: kept[joints[number]][0] for number in curves}
    on_places, every = body.split(body.frames[body.sampled]), body.split(body.frames)
    for body.stretches in (on_places, every, on_places):
        fewer = body.proven(chosen, keyed, shared=False)
    fewer = body.automatic(curves, fewer, dict.fromkeys(curves, 1.0))
    for body.stretches in (every, on_places):
        body.between = body.errors.copy()
        body.keep_to(math.inf, fewer)
    return body.plans(fewer)


def _with_handles(rows: list[int], keys: Keys, base: KeyedTransform, at: np.ndarray) -> Keys:
    """Return the keys of rows, with the base's handles for the segments numbered `at` if the base has both keys."""
    if keys.left is None or keys.right is None:
        return keys
    left, right, codes = keys.left.copy(), keys.right.copy(), keys.interpolation.copy()
    for old_rows, old in base.channels:
        begins = np.clip(np.searchsorted(old.times, keys.times[at] - SAME_FRAME), 0, max(len(old.times) - 2, 0))
        ends = np.minimum(begins + 1, len(old.times) - 1)
        both = np.abs(old.times[[begins, ends]] - keys.times[[at, at + 1]]).max(axis=0) < SAME_FRAME
        for row in set(rows) & set(old_rows):
            channel, place = rows.index(row), old_rows.index(row)
            is_plain = both & (old.interpolation[place, begins] <= BEZIER)
            first, last = at[is_plain], at[is_plain] + 1
            codes[channel, first] = old.interpolation[place, begins[is_plain]]
            if old.left is not None and old.right is not None:
                behind, before = old.right[place] - old.points[place], old.left[place] - old.points[place]
                right[channel, first] = keys.points[channel, first] + behind[begins[is_plain]]
                left[channel, last] = keys.points[channel, last] + before[ends[is_plain]]
    return replace(keys, left=left, right=right, interpolation=codes)
