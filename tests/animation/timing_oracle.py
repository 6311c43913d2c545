"""How far channels have come between two keys, as `FCurve.evaluate` has it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np

Curves = dict[tuple[str, int], bpy.types.FCurve]
"""F-curves with keys by data path and index."""


def progress(curves: Curves, first: float, last: float, frames: np.ndarray, turns: float = 0.0) -> np.ndarray:
    """How far the channels have come between two keys: the share of the chord that they make up together."""
    done, whole = np.zeros(len(frames)), 0.0
    for (path, _), fcurve in curves.items():
        weight = 4.0 if path == "rotation_quaternion" else 1.0
        begin, end, *values = timing(fcurve, [first, last, *frames])
        done += weight * (end - begin) * (np.array(values) - begin)
        whole += weight * (end - begin) ** 2
    if whole > 0.0:
        return done / whole
    return _counted(curves, first, last, frames) if turns else done


def _counted(curves: Curves, first: float, last: float, frames: np.ndarray) -> np.ndarray:
    """The same where the body spins and no channel changes: of a value that goes up by one from key to key.

    It has the keys of the first channel that turns, with flat handles.
    """
    like = min(curves.items(), key=lambda item: ("rotation" not in item[0][0], item[0]))[1]
    with spare_curve() as fcurve:
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


def timing(fcurve: bpy.types.FCurve, frames: Sequence[float]) -> list[float]:
    """The channel's values; elastic segments as a curve from 0 to 1 with the same keys has them, stretched."""
    values = [fcurve.evaluate(frame) for frame in frames]
    keys = fcurve.keyframe_points
    for first, last in itertools.pairwise(keys):
        if first.interpolation == "ELASTIC":
            inside = [place for place, frame in enumerate(frames) if first.co[0] <= frame <= last.co[0]]
            share = _elastic(first, last.co[0], [frames[place] for place in inside])
            for place, part in zip(inside, share, strict=True):
                values[place] = first.co[1] + part * (last.co[1] - first.co[1])
    return values


def _elastic(key: bpy.types.Keyframe, end: float, frames: Sequence[float]) -> list[float]:
    """Blender's own elastic easing from 0 to 1."""
    with spare_curve() as fcurve:
        fcurve.keyframe_points.insert(key.co[0], 0.0)
        fcurve.keyframe_points.insert(end, 1.0)
        start = fcurve.keyframe_points[0]
        for field in ("interpolation", "easing", "back", "amplitude", "period"):
            setattr(start, field, getattr(key, field))
        return [fcurve.evaluate(frame) for frame in frames]


@contextmanager
def spare_curve() -> Iterator[bpy.types.FCurve]:
    """An F-curve of an Action that nothing uses."""
    action = bpy.data.actions.new("Timing")
    strip = action.layers.new("Layer").strips.new(type="KEYFRAME")
    yield strip.channelbag(action.slots.new("OBJECT", "Timing"), ensure=True).fcurves.new("location")
    bpy.data.actions.remove(action)
