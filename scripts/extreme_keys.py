"""Keys that no motion can be computed from: with a frame, a value or a handle that is infinite, or nearly so."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np

from addon.animation.slots import Transformable, curves_in, slots_of

LARGEST = 1e30
"""Frames and values from here on are none. An infinite one that is typed, or set by a script, becomes 3.4e38."""

PARTS = {"co": "", "handle_left": "left handle of ", "handle_right": "right handle of "}
"""What of a key has a frame and a value, and what it is called."""


def extreme_key(obj: bpy.types.Object) -> str:
    """Which key of an object is the first that no motion can be computed from, and the way out; "" without any."""
    for channel, fcurve in _channels(obj):
        points = np.empty((len(PARTS), len(fcurve.keyframe_points), 2), np.float32)
        for part, numbers in zip(PARTS, points, strict=True):
            fcurve.keyframe_points.foreach_get(part, numbers.ravel())
        extreme = np.argwhere(~(np.abs(points) < LARGEST))  # Not a number is not smaller, either.
        if len(extreme):
            part, key, axis = extreme[0].tolist()
            return (
                f"{list(PARTS.values())[part]}key {key + 1} of {channel} has the {('frame', 'value')[axis]} "
                f"{points[part, key, axis]:g}, which no motion can be computed from: delete it (Dope Sheet, X)"
            )
    return ""


def _channels(obj: bpy.types.Object) -> Iterator[tuple[str, bpy.types.FCurve]]:
    """The channels that move an object, as the Dope Sheet names them."""
    for slot in slots_of([obj]):
        curves = curves_in(slot.channelbag)
        for path, index in Transformable.of(obj).channels.values():
            fcurve = curves.get((path, index))
            if fcurve is not None and not fcurve.mute:
                axes = "WXYZ" if path.endswith("quaternion") else "XYZ"
                yield f"{path.partition('_')[0].title()} {axes[index]}", fcurve
