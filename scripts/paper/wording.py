"""The words and numbers of the page: how shares, times and tables are written, and verdicts that depend on numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scripts.comparison.report.findings import listed
from scripts.comparison.study.modes import REFERENCE

from . import claims
from .timing import Timing


def percents(shares: Sequence[float]) -> str:
    """Shares in a sentence: "33, 50, 53 and 58 %"."""
    return f"{listed([number(100.0 * share, 0) if np.isfinite(share) else '-' for share in shares])} %"


def less(saved: Sequence[float]) -> str:
    """Shares saved, in a sentence."""
    return f"{percents(saved)} less"


def verdict(saved: Sequence[float]) -> str:
    """Whether the paper's saving is there."""
    good = [row.quality.lower() for row, share in zip(claims.TABLE, saved, strict=True) if share >= row.saved - 0.005]
    if len(good) == len(claims.TABLE):
        return "That is the paper's saving in every row."
    return f"The paper's saving is there for {listed(good)}." if good else "The paper's saving is in no row."


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


def percent(share: float) -> str:
    """A share without decimals."""
    return number(100.0 * share, 0) + "%"


def number(value: float, decimals: int = 2) -> str:
    """With the sign that print has for a number below zero, and none for a zero."""
    return f"{value:.{decimals}f}".replace("-", "\N{MINUS SIGN}") if round(value, decimals) else f"{0:.{decimals}f}"


def grid(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A table of Markdown, its first column to the left and the others to the right."""
    align = ["---", *["---:"] * (len(head) - 1)]
    return ["| " + " | ".join(cells) + " |" for cells in (head, align, *rows)]
