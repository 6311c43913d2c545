"""Slip report: how far held objects slip in their holders, and how far points that should stay move.

Contains a table for each pair, and sentences.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigid_motion_batch.analysis.choices import Choice
from rigid_motion_batch.analysis.held import PairSlips
from rigid_motion_batch.analysis.modes import STATE_OF_THE_ART

from .numbers import STILL_AT, Numbers, digits, listed
from .tables import Grid, grid_rows

MOST_SAID = 5
"""Maximum number of pairs, or clips, that get a sentence; further pairs are only counted."""


def slip_grids(pairs: Sequence[PairSlips], numbers: Numbers) -> list[Grid]:
    """Return a table of the largest slips of each pair, in mm."""
    result = []
    for pair in pairs:
        values = slips_in_mm(pair, numbers)
        if not np.isfinite(values).any():
            continue
        own = max(row.recorded_slip_m for some in pair.choices for row in some.rows)
        caption = f"{pair.held} in {pair.holder}: largest slip, mm; in the recording itself {digits(1e3 * own)}"
        heads = tuple(choice.title for choice in numbers.choices)
        result.append(Grid("", 0, caption, heads, grid_rows(values, numbers.groups(), numbers)))
    return result


def slips_in_mm(pair: PairSlips, numbers: Numbers) -> np.ndarray:
    """Return the largest slips of a pair in mm, shape (choices, modes); NaN where there are none."""
    values = np.full((len(numbers.choices), len(numbers.modes)), np.nan)
    for some in pair.choices:
        for row in some.rows:
            values[numbers.choices.index(some.choice), numbers.modes.index(row.mode)] = 1e3 * row.max_slip_m
    return values


def slip_sentences(pairs: Sequence[PairSlips], numbers: Numbers, spoken_of: Choice | None) -> list[str]:
    """Return a sentence for each of the first pairs, with the slips of the reference, straight lines and the best mode.

    Uses the choice of keys that the verdict is about, or the first one with slips.
    """
    result = []
    for pair in pairs[:MOST_SAID]:
        values = slips_in_mm(pair, numbers)
        known = np.isfinite(values).any(axis=1)
        if not known.any():
            continue
        at = _choice_index(numbers, known, spoken_of)
        said = _values_text(values[at], numbers)
        choice = numbers.choices[at]
        own = next(some.rows[0].recorded_slip_m for some in pair.choices if some.choice == choice)
        result.append(
            f"{pair.holder} holds {pair.held}, which slips up to {said} {choice.phrase}, and {digits(1e3 * own)} mm in "
            "the recording."
        )
    if len(pairs) > MOST_SAID:
        left = len(pairs) - MOST_SAID
        result.append(f"{left} more {'pairs are' if left > 1 else 'pair is'} in slip.csv.")
    return result


def still_sentences(numbers: Numbers, spoken_of: Choice | None) -> list[str]:
    """Return the same sentences for the first clips that have a point which stays, such as a pivot."""
    result: list[str] = []
    for name, values in zip(numbers.clips, numbers.values[STILL_AT], strict=True):
        known = np.isfinite(values).any(axis=1)
        if known.any() and len(result) < MOST_SAID:
            at = _choice_index(numbers, known, spoken_of)
            said, phrase = _values_text(values[at], numbers), numbers.choices[at].phrase
            result.append(f"{name} has a point that stays in the recording; it is off by up to {said} {phrase}.")
    return result


def _choice_index(numbers: Numbers, known: np.ndarray, spoken_of: Choice | None) -> int:
    """Return the index of the choice that the verdict is about, or of the first one with values."""
    asked = numbers.choices.index(spoken_of) if spoken_of in numbers.choices else 0
    return asked if known[asked] else int(np.argmax(known))


def _values_text(values: np.ndarray, numbers: Numbers) -> str:
    """Return text with the values (modes,), in mm, of the reference, of straight lines and of the best mode."""
    at = {group[0]: values[numbers.modes.index(group[0])] for group in numbers.groups()}
    shown = {mode: digits(value) for mode, value in at.items() if np.isfinite(value)}
    least = min(shown.values(), key=float)
    named = dict.fromkeys(mode for mode in (numbers.reference, STATE_OF_THE_ART) if mode in shown)
    best = [mode for mode in shown if shown[mode] == least and mode not in named]
    parts = [f"{shown[mode]} mm by {numbers.label(mode)}" for mode in named]
    parts += [f"{shown[best[0]]} mm by {listed(map(numbers.label, best))}"] if best else []
    return listed(parts)
