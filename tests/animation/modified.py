"""What Stepped and other modifiers do to F-curves, asked of Blender itself: of spare ones, and with them muted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np

from rigid_motion.animation.actions.modifiers import copy_modifier, is_term, on_top

__all__ = ["copy_modifier", "is_term"]


@contextmanager
def spare_fcurve() -> Iterator[bpy.types.FCurve]:
    """An F-curve of an Action that nothing uses."""
    action = bpy.data.actions.new("Spare")
    strip = action.layers.new("Layer").strips.new(type="KEYFRAME")
    try:
        yield strip.channelbag(action.slots.new("OBJECT", "Spare"), ensure=True).fcurves.new("location")
    finally:
        bpy.data.actions.remove(action)


@contextmanager
def _spare(
    points: Iterable[tuple[float, float]], modifiers: Iterable[bpy.types.FModifier]
) -> Iterator[bpy.types.FCurve]:
    """One with linear keys and copies of modifiers."""
    with spare_fcurve() as fcurve:
        for frame, value in points:
            fcurve.keyframe_points.insert(frame, value).interpolation = "LINEAR"
        for modifier in modifiers:
            copy_modifier(modifier, fcurve)
        yield fcurve


def modified(fcurve: bpy.types.FCurve, held: np.ndarray, values: np.ndarray, frames: Sequence[float]) -> np.ndarray:
    """What the animator's modifiers of an F-curve make of it on frames, which has these values where it is held."""
    times, first = np.unique(held, return_index=True)
    with _spare(zip(times, values[first], strict=True), on_top(fcurve)) as spare:
        return np.array([spare.evaluate(frame) for frame in frames])


def held_frames(fcurves: Sequence[bpy.types.FCurve], frames: Sequence[float]) -> np.ndarray:
    """The frames whose poses channels hold on these ones, as the first that does so."""
    for fcurve in fcurves:
        stepped = [item for item in on_top(fcurve) if item.type == "STEPPED"]
        if stepped and len(fcurve.keyframe_points) > 1:
            with _spare(((-1024.0, -1024.0), (1024.0, 1024.0)), stepped) as spare:
                return np.round([spare.evaluate(frame) for frame in frames], 3)
    return np.asarray(frames)


@contextmanager
def without_modifiers(fcurves: Sequence[bpy.types.FCurve]) -> Iterator[None]:
    """Modifiers but for Cycles are muted meanwhile; nothing is evaluated."""
    muted = [item for fcurve in fcurves for item in fcurve.modifiers if item.type != "CYCLES" and not item.mute]
    for modifier in muted:
        modifier.mute = True
    try:
        yield
    finally:
        for modifier in muted:
            modifier.mute = False
