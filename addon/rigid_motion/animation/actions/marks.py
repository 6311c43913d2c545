"""Marks: what keys say of the segments that they begin, in the keys themselves.

Blender keeps nothing of an extension's on a key. But each key has settings for eases that it does not have: `back` and
`amplitude`. A mark is in the lowest bits of both, where it changes no ease by more than a part in a hundred thousand.
So it goes where the key goes: it is copied and pasted, duplicated, mirrored, linked and saved with it, and is gone
where a key is made anew.

Without a mark a key goes on with what the key before it says, and before the first mark with what that says.
"""

from __future__ import annotations

import bpy
import numpy as np

LOW = 63
"""The bits of either setting that have a mark."""

SIGNATURE = 42
"""What `amplitude` has in these bits where there is a mark: neither Blender's default nor a round number."""

CHECK = 16
"""What `back` has in these bits beside a mark, which is less."""

MOST = 15
"""The largest mark."""


def marks_of(backs: np.ndarray, amplitudes: np.ndarray) -> np.ndarray:
    """Return the marks in settings `back` and `amplitude` of keys (float32, any shape), 0 where there is none."""
    low = backs.view(np.int32) & LOW
    is_marked = ((amplitudes.view(np.int32) & LOW) == SIGNATURE) & ((low & ~MOST) == CHECK)
    return np.where(is_marked, low & MOST, 0)


def read_marks(fcurve: bpy.types.FCurve) -> np.ndarray:
    """Return the marks of the keys of an F-curve, shape (n,)."""
    return marks_of(*_settings(fcurve))


def has_marks(fcurve: bpy.types.FCurve) -> bool:
    """Return whether any of the keys of an F-curve has a mark."""
    return bool(read_marks(fcurve).any())


def write_marks(fcurve: bpy.types.FCurve, marks: np.ndarray) -> None:
    """Give the keys of an F-curve marks (n,). Nothing that Blender evaluates changes, so nothing is tagged."""
    backs, amplitudes = settings = _settings(fcurve)
    for values, bits in ((backs, CHECK | marks), (amplitudes, SIGNATURE)):
        raw = values.view(np.int32)
        raw[:] = np.where(marks > 0, raw & ~LOW | bits, raw)
    # Without one the signature is off by a bit, so that nothing else is read from it.
    amplitudes.view(np.int32)[(marks == 0) & (marks_of(backs, amplitudes) > 0)] ^= 1
    for name, values in zip(("back", "amplitude"), settings, strict=True):
        fcurve.keyframe_points.foreach_set(name, values)


def carried_on(marks: np.ndarray) -> np.ndarray:
    """Return the marks (n,) that keys one behind the other have where those without go on with what there is."""
    marked = np.flatnonzero(marks)
    if not len(marked):
        return marks
    return marks[marked[np.clip(np.searchsorted(marked, np.arange(len(marks)), side="right") - 1, 0, None)]]


def _settings(fcurve: bpy.types.FCurve) -> tuple[np.ndarray, np.ndarray]:
    keys = fcurve.keyframe_points
    backs, amplitudes = np.empty(len(keys), np.float32), np.empty(len(keys), np.float32)
    keys.foreach_get("back", backs)
    keys.foreach_get("amplitude", amplitudes)
    return backs, amplitudes
