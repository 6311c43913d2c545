"""The tables of the report, as rows of text for the templates: lower is better in all of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rigid_motion_batch.analysis.needed import DECIMATIONS, KeysNeeded, overall

from .numbers import MEASURES, MINUS, NONE, Numbers, digits, percent

SPACINGS = dict(zip(DECIMATIONS, ("evenly spaced", "where needed", "where needed, and fitted"), strict=True))


@dataclass(frozen=True)
class Cell:
    text: str
    small: str = ""
    best: bool = False
    value: float | None = None
    """What it is sorted by, where that is not all of its text."""


@dataclass(frozen=True)
class Row:
    modes: tuple[str, ...]
    """Those that are one motion."""

    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Grid:
    """All modes under all choices of keys, by one measure."""

    scope: str
    """The place of a clip, or "all"."""

    column: int
    """The measure."""

    caption: str
    heads: tuple[str, ...]
    rows: tuple[Row, ...]


def grids(numbers: Numbers, clip: int | None = None) -> list[Grid]:
    """Return a grid for each measure that a clip has, or that the mean over all clips has."""
    values = numbers.mean(clip)
    groups = numbers.groups(clip)
    where = (
        numbers.clips[clip]
        if clip is not None
        else f"geometric mean over {len(numbers.clips)} clips"
        if len(numbers.clips) > 1
        else numbers.clips[0]
    )
    columns = [numbers.modes.index(group[0]) for group in groups]
    reference = numbers.modes.index(numbers.reference) if numbers.reference else None
    found = []
    for place, measure in enumerate(MEASURES):
        own = values[place][:, columns]
        if not np.isfinite(own).any():
            continue
        texts = [[digits(value) for value in row] for row in own.tolist()]
        least = [_least(row) for row in texts]
        rows = tuple(
            Row(
                group,
                tuple(
                    Cell(
                        texts[choice][column],
                        _change(own[choice, column], reference, values[place, choice], group, numbers),
                        texts[choice][column] == least[choice],
                        float(np.nan_to_num(own[choice, column], nan=1e12)),
                    )
                    for choice in range(len(numbers.choices))
                ),
            )
            for column, group in enumerate(groups)
        )
        caption = f"{measure.title}, {measure.unit}: {where}"
        scope = "all" if clip is None else str(clip)
        found.append(Grid(scope, place, caption, tuple(choice.title for choice in numbers.choices), rows))
    return found


def _least(texts: Iterable[str]) -> str:
    """Return the lowest as it is shown, so that ties are ties; nothing where all are."""
    different = set(texts) - {NONE}
    return min(different, key=float) if len(different) > 1 else ""


def _change(value: float, reference: int | None, row: np.ndarray, group: Sequence[str], numbers: Numbers) -> str:
    """Return a value beside the reference's, in per cent."""
    if reference is None or not np.isfinite(value):
        return ""
    if numbers.reference in group:
        return "reference"
    if not row[reference] > 0.0:
        return ""
    change = 100.0 * (value / row[reference] - 1.0)
    shown = f"{abs(change):.1f}" if abs(change) < 9.95 else f"{abs(change):.0f}"
    return "same" if shown == "0.0" else f"{'+' if change > 0 else MINUS}{shown}\u00a0%"


def needed_rows(needed: Sequence[KeysNeeded]) -> tuple[list[str], list[tuple[tuple[str, ...], str, list[Cell]]]]:
    """Heads, and for each motion and way to space keys the keys that are as good as the reference's at each rate."""
    together = overall(needed)
    asked = [at for at in range(len(together.rates)) if together.asked[at]]
    single = needed[0] if len(needed) == 1 else None
    finite = np.where(np.isfinite(together.shares), together.shares, np.inf)
    rows = []
    for group, modes in enumerate(together.groups):
        for way in range(together.shares.shape[1]):
            cells = []
            for at in asked:
                share, reached = together.shares[group, way, at], int(together.clips[group, way, at])
                if not reached:
                    cells.append(Cell("not reached", value=1e9))
                    continue
                number = (
                    f"{single.keys[group, way, at]:.0f}"
                    if single
                    else f"{digits(together.keys_per_s[group, way, at])}/s"
                )
                partly = f" on {reached} of {together.asked[at]} clips" if reached < together.asked[at] else ""
                best = bool(share <= finite[..., at].min() + 5e-3)
                cells.append(Cell(number, percent(share) + partly, best, float(share)))
            rows.append((modes, SPACINGS[DECIMATIONS[way]], cells))
    return [f"{together.rates[at]}/s" for at in asked], rows
