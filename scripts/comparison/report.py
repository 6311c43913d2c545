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

from .charts import Axis, Curve, axis_over, line_chart
from .clips import Reconstruction
from .files import replacing
from .findings import Summary, findings, identical_modes, listed, summarise
from .markup import Content, Markup, element, join
from .metrics import Metrics, measure_reconstruction
from .palette import colour_of

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


def write_report(
    path: Path,
    reconstructions: Sequence[Reconstruction],
    *,
    films: Mapping[tuple[str, str], Path],
    settings: Settings,
) -> None:
    """Write the report of a run.

    Parameters
    ----------
    path : Path
        Of the page.
    reconstructions : sequence of Reconstruction
        Those of one clip follow one another. At least one.
    films : mapping
        (clip name, rate) to its video, for those that there are. Files that do not exist count as missing. Links to
        them are relative to the page's folder. Where it is empty, the report does not speak of videos.
    settings : Settings

    Raises
    ------
    ValueError
        Where there is nothing to report.
    """
    if not reconstructions:
        raise ValueError("no reconstruction to report: every clip is shorter than two keys at every rate")
    page = _page(path, reconstructions, films, settings)
    before, after = page.split(FILMS_GO_HERE)
    with replacing(path) as stream:
        stream.write(before)
        for (clip, rate), film in films.items():
            if film.is_file():
                _write_film(stream, _name_of(reconstructions, clip, rate), film)
        stream.write(after)


def _page(
    path: Path,
    reconstructions: Sequence[Reconstruction],
    films: Mapping[tuple[str, str], Path],
    settings: Settings,
) -> str:
    rows = {id(reconstruction): measure_reconstruction(reconstruction) for reconstruction in reconstructions}
    groups = identical_modes(reconstructions)
    summary = summarise([row for some in rows.values() for row in some], groups)
    by_clip = [list(of_clip) for _, of_clip in groupby(reconstructions, key=lambda one: one.clip.name)]
    clips = [
        _clip_section(number, of_clip, [rows[id(one)] for one in of_clip], films, path.parent)
        for number, of_clip in enumerate(by_clip, start=1)
    ]
    script = (PAGE / "page.js").read_text(encoding="utf-8")
    return Template((PAGE / "page.html").read_text(encoding="utf-8")).substitute(
        script=script,
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        style=(PAGE / "page.css").read_text(encoding="utf-8"),
        lead=_lead(summary),
        date=element("time", f"{settings.date:%d %B %Y, %H:%M}", datetime=settings.date.isoformat(timespec="minutes")),
        program=element("span", settings.program),
        navigation=join(_navigation(by_clip)),
        summary=_summary_section(summary),
        modes=_modes_section(summary, settings),
        clips=join(clips),
        settings=_settings_section(summary, settings),
    )


def _lead(summary: Summary) -> Markup:
    clips, rates, modes = len(summary.clips), summary.rates, len(summary.modes)
    return element(
        "p",
        f"{'One recorded clip' if clips == 1 else f'{clips} recorded clips, each'} thinned to {listed(rates)} "
        f"keys a second and filled in again by {'one mode' if modes == 1 else f'{modes} modes'} of interpolation: how "
        f"far is the in-between motion from what was recorded?",
        class_="lead",
    )


def _navigation(by_clip: list[list[Reconstruction]]) -> list[Markup]:
    places = [("summary", "Summary"), ("modes", "Modes and measures")]
    places += [(f"clip-{number}", of_clip[0].clip.name) for number, of_clip in enumerate(by_clip, start=1)]
    places += [("settings", "This run")]
    return [element("li", element("a", title, href=f"#{place}")) for place, title in places]


# -- summary ----------------------------------------------------------------------------------------------------------


def _summary_section(summary: Summary) -> Markup:
    reference = _label(summary.reference)
    said = findings(summary, {mode: _label(mode) for mode in summary.modes})
    content: list[Content] = [element("h2", "Summary")]
    if said:
        content.append(element("ul", [element("li", sentence) for sentence in said], class_="findings"))
    if np.isfinite(summary.relative).any() and len(summary.modes) > 1:
        mean = f", geometric mean over the {len(summary.clips)} clips" if len(summary.clips) > 1 else ""
        content += [
            element("h3", f"Error relative to {reference}"),
            element(
                "p",
                f"RMS shell error as a multiple of that of {reference} at the same rate{mean}: 1.00 "
                "is as far off, lower is better.",
                class_="note",
            ),
            element(
                "div",
                _relative_table(summary),
                _relative_chart(summary) if len(summary.rates) > 1 else None,
                class_="pair",
            ),
        ]
    return element("section", content, id="summary")


def _relative_table(summary: Summary) -> Markup:
    head = [_heading("Mode", "text"), *(_heading(rate, "number", "/s") for rate in summary.rates)]
    best = np.nanmin(np.where(np.isfinite(summary.relative), summary.relative, np.inf), axis=1)
    body = []
    for column, mode in enumerate(summary.modes):
        cells = [
            _number_cell(ratio, f"{ratio:.2f}", best=_is_best(ratio, best[row]), tint=ratio)
            for row, ratio in enumerate(summary.relative[:, column])
        ]
        body.append(element("tr", _mode_cell(mode), cells))
    return _table(f"Error relative to {_label(summary.reference)}, by mode and keys per second", head, body)


def _relative_chart(summary: Summary) -> Markup:
    rates = np.array([float(rate) for rate in summary.rates])
    curves = [_curve(group, rates, summary.relative[:, summary.modes.index(group[0])]) for group in summary.groups]
    shown = summary.relative[np.isfinite(summary.relative)]
    half = max(float(np.abs(shown - 1.0).max()) * 1.15, 0.05)
    y = Axis("error relative to " + _label(summary.reference), "", min(1.0 - half, shown.min()), 1.0 + half)
    return line_chart(
        "summary-chart",
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
            element("dt", _swatch(mode), _label(mode), " ", element("code", mode)),
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
        ("Bytes/s", "Of the keys that were kept: seven double-precision numbers, 56 bytes, for a key."),
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
) -> Markup:
    clip = reconstructions[0].clip
    name = f"clip-{number}"
    duration = float(clip.times[-1] - clip.times[0])
    rate = (len(clip.times) - 1) / duration
    rates = [element("a", one.rate, href=f"#{name}-rate-{place}") for place, one in enumerate(reconstructions, 1)]
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
            element("p", "Go to ", rates, " keys/s", class_="jumps"),
        ),
        element(
            "div",
            element(
                "div",
                element("h3", "Repaired in the recording"),
                element("ul", repairs) if repairs else element("p", "Nothing."),
                class_="repairs",
            ),
            element("div", element("h3", "Error over rate"), _error_over_rate(name, reconstructions, rows))
            if len(rates) > 1
            else None,
            class_="pair",
        ),
        [
            _rate_section(f"{name}-rate-{place}", one, some, films, folder)
            for place, (one, some) in enumerate(zip(reconstructions, rows, strict=True), start=1)
        ],
        id=name,
        class_="clip",
    )


def _error_over_rate(name: str, reconstructions: list[Reconstruction], rows: list[list[Metrics]]) -> Markup:
    order = np.argsort([float(one.rate) for one in reconstructions])
    rates = np.array([float(one.rate) for one in reconstructions])[order]
    errors = {
        row.mode: np.array([next(r.rms_shell_m for r in rows[at] if r.mode == row.mode) for at in order]) * 1e3
        for row in rows[0]
    }
    return line_chart(
        f"{name}-chart",
        "Error over rate",
        "RMS shell error of each mode at each rate of keys.",
        [_curve(group, rates, errors[group[0]]) for group in identical_modes(reconstructions)],
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
    row = rows[0]
    charts = _errors_over_time(name, reconstruction)
    if films:
        film = films.get((reconstruction.clip.name, reconstruction.rate))
        charts = [_film(name, film, folder), element("div", charts)]
    return element(
        "section",
        element("h3", f"{reconstruction.rate} keys/s"),
        element(
            "p",
            f"{row.keys} keys in {row.duration_s:.2f} s, {row.bytes_per_s:.0f} bytes/s; "
            f"compared at {row.samples} samples",
            class_="note",
        ),
        element("div", charts, class_="pair"),
        _numbers(f"{reconstruction.clip.name} at {reconstruction.rate} keys/s", rows),
        id=name,
        class_="rate",
    )


def _film(name: str, film: Path | None, folder: Path) -> Markup:
    if film is None or not film.is_file():
        return element("p", "There is no video for this rate.", class_="film note")
    link = quote(Path(os.path.relpath(film, folder)).as_posix())
    return element(
        "div",
        element("p", element("a", "Video file", href=link), class_="note"),
        class_="film",
        data_film=f"{name}-film",
    )


def _errors_over_time(name: str, reconstruction: Reconstruction) -> list[Markup]:
    """The shell errors over the whole clip and, where that is too much to make out, over the segments at the worst."""
    times, keys = reconstruction.times - reconstruction.times[0], reconstruction.keys - reconstruction.keys[0]
    errors = {mode: some.shell * 1e3 for mode, some in reconstruction.errors.items()}
    groups = identical_modes([reconstruction])

    def chart(suffix: str, title: str, samples: slice) -> Markup:
        shown = {mode: some[samples] for mode, some in errors.items()}
        seconds = times[samples]
        # The larger errors behind, or they would cover the smaller ones.
        ordered = sorted(groups, key=lambda group: -shown[group[0]].mean())
        return element(
            "figure",
            line_chart(
                f"{name}-{suffix}",
                title,
                "Shell error of each mode over time; strokes on the time axis mark the keys.",
                [_curve(group, seconds, shown[group[0]]) for group in ordered],
                Axis("time since the first key", "s", float(seconds[0]), float(seconds[-1])),
                axis_over("shell error", "mm", np.concatenate(list(shown.values()))),
                marks=times[keys[(keys >= samples.start) & (keys < samples.stop)]],
            ),
            element("figcaption", title),
        )

    whole = chart("time", "Error over time, keys marked", slice(0, len(times)))
    if len(keys) <= 2 * CLOSE_UP_SEGMENTS:
        return [whole]
    worst = int(np.max(np.stack(list(errors.values())), axis=0).argmax())
    first = int(np.clip(np.searchsorted(keys, worst) - CLOSE_UP_SEGMENTS // 2, 0, len(keys) - 1 - CLOSE_UP_SEGMENTS))
    close = slice(int(keys[first]), int(keys[first + CLOSE_UP_SEGMENTS]) + 1)
    return [whole, chart("close", f"The {CLOSE_UP_SEGMENTS} segments around the largest error", close)]


def _numbers(caption: str, rows: list[Metrics]) -> Markup:
    head = [_heading("Mode", "text"), *(_heading(column.title, "number", column.unit) for column in COLUMNS)]
    best = {column.metric: min(getattr(row, column.metric) for row in rows) for column in COLUMNS}
    body = [
        element(
            "tr",
            _mode_cell(row.mode),
            [
                _number_cell(
                    value := getattr(row, column.metric),
                    _rounded(value * column.factor),
                    best=len(rows) > 1 and _is_best(value, best[column.metric]),
                )
                for column in COLUMNS
            ],
        )
        for row in rows
    ]
    return _table(caption, head, body)


# -- this run ---------------------------------------------------------------------------------------------------------


def _settings_section(summary: Summary, settings: Settings) -> Markup:
    facts: list[tuple[str, Content]] = [
        ("Program", settings.program),
        ("Blender", settings.blender),
        ("Rates", f"{listed(summary.rates)} keys/s"),
        ("Modes", [[element("code", mode), " "] for mode in summary.modes]),
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
            "the folders of the clips and rates.",
            class_="note",
        ),
        id="settings",
    )


# -- parts ------------------------------------------------------------------------------------------------------------


def _label(mode: str) -> str:
    return MODES[mode].label


def _curve(group: Sequence[str], x: np.ndarray, y: np.ndarray) -> Curve:
    return Curve(tuple(map(_label, group)), x, y, colour_of(group[0]))


def _swatch(mode: str) -> Markup:
    return element("i", class_="swatch", style=f"--colour:{colour_of(mode)}")


def _table(caption: str, head: list[Markup], body: list[Markup]) -> Markup:
    table = element(
        "table",
        element("caption", caption),
        element("thead", element("tr", head)),
        element("tbody", body),
        class_="numbers sortable",
    )
    return element("div", table, class_="scroll", role="region", tabindex=0, aria_label=caption)


def _heading(title: str, kind: str, unit: str = "") -> Markup:
    return element(
        "th", element("span", title, element("small", f" {unit}") if unit else None), scope="col", class_=kind
    )


def _mode_cell(mode: str) -> Markup:
    return element("th", _swatch(mode), _label(mode), scope="row", data_value=_label(mode))


def _number_cell(value: float, shown: str, *, best: bool, tint: float | None = None) -> Markup:
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


def _is_best(value: float, best: float) -> bool:
    """Equal to the best but for rounding: identical modes are best together."""
    return bool(value <= best * (1.0 + 1e-6) + 1e-12)


def _rounded(value: float) -> str:
    """Three digits that count, without exponents where a table can do without."""
    if value == 0.0 or abs(value) < 1e-6:
        return "0"
    if abs(value) < 1e-3:
        return f"{value:.1e}"
    return f"{value:.{max(2 - int(np.floor(np.log10(abs(value)))), 0)}f}"


# -- videos -----------------------------------------------------------------------------------------------------------


def _name_of(reconstructions: Sequence[Reconstruction], clip: str, rate: str) -> str:
    clips = list(dict.fromkeys(one.clip.name for one in reconstructions))
    rates = [one.rate for one in reconstructions if one.clip.name == clip]
    return f"clip-{clips.index(clip) + 1}-rate-{rates.index(rate) + 1}-film"


def _write_film(stream: TextIO, name: str, film: Path) -> None:
    """The video as base64, a piece at a time: reports are larger than what one wants in memory."""
    stream.write(f'<script type="text/plain" id="{name}">')
    with film.open("rb") as source:
        while piece := source.read(3 << 18):  # A multiple of 3 bytes has no padding.
            stream.write(base64.b64encode(piece).decode("ascii"))
    stream.write("</script>\n")
