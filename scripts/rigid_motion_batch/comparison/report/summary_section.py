"""The report's section on all clips together: what the numbers say, in sentences, tables and charts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigid_motion_batch.analysis.choices import Budget, Tolerance, Uniform

from .charts import Axis, line_chart
from .elements import curve, heading, is_best, label, mode_cell, number_cell, rate_axis, table
from .findings import Summary, findings, listed
from .markup import Content, Markup, element

HEADINGS = {
    Uniform: "Keys evenly spaced",
    Budget: "As many keys, placed where the motion needs them",
    Tolerance: "The fewest keys within a tolerance",
}
"""Of the parts of the summary, where there are several kinds of choices."""


def summary_section(summaries: Sequence[Summary]) -> Markup:
    """What the numbers say over all clips."""
    content: list[Content] = [element("h2", "Summary")]
    for number, summary in enumerate(summaries, start=1):
        if len(summaries) > 1:
            content.append(element("h3", HEADINGS[summary.kind]))
        content += _summarised(summary, "summary-chart" if number == 1 else f"summary-chart-{number}")
    return element("section", content, id="summary")


def _summarised(summary: Summary, chart: str) -> list[Content]:
    reference = label(summary.reference)
    said = findings(summary, {mode: label(mode) for mode in summary.modes})
    content: list[Content] = []
    if said:
        content.append(element("ul", [element("li", sentence) for sentence in said], class_="findings"))
    if np.isfinite(summary.relative).any() and len(summary.modes) > 1:
        mean = f", geometric mean over the {len(summary.clips)} clips" if len(summary.clips) > 1 else ""
        measure = "Number of keys" if summary.kind is Tolerance else "RMS shell error"
        where = "within the same tolerance" if summary.kind is Tolerance else "at the same rate"
        meaning = "the same number" if summary.kind is Tolerance else "the same error"
        content += [
            element("h3", f"{summary.what.capitalize()} relative to {reference}"),
            element(
                "p",
                f"{measure} as a multiple of that of {reference} {where}{mean}: 1.00 means {meaning}, lower is better.",
                class_="note",
            ),
            element(
                "div",
                _relative_table(summary),
                _relative_chart(summary, chart) if len(summary.choices) > 1 and summary.kind is not Tolerance else None,
                class_="pair",
            ),
        ]
    return content


def _relative_table(summary: Summary) -> Markup:
    unit = "" if summary.kind is Tolerance else "/s"
    head = [heading("Mode", "text"), *(heading(amount, "number", unit) for amount in summary.amounts)]
    best = np.nanmin(np.where(np.isfinite(summary.relative), summary.relative, np.inf), axis=1)
    body = []
    for column, mode in enumerate(summary.modes):
        cells = [
            number_cell(ratio, f"{ratio:.2f}", best=is_best(ratio, best[row]), tint=ratio)
            for row, ratio in enumerate(summary.relative[:, column])
        ]
        body.append(element("tr", mode_cell(mode), cells))
    by = "tolerance" if summary.kind is Tolerance else "keys per second"
    return table(f"{summary.what.capitalize()} relative to {label(summary.reference)}, by mode and {by}", head, body)


def _relative_chart(summary: Summary, name: str) -> Markup:
    rates = np.array([choice.size for choice in summary.choices])
    curves = [curve(group, rates, summary.relative[:, summary.modes.index(group[0])]) for group in summary.groups]
    shown = summary.relative[np.isfinite(summary.relative)]
    half = max(float(np.abs(shown - 1.0).max()) * 1.15, 0.05)
    y = Axis("error relative to " + label(summary.reference), "", min(1.0 - half, shown.min()), 1.0 + half)
    return line_chart(
        name,
        "Relative error over rate",
        "One line for each mode; below 1 the mode is closer to the recording than the reference.",
        curves,
        rate_axis(rates),
        y,
        points=True,
        level=1.0,
    )


def lead(summaries: Sequence[Summary]) -> Markup:
    """What was done, in a sentence."""
    clips, modes = len(summaries[0].clips), len(summaries[0].modes)
    return element(
        "p",
        f"{'One recorded clip was' if clips == 1 else f'{clips} recorded clips were each'} reduced to "
        f"{', and to '.join(map(_kept, summaries))}. Then {'one mode' if modes == 1 else f'{modes} modes'} of "
        "interpolation computed the in-betweens again. This report shows how far they are from what was recorded.",
        class_="lead",
    )


def _kept(summary: Summary) -> str:
    """The keys that are kept, in a sentence."""
    if summary.kind is Tolerance:
        return f"the fewest keys with which a mode stays within {listed(summary.amounts)} everywhere"
    where = " on average, placed where a mode needs them," if summary.kind is Budget else ""
    return f"{listed(summary.amounts)} keys a second{where}"
