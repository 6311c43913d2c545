"""Modifiers of F-curves: which of them in-betweens can follow, and what they do to a channel.

Cycles and Stepped modifiers change which moment is shown, for all of the motion alike. What is added to a channel stays
on top of the mode: its F-curve has it, and the difference does not know of it.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..compute.sources import Source
from ..transforms import Transform
from .slots import Binding

FOLLOWED = ("CYCLES", "STEPPED")
"""Types that change which moment is shown."""


def may_add(modifier: bpy.types.FModifier) -> bool:
    """Return whether modifiers of this type add something, or can be set to."""
    return modifier.type in ("NOISE", "GENERATOR", "FNGENERATOR")


def is_added(modifier: bpy.types.FModifier) -> bool:
    """Return whether a modifier adds something to the value that depends on the time alone."""
    if modifier.type == "NOISE":
        return modifier.blend_type != "MULTIPLY"
    return may_add(modifier) and modifier.use_additive


def is_modified(fcurve: bpy.types.FCurve) -> bool:
    """Return whether a channel that in-betweens can follow has something added to it."""
    return any(is_added(modifier) and not modifier.mute for modifier in fcurve.modifiers)


def is_whole(modifier: bpy.types.FModifier) -> bool:
    """Return whether a modifier acts in full and everywhere.
    Blender does not show the range of a Stepped one to Python.
    """
    return not (modifier.use_restricted_range or (modifier.use_influence and modifier.influence < 1.0))


def added_values(binding: Binding, user: Transform, source: Source, frames: np.ndarray) -> np.ndarray:
    """Return what modifiers add to the channels of a slot on these frames (m,) of its Action, shape (10, m)."""
    added = np.zeros((10, len(frames)))
    if source.modified:
        native = source.values_at(source.held(frames))
        for row in source.modified:
            fcurve = binding.curves[user.channels[row]]
            added[row] = [fcurve.evaluate(frame) for frame in frames.tolist()] - native[row]
    return added
