from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rigid_motion_batch.comparison.report.charts import (
    GRID_X,
    GRID_Y,
    HEIGHT,
    Axis,
    Curve,
    Marks,
    axis_over,
    line_chart,
    log_ticks,
    nice_ticks,
    thin,
    with_rows_below,
)

SVG = "{http://www.w3.org/2000/svg}"
TIME = Axis("time", "s", 0.0, 10.0)
ERROR = Axis("error", "mm", 0.0, 5.0)


def draw(curves: list[Curve], x: Axis = TIME, y: Axis = ERROR, **options: object) -> ElementTree.Element:
    """The chart as a tree: it has to be well-formed XML for that."""
    return ElementTree.fromstring(line_chart("c", "A title", "What it is", curves, x, y, **options))


def curve(*labels: str, x: object = (0.0, 5.0, 10.0), y: object = (1.0, 4.0, 2.0)) -> Curve:
    return Curve(labels or ("a",), np.array(x, dtype=float), np.array(y, dtype=float), "#123456")


def drawn_points(chart: ElementTree.Element) -> list[np.ndarray]:
    """The points of every curve, read from its path as the page's script does."""
    paths = [path.get("d", "") for path in chart.iter(f"{SVG}path") if path.get("class") == "curve"]
    return [np.cumsum(np.array(re.findall(r"-?\d+", path), dtype=int).reshape(-1, 2), axis=0) for path in paths]


def values_back(chart: ElementTree.Element) -> np.ndarray:
    """The first curve's values, read back through the axes that the chart describes."""
    root = next(svg for svg in chart.iter(f"{SVG}svg") if svg.get("class") == "chart")
    values = []
    for name, share in zip(("data-x", "data-y"), (drawn_points(chart)[0] / (GRID_X, GRID_Y)).T, strict=True):
        low, high, kind, _ = root.get(name, "").split(" ")
        share = 1.0 - share if name == "data-y" else share
        low, high = float(low), float(high)
        values.append(low * (high / low) ** share if kind == "log" else low + share * (high - low))
    return np.array(values)


@pytest.mark.parametrize("log", [False, True])
def test_a_reader_gets_back_the_values_that_were_drawn(log: bool) -> None:
    errors = np.array([0.2, 40.0, 3.0])
    chart = draw([curve(y=errors)], y=axis_over("error", "mm", errors, log=log))
    x, y = values_back(chart)
    np.testing.assert_allclose(x, (0.0, 5.0, 10.0))
    np.testing.assert_allclose(y, errors, rtol=0.002, atol=0.02)


def test_the_title_description_units_and_labels_are_in_the_chart() -> None:
    words = "".join(draw([curve("one", "other")]).itertext())
    for word in ("A title", "What it is", "time (s)", "error (mm)", "one = other"):
        assert word in words


def test_a_screen_reader_finds_the_name_of_the_chart() -> None:
    chart = draw([curve()])
    names = {node.get("id") for node in chart.iter()}
    (svg,) = (node for node in chart.iter() if node.get("role") == "img")
    assert set(svg.get("aria-labelledby", "").split()) <= names


def test_labels_are_text_whatever_they_hold() -> None:
    chart = draw([curve("<script>alert(1)</script>")])
    assert not list(chart.iter("script"))
    assert not list(chart.iter(f"{SVG}script"))
    assert "<script>alert(1)</script>" in "".join(chart.itertext())


def test_what_a_log_axis_cannot_show_is_left_out() -> None:
    errors = np.array([0.0, np.nan, 3.0])
    (points,) = drawn_points(draw([curve(y=errors)], y=axis_over("error", "mm", errors, log=True)))
    assert points[:, 0].tolist() == [GRID_X]


def test_a_curve_without_a_point_to_draw_is_no_reason_to_fail() -> None:
    nothing = curve(y=(0.0, 0.0, 0.0))
    draw([nothing], y=axis_over("error", "mm", nothing.y, log=True), points=True)


def test_a_long_curve_keeps_its_peaks_and_the_chart_stays_small() -> None:
    x = np.linspace(0.0, 10.0, 200_001)
    y = 1.0 + np.abs(np.sin(x * 40.0))
    y[123_457], y[77] = 5.0, 0.0
    chart = line_chart("c", "t", "d", [curve(x=x, y=y)], TIME, ERROR)
    assert len(chart) < 20_000
    (points,) = drawn_points(ElementTree.fromstring(chart))
    assert points[:, 1].min() == 0
    assert points[:, 1].max() == GRID_Y


@given(
    st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=400),
    st.integers(1, 50),
    st.integers(0, 2**32 - 1),
)
def test_thinning_keeps_the_ends_and_the_extremes_in_their_order(values: list[float], columns: int, seed: int) -> None:
    y = np.array(values)
    x = np.cumsum(np.random.default_rng(seed).uniform(0.1, 2.0, len(y)))
    kept = thin(x, y, columns)
    assert np.all(np.diff(kept) > 0)
    assert (kept[0], kept[-1]) == (0, len(y) - 1)
    assert y[kept].max() == y.max()
    assert y[kept].min() == y.min()
    assert len(kept) <= 2 * columns + 2


def test_keys_are_marked_on_the_axis_once_for_every_place() -> None:
    chart = draw([curve()], marks=[Marks(np.array([0.0, 2.5, 2.5001, 10.0]))])
    (marks,) = (path.get("d", "") for path in chart.iter(f"{SVG}path") if path.get("class") == "marks")
    assert [int(place) for place in re.findall(r"M(\d+)", marks)] == [0, GRID_X // 4, GRID_X]


def test_labels_at_the_ends_do_not_overlap_and_stand_in_the_order_of_the_curves() -> None:
    curves = [curve(label, y=(1.0, 1.0, end)) for label, end in (("low", 1.0), ("high", 1.02), ("middle", 1.01))]
    chart = draw(curves, points=True)
    (labels,) = (svg for svg in chart.iter(f"{SVG}svg") if svg.get("class") == "labels")
    at = {span.text: float(span.get("y", "")) for span in labels.iter(f"{SVG}tspan")}
    assert at["high"] + 15 <= at["middle"]
    assert at["middle"] + 15 <= at["low"]
    assert 0 < at["middle"] < HEIGHT


# An axis far off that is 1e12 times shorter than its distance from 0 has no doubles left to put ticks on.
@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_ticks_are_round_and_within_the_axis(spans: float, span: float) -> None:
    low = spans * span
    ticks = nice_ticks(low, low + span)
    assert 1 <= len(ticks) <= 7
    assert ticks[0] >= low - 1e-6 * span
    assert ticks[-1] <= low + span * (1 + 1e-6)
    if len(ticks) > 1:
        step = ticks[1] - ticks[0]
        assert f"{step:.1e}"[0] in "125"


@given(st.floats(-6.0, 6.0), st.floats(0.5, 9.0))
def test_log_ticks_are_few_and_within_the_axis(power: float, powers: float) -> None:
    low, high = 10.0**power, 10.0 ** (power + powers)
    ticks = log_ticks(low, high)
    assert 1 <= len(ticks) <= 7
    assert ticks[0] >= low * 0.99
    assert ticks[-1] <= high * 1.01
    assert np.all(np.diff(ticks) > 0.0)


def test_numbers_on_the_axis_say_what_they_are_at() -> None:
    chart = draw([curve()], y=Axis("error", "mm", 0.0, 0.3))
    texts = [node.text for node in chart.iter(f"{SVG}text") if node.get("class") != "axis" and node.text]
    assert "0.1" in texts
    assert not [text for text in texts if len(text) > 6]


@pytest.mark.parametrize("values", [[], [np.nan], [0.0, 0.0], [3.0, 3.0], [-1.0, -1.0], [1e-12, 1e12]])
@pytest.mark.parametrize("log", [False, True])
def test_an_axis_has_room_for_whatever_comes(values: list[float], log: bool) -> None:
    axis = axis_over("error", "mm", np.array(values), log=log)
    assert np.isfinite((axis.low, axis.high)).all()
    assert axis.low < axis.high
    for value in values:
        if np.isfinite(value) and (value > 0.0 or not log):
            assert axis.low <= value <= axis.high


def test_marks_of_several_kinds_stand_in_rows_below_the_curves_in_their_colours() -> None:
    axis = with_rows_below(axis_over("error", "mm", np.array([0.0, 4.0])), 2)
    chart = draw(
        [curve(y=(0.0, 4.0, 0.0))], y=axis, marks=[Marks(np.array([0.0]), "#111111"), Marks(np.array([5.0]), "#222222")]
    )
    rows = [path for path in chart.iter(f"{SVG}path") if "marks" in path.get("class", "")]
    spans = [[int(number) for number in re.fullmatch(r"M\d+ (\d+)v-(\d+)", row.get("d", "")).groups()] for row in rows]
    (first, height), (second, _) = spans
    assert [row.get("style") for row in rows] == ["--colour:#111111", "--colour:#222222"]
    assert second < first - height
    assert drawn_points(chart)[0][:, 1].max() < second - height
    assert "-" not in "".join(node.text or "" for node in chart.iter(f"{SVG}text"))


def test_a_dashed_curve_is_drawn_and_named_to_pointers_but_has_no_label_of_its_own() -> None:
    companion = replace(curve("a, evenly"), dashed=True)
    chart = draw([curve("a"), companion], points=True, listed=True)
    assert [path.get("class") for path in chart.iter(f"{SVG}path") if "curve" in path.get("class", "")] == [
        "curve",
        "curve dashed",
    ]
    assert [span.text for span in chart.iter(f"{SVG}tspan")] == ["a"]
    assert "a, evenly" in [title.text for title in chart.iter(f"{SVG}title")]
    assert len([dots for dots in chart.iter(f"{SVG}g") if "dots" in dots.get("class", "")]) == 2
