"""`report.html`: what a comparison found, on one page that needs nothing beside it and no network.

The page, its style and its script are in `page/`; this module fills them in. Videos follow the page's content as base64
and become Blobs when they are first looked at (Safari plays no `data:` URIs), so that a large report opens at once. A
content security policy forbids every request and every script but the page's own.
"""

from __future__ import annotations

import base64
import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from itertools import groupby
from pathlib import Path
from string import Template
from typing import TextIO
from urllib.parse import quote

import numpy as np

from addon.motion import MODES

from .charts import Axis, Marks, axis_over, line_chart, with_rows_below
from .choices import Budget, Tolerance, Uniform
from .files import replacing
from .findings import Summary, findings, listed, summarise
from .markup import Content, Markup, element, join
from .metrics import Metrics, measure_reconstruction
from .needed import KeysNeeded
from .needed_section import clip_part, keys_section
from .palette import colour_of
from .parts import curve, heading, is_best, label, mode_cell, number_cell, rounded, swatch, table
from .reconstructions import Reconstruction, identical_modes

PAGE = Path(__file__).parent / "page"

CLOSE_UP_SEGMENTS = 12
"""How many segments the close-up of the errors over time shows; curves of more than twice as many get one."""

FILMS_GO_HERE = "<!-- films -->"


@dataclass(frozen=True)
class Settings:
    """What the reader needs to know of a run, beyond the numbers themselves."""

    radius: float
    """Of the shell, in metres."""

    program: str
    """Name and version."""

    blender: str
    """Its version."""

    command: str
    """The command line, as one would type it."""

    date: datetime = field(default_factory=datetime.now)

    details: Mapping[str, str] = field(default_factory=dict)
    """Whatever else is worth a line: what it is, and its value."""


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


KEY_COLUMNS = (Column("Keys", "", "keys", 1.0), Column("Keys", "/s", "keys_per_s", 1.0))
"""Where the modes have different numbers of keys."""


def write_report(
    path: Path,
    reconstructions: Sequence[Reconstruction],
    *,
    films: Mapping[tuple[str, str], Path],
    settings: Settings,
    needed: Sequence[KeysNeeded] = (),
) -> None:
    """Write the report of a run.

    Parameters
    ----------
    path : Path
        Of the page.
    reconstructions : sequence of Reconstruction
        Those of one clip follow one another. At least one.
    films : mapping
        (clip name, name of the choice) to its video, for those that there are. Files that do not exist count as
        missing. Links to them are relative to the page's folder. Where it is empty, the report does not speak of
        videos.
    settings : Settings
    needed : sequence of KeysNeeded
        Of clips that have reconstructions. Where it is empty, the report does not speak of the keys that are needed.

    Raises
    ------
    ValueError
        Where there is nothing to report.
    """
    if not reconstructions:
        raise ValueError("no reconstruction to report: every clip is too short for two keys")
    page = _page(path, reconstructions, films, settings, needed)
    before, after = page.split(FILMS_GO_HERE)
    with replacing(path) as stream:
        stream.write(before)
        for (clip, choice), film in films.items():
            if film.is_file():
                _write_film(stream, _name_of(reconstructions, clip, choice), film)
        stream.write(after)


def _page(
    path: Path,
    reconstructions: Sequence[Reconstruction],
    films: Mapping[tuple[str, str], Path],
    settings: Settings,
    needed: Sequence[KeysNeeded],
) -> str:
    rows = {id(reconstruction): measure_reconstruction(reconstruction) for reconstruction in reconstructions}
    summaries = summarise([(reconstruction, rows[id(reconstruction)]) for reconstruction in reconstructions])
    of_clip = {one.clip: one for one in needed}
    by_clip = [list(some) for _, some in groupby(reconstructions, key=lambda one: one.clip.name)]
    clips = [
        _clip_section(
            number,
            some,
            [rows[id(one)] for one in some],
            films,
            path.parent,
            # A single clip has its keys in the section of all clips.
            of_clip.get(some[0].clip.name) if len(needed) > 1 else None,
        )
        for number, some in enumerate(by_clip, start=1)
    ]
    script = (PAGE / "page.js").read_text(encoding="utf-8")
    return Template((PAGE / "page.html").read_text(encoding="utf-8")).substitute(
        script=script,
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        style=(PAGE / "page.css").read_text(encoding="utf-8"),
        lead=_lead(summaries),
        date=element("time", f"{settings.date:%d %B %Y, %H:%M}", datetime=settings.date.isoformat(timespec="minutes")),
        program=element("span", settings.program),
        navigation=join(_navigation(by_clip, bool(needed))),
        summary=_summary_section(summaries),
        needed=keys_section(needed) if needed else "",
        modes=_modes_section(summaries[0], settings),
        clips=join(clips),
        settings=_settings_section(summaries, settings),
    )


def _lead(summaries: Sequence[Summary]) -> Markup:
    clips, modes = len(summaries[0].clips), len(summaries[0].modes)
    return element(
        "p",
        f"{'One recorded clip' if clips == 1 else f'{clips} recorded clips, each'} thinned to "
        f"{', and to '.join(map(_kept, summaries))} and filled in again by "
        f"{'one mode' if modes == 1 else f'{modes} modes'} of interpolation: how far is the in-between motion from "
        "what was recorded?",
        class_="lead",
    )


def _kept(summary: Summary) -> str:
    """The keys that are kept, in a sentence."""
    if summary.kind is Tolerance:
        return f"the fewest keys that keep a mode within {listed(summary.amounts)} everywhere,"
    where = " on average, wherever a mode needs them," if summary.kind is Budget else ""
    return f"{listed(summary.amounts)} keys a second{where}"


def _navigation(by_clip: list[list[Reconstruction]], needed: bool) -> list[Markup]:
    places = [("summary", "Summary"), *([("needed", "Keys needed")] if needed else []), ("modes", "Modes and measures")]
    places += [(f"clip-{number}", of_clip[0].clip.name) for number, of_clip in enumerate(by_clip, start=1)]
    places += [("settings", "This run")]
    return [element("li", element("a", title, href=f"#{place}")) for place, title in places]


# -- summary ----------------------------------------------------------------------------------------------------------


HEADINGS = {
    Uniform: "Keys evenly spaced",
    Budget: "As many keys, where the motion needs them",
    Tolerance: "As few keys as keep to a tolerance",
}
"""Of the parts of the summary, where there are several kinds of choices."""


def _summary_section(summaries: Sequence[Summary]) -> Markup:
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
        meaning = "as many" if summary.kind is Tolerance else "as far off"
        content += [
            element("h3", f"{summary.what.capitalize()} relative to {reference}"),
            element(
                "p",
                f"{measure} as a multiple of that of {reference} {where}{mean}: 1.00 is {meaning}, lower is better.",
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
        _rate_axis(rates),
        y,
        points=True,
        level=1.0,
    )


def _rate_axis(rates: np.ndarray) -> Axis:
    return Axis("rate", "keys/s", float(rates.min()), float(rates.max()), ticks=tuple(rates))


# -- modes and measures -----------------------------------------------------------------------------------------------


def _modes_section(summary: Summary, settings: Settings) -> Markup:
    modes = [
        element(
            "div",
            element("dt", swatch(mode), label(mode), " ", element("code", mode)),
            element("dd", MODES[mode].description),
        )
        for mode in summary.modes
    ]
    radius = f"{settings.radius * 1e3:g} mm"
    measures = [
        (
            "Shell error",
            f"The largest displacement of the three points {radius} from the body's origin along its axes: "
            "position and rotation together, as the surface of a body of that size shows them.",
        ),
        ("Position, rotation", "The distance of the origin, and the angle of the rotation, from the recorded ones."),
        (
            "Velocity",
            "How much the origin's velocity differs from the recorded one: an in-between that jerks at the "
            "keys shows here first.",
        ),
        (
            "RMS, 95th percentile, largest",
            "Over the recording's own samples between the first and the last key, the keys themselves among them.",
        ),
        (
            "Bytes/s",
            "Of the keys that were kept: seven double-precision numbers, 56 bytes, for a key. Keys that are not evenly "
            "spaced need their times too, which are not counted.",
        ),
    ]
    return element(
        "section",
        element("h2", "Modes and measures"),
        element("dl", modes, class_="cards"),
        element("h3", "How far off is measured as"),
        element(
            "dl",
            [element("div", element("dt", name), element("dd", meaning)) for name, meaning in measures],
            class_="cards",
        ),
        id="modes",
    )


# -- a clip -----------------------------------------------------------------------------------------------------------


def _clip_section(
    number: int,
    reconstructions: list[Reconstruction],
    rows: list[list[Metrics]],
    films: Mapping[tuple[str, str], Path],
    folder: Path,
    needed: KeysNeeded | None,
) -> Markup:
    clip = reconstructions[0].clip
    name = f"clip-{number}"
    duration = float(clip.times[-1] - clip.times[0])
    rate = (len(clip.times) - 1) / duration
    evenly = [place for place, one in enumerate(reconstructions) if isinstance(one.choice, Uniform)]
    repairs = [element("li", sentence) for sentence in clip.repairs]
    return element(
        "section",
        element(
            "header",
            element("h2", clip.name),
            element(
                "p",
                f"{duration:.1f} s, {len(clip.times)} samples ({rate:.0f} a second), axes {clip.axes}, from ",
                element("code", clip.source),
                class_="note",
            ),
            [element("p", "Go to ", links, class_="jumps") for links in _jumps(name, reconstructions)],
        ),
        element(
            "div",
            element(
                "div",
                element("h3", "Repaired in the recording"),
                element("ul", repairs) if repairs else element("p", "Nothing."),
                class_="repairs",
            ),
            element(
                "div",
                element("h3", "Error over rate"),
                _error_over_rate(name, [reconstructions[place] for place in evenly], [rows[place] for place in evenly]),
            )
            if len(evenly) > 1
            else None,
            class_="pair",
        ),
        clip_part(name, needed) if needed else None,
        [
            _rate_section(f"{name}-rate-{place}", one, some, films, folder)
            for place, (one, some) in enumerate(zip(reconstructions, rows, strict=True), start=1)
        ],
        id=name,
        class_="clip",
    )


def _jumps(name: str, reconstructions: list[Reconstruction]) -> list[list[Content]]:
    """Links to the choices of a clip, those of a kind together."""
    places = {one: f"#{name}-rate-{place}" for place, one in enumerate(reconstructions, 1)}
    kinds = groupby(reconstructions, key=lambda one: type(one.choice))
    return [
        [
            f"{kind.at} " if kind is Tolerance else None,
            [element("a", one.choice.amount, href=places[one]) for one in some],
            kind.unit,
        ]
        for kind, some in kinds
    ]


def _error_over_rate(name: str, reconstructions: list[Reconstruction], rows: list[list[Metrics]]) -> Markup:
    rates = np.array([one.choice.size for one in reconstructions])
    order = np.argsort(rates)
    rates = rates[order]
    errors = {
        row.mode: np.array([next(r.rms_shell_m for r in rows[at] if r.mode == row.mode) for at in order]) * 1e3
        for row in rows[0]
    }
    return line_chart(
        f"{name}-chart",
        "Error over rate",
        "RMS shell error of each mode at each rate of keys.",
        [curve(group, rates, errors[group[0]]) for group in identical_modes(reconstructions)],
        _rate_axis(rates),
        axis_over("RMS shell error", "mm", np.concatenate(list(errors.values())), log=True),
        points=True,
    )


def _rate_section(
    name: str,
    reconstruction: Reconstruction,
    rows: list[Metrics],
    films: Mapping[tuple[str, str], Path],
    folder: Path,
) -> Markup:
    row, choice = rows[0], reconstruction.choice
    charts = _errors_over_time(name, reconstruction)
    if films:
        film = films.get((reconstruction.clip.name, choice.name))
        charts = [_film(name, film, folder), element("div", charts)]
    own_counts = len({row.keys for row in rows}) > 1
    counted = "Each mode has keys of its own" if own_counts else f"{row.keys} keys"
    sent = "" if own_counts else f", {row.bytes_per_s:.0f} bytes/s"
    return element(
        "section",
        element("h3", choice.title),
        element(
            "p",
            f"{counted} in {row.duration_s:.2f} s{sent}; compared at {row.samples} samples",
            class_="note",
        ),
        element("div", charts, class_="pair"),
        _numbers(f"{reconstruction.clip.name} {choice.phrase}", rows, KEY_COLUMNS + COLUMNS if own_counts else COLUMNS),
        id=name,
        class_="rate",
    )


def _film(name: str, film: Path | None, folder: Path) -> Markup:
    if film is None or not film.is_file():
        return element("p", "There is no video with these keys.", class_="film note")
    link = quote(Path(os.path.relpath(film, folder)).as_posix())
    return element(
        "div",
        element("p", element("a", "Video file", href=link), class_="note"),
        class_="film",
        data_film=f"{name}-film",
    )


def _errors_over_time(name: str, reconstruction: Reconstruction) -> list[Markup]:
    """The shell errors over the whole clip and, where that is too much to make out, over the segments at the worst."""
    times = reconstruction.times - reconstruction.times[0]
    errors = {mode: some.shell * 1e3 for mode, some in reconstruction.errors.items()}
    groups = identical_modes([reconstruction])
    keys = {mode: kept - reconstruction.samples.start for mode, kept in reconstruction.keys.items()}

    def marks(samples: slice) -> list[Marks]:
        def within(mode: str) -> np.ndarray:
            return times[keys[mode][(keys[mode] >= samples.start) & (keys[mode] < samples.stop)]]

        if reconstruction.choice.decimation == "uniform":
            return [Marks(within(groups[0][0]))]
        return [Marks(within(group[0]), colour_of(group[0])) for group in groups]

    def chart(suffix: str, title: str, samples: slice) -> Markup:
        shown = {mode: some[samples] for mode, some in errors.items()}
        seconds, rows = times[samples], marks(samples)
        errors_axis = axis_over("shell error", "mm", np.concatenate(list(shown.values())))
        # The larger errors behind, or they would cover the smaller ones.
        ordered = sorted(groups, key=lambda group: -shown[group[0]].mean())
        return element(
            "figure",
            line_chart(
                f"{name}-{suffix}",
                title,
                "Shell error of each mode over time; strokes on the time axis mark the keys.",
                [curve(group, seconds, shown[group[0]]) for group in ordered],
                Axis("time since the first key", "s", float(seconds[0]), float(seconds[-1])),
                with_rows_below(errors_axis, len(rows)) if len(rows) > 1 else errors_axis,
                marks=rows,
            ),
            element("figcaption", title),
        )

    whole = chart("time", "Error over time, keys marked", slice(0, len(times)))
    worst_mode = max(errors, key=lambda mode: errors[mode].max())
    own = keys[worst_mode]
    if len(own) <= 2 * CLOSE_UP_SEGMENTS:
        return [whole]
    worst = int(errors[worst_mode].argmax())
    first = int(np.clip(np.searchsorted(own, worst) - CLOSE_UP_SEGMENTS // 2, 0, len(own) - 1 - CLOSE_UP_SEGMENTS))
    close = slice(int(own[first]), int(own[first + CLOSE_UP_SEGMENTS]) + 1)
    return [whole, chart("close", f"The {CLOSE_UP_SEGMENTS} segments around the largest error", close)]


def _numbers(caption: str, rows: list[Metrics], columns: Sequence[Column]) -> Markup:
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


# -- this run ---------------------------------------------------------------------------------------------------------


FACTS = {Uniform: "Rates", Budget: "Budgets of keys", Tolerance: "Tolerances"}


def _settings_section(summaries: Sequence[Summary], settings: Settings) -> Markup:
    facts: list[tuple[str, Content]] = [
        ("Program", settings.program),
        ("Blender", settings.blender),
        *((FACTS[summary.kind], f"{listed(summary.amounts)} {summary.kind.unit}".strip()) for summary in summaries),
        ("Modes", [[element("code", mode), " "] for mode in summaries[0].modes]),
        ("Radius of the shell", f"{settings.radius:g} m"),
        *settings.details.items(),
        ("Command", element("code", settings.command)),
    ]
    return element(
        "section",
        element("h2", "This run"),
        element(
            "dl", [element("div", element("dt", name), element("dd", value)) for name, value in facts], class_="facts"
        ),
        element(
            "p",
            "All numbers, at full precision, are in metrics.csv beside this page; the keys and every in-between are in "
            "the folders of the clips, one for each choice of keys.",
            class_="note",
        ),
        id="settings",
    )


# -- videos -----------------------------------------------------------------------------------------------------------


def _name_of(reconstructions: Sequence[Reconstruction], clip: str, choice: str) -> str:
    clips = list(dict.fromkeys(one.clip.name for one in reconstructions))
    choices = [one.choice.name for one in reconstructions if one.clip.name == clip]
    return f"clip-{clips.index(clip) + 1}-rate-{choices.index(choice) + 1}-film"


def _write_film(stream: TextIO, name: str, film: Path) -> None:
    """The video as base64, a piece at a time: reports are larger than what one wants in memory."""
    stream.write(f'<script type="text/plain" id="{name}">')
    with film.open("rb") as source:
        while piece := source.read(3 << 18):  # A multiple of 3 bytes has no padding.
            stream.write(base64.b64encode(piece).decode("ascii"))
    stream.write("</script>\n")
