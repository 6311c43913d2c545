"""Line charts as SVG, of the standard library and NumPy alone: Blender's own Python has no matplotlib.

A chart is as wide as the page lets it be and `HEIGHT` pixels high. Curves are drawn in an inner SVG that is stretched
to the plot, with strokes that are not; text is placed by percentages, so that it keeps its size on a phone. Ink, grid
and the gutters around the plot come from the page (`page/page.css`), which is how one chart serves light and dark.
`page/page.js` reads values back from the curves' coordinates for whoever points at them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .markup import Markup, element

HEIGHT = 200
"""Of the plot, in pixels."""

COLUMNS = 500
"""Into how many columns the plot is divided where a curve has more samples than can be seen."""

GRID_X, GRID_Y = 5000, 2000
"""The curves' coordinates are whole numbers up to these: a tenth of a pixel, and short to write."""

STROKE = 70
"""The height of marks, in the coordinates of curves."""

STROKE_GAP = 10
"""Between rows of marks, in the same."""

LINE_OF_TEXT = 15
"""In pixels, in labels."""


@dataclass(frozen=True, eq=False)
class Curve:
    """What is drawn: n points, and how they are called."""

    labels: tuple[str, ...]
    """One, or several where several things have this very curve."""

    x: np.ndarray
    y: np.ndarray
    colour: str
    """#rrggbb"""

    dashed: bool = False
    """Drawn with dashes, for a companion of another curve in its colour, that one's label standing for both."""


@dataclass(frozen=True, eq=False)
class Marks:
    """Values of x that get a short stroke above the axis."""

    x: np.ndarray

    colour: str | None = None
    """#rrggbb, or that of the soft ink of the page."""


@dataclass(frozen=True)
class Axis:
    """What is measured along an axis, and between which values."""

    name: str
    unit: str
    low: float
    high: float
    log: bool = False
    ticks: tuple[float, ...] | None = None
    """Where numbers and grid lines go; round values where None."""

    def share(self, values: np.ndarray) -> np.ndarray:
        """How far along the axis the values are, 0 to 1. Of a log axis, values need to be above 0."""
        low, high, values = self.low, self.high, np.asarray(values, dtype=float)
        if self.log:
            low, high, values = np.log(low), np.log(high), np.log(values)
        return (values - low) / (high - low)

    @property
    def title(self) -> str:
        return f"{self.name} ({self.unit})" if self.unit else self.name


def axis_over(name: str, unit: str, values: np.ndarray, *, log: bool = False) -> Axis:
    """An axis that has room for all values, from 0 on where it is linear and they are positive.

    Values that cannot be drawn, not finite or on a log axis not above 0, do not count.
    """
    values = np.asarray(values, dtype=float)
    values = values[np.isfinite(values) & ((values > 0.0) | (not log))]
    if not len(values):
        values = np.array([1.0])
    low, high = float(values.min()), float(values.max())
    if log:
        # Half a decade at least, or the noise of a flat curve would fill the plot.
        middle, half = np.log10(low * high) / 2.0, max(np.log10(high / low) / 2.0 * 1.1, 0.25)
        low, high = 10.0 ** (middle - half), 10.0 ** (middle + half)
    elif low >= 0.0:
        low, high = 0.0, high * 1.05 or 1.0
    else:
        low, high = low - 0.05 * (high - low), high + 0.05 * (high - low)
        high = high if high > low else low + 1.0
    return Axis(name, unit, float(low), float(high), log)


def with_rows_below(axis: Axis, rows: int) -> Axis:
    """A linear axis from 0 on that has room below 0 for so many rows of marks, where no curve covers them."""
    share = (rows * (STROKE + STROKE_GAP) + STROKE_GAP) / GRID_Y
    low = -axis.high * share / (1.0 - share)
    return replace(axis, low=low, ticks=tuple(nice_ticks(0.0, axis.high).tolist()))


def nice_ticks(low: float, high: float, count: int = 5) -> np.ndarray:
    """About `count` round values, 1, 2 or 5 times a power of ten apart, between `low` and `high`."""
    raw = (high - low) / count
    power = 10.0 ** np.floor(np.log10(raw))
    step = power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= raw * 0.999)
    ticks = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1.0) * step
    return ticks + 0.0  # -0.0 is not a label.


def log_ticks(low: float, high: float, most: int = 7) -> np.ndarray:
    """Round values for a log axis: 1, 2 and 5 in every power of ten, or fewer where that would be too many."""
    powers = np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1.0)
    for factors in ((1.0, 2.0, 3.0, 5.0, 7.0), (1.0, 2.0, 5.0), (1.0, 3.0), (1.0,)):
        ticks = np.outer(10.0**powers, factors).ravel()
        ticks = ticks[(ticks >= low * 0.999) & (ticks <= high * 1.001)]
        if len(ticks) <= most:
            return ticks
    return ticks[:: -(-len(ticks) // most)]


def thin(x: np.ndarray, y: np.ndarray, columns: int = COLUMNS) -> np.ndarray:
    """The samples a picture needs: the lowest and the highest of each of `columns`, so that no peak is lost.

    Parameters
    ----------
    x, y : array, shape (n,)
        x rising.
    columns : int

    Returns
    -------
    array of int
        Rising indices, the first and the last sample among them; all n where they are few.
    """
    n = len(x)
    if n <= 2 * columns:
        return np.arange(n)
    column = np.minimum((x - x[0]) / (x[-1] - x[0]) * columns, columns - 1).astype(int)
    by_height = np.lexsort((y, column))
    firsts = np.flatnonzero(np.diff(column[by_height], prepend=-1))
    lasts = np.append(firsts[1:], n) - 1
    return np.unique(np.concatenate(([0, n - 1], by_height[firsts], by_height[lasts])))


def line_chart(
    name: str,
    title: str,
    description: str,
    curves: Sequence[Curve],
    x: Axis,
    y: Axis,
    *,
    points: bool = False,
    listed: bool = False,
    marks: Sequence[Marks] = (),
    level: float | None = None,
) -> Markup:
    """A chart with its labels, to be put into a page.

    Parameters
    ----------
    name : str
        Of the chart among all of the page: letters, digits and hyphens.
    title, description : str
        What a screen reader says. Neither is seen.
    curves : sequence of Curve
        Points that are not finite, or not above 0 on a log axis, are left out.
    x, y : Axis
    points : bool
        Whether each point gets a dot, and each curve its label at its end; for few points.
    listed : bool
        Whether the labels stand in one list beside the plot all the same, for curves that end here and there. Where
        there are no dots they always do.
    marks : sequence of Marks
        Each in a row of its own, the first on the axis.
    level : float, optional
        A value of y that gets a line across.
    """
    curves = [_drawable(curve, x, y) for curve in curves]
    named = [curve for curve in curves if not curve.dashed]
    drawing = element(
        "svg",
        element("title", title, id=f"{name}-title"),
        element("desc", description, id=f"{name}-desc"),
        _grid(x, y),
        _stretched(curves, x, y, [_marks(some, x, row) for row, some in enumerate(marks)], level),
        [_dots(curve, x, y) for curve in curves] if points else None,
        _labels_at_ends(named, y) if points and not listed else _labels_in_list(named),
        xmlns="http://www.w3.org/2000/svg",
        class_="chart",
        width="100%",
        height=HEIGHT,
        role="img",
        tabindex=0,
        aria_labelledby=f"{name}-title {name}-desc",
        data_x=_described(x),
        data_y=_described(y),
    )
    longest = max((len(label) for curve in named for label in curve.labels), default=0)
    return element("div", drawing, _legend(named), class_="plot", style=f"--gutter:{34 + 6.3 * longest:.0f}px")


def _drawable(curve: Curve, x: Axis, y: Axis) -> Curve:
    kept = np.isfinite(curve.x) & np.isfinite(curve.y)
    for axis, values in ((x, curve.x), (y, curve.y)):
        if axis.log:
            kept &= values > 0.0
    return replace(curve, x=curve.x[kept], y=curve.y[kept])


def _described(axis: Axis) -> str:
    return f"{float(axis.low)!r} {float(axis.high)!r} {'log' if axis.log else 'linear'} {axis.unit}"


def _grid(x: Axis, y: Axis) -> Markup:
    parts: list[Markup] = []
    for axis, most in ((x, 8), (y, 5)):
        ticks = axis.ticks
        if ticks is None:
            ticks = log_ticks(axis.low, axis.high) if axis.log else nice_ticks(axis.low, axis.high, most)
        for share, label in zip(axis.share(np.array(ticks)), _tick_labels(ticks, axis.log), strict=True):
            if axis is x:
                at = f"{share * 100:.2f}%"
                parts.append(element("line", x1=at, x2=at, y1=0, y2=HEIGHT))
                parts.append(element("text", label, x=at, y=HEIGHT + 17, text_anchor="middle"))
            else:
                at = f"{(1.0 - share) * HEIGHT:.1f}"
                parts.append(element("line", x1=0, x2="100%", y1=at, y2=at))
                parts.append(element("text", label, x=-8, y=at, dy=".32em", text_anchor="end"))
    parts.append(element("text", x.title, class_="axis", x="100%", y=HEIGHT + 35, text_anchor="end"))
    parts.append(element("text", y.title, class_="axis", x=0, y=-12))
    return element("g", parts, class_="grid", aria_hidden="true")


def _tick_labels(ticks: Sequence[float], log: bool) -> list[str]:
    if log or len(ticks) < 2:
        return [f"{tick:.3g}" for tick in ticks]
    return [f"{tick:.10g}" for tick in np.round(ticks, 12)]


def _stretched(curves: list[Curve], x: Axis, y: Axis, marks: list[Markup], level: float | None) -> Markup:
    levels = None
    if level is not None:
        at = round((1.0 - float(y.share(np.array(level)))) * GRID_Y)
        levels = element("path", d=f"M0 {at}h{GRID_X}", class_="level")
    return element(
        "svg",
        levels,
        marks,
        [
            element(
                "path",
                element("title", " = ".join(curve.labels)),
                d=_path(x.share(curve.x), y.share(curve.y)),
                class_="curve dashed" if curve.dashed else "curve",
                style=f"--colour:{curve.colour}",
                stroke=curve.colour,
                fill="none",
            )
            for curve in curves
        ],
        viewBox=f"0 0 {GRID_X} {GRID_Y}",
        width="100%",
        height=HEIGHT,
        preserveAspectRatio="none",
    )


def _path(along: np.ndarray, up: np.ndarray) -> str:
    """A path through points given as shares of the plot, in whole numbers: the first as it is, then the steps."""
    if not len(along):
        return ""
    kept = thin(along, up)
    points = np.stack((along[kept] * GRID_X, (1.0 - up[kept]) * GRID_Y), axis=-1).round().astype(int)
    steps = np.diff(points, axis=0)
    return f"M{points[0, 0]} {points[0, 1]}" + (
        "l" + " ".join(f"{right} {down}" for right, down in steps.tolist()) if len(steps) else ""
    )


def _marks(marks: Marks, x: Axis, row: int) -> Markup:
    # Those that would fall on one another are drawn once.
    at = np.unique((x.share(marks.x) * COLUMNS).round()) * (GRID_X // COLUMNS)
    foot = GRID_Y - row * (STROKE + STROKE_GAP)
    return element(
        "path",
        d="".join(f"M{value:.0f} {foot}v-{STROKE}" for value in at),
        class_="marks" if marks.colour is None else "marks coloured",
        style=None if marks.colour is None else f"--colour:{marks.colour}",
    )


def _dots(curve: Curve, x: Axis, y: Axis) -> Markup:
    return element(
        "g",
        [
            element("circle", cx=f"{along * 100:.2f}%", cy=f"{(1.0 - up) * HEIGHT:.1f}", r=3.5)
            for along, up in zip(x.share(curve.x), y.share(curve.y), strict=True)
        ],
        class_="dots hollow" if curve.dashed else "dots",
        style=f"--colour:{curve.colour}",
        fill=curve.colour,
    )


def _labels_at_ends(curves: list[Curve], y: Axis) -> Markup:
    """Labels to the right of the plot, each as close to its curve's end as the others let it be."""
    curves = sorted((curve for curve in curves if len(curve.x)), key=lambda curve: -curve.y[-1])
    heights = np.array([len(curve.labels) * LINE_OF_TEXT + 6.0 for curve in curves])
    ends = np.array([float(1.0 - y.share(curve.y[-1])) * HEIGHT for curve in curves])
    return element(
        "svg",
        [
            [_leader(curve, f"M6 {end:.1f}L18 {middle:.1f}"), _label(curve, 23, middle)]
            for curve, end, middle in zip(curves, ends, _apart(ends, heights), strict=True)
        ],
        x="100%",
        overflow="visible",
        class_="labels",
        aria_hidden="true",
    )


def _leader(curve: Curve, d: str) -> Markup:
    """The line in the curve's colour that leads to its label."""
    return element("path", d=d, class_="leader", style=f"--colour:{curve.colour}", stroke=curve.colour)


def _labels_in_list(curves: list[Curve]) -> Markup:
    heights = np.array([len(curve.labels) * LINE_OF_TEXT + 8.0 for curve in curves])
    middles = np.cumsum(heights) - heights / 2.0
    return element(
        "svg",
        [
            [_leader(curve, f"M8 {middle:.1f}h14"), _label(curve, 27, middle)]
            for curve, middle in zip(curves, middles, strict=True)
        ],
        x="100%",
        overflow="visible",
        class_="labels",
        aria_hidden="true",
    )


def _label(curve: Curve, left: float, middle: float) -> Markup:
    first = middle - (len(curve.labels) - 1) * LINE_OF_TEXT / 2.0
    return element(
        "text",
        [
            element("tspan", label, x=left, y=f"{first + line * LINE_OF_TEXT:.1f}", dy=".32em")
            for line, label in enumerate(curve.labels)
        ],
    )


def _apart(wanted: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Middles of labels of these heights, as near to the wanted ones as they can be without overlap.

    `wanted` is rising. Labels that would overlap form a block around the mean of what they want; a block that grows
    into the next takes it in.
    """
    blocks: list[list[int]] = []

    def top_of(block: list[int]) -> float:
        return float(np.mean(wanted[block]) - heights[block].sum() / 2.0)

    for label in range(len(wanted)):
        blocks.append([label])
        while len(blocks) > 1 and top_of(blocks[-2]) + heights[blocks[-2]].sum() > top_of(blocks[-1]):
            last = blocks.pop()
            blocks[-1] += last
    middles = np.empty(len(wanted))
    for block in blocks:
        middles[block] = top_of(block) + np.cumsum(heights[block]) - heights[block] / 2.0
    return middles


def _legend(curves: list[Curve]) -> Markup:
    """The labels once more, below the plot, for pages too narrow to have them beside it."""
    return element(
        "ul",
        [
            element("li", element("i", class_="swatch", style=f"--colour:{curve.colour}"), " = ".join(curve.labels))
            for curve in curves
        ],
        class_="legend",
    )
