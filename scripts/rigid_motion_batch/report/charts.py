"""Charts of the report (except the viewer's): Vega-Lite specifications, rendered to SVG in the page's colours.

To add a chart: write a function here that returns a specification, or None if there is nothing to draw; add it to
`CHARTS`; call `chart(...)` in a template.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import vl_convert
from markupsafe import Markup

from rigid_motion_batch.analysis.choices import Tolerance, Uniform
from rigid_motion_batch.analysis.needed import KeysNeeded, overall

from .numbers import ERROR_AT, Numbers

Specification = dict[str, Any]

STYLE: Specification = {
    "background": None,
    "view": {"stroke": None},
    "axis": {
        "labelColor": "var(--soft)",
        "titleColor": "var(--soft)",
        "titleFontWeight": "normal",
        "gridColor": "var(--grid)",
        "domainColor": "var(--edge)",
        "tickColor": "var(--edge)",
        "labelFontSize": 12,
        "titleFontSize": 12,
    },
    "legend": {"labelColor": "var(--soft)", "titleColor": "var(--soft)", "labelFontSize": 12, "symbolType": "stroke"},
}

DASHES: Specification = {
    "field": "keys",
    "legend": {"title": "Keys", "orient": "bottom"},
    "scale": {"domain": ["where needed", "evenly spaced"], "range": [[1, 0], [4, 3]]},
}


def error_over_rate(numbers: Numbers, clip: int | None = None) -> Specification | None:
    """Return the RMS shell error over the keys per second, for a clip or averaged over all clips."""
    places = [place for place, choice in enumerate(numbers.choices) if not isinstance(choice, Tolerance)]
    if len(places) < 2:
        return None
    values = numbers.mean(clip)[ERROR_AT]
    rows: list[Specification] = [
        {
            "rate": numbers.choices[place].size,
            "error": float(values[place, numbers.modes.index(group[0])]),
            "mode": numbers.joined(group),
            "keys": "evenly spaced" if isinstance(numbers.choices[place], Uniform) else "where needed",
        }
        for group in numbers.groups(clip)
        for place in places
    ]
    return _lines(numbers, rows, numbers.groups(clip), sorted({row["rate"] for row in rows}))


def keys_needed(numbers: Numbers, needed: Sequence[KeysNeeded]) -> Specification | None:
    """Return the error over the keys per second of each mode, with keys evenly spaced or where the mode needs them."""
    together = overall(needed)
    # Means over different sets of clips do not make one curve.
    whole = together.asked == len(needed)
    reached = together.clips[:, 1] == len(needed)
    rows = []
    for row, group in enumerate(together.groups):
        evenly = zip(together.reference_keys_per_s[whole], together.uniform_errors[row][whole], strict=True)
        needing = zip(together.keys_per_s[row, 1][reached[row]], together.reached[row, 1][reached[row]], strict=True)
        for keys, points in (("evenly spaced", evenly), ("where needed", needing)):
            rows += [
                {"rate": float(rate), "error": float(1e3 * error), "mode": numbers.joined(group), "keys": keys}
                for rate, error in points
            ]
    return _lines(numbers, rows, together.groups)


def _lines(
    numbers: Numbers, rows: list[Specification], groups: Iterable[tuple[str, ...]], ticks: Sequence[float] | None = None
) -> Specification | None:
    """Return lines on log-log axes, where powers of the rate are straight; None with fewer than two points."""
    rows = [row for row in rows if np.isfinite(row["error"]) and row["error"] > 0.0 and row["rate"] > 0.0]
    if len(rows) < 2:
        return None
    groups = list(groups)
    return {
        "width": 400,
        "height": 210,
        "data": {"values": rows},
        "mark": {"type": "line", "point": {"size": 26}, "strokeWidth": 1.8},
        "encoding": {
            "x": {
                "field": "rate",
                "type": "quantitative",
                "title": "keys a second",
                "scale": {"type": "log", "nice": False, "padding": 8},
                "axis": {"grid": False, "format": "~g", **({"values": ticks} if ticks else {"tickCount": 6})},
            },
            "y": {
                "field": "error",
                "type": "quantitative",
                "title": "RMS shell error, mm",
                "scale": {"type": "log", "nice": False, "padding": 8},
                "axis": {"values": _tick_values([row["error"] for row in rows]), "format": "~g"},
            },
            "color": {
                "field": "mode",
                "type": "nominal",
                "legend": None,
                "scale": {
                    "domain": [numbers.joined(group) for group in groups],
                    "range": [f"var(--m{numbers.modes.index(group[0])})" for group in groups],
                },
            },
            **({"strokeDash": DASHES} if len({row["keys"] for row in rows}) > 1 else {}),
        },
    }


def _tick_values(values: Sequence[float]) -> list[float]:
    """Return 1, 2 and 5 times powers of ten that cover the values, extended by a factor of two at both ends."""
    low, high = min(values) / 2.0, max(values) * 2.0
    powers = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    result = [step * 10.0**power for power in powers for step in (1, 2, 5)]
    return [value for value in result if low <= value <= high]


CHARTS: dict[str, Callable[..., Specification | None]] = {
    "error over rate": error_over_rate,
    "keys needed": keys_needed,
}


def chart(name: str, *arguments: Any) -> Markup:
    """Return the SVG of a chart; empty if there is nothing to draw."""
    specification = CHARTS[name](*arguments)
    if specification is None:
        return Markup()
    described = {"config": STYLE, "description": name, "$schema": "https://vega.github.io/schema/vega-lite/v6.json"}
    drawing = vl_convert.vegalite_to_svg(described | specification)
    return Markup(drawing.replace("<svg ", '<svg role="img" ', 1))
