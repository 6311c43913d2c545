"""Parts that the sections of the report share: tables with their cells, and what a mode looks like."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigid_motion_batch.analysis.modes import label_of as label
from rigid_motion_batch.palette import colour_of

from .charts import Axis, Curve
from .markup import Content, Markup, element


def curve(group: Sequence[str], x: np.ndarray, y: np.ndarray) -> Curve:
    """The curve that modes share."""
    return Curve(tuple(map(label, group)), x, y, colour_of(group[0]))


def rate_axis(rates: np.ndarray) -> Axis:
    """Rates as an axis, with a tick at each."""
    return Axis("rate", "keys/s", float(rates.min()), float(rates.max()), ticks=tuple(rates))


def swatch(mode: str) -> Markup:
    """A patch in the colour of a mode."""
    return element("i", class_="swatch", style=f"--colour:{colour_of(mode)}")


def table(caption: str, head: list[Markup], body: list[Markup]) -> Markup:
    """A table that can be sorted by any column, and scrolled where the page is too narrow for it."""
    content = element(
        "table",
        element("caption", caption),
        element("thead", element("tr", head)),
        element("tbody", body),
        class_="numbers sortable",
    )
    return element("div", content, class_="scroll", role="region", tabindex=0, aria_label=caption)


def heading(title: str, kind: str, unit: str = "") -> Markup:
    """Of a column of one kind: "text" or "number"."""
    return element(
        "th", element("span", title, element("small", f" {unit}") if unit else None), scope="col", class_=kind
    )


def mode_cell(*modes: str) -> Markup:
    """The head of a row: a mode, or several that are one motion."""
    names = " = ".join(map(label, modes))
    return element(
        "th", swatch(modes[0]), names, scope="row", data_value=names, class_="joint" if len(modes) > 1 else None
    )


def text_cell(text: str) -> Markup:
    return element("td", text, data_value=text, class_="text")


def number_cell(value: float, shown: Content, *, best: bool, tint: float | None = None) -> Markup:
    """A number, marked where it is the best of its column; `tint` shades it by how far it is from 1."""
    if not np.isfinite(value):
        return element("td", "n/a", data_value="Infinity")
    shade = None
    if tint is not None and abs(tint - 1.0) >= 0.005:
        shade = (
            f"--tint:var({'--better' if tint < 1.0 else '--worse'});--share:{min(abs(tint - 1.0) * 120.0, 45.0):.0f}%"
        )
    mark = element("b", shown, element("span", " best", class_="spoken")) if best else shown
    return element("td", mark, data_value=repr(float(value)), class_="best" if best else None, style=shade)


def missing_cell(reason: str) -> Markup:
    """The place of a number that there is not; sorted behind all."""
    return element("td", reason, data_value="Infinity", class_="missing")


def is_best(value: float, best: float) -> bool:
    """Equal to the best but for rounding: identical modes are best together."""
    return bool(value <= best * (1.0 + 1e-6) + 1e-12)


def rounded(value: float) -> str:
    """Three digits that count, without exponents where a table can do without."""
    if value == 0.0 or abs(value) < 1e-6:
        return "0"
    if abs(value) < 1e-3:
        return f"{value:.1e}"
    return f"{value:.{max(2 - int(np.floor(np.log10(abs(value)))), 0)}f}"
