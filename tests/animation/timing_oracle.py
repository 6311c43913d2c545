"""Oracle for timing: the progress of channels between two keys, by `FCurve.evaluate`."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion.animation.actions.channels import read_keys
from rigid_motion.animation.fcurves.evaluation import evaluate
from tests.animation.modified import spare_fcurve

Curves = dict[tuple[str, int], bpy.types.FCurve]
"""F-curves with keys, by data path and index."""


def progress(curves: Curves, first: float, last: float, frames: np.ndarray, turns: float = 0.0) -> np.ndarray:
    """Return the progress between two keys: the fraction of the chord that all channels cover together."""
    done, whole = np.zeros(len(frames)), 0.0
    for (path, _), fcurve in curves.items():
        weight = 4.0 if path == "rotation_quaternion" else 1.0
        begin, end, *values = evaluated(fcurve, np.array((first, last, *frames)))
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


def evaluated(fcurve: bpy.types.FCurve, frames: np.ndarray) -> np.ndarray:
    """Return `FCurve.evaluate` on frames (m,), with the extra digits that slopes need over single precision.

    The digits are the program's: values that differ from Blender's by more are left as they are.
    """
    values = np.array([fcurve.evaluate(frame) for frame in frames])
    ((_, keys, *_),) = read_keys([fcurve])
    ((exact,),) = evaluate([keys], [np.asarray(frames, dtype=np.float64)])
    return np.where(np.abs(exact - values) <= 1e-5 * np.maximum(1.0, np.abs(values)), exact, values)
