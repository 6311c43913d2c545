"""Handles that keep the motion of a held object in its holder unchanged after one more key was inserted there.

The keys in one holder are a motion of their own: automatic handles ignore the keys in other holders. As soon as one
handle is set, Blender computes those of its neighbours, from all keys; so all handles that would change are set. After
the last key in a holder, an object that passes on continues at its speed, also up to a key inserted there.
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
"""Frames and values of handles that differ by less (relative, absolute below 1) are the same in single precision."""

Curves = Mapping[int, bpy.types.FCurve]
"""F-curves by row of the component."""


def keep_run(curves: Curves, old: KeyedTransform, new: KeyedTransform, frame: float, *, may_free: bool) -> None:
    """Make the keys of one holder move the object as they did before another key was inserted on this frame.

    `may_free` is true if the handles around that key are set afterwards.
    """
    was = {row: keys.only([number]) for rows, keys in old.channels for number, row in enumerate(rows)}
    channels = [
        ([row], _divided_keys(was.get(row), keys.only([number]), frame))
        for rows, keys in new.channels
        for number, row in enumerate(rows)
    ]
    if frame > old.key_frames[-1] > old.key_frames[0]:
        channels = _channels_at_former_speed(old, replace(new, channels=tuple(channels)))
    there = {row: keys.only([number]) for rows, keys in new.channels for number, row in enumerate(rows)}
    for (row,), keys in channels:
        if keys.left is not None and (may_free or len(_differing_handles(_handles(keys), _handles(there[row])))):
            _set_handles(curves[row], keys)


def _divided_keys(was: Keys | None, keys: Keys, frame: float) -> Keys:
    """Return the keys of a channel with its previous handles, and with a new key's handles by de Casteljau's division.

    After the last key, the motion continues in a straight line.
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


def _channels_at_former_speed(old: KeyedTransform, new: KeyedTransform) -> list[tuple[list[int], Keys]]:
    """Return the channels that make a motion pass its former last key, on the way to a new one, at its former speed.

    A smooth mode, which now looks at both keys, gives a speed in proportion to the slopes of the channels there.
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
    """Return the handles of the keys of one channel, left and right, (2, n, 2)."""
    assert keys.left is not None
    assert keys.right is not None
    return np.stack((keys.left[0], keys.right[0]))


def _differing_handles(desired: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Return the indices of keys whose handles (2, n, 2) differ from those desired."""
    return np.flatnonzero((np.abs(there - desired) > SAME_HANDLE * np.maximum(1.0, np.abs(desired))).any(axis=(0, 2)))


def _set_handles(fcurve: bpy.types.FCurve, keys: Keys) -> None:
    """Set the handles and interpolations of an F-curve to those of these keys, of one channel, if they differ."""
    first = int(np.searchsorted(key_points(fcurve)[:, 0], keys.points[0, 0, 0] - 0.5 * SAME_FRAME))
    span = slice(first, first + len(keys.times))
    points, desired = fcurve.keyframe_points[span], _handles(keys)
    for point, code in zip(points, keys.interpolation[0].tolist(), strict=True):
        if code == LINEAR:
            point.interpolation = "LINEAR"
    # Handles that Blender computes change when those of their neighbours do.
    for _ in range(len(points)):
        off = _differing_handles(
            desired, np.stack([key_points(fcurve, f"handle_{side}")[span] for side in ("left", "right")])
        )
        if not len(off):
            break
        for place in off.tolist():
            point = points[place]
            point.handle_left_type = point.handle_right_type = "FREE"
            point.handle_left, point.handle_right = desired[:, place].tolist()
        fcurve.update()
