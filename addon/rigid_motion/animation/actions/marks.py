"""Marks: the mode and the holder of the segment that a key begins, hidden in the key's own settings.

Blender stores no custom data on keys. But each key has settings for eases that it does not use: `back` and
`amplitude`. A mark is stored in the lowest bits of both, where it changes no ease by more than a part in a hundred
thousand. So the mark travels with the key when it is copied and pasted, duplicated, mirrored, linked or saved, and is
gone when the key is made anew. The holder of a key is stored next to its mark, in the lowest bits of `period`, with a
check of its own: a number typed into one of the three settings destroys its part, and the other two still tell.

A key without a mark continues with the mark of the key before it; keys before the first mark use the first mark.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..evaluation.runs import MOST_FRAMES

MARK_BITS = 63
"""The bits of `back` and of `amplitude` that store a mark."""

AMPLITUDE_SIGNATURE_BITS = 42
"""The value of these bits of `amplitude` on a marked key: neither Blender's default nor a round number gives it."""

BACK_CHECK_BIT = 16
"""Set in `back` on a marked key, above the bits of the mark."""

BACK_HELD_BIT = 32
"""Set in `back`, too, if `period` stores a hold."""

MAX_MARK = 15
"""The largest mark, and the largest number of holders that keys can distinguish."""

HOLD_BITS = (MAX_MARK + 1) * (MOST_FRAMES + 1) - 1
"""The bits of `period` that store a hold: the number of the holder, and the frames of the switch."""

CHECK_BITS = 15 * (HOLD_BITS + 1)
"""The bits above, a checksum of the hold."""

MARK_MULTIPLIER, MARK_ADDEND = 4181, 3863
"""Make the checksum: chosen such that no whole number up to 500 and no hundredths up to 20 look like a hold."""

DEFAULT_PERIOD_FRAMES = 4.1
"""Blender's default, set if `period` is 0 and has no bits to store a hold in."""


def marks_of(backs: np.ndarray, amplitudes: np.ndarray) -> np.ndarray:
    """Return the marks in the settings `back` and `amplitude` of keys (float32, any shape), 0 for none."""
    low = backs.view(np.int32) & MARK_BITS
    is_marked = ((amplitudes.view(np.int32) & MARK_BITS) == AMPLITUDE_SIGNATURE_BITS) & ((low & BACK_CHECK_BIT) != 0)
    return np.where(is_marked, low & MAX_MARK, 0)


def are_held(backs: np.ndarray, amplitudes: np.ndarray, periods: np.ndarray) -> np.ndarray:
    """Return which keys with these settings (float32, any shape) store a hold."""
    return (marks_of(backs, amplitudes) > 0) & _are_flagged(backs) & _have_checksum(periods)


def holds_of(backs: np.ndarray, amplitudes: np.ndarray, periods: np.ndarray) -> np.ndarray:
    """Return the holds in the settings of keys (float32, any shape): see `hold`; -1 for none."""
    return np.where(are_held(backs, amplitudes, periods), periods.view(np.int32) & HOLD_BITS, -1)


def is_any_flagged(backs: np.ndarray) -> bool:
    """Return whether any key with such a setting may store a hold."""
    return bool(_are_flagged(backs).any())


def _are_flagged(backs: np.ndarray) -> np.ndarray:
    return (backs.view(np.int32) & (BACK_CHECK_BIT | BACK_HELD_BIT)) == BACK_CHECK_BIT | BACK_HELD_BIT


def _have_checksum(periods: np.ndarray) -> np.ndarray:
    bits = periods.view(np.int32) & (CHECK_BITS | HOLD_BITS)
    return _with_checksum(bits & HOLD_BITS) == bits


def _with_checksum(holds: np.ndarray) -> np.ndarray:
    """Return holds with their checksum bits added."""
    return holds | (holds * MARK_MULTIPLIER + MARK_ADDEND) & CHECK_BITS


def hold(number: int, frames: int = 0) -> int:
    """Return the hold of keys in the holder of this number, 0 for none, that is reached over this many frames."""
    return number * (MOST_FRAMES + 1) + frames


def read_marks(fcurve: bpy.types.FCurve) -> np.ndarray:
    """Return the marks of the keys of an F-curve, shape (n,)."""
    return marks_of(*_settings(fcurve))


def read_holds(fcurve: bpy.types.FCurve) -> np.ndarray:
    """Return the holds of the keys of an F-curve, shape (n,): see `hold`; -1 for none."""
    return holds_of(*_settings(fcurve), _setting(fcurve, "period"))


def mend_marks(fcurve: bpy.types.FCurve) -> np.ndarray:
    """Restore the marks of keys that still show a hold in two of the three settings, after one was typed over.

    Returns which of these keys have lost the hold itself, shape (n,).
    """
    (backs, amplitudes), is_checked = _settings(fcurve), _have_checksum(_setting(fcurve, "period"))
    is_flagged, is_signed = _are_flagged(backs), (amplitudes.view(np.int32) & MARK_BITS) == AMPLITUDE_SIGNATURE_BITS
    typed = is_flagged.astype(int) + is_signed + is_checked == 2
    if typed.any():
        marks = np.where(typed & is_flagged, backs.view(np.int32) & MAX_MARK, marks_of(backs, amplitudes))
        write_marks(fcurve, np.where(typed & (marks == 0), np.maximum(carried_on(marks), 1), marks))
    return typed & ~(is_flagged & is_checked)


def has_marks(fcurve: bpy.types.FCurve) -> bool:
    """Return whether any of the keys of an F-curve has a mark."""
    return bool(read_marks(fcurve).any())


def write_marks(fcurve: bpy.types.FCurve, marks: np.ndarray) -> None:
    """Give the keys of an F-curve marks (n,). Nothing that Blender evaluates changes, so nothing is tagged."""
    backs, amplitudes = settings = _settings(fcurve)
    # Keep the hold of each key.
    is_held = (amplitudes.view(np.int32) & MARK_BITS) == AMPLITUDE_SIGNATURE_BITS
    is_held |= _have_checksum(_setting(fcurve, "period"))
    held = np.where(is_held & _are_flagged(backs), BACK_HELD_BIT, 0)
    for values, bits in ((backs, BACK_CHECK_BIT | marks | held), (amplitudes, AMPLITUDE_SIGNATURE_BITS)):
        raw = values.view(np.int32)
        raw[:] = np.where(marks > 0, raw & ~MARK_BITS | bits, raw)
    # Keys without a mark: flip a bit of the signature so that none is read.
    amplitudes.view(np.int32)[(marks == 0) & (marks_of(backs, amplitudes) > 0)] ^= 1
    for name, values in zip(("back", "amplitude"), settings, strict=True):
        fcurve.keyframe_points.foreach_set(name, values)


def write_holds(fcurve: bpy.types.FCurve, holds: np.ndarray) -> None:
    """Give the keys of an F-curve, all of them marked, holds (n,): see `hold`; -1 removes the hold."""
    backs, _ = _settings(fcurve)
    periods = _setting(fcurve, "period")
    periods[(holds >= 0) & ~(np.abs(periods) > 1e-3)] = DEFAULT_PERIOD_FRAMES
    raw, bits = backs.view(np.int32), periods.view(np.int32)
    raw[:] = np.where(holds >= 0, raw | BACK_HELD_BIT, raw & ~BACK_HELD_BIT)
    bits[:] = np.where(holds >= 0, bits & ~(CHECK_BITS | HOLD_BITS) | _with_checksum(holds), bits)
    # Keys without a hold: flip a bit of the checksum so that none is read.
    bits[(holds < 0) & _have_checksum(periods)] ^= HOLD_BITS + 1
    fcurve.keyframe_points.foreach_set("back", backs)
    fcurve.keyframe_points.foreach_set("period", periods)


def carried_on(marks: np.ndarray) -> np.ndarray:
    """Return the marks (n,) of consecutive keys; a key without one takes that of the last marked key before it."""
    marked = np.flatnonzero(marks)
    if not len(marked):
        return marks
    return marks[marked[np.clip(np.searchsorted(marked, np.arange(len(marks)), side="right") - 1, 0, None)]]


def _settings(fcurve: bpy.types.FCurve) -> tuple[np.ndarray, np.ndarray]:
    return _setting(fcurve, "back"), _setting(fcurve, "amplitude")


def _setting(fcurve: bpy.types.FCurve, name: str) -> np.ndarray:
    values = np.empty(len(fcurve.keyframe_points), np.float32)
    fcurve.keyframe_points.foreach_get(name, values)
    return values
