"""Oracle for timing: the progress of channels between two keys, by `FCurve.evaluate`."""

from __future__ import annotations

from functools import lru_cache

import bpy
import numpy as np

from tests.animation.modified import spare_fcurve

Curves = dict[tuple[str, int], bpy.types.FCurve]
"""F-curves with keys, by data path and index."""


def progress(curves: Curves, first: float, last: float, frames: np.ndarray, turns: float = 0.0) -> np.ndarray:
    """Return the progress between two keys: the fraction of the chord that all channels cover together."""
    done, whole = np.zeros(len(frames)), 0.0
    for (path, _), fcurve in curves.items():
        weight = 4.0 if path == "rotation_quaternion" else 1.0
        begin, end, *values = (evaluated(fcurve, frame) for frame in (first, last, *frames))
        done += weight * (end - begin) * (np.array(values) - begin)
        whole += weight * (end - begin) ** 2
    if whole > 0.0:
        return done / whole
    return _progress_of_spin(curves, first, last, frames) if turns else done


def _progress_of_spin(curves: Curves, first: float, last: float, frames: np.ndarray) -> np.ndarray:
    """Return the progress if the body spins but no channel changes: of a value that rises by one from key to key.

    The spare curve has the keys of the first channel, with flat handles.
    """
    like = next(iter(curves.values()))
    with spare_fcurve() as fcurve:
        fcurve.extrapolation = like.extrapolation
        fcurve.keyframe_points.add(len(like.keyframe_points))
        for number, (made, key) in enumerate(zip(fcurve.keyframe_points, like.keyframe_points, strict=True)):
            made.co = key.co[0], number
            for field in ("interpolation", "easing", "back", "amplitude", "period"):
                setattr(made, field, getattr(key, field))
            made.handle_left_type = made.handle_right_type = "FREE"
            made.handle_left, made.handle_right = (key.handle_left[0], number), (key.handle_right[0], number)
        begin, end, *values = (fcurve.evaluate(frame) for frame in (first, last, *frames))
    if begin == end:
        share = (frames - first) / (last - first)
        return share if like.extrapolation == "LINEAR" else np.clip(share, 0.0, 1.0)
    return (np.array(values) - begin) / (end - begin)


def evaluated(fcurve: bpy.types.FCurve, frame: float) -> float:
    """Return `FCurve.evaluate`, in Bezier segments with the extra digits that slopes need over single precision."""
    value, keys = fcurve.evaluate(frame), fcurve.keyframe_points
    behind = next((number for number, key in enumerate(keys) if key.co[0] > frame), 0)
    if not behind or keys[behind - 1].interpolation != "BEZIER":
        return value
    first, last = keys[behind - 1], keys[behind]
    x, y = np.array((first.co, first.handle_right, last.handle_left, last.co), dtype=np.float64).T
    # Overlapping handles are shortened.
    reach = max(abs(x[1] - x[0]) + abs(x[3] - x[2]), x[3] - x[0])
    for ends in (x, y) if reach > x[3] - x[0] else ():
        ends[1:3] += (1.0 - (x[3] - x[0]) / reach) * (ends[[0, 3]] - ends[1:3])
    exact = _bezier(*y.tolist(), _bezier_parameter(*x.tolist(), frame))
    return exact if abs(exact - value) <= 1e-5 * max(1.0, abs(value)) else value


@lru_cache(maxsize=2**16)
def _bezier_parameter(first: float, second: float, third: float, fourth: float, frame: float) -> float:
    """Return the parameter of a Bezier segment at a frame. Cached, since most channels of a body share it."""
    low, high = 0.0, 1.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        is_before = _bezier(first, second, third, fourth, middle) < frame
        low, high = (middle, high) if is_before else (low, middle)
    return low


def _bezier(first: float, second: float, third: float, fourth: float, t: float) -> float:
    left = 1.0 - t
    return left**3 * first + 3.0 * left * t * (left * second + t * third) + t**3 * fourth
