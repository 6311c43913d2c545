"""What Stepped and other modifiers do to F-curves, asked of Blender itself: of spare ones, and with them muted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np

STEPPED = ("frame_step", "frame_offset", "use_frame_start", "frame_start", "use_frame_end", "frame_end")
"""The settings of a Stepped modifier."""

FCurves = Sequence[bpy.types.FCurve]


def acting(fcurves: Iterable[bpy.types.FCurve]) -> list[bpy.types.FModifier]:
    """The modifiers of these that are not muted, without Cycles."""
    return [
        modifier
        for fcurve in fcurves
        for modifier in fcurve.modifiers
        if modifier.type != "CYCLES" and not modifier.mute
    ]


def led_to(settings: Iterable[dict[str, object]], frames: Sequence[float]) -> np.ndarray:
    """The frames that Blender shows with Stepped modifiers of these settings, first to last."""
    action = bpy.data.actions.new("Frames")
    strip = action.layers.new("Layer").strips.new(type="KEYFRAME")
    fcurve = strip.channelbag(action.slots.new("OBJECT", "Frames"), ensure=True).fcurves.new("location")
    for frame in (-1024.0, 1024.0):
        fcurve.keyframe_points.insert(frame, frame).interpolation = "LINEAR"
    for setting in settings:
        modifier = fcurve.modifiers.new("STEPPED")
        for name, value in setting.items():
            setattr(modifier, name, value)
    result = np.array([fcurve.evaluate(frame) for frame in frames])
    bpy.data.actions.remove(action)
    return np.round(result, 3)


def held_frames(fcurves: FCurves, frames: Sequence[float]) -> np.ndarray:
    """The frames whose poses channels hold on these ones, as the first that does so."""
    for fcurve in fcurves:
        stepped = [item for item in acting([fcurve]) if item.type == "STEPPED"]
        if stepped and len(fcurve.keyframe_points) > 1:
            return led_to([{name: getattr(item, name) for name in STEPPED} for item in stepped], frames)
    return np.asarray(frames)


@contextmanager
def without_modifiers(fcurves: FCurves) -> Iterator[None]:
    """Modifiers but for Cycles are muted meanwhile; nothing is evaluated."""
    result = acting(fcurves)
    for item in result:
        item.mute = True
    try:
        yield
    finally:
        for item in result:
            item.mute = False
