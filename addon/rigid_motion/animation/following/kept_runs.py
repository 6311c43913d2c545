"""Handles with which what is held moves on in its holder as it did, after a key more was inserted there.

The keys in one holder are a motion for themselves: automatic handles do not see the keys in others. As soon as one of
them is set those of its neighbours are Blender's, which does see these; so all that would be others are set. Behind its
last key, where something passes over, the motion goes on at its speed, and so it does to a key that is inserted there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import bpy
import numpy as np

from ..actions.channels import key_points
from ..evaluation.differences import progress_at
from ..evaluation.ends import SLOPE_MOMENTS, SLOPE_WEIGHTS
from ..evaluation.sources import SAME_FRAME, KeyedTransform
from ..fcurves.keys import BEZIER, LINEAR, Keys
from ..fcurves.solvers import bezier_cubics, solve_cubics

SAME_HANDLE = 1e-6
"""Frames and values of handles that differ by less, relative or absolute below 1, are the same in single precision."""

Curves = Mapping[int, bpy.types.FCurve]
"""F-curves by the rows of their components."""


def keep_run(curves: Curves, old: KeyedTransform, new: KeyedTransform, frame: float, *, may_free: bool) -> None:
    """Have keys of one holder move something as those that were there before a key more on this frame.

    `may_free` is true where the handles around that key are set afterwards.
    """
    was = {row: keys.only([number]) for rows, keys in old.channels for number, row in enumerate(rows)}
    channels = [
        ([row], _divided(was.get(row), keys.only([number]), frame))
        for rows, keys in new.channels
        for number, row in enumerate(rows)
    ]
    if frame > old.key_frames[-1] > old.key_frames[0]:
        channels = _at_speed(old, replace(new, channels=tuple(channels)))
    there = {row: keys.only([number]) for rows, keys in new.channels for number, row in enumerate(rows)}
    for (row,), keys in channels:
        if keys.left is not None and (may_free or len(_off(_handles(keys), _handles(there[row])))):
            _set_handles(curves[row], keys)


def _divided(was: Keys | None, keys: Keys, frame: float) -> Keys:
    """Return the keys of a channel with the handles that it had, and those of a new one by de Casteljau's division.

    Behind the last key it goes on straight.
    """
    at = int(np.argmin(np.abs(keys.times - frame)))
    others = np.arange(len(keys.times)) != at
    if was is None or was.left is None or was.right is None or keys.left is None or keys.right is None:
        return keys
    if abs(keys.times[at] - frame) >= SAME_FRAME or np.count_nonzero(others) != len(was.times):
        return keys
    points, left, right = (array[0].astype(np.float64) for array in (keys.points, keys.left, keys.right))
    if len(was.times) > 1:
        left[others], right[others] = was.left[0], was.right[0]
    codes = keys.interpolation
    if at == len(points) - 1:
        step = (points[at] - points[at - 1]) / 3
        right[at - 1], left[at], right[at] = points[at - 1] + step, points[at] - step, points[at] + step
        if codes[0, at - 1] > BEZIER:
            codes = codes.copy()
            codes[0, at - 1 :] = LINEAR
    elif at > 0:
        p = [points[at - 1], right[at - 1], left[at + 1], points[at + 1]]
        times = bezier_cubics(*(point[None] for point in p))[:, 0, :1] / (p[3][0] - p[0][0])
        t = solve_cubics((points[at, :1] - p[0][0]) / (p[3][0] - p[0][0]), times)[0]
        q = [a + t * (b - a) for a, b in pairwise(p)]
        right[at - 1], (left[at], right[at]), left[at + 1] = q[0], [a + t * (b - a) for a, b in pairwise(q)], q[2]
    handles = (array[None].astype(np.float32) for array in (left, right))
    return replace(keys, interpolation=codes, **dict(zip(("left", "right"), handles, strict=True)))


def _at_speed(old: KeyedTransform, new: KeyedTransform) -> list[tuple[list[int], Keys]]:
    """Return the channels with which a motion passes the key that was its last one, to a new one, as fast as it did.

    A smooth mode, which now looks at both, has it pass in proportion to the slopes of the channels there.
    """
    before, last, frame = new.key_frames[-3:].tolist()
    near = np.concatenate((before + (last - before) * SLOPE_MOMENTS[3:], last + (frame - last) * SLOPE_MOMENTS[:3]))
    desired = np.concatenate((progress_at([old], [near[:3]])[0], SLOPE_MOMENTS[:3]))
    for _ in range(3):
        now = progress_at([new], [near])[0]
        slopes = np.array([((1.0 - one[2::-1]) @ SLOPE_WEIGHTS, one[3:] @ SLOPE_WEIGHTS) for one in (desired, now)])
        factors = np.divide(slopes[0], slopes[1], out=np.ones(2), where=np.abs(slopes[1]) > 0.1)
        channels = []
        for rows, keys in new.channels:
            at = int(np.argmin(np.abs(keys.times - last)))
            if keys.left is not None and keys.right is not None and abs(keys.times[at] - last) < SAME_FRAME:
                left, right = keys.left.copy(), keys.right.copy()
                for handles, factor in zip((left, right), factors.tolist(), strict=True):
                    handles[:, at, 1] += (factor - 1.0) * (handles[:, at, 1] - keys.values[:, at])
                keys = replace(keys, left=left, right=right)
            channels.append((rows, keys))
        new = replace(new, channels=tuple(channels))
    return channels


def _handles(keys: Keys) -> np.ndarray:
    """Return the handles of the keys of one channel, left and right ones, (2, n, 2)."""
    assert keys.left is not None
    assert keys.right is not None
    return np.stack((keys.left[0], keys.right[0]))


def _off(desired: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Return the places of keys whose handles (2, n, 2) are others than those desired."""
    return np.flatnonzero((np.abs(there - desired) > SAME_HANDLE * np.maximum(1.0, np.abs(desired))).any(axis=(0, 2)))


def _set_handles(fcurve: bpy.types.FCurve, keys: Keys) -> None:
    """Give an F-curve the handles and interpolations of these keys of it, one channel, where it has others."""
    first = int(np.searchsorted(key_points(fcurve)[:, 0], keys.points[0, 0, 0] - 0.5 * SAME_FRAME))
    span = slice(first, first + len(keys.times))
    points, desired = fcurve.keyframe_points[span], _handles(keys)
    for point, code in zip(points, keys.interpolation[0].tolist(), strict=True):
        if code == LINEAR:
            point.interpolation = "LINEAR"
    # Those that Blender sets are others as soon as their neighbours are.
    for _ in range(len(points)):
        off = _off(desired, np.stack([key_points(fcurve, f"handle_{side}")[span] for side in ("left", "right")]))
        if not len(off):
            break
        for place in off.tolist():
            point = points[place]
            point.handle_left_type = point.handle_right_type = "FREE"
            point.handle_left, point.handle_right = desired[:, place].tolist()
        fcurve.update()
