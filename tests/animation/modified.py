"""F-curve modifiers evaluated by Blender: on spare F-curves, and F-curves with their modifiers muted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np

from rigid_motion.animation.actions.modifiers import copy_modifier, is_term, on_top

__all__ = ["copy_modifier", "is_term"]


@contextmanager
def spare_fcurve() -> Iterator[bpy.types.FCurve]:
    """Yield an F-curve of an unused Action."""
    action = bpy.data.actions.new("Spare")
    strip = action.layers.new("Layer").strips.new(type="KEYFRAME")
    try:
        yield strip.channelbag(action.slots.new("OBJECT", "Spare"), ensure=True).fcurves.new("location")
    finally:
        bpy.data.actions.remove(action)


@contextmanager
def _spare_with_modifiers(
    points: Iterable[tuple[float, float]], modifiers: Iterable[bpy.types.FModifier]
) -> Iterator[bpy.types.FCurve]:
    """Yield a spare F-curve with linear keys and copies of modifiers."""
    with spare_fcurve() as fcurve:
        for frame, value in points:
            fcurve.keyframe_points.insert(frame, value).interpolation = "LINEAR"
        for modifier in modifiers:
            copy_modifier(modifier, fcurve)
        yield fcurve


def modified(fcurve: bpy.types.FCurve, held: np.ndarray, values: np.ndarray, frames: Sequence[float]) -> np.ndarray:
    """Apply the animator's modifiers of an F-curve that has these values on the frames where it is held."""
    times, first = np.unique(held, return_index=True)
    with _spare_with_modifiers(zip(times, values[first], strict=True), on_top(fcurve)) as spare:
        return np.array([spare.evaluate(frame) for frame in frames])


def held_frames(fcurves: Sequence[bpy.types.FCurve], frames: Sequence[float]) -> np.ndarray:
    """Return the frames whose poses the channels show on these frames, by the first channel with a Stepped modifier."""
    for fcurve in fcurves:
        stepped = [item for item in on_top(fcurve) if item.type == "STEPPED"]
        if stepped and len(fcurve.keyframe_points) > 1:
            with _spare_with_modifiers(((-1024.0, -1024.0), (1024.0, 1024.0)), stepped) as spare:
                return np.round([spare.evaluate(frame) for frame in frames], 3)
    return np.asarray(frames)


@contextmanager
def without_modifiers(fcurves: Sequence[bpy.types.FCurve]) -> Iterator[None]:
    """Mute all modifiers except Cycles within the block. Nothing is evaluated."""
    muted = [item for fcurve in fcurves for item in fcurve.modifiers if item.type != "CYCLES" and not item.mute]
    for modifier in muted:
        modifier.mute = True
    try:
        yield
    finally:
        for modifier in muted:
            modifier.mute = False
