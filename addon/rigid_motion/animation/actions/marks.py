"""Marks: what keys say of the segments that they begin, and of what they are held in, in the keys themselves.

Blender keeps nothing of an extension's on a key. But each key has settings for eases that it does not have: `back` and
`amplitude`. A mark is in the lowest bits of both, where it changes no ease by more than a part in a hundred thousand.
So it goes where the key goes: it is copied and pasted, duplicated, mirrored, linked and saved with it, and is gone
where a key is made anew. What a key is held in is beside its mark, in the lowest bits of `period`, with a check of its
own: a number that is typed into one of the three settings takes its say off, and the other two tell.

Without a mark a key goes on with what the key before it says, and before the first mark with what that says.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..evaluation.runs import MOST_FRAMES

MARK_BITS = 63
"""The bits of either setting that have a mark."""

AMPLITUDE_SIGNATURE_BITS = 42
"""What `amplitude` has in these bits where there is a mark: neither Blender's default nor a round number."""

BACK_CHECK_BIT = 16
"""What `back` has in these bits beside a mark, which is less."""

BACK_HELD_BIT = 32
"""What `back` has in these bits, too, where `period` says what a key is held in."""

MAX_MARK = 15
"""The largest mark, and the most holders that keys can tell apart."""

HOLD_BITS = (MAX_MARK + 1) * (MOST_FRAMES + 1) - 1
"""The bits of `period` that have a hold: the number of the holder, and the frames."""

CHECK_BITS = 15 * (HOLD_BITS + 1)
"""Those above, which say whether it is one."""

MARK_MULTIPLIER, MARK_ADDEND = 4181, 3863
"""What they are made by: so no whole number up to 500 says a hold, nor any hundredths up to 20."""

DEFAULT_PERIOD_FRAMES = 4.1
"""Blender's own, where there is none yet to have a hold in its bits."""


def marks_of(backs: np.ndarray, amplitudes: np.ndarray) -> np.ndarray:
    """Return the marks in settings `back` and `amplitude` of keys (float32, any shape), 0 where there is none."""
    low = backs.view(np.int32) & MARK_BITS
    is_marked = ((amplitudes.view(np.int32) & MARK_BITS) == AMPLITUDE_SIGNATURE_BITS) & ((low & BACK_CHECK_BIT) != 0)
    return np.where(is_marked, low & MAX_MARK, 0)


def are_held(backs: np.ndarray, amplitudes: np.ndarray, periods: np.ndarray) -> np.ndarray:
    """Return which keys with these settings (float32, any shape) say what they are held in."""
    return (marks_of(backs, amplitudes) > 0) & _are_flagged(backs) & _are_checked(periods)


def holds_of(backs: np.ndarray, amplitudes: np.ndarray, periods: np.ndarray) -> np.ndarray:
    """Return the holds in the settings of keys (float32, any shape): see `hold`; -1 where there is none."""
    return np.where(are_held(backs, amplitudes, periods), periods.view(np.int32) & HOLD_BITS, -1)


def is_any_flagged(backs: np.ndarray) -> bool:
    """Return whether any key with such a setting may say what it is held in."""
    return bool(_are_flagged(backs).any())


def _are_flagged(backs: np.ndarray) -> np.ndarray:
    return (backs.view(np.int32) & (BACK_CHECK_BIT | BACK_HELD_BIT)) == BACK_CHECK_BIT | BACK_HELD_BIT


def _are_checked(periods: np.ndarray) -> np.ndarray:
    bits = periods.view(np.int32) & (CHECK_BITS | HOLD_BITS)
    return _checked(bits & HOLD_BITS) == bits


def _checked(holds: np.ndarray) -> np.ndarray:
    """Return holds with the bits that say that they are some."""
    return holds | (holds * MARK_MULTIPLIER + MARK_ADDEND) & CHECK_BITS


def hold(number: int, frames: int = 0) -> int:
    """Return the hold of keys in a holder of this number, 0 for none, that is reached over so many frames."""
    return number * (MOST_FRAMES + 1) + frames


def read_marks(fcurve: bpy.types.FCurve) -> np.ndarray:
    """Return the marks of the keys of an F-curve, shape (n,)."""
    return marks_of(*_settings(fcurve))


def read_holds(fcurve: bpy.types.FCurve) -> np.ndarray:
    """Return the holds of the keys of an F-curve, shape (n,): see `hold`; -1 where there is none."""
    return holds_of(*_settings(fcurve), _setting(fcurve, "period"))


def mend_marks(fcurve: bpy.types.FCurve) -> np.ndarray:
    """Mark keys again that say a hold by two of the three settings, as one was typed over.

    Returns which of them do not say any more what it was, shape (n,).
    """
    (backs, amplitudes), is_checked = _settings(fcurve), _are_checked(_setting(fcurve, "period"))
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
    # What a key is held in stays.
    is_held = (amplitudes.view(np.int32) & MARK_BITS) == AMPLITUDE_SIGNATURE_BITS
    is_held |= _are_checked(_setting(fcurve, "period"))
    held = np.where(is_held & _are_flagged(backs), BACK_HELD_BIT, 0)
    for values, bits in ((backs, BACK_CHECK_BIT | marks | held), (amplitudes, AMPLITUDE_SIGNATURE_BITS)):
        raw = values.view(np.int32)
        raw[:] = np.where(marks > 0, raw & ~MARK_BITS | bits, raw)
    # Without one the signature is off by a bit, so that nothing else is read from it.
    amplitudes.view(np.int32)[(marks == 0) & (marks_of(backs, amplitudes) > 0)] ^= 1
    for name, values in zip(("back", "amplitude"), settings, strict=True):
        fcurve.keyframe_points.foreach_set(name, values)


def write_holds(fcurve: bpy.types.FCurve, holds: np.ndarray) -> None:
    """Give the keys of an F-curve, all of which have marks, holds (n,): see `hold`. Those of -1 have none."""
    backs, _ = _settings(fcurve)
    periods = _setting(fcurve, "period")
    periods[(holds >= 0) & ~(np.abs(periods) > 1e-3)] = DEFAULT_PERIOD_FRAMES
    raw, bits = backs.view(np.int32), periods.view(np.int32)
    raw[:] = np.where(holds >= 0, raw | BACK_HELD_BIT, raw & ~BACK_HELD_BIT)
    bits[:] = np.where(holds >= 0, bits & ~(CHECK_BITS | HOLD_BITS) | _checked(holds), bits)
    # Without one the check is off by a bit, so that none is read from it.
    bits[(holds < 0) & _are_checked(periods)] ^= HOLD_BITS + 1
    fcurve.keyframe_points.foreach_set("back", backs)
    fcurve.keyframe_points.foreach_set("period", periods)


def carried_on(marks: np.ndarray) -> np.ndarray:
    """Return the marks (n,) that keys one behind the other have where those without go on with what there is."""
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
