"""What Stepped and other modifiers do to F-curves, asked of Blender itself: of spare ones, and with them muted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np

FCurves = Sequence[bpy.types.FCurve]


def acting(fcurves: Iterable[bpy.types.FCurve]) -> list[bpy.types.FModifier]:
    """The animator's modifiers of these that are not muted, without Cycles."""
    return [
        modifier
        for fcurve in fcurves
        for modifier in fcurve.modifiers
        if modifier.type != "CYCLES" and not modifier.mute and not is_term(modifier)
    ]


def is_term(modifier: bpy.types.FModifier) -> bool:
    """Whether a modifier is what the extension adds: a product with a factor that is constant, in a range."""
    if modifier.type != "GENERATOR" or modifier.mode != "POLYNOMIAL_FACTORISED":
        return False
    return modifier.use_additive and modifier.use_restricted_range and modifier.coefficients[-2] == 0.0


def copy_modifier(modifier: bpy.types.FModifier, fcurve: bpy.types.FCurve) -> None:
    """Add one like it to an F-curve."""
    copy = fcurve.modifiers.new(modifier.type)
    props = {prop.identifier: prop for prop in modifier.bl_rna.properties}
    # Some of them are others' limits.
    for name in sorted(props, key=lambda name: (name not in ("mode", "poly_order"), "end" in name)):
        if not props[name].is_readonly and props[name].type not in ("POINTER", "COLLECTION"):
            value = getattr(modifier, name)
            setattr(copy, name, tuple(value) if getattr(props[name], "is_array", False) else value)


@contextmanager
def _spare(points: Iterable[tuple[float, float]], modifiers: Iterable[bpy.types.FModifier]) -> Iterator:
    """An F-curve of an Action that nothing uses, with linear keys and copies of modifiers."""
    action = bpy.data.actions.new("Spare")
    strip = action.layers.new("Layer").strips.new(type="KEYFRAME")
    fcurve = strip.channelbag(action.slots.new("OBJECT", "Spare"), ensure=True).fcurves.new("location")
    for frame, value in points:
        fcurve.keyframe_points.insert(frame, value).interpolation = "LINEAR"
    for modifier in modifiers:
        copy_modifier(modifier, fcurve)
    try:
        yield fcurve
    finally:
        bpy.data.actions.remove(action)


def led_to(modifiers: Iterable[bpy.types.FModifier], frames: Sequence[float]) -> np.ndarray:
    """The frames that Blender shows with these Stepped modifiers."""
    with _spare(((-1024.0, -1024.0), (1024.0, 1024.0)), modifiers) as fcurve:
        return np.round([fcurve.evaluate(frame) for frame in frames], 3)


def modified(fcurve: bpy.types.FCurve, held: np.ndarray, values: np.ndarray, frames: Sequence[float]) -> np.ndarray:
    """What the animator's modifiers of an F-curve make of it on frames, which has these values where it is held."""
    times, first = np.unique(held, return_index=True)
    with _spare(zip(times, values[first], strict=True), acting([fcurve])) as spare:
        return np.array([spare.evaluate(frame) for frame in frames])


def held_frames(fcurves: FCurves, frames: Sequence[float]) -> np.ndarray:
    """The frames whose poses channels hold on these ones, as the first that does so."""
    for fcurve in fcurves:
        stepped = [item for item in acting([fcurve]) if item.type == "STEPPED"]
        if stepped and len(fcurve.keyframe_points) > 1:
            return led_to(stepped, frames)
    return np.asarray(frames)


@contextmanager
def without_modifiers(fcurves: FCurves, *, ours: bool = False) -> Iterator[None]:
    """Modifiers but for Cycles are muted meanwhile, or our terms alone; nothing is evaluated."""
    before = []
    for fcurve in fcurves:
        muted = np.zeros(len(fcurve.modifiers), bool)
        fcurve.modifiers.foreach_get("mute", muted)
        before.append((fcurve, muted))
        meant = [is_term(item) if ours else item.type != "CYCLES" for item in fcurve.modifiers]
        fcurve.modifiers.foreach_set("mute", muted | np.array(meant, bool))
    try:
        yield
    finally:
        for fcurve, muted in before:
            fcurve.modifiers.foreach_set("mute", muted)
