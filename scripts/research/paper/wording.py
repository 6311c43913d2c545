"""The words and numbers of the page: how shares, times and tables are written, and verdicts that depend on numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.report.numbers import listed

from . import claims
from .sending import SentNeeded
from .table import Needed
from .timing import Timing


def percents(shares: Sequence[float]) -> str:
    """Shares in a sentence: "33, 50, 53 and 58 %"."""
    return f"{listed([number(100.0 * share, 0) if np.isfinite(share) else '-' for share in shares])} %"


def less(saved: Sequence[float], word: str = "less") -> str:
    """Shares saved, in a sentence; of a share below zero it says how much more that is."""
    shares = [round(share, 2) if np.isfinite(share) else float("nan") for share in saved]
    if not any(share < 0.0 for share in shares):
        return f"{percents(saved)} {word}"
    if not any(share > 0.0 for share in shares):
        return f"{percents([-share for share in saved])} more"
    return listed([_less_or_more(share, word) for share in saved])


def _less_or_more(saved: float, word: str) -> str:
    if not np.isfinite(saved):
        return "-"
    return f"{number(100.0 * abs(saved), 0)} % {'more' if round(saved, 2) < 0.0 else word}"


def verdict(saved: Sequence[float]) -> str:
    """At which of the paper's rates its saving is reached."""
    reached = [str(row.state_of_the_art) for row in holding(saved)]
    if len(reached) == len(claims.TABLE):
        return "This reaches the paper's saving at every rate."
    return f"This reaches the paper's saving {f'at {listed(reached)} only' if reached else 'at no rate'}."


def holding(saved: Sequence[float]) -> list[claims.Row]:
    """The rows of the paper's table whose saving is there, to the percent."""
    return [row for row, share in zip(claims.TABLE, saved, strict=True) if share >= row.saved - 0.005]


def needed_cell(cell: Needed | SentNeeded | None) -> str:
    """A cell of a table of what is needed: updates a second, what is saved, and on how many clips if not on all."""
    if cell is None or not np.isfinite(cell.needed):
        return "-"
    part = "" if cell.reached == cell.asked else f"; {cell.reached} of {cell.asked} clips"
    return f"{cell.needed:.1f} ({percent(cell.saved)}{part})"


def heads(first: str) -> list[str]:
    """The heads of a table whose columns are the rows of the paper's."""
    return [first, *(f"{row.quality}, {row.state_of_the_art}/s" for row in claims.TABLE)]


def papers_row() -> list[str]:
    """What the paper says, as a row of such a table."""
    return ["*the paper*", *(f"*{row.multivectors} ({row.saved:.0%})*" for row in claims.TABLE)]


def changed(relative: float) -> str:
    """A ratio as what it is more or less than 1."""
    return f"{abs(1.0 - relative):.1%} {'less' if relative < 1.0 else 'more'}"


def doubt(one: Timing) -> str:
    """Whether the interval leaves room for doubt."""
    return "" if one.low > 1.0 or one.high < 1.0 else " (which may be chance)"


def timed(one: Timing | None) -> str:
    """A cell of the races: the ratio, its interval, and the processor's time."""
    if one is None:
        return ""
    if one.mode == REFERENCE:
        return f"1 ({written(one.processor_s)})"
    return f"{one.relative:.3g}, {one.low:.3g} to {one.high:.3g} ({written(one.processor_s)})"


def written(seconds: float) -> str:
    """A time that is short."""
    for unit, factor in (("ns", 1e9), ("µs", 1e6)):
        if seconds * factor < 1000.0:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e3:.3g} ms"


def percent(saved: float) -> str:
    """A share that is saved, without decimals; below zero it says how much more that is: "23% more"."""
    return number(100.0 * abs(saved), 0) + ("% more" if round(saved, 2) < 0.0 else "%")


def number(value: float, decimals: int = 2) -> str:
    """With the sign that print has for a number below zero, and none for a zero."""
    return f"{value:.{decimals}f}".replace("-", "\N{MINUS SIGN}") if round(value, decimals) else f"{0:.{decimals}f}"


def grid(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A table of Markdown, its first column to the left and the others to the right."""
    align = ["---", *["---:"] * (len(head) - 1)]
    return ["| " + " | ".join(cells) + " |" for cells in (head, align, *rows)]
