"""The report's section on one clip: what was repaired in it, and for every choice of keys charts, film and numbers."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from urllib.parse import quote

import numpy as np

from rigid_motion_batch.analysis.choices import Tolerance, Uniform
from rigid_motion_batch.analysis.metrics import NOTHING, Metrics
from rigid_motion_batch.analysis.modes import BEST_OF, single_modes
from rigid_motion_batch.analysis.reconstructions import joint_groups
from rigid_motion_batch.comparison.results import ClipResults, Result, SegmentModes

from .charts import axis_over, line_chart
from .elements import curve, heading, is_best, label, mode_cell, number_cell, rate_axis, rounded, table
from .findings import compared, listed
from .markup import Content, Markup, element
from .needed_section import clip_part

Films = Mapping[tuple[str, str], Path | None]
"""(clip name, name of the choice) to its video, which may not be there yet; None where it could not be made."""


@dataclass(frozen=True)
class Column:
    """A column of the tables of numbers."""

    title: str
    unit: str
    metric: str
    """The field of `Metrics`."""

    factor: float
    """From the metric's unit to the column's."""


COLUMNS = (
    Column("Shell RMS", "mm", "rms_shell_m", 1e3),
    Column("Shell 95th percentile", "mm", "p95_shell_m", 1e3),
    Column("Shell largest", "mm", "max_shell_m", 1e3),
    Column("Position RMS", "mm", "rms_position_m", 1e3),
    Column("Rotation RMS", "°", "rms_rotation_deg", 1.0),
    Column("Velocity RMS", "mm/s", "rms_velocity_m_s", 1e3),
)


SLIDE = Column("Feet slide", "mm", "foot_slide_m", 1e3)
"""Of a whole body that stands on the ground."""

KEY_COLUMNS = (Column("Keys", "", "keys", 1.0), Column("Keys", "/s", "keys_per_s", 1.0))
"""Where the modes have different numbers of keys."""


def clip_section(name: str, clip: ClipResults, films: Films, folder: Path, *, with_needed: bool) -> Markup:
    """The section of a clip.

    Parameters
    ----------
    name : str
        Of the section among those of the page: letters, digits and hyphens.
    clip : ClipResults
    films : mapping
        Empty where the run does without videos.
    folder : Path
        Where the page will be: what links are relative to.
    with_needed : bool
        Whether to show the keys that are needed, if it is known.
    """
    facts, results = clip.facts, clip.results
    rate = (facts.samples - 1) / facts.duration
    evenly = [result for result in results if isinstance(result.choice, Uniform)]
    repairs = [element("li", sentence) for sentence in facts.repairs]
    return element(
        "section",
        element(
            "header",
            element("h2", facts.name),
            element(
                "p",
                f"{f'{facts.joints} joints, ' if facts.joints else ''}{facts.duration:.1f} s, {facts.samples} samples "
                f"({rate:.0f} a second), axes {facts.axes}, from ",
                element("code", facts.source),
                class_="note",
            ),
            [element("p", "Go to ", links, class_="jumps") for links in _jumps(name, results)],
        ),
        element(
            "div",
            element(
                "div",
                element("h3", "Repaired in the recording"),
                element("ul", repairs) if repairs else element("p", "Nothing."),
                class_="repairs",
            ),
            element("div", element("h3", "Error over rate"), _error_over_rate(name, evenly))
            if len(evenly) > 1
            else None,
            class_="pair",
        ),
        clip_part(name, clip.needed) if clip.needed and with_needed else None,
        [
            _rate_section(f"{name}-rate-{place}", facts.name, result, films, folder)
            for place, result in enumerate(results, start=1)
        ],
        id=name,
        class_="clip",
    )


def film_name(place: str) -> str:
    """Of the film of a choice of keys, whose place on the page is this."""
    return f"{place}-film"


def _jumps(name: str, results: Sequence[Result]) -> list[list[Content]]:
    """Links to the choices of a clip, those of a kind together."""
    places = {result.choice: f"#{name}-rate-{place}" for place, result in enumerate(results, 1)}
    kinds = groupby(places, key=type)
    return [
        [
            f"{kind.at} " if kind is Tolerance else None,
            [element("a", choice.amount, href=places[choice]) for choice in some],
            kind.unit,
        ]
        for kind, some in kinds
    ]


def _error_over_rate(name: str, results: Sequence[Result]) -> Markup:
    ordered = sorted(results, key=lambda result: result.choice.size)
    rates = np.array([result.choice.size for result in ordered])
    of_mode = [{row.mode: row.rms_shell_m * 1e3 for row in result.rows} for result in ordered]
    errors = {mode: np.array([errors[mode] for errors in of_mode]) for mode in of_mode[0]}
    return line_chart(
        f"{name}-chart",
        "Error over rate",
        "RMS shell error of each mode at each rate of keys.",
        [curve(group, rates, errors[group[0]]) for group in joint_groups(result.groups for result in results)],
        rate_axis(rates),
        axis_over("RMS shell error", "mm", np.concatenate(list(errors.values())), log=True),
        points=True,
    )


def _rate_section(name: str, clip: str, result: Result, films: Films, folder: Path) -> Markup:
    rows, choice = result.rows, result.choice
    charts: list[Content] = [Markup(result.charts())]
    if (clip, choice.name) in films:
        charts = [_film(name, films[clip, choice.name], folder), element("div", charts)]
    own_counts = len({row.keys for row in rows}) > 1
    columns = (*(KEY_COLUMNS if own_counts else ()), *COLUMNS)
    if rows[0].foot_slide_m is not None:
        columns = (*columns, SLIDE)
    poses = f"{rows[0].key_frames} key poses" if rows[0].joints else f"{rows[0].keys} keys"
    counted = "Each mode has keys of its own" if own_counts else poses
    sent = "" if own_counts else f", {rows[0].bytes_per_s:.0f} bytes/s"
    return element(
        "section",
        element("h3", choice.title),
        element(
            "p",
            f"{counted} in {rows[0].duration_s:.2f} s{sent}; compared at {rows[0].samples} samples",
            class_="note",
        ),
        element("div", charts, class_="pair"),
        _numbers(f"{clip} {choice.phrase}", rows, columns),
        element("p", _said_of_body(rows), class_="note") if rows[0].joints else None,
        Markup(result.body()),
        Markup(result.decimated()),
        _best_of(result.segment_modes, rows) if result.segment_modes else None,
        id=name,
        class_="rate",
    )


def _said_of_body(rows: Sequence[Metrics]) -> str:
    """What the numbers of a whole body are of."""
    first = rows[0]
    said = (
        f"Over all {first.joints} joints, where the chain of joints puts them; the largest is that of the worst joint."
    )
    if first.recorded_slide_m is None:
        return said
    return (
        f"{said} Feet slide: the farthest that a joint moves while it stands on the ground; in the recording itself "
        f"{rounded(1e3 * first.recorded_slide_m)} mm."
    )


def _best_of(found: SegmentModes, rows: Sequence[Metrics]) -> Markup:
    """Which modes were best in how many segments, and what came of it."""
    errors = {row.mode: row.rms_shell_m for row in rows}
    modes = [f"{label(mode)} in {found.counts[mode]}" for mode in single_modes(errors) if found.counts.get(mode)]
    segments = sum(found.counts.values())
    gain = ""
    if errors[found.best_single] > NOTHING:
        ratio = errors[BEST_OF] / errors[found.best_single]
        best = label(found.best_single)
        gain = f" Compared with {best}, the best single mode, its RMS shell error is {compared(ratio)}."
    return element(
        "p",
        f"{label(BEST_OF)}: of {segments} segment{'s' * (segments != 1)}, {listed(modes)}; the mode changes at "
        f"{found.changes} key{'s' * (found.changes != 1)}.{gain}",
        class_="note",
    )


def _film(name: str, film: Path | None, folder: Path) -> Markup:
    if film is None:
        return element("p", "The video could not be made.", class_="film note")
    link = quote(Path(os.path.relpath(film, folder)).as_posix())
    if not film.is_file():
        return element(
            "div",
            element("p", "The video is being rendered, and will appear here.", class_="note"),
            class_="film coming",
            data_coming=link,
        )
    return element(
        "div",
        element("p", element("a", "Video file", href=link), class_="note"),
        class_="film",
        data_film=film_name(name),
    )


def _numbers(caption: str, rows: Sequence[Metrics], columns: Sequence[Column]) -> Markup:
    head = [heading("Mode", "text"), *(heading(column.title, "number", column.unit) for column in columns)]
    best = {column.metric: min(getattr(row, column.metric) for row in rows) for column in columns}
    body = [
        element(
            "tr",
            mode_cell(row.mode),
            [
                number_cell(
                    value := getattr(row, column.metric),
                    str(value) if isinstance(value, int) else rounded(value * column.factor),
                    best=len(rows) > 1 and is_best(value, best[column.metric]),
                )
                for column in columns
            ],
        )
        for row in rows
    ]
    return table(caption, head, body)
