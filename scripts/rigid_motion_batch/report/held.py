"""How far bodies slip that hold one another: a table for each pair, and a sentence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigid_motion_batch.analysis.held import PairSlips
from rigid_motion_batch.analysis.modes import STATE_OF_THE_ART
from rigid_motion_batch.command_line import listed

from .numbers import KINDS, Numbers, digits
from .tables import Grid, grid_rows

MOST_SAID = 5
"""Pairs that a sentence is said of; more are counted."""


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
    """Return the largest slips of a pair, shape (choices, modes); NaN where there are none."""
    values = np.full((len(numbers.choices), len(numbers.modes)), np.nan)
    for some in pair.choices:
        for row in some.rows:
            values[numbers.choices.index(some.choice), numbers.modes.index(row.mode)] = 1e3 * row.max_slip_m
    return values


def slip_sentences(pairs: Sequence[PairSlips], numbers: Numbers) -> list[str]:
    """Return a sentence for each of the first pairs: what the reference, straight lines and the best mode make of it.

    With the middle one of the choices of the first kind, as pages open with.
    """
    kind = next(kind for kind in KINDS for choice in numbers.choices if type(choice) is kind)
    result = []
    for pair in pairs[:MOST_SAID]:
        values = slips_in_mm(pair, numbers)
        known = np.isfinite(values).any(axis=1)
        places = [at for at, choice in enumerate(numbers.choices) if type(choice) is kind and known[at]]
        if not places:
            continue
        at = places[(len(places) - 1) // 2]
        groups = [group[0] for group in numbers.groups() if np.isfinite(values[at, numbers.modes.index(group[0])])]
        shown = {mode: digits(values[at, numbers.modes.index(mode)]) for mode in groups}
        best = min(groups, key=lambda mode: float(shown[mode]))
        named = [mode for mode in (numbers.reference, STATE_OF_THE_ART, best) if mode in shown]
        said = listed([f"{shown[mode]} mm by {numbers.label(mode)}" for mode in dict.fromkeys(named)])
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
