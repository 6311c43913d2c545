"""Reports: what a comparison found, as pages that need nothing beside them and no network.

A few clips are one page. Where there are many, each has a page of its own, and one page says what they come to and
leads to them. The page, its style and its script are in `page/`; this module fills them in. Videos follow the page's
content as base64 and become Blobs when they are first looked at (Safari plays no `data:` URIs), so that a large report
opens at once. A content security policy forbids every request and every script but the page's own; while videos are
being rendered, it allows those beside the page.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from string import Template
from typing import TextIO
from urllib.parse import quote

from rigid_motion_batch.analysis.choices import Budget, Choice, Tolerance, Uniform
from rigid_motion_batch.analysis.metrics import NOTHING
from rigid_motion_batch.analysis.modes import REFERENCE, description_of, label_of, single_modes
from rigid_motion_batch.analysis.needed import KeysNeeded
from rigid_motion_batch.analysis.radii import JOINT
from rigid_motion_batch.comparison.results import ClipResults, Result
from rigid_motion_batch.files import replacing

from .clip_section import Films, clip_section, film_name
from .elements import heading, number_cell, rounded, swatch, text_cell
from .findings import Summary, listed, summarise
from .markup import Content, Markup, element, escape, join
from .needed_section import keys_section
from .summary_section import lead, summary_section

PAGE = Path(__file__).parent / "page"

BESIDE_THE_PAGE = "'self' file:"
"""Where a page may take videos from that are not in it: a server's page from that server, a file from other files."""

ON_ONE_PAGE = 24
"""So many clips are one page; more have a page each."""

CLIPS_GO_HERE = "<!-- clips -->"
FILMS_GO_HERE = "<!-- films -->"


@dataclass(frozen=True)
class Settings:
    """What the reader needs to know of a run, beyond the numbers themselves."""

    radius: float
    """Of the shell of a rigid body, in metres."""

    program: str
    """Name and version."""

    blender: str
    """Its version."""

    command: str
    """The command line, as one would type it."""

    date: datetime = field(default_factory=datetime.now)

    joint_radius: float = JOINT
    """Of the shell of a joint, in metres."""

    details: Mapping[str, str] = field(default_factory=dict)
    """Whatever else is worth a line: what it is, and its value."""


def write_report(
    path: Path,
    clips: Iterable[ClipResults],
    *,
    films: Films,
    settings: Settings,
    folder: Path | None = None,
    advance: Callable[[], object] = lambda: None,
) -> None:
    """Write the report of a run on one page.

    Parameters
    ----------
    path : Path
        Of the page.
    clips : iterable of ClipResults
        At least one. They are gone through twice, and only one of them is in memory at a time.
    films : mapping
        (clip name, name of the choice) to its video, None or a file that does not exist where it could not be made.
        Where it is empty, the report does not speak of videos.
    settings : Settings
    folder : Path, optional
        Where the page will be in the end: what links are relative to. That of `path` unless given.
    advance : callable
        Called once for every clip.

    Raises
    ------
    ValueError
        Where there is nothing to report.
    """
    folder = folder or path.parent
    summaries, needed, names = _summed_up(clips)
    # A single clip has its keys in the section of all clips.
    places = [(f"clip-{number}", name) for number, name in enumerate(names, start=1)]

    def sections() -> Iterable[Markup]:
        for (place, _), clip in zip(places, clips, strict=True):
            yield clip_section(place, clip, films, folder, with_needed=len(needed) > 1)
            advance()

    def videos() -> Iterable[tuple[str, Path]]:
        for (place, _), clip in zip(places, clips, strict=True):
            yield from _videos_of(place, clip, films)

    content = {
        "lead": lead(summaries),
        "navigation": _navigation([*_of_all(needed), *places, ("settings", "This run")]),
        "summary": summary_section(summaries),
        "needed": keys_section(needed) if needed else "",
        "modes": _modes_section(summaries[0], settings),
        "settings": _settings_section(summaries, settings),
    }
    _write_page(
        path,
        "Rigid Motion: a comparison of interpolation modes",
        content,
        settings,
        sections(),
        videos(),
        coming=_coming(films),
    )


def write_clip_page(
    path: Path, clip: ClipResults, *, films: Films, settings: Settings, folder: Path, overview: str
) -> None:
    """Write the page of one clip among many.

    Parameters
    ----------
    path, films, settings, folder
        As of `write_report`.
    clip : ClipResults
    overview : str
        The way from `folder` to the page of all clips.
    """
    name = clip.facts.name
    content = {
        "lead": element("p", element("a", "All clips of this comparison", href=overview), class_="lead"),
        "navigation": _navigation([("clip-1", name)]),
        **dict.fromkeys(("summary", "needed", "modes", "settings"), ""),
    }
    section = clip_section("clip-1", clip, films, folder, with_needed=True)
    _write_page(
        path,
        f"{name}: a comparison",
        content,
        settings,
        [section],
        _videos_of("clip-1", clip, films),
        coming=_coming(films),
    )


def write_overview(
    path: Path,
    clips: Iterable[ClipResults],
    *,
    pages: Mapping[str, str | None],
    settings: Settings,
    advance: Callable[[], object] = lambda: None,
) -> None:
    """Write the page of many clips that have pages of their own.

    Parameters
    ----------
    path, clips, settings, advance
        As of `write_report`.
    pages : mapping
        Clip name to the way from this page to the clip's; None where there is none.

    Raises
    ------
    ValueError
        Where there is nothing to report.
    """
    summaries, needed, names = _summed_up(clips)

    def rows() -> Iterable[Markup]:
        choices = list(dict.fromkeys(choice for summary in summaries for choice in summary.choices))
        yield Markup(_opening_of_clips(choices, len(names)))
        for clip in clips:
            yield _row_of_clip(clip, choices, pages.get(clip.facts.name))
            advance()
        yield Markup("</tbody></table></div></section>")

    content = {
        "lead": lead(summaries),
        "navigation": _navigation([*_of_all(needed), ("clips", "Clips"), ("settings", "This run")]),
        "summary": summary_section(summaries),
        "needed": keys_section(needed) if needed else "",
        "modes": _modes_section(summaries[0], settings),
        "settings": _settings_section(summaries, settings),
    }
    _write_page(path, "Rigid Motion: a comparison of interpolation modes", content, settings, rows(), ())


def _summed_up(clips: Iterable[ClipResults]) -> tuple[list[Summary], list[KeysNeeded], list[str]]:
    """What there is to say of all clips, and their names."""
    names: list[str] = []
    needed: list[KeysNeeded] = []

    def results() -> Iterable[Result]:
        for clip in clips:
            names.append(clip.facts.name)
            if clip.needed:
                needed.append(clip.needed)
            yield from clip.results

    summaries = summarise(results())
    if not summaries:
        raise ValueError("no reconstruction to report: every clip is too short for two keys")
    return summaries, needed, names


# -- the page ---------------------------------------------------------------------------------------------------------


def _write_page(
    path: Path,
    title: str,
    content: Mapping[str, str],
    settings: Settings,
    clips: Iterable[Markup],
    films: Iterable[tuple[str, Path]],
    *,
    coming: bool = False,
) -> None:
    """Write a page, a clip and a film at a time: a report may be larger than what one wants in memory.

    `coming` says that there are films which are not there yet.
    """
    script = (PAGE / "page.js").read_text(encoding="utf-8")
    page = Template((PAGE / "page.html").read_text(encoding="utf-8")).substitute(
        content,
        title=escape(title),
        media=f"blob: {BESIDE_THE_PAGE}" if coming else "blob:",
        script=script,
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        style=(PAGE / "page.css").read_text(encoding="utf-8"),
        date=element("time", f"{settings.date:%d %B %Y, %H:%M}", datetime=settings.date.isoformat(timespec="minutes")),
        program=element("span", settings.program),
    )
    before, rest = page.split(CLIPS_GO_HERE)
    between, after = rest.split(FILMS_GO_HERE)
    with replacing(path) as stream:
        stream.write(before)
        stream.writelines(clips)
        stream.write(between)
        for name, film in films:
            _write_film(stream, name, film)
        stream.write(after)


def _navigation(places: Iterable[tuple[str, str]]) -> Markup:
    return join([element("li", element("a", title, href=f"#{place}")) for place, title in places])


def _of_all(needed: Sequence[KeysNeeded]) -> list[tuple[str, str]]:
    """The places of what is said of all clips."""
    middle = [("needed", "Keys needed")] if needed else []
    return [("summary", "Summary"), *middle, ("modes", "Modes and measures")]


def _coming(films: Films) -> bool:
    """Whether there are films that are not there yet."""
    return any(film is not None and not film.is_file() for film in films.values())


def _videos_of(place: str, clip: ClipResults, films: Films) -> Iterable[tuple[str, Path]]:
    for number, result in enumerate(clip.results, start=1):
        film = films.get((clip.facts.name, result.choice.name))
        if film is not None and film.is_file():
            yield film_name(f"{place}-rate-{number}"), film


def _write_film(stream: TextIO, name: str, film: Path) -> None:
    """The video as base64, a piece at a time: reports are larger than what one wants in memory."""
    stream.write(f'<script type="text/plain" id="{name}">')
    with film.open("rb") as source:
        while piece := source.read(3 << 18):  # A multiple of 3 bytes has no padding.
            stream.write(base64.b64encode(piece).decode("ascii"))
    stream.write("</script>\n")


# -- many clips -------------------------------------------------------------------------------------------------------


def _opening_of_clips(choices: Sequence[Choice], count: int) -> str:
    """The section of all clips, up to the rows of its table."""
    head = [
        heading("Clip", "text"),
        heading("Duration", "number", "s"),
        heading("Samples", "number"),
        heading("Repairs", "number"),
        *(heading(f"{choice.title[0].upper()}{choice.title[1:]}", "number", _unit(choice)) for choice in choices),
    ]
    caption = f"All {count} clips"
    explained = (
        f"Each column has the RMS shell error of {label_of(REFERENCE)} (within a tolerance, its keys a second), or of "
        "the first mode in a run without it. Below is the mode that came closest (or needed the fewest keys), with its "
        "number as a share of the first. Click on a heading to sort."
    )
    opening = element(
        "section",
        element("h2", "Clips"),
        element("p", explained, class_="note"),
        element(
            "div",
            element(
                "table",
                element("caption", caption),
                element("thead", element("tr", head)),
                element("tbody"),
                class_="numbers sortable clips",
            ),
            class_="scroll",
            role="region",
            tabindex=0,
            aria_label=caption,
        ),
        id="clips",
    )
    return opening.removesuffix("</tbody></table></div></section>")


def _row_of_clip(clip: ClipResults, choices: Sequence[Choice], page: str | None) -> Markup:
    facts = clip.facts
    by_choice = {result.choice: result for result in clip.results}
    name = element("a", facts.name, href=quote(page)) if page else facts.name
    return element(
        "tr",
        element("th", name, scope="row", data_value=facts.name),
        number_cell(facts.duration, rounded(facts.duration), best=False),
        number_cell(facts.samples, facts.samples, best=False),
        number_cell(len(facts.repairs), len(facts.repairs), best=False),
        [_cell_of(by_choice[choice]) if choice in by_choice else text_cell("too short") for choice in choices],
    )


def _unit(choice: Choice) -> str:
    return "keys/s" if isinstance(choice, Tolerance) else "mm"


def _cell_of(result: Result) -> Markup:
    """The number of the reference, and the best mode with its share of it."""
    factor = 1.0 if isinstance(result.choice, Tolerance) else 1e3
    numbers = {
        row.mode: row.keys_per_s if isinstance(result.choice, Tolerance) else row.rms_shell_m for row in result.rows
    }
    reference = numbers.get(REFERENCE, next(iter(numbers.values())))
    best = min(single_modes(numbers), key=numbers.__getitem__)
    share = f"{label_of(best)} {numbers[best] / reference:.2f}" if reference > NOTHING else ""
    return number_cell(reference, [rounded(reference * factor), element("small", share)], best=False)


# -- modes and measures -----------------------------------------------------------------------------------------------


def _modes_section(summary: Summary, settings: Settings) -> Markup:
    modes = [
        element(
            "div",
            element("dt", swatch(mode), label_of(mode), " ", element("code", mode)),
            element("dd", description_of(mode)),
        )
        for mode in summary.modes
    ]
    radius, of_joints = (f"{length * 1e3:g} mm" for length in (settings.radius, settings.joint_radius))
    of_joints = (
        f", or {of_joints} of that of a joint of a whole body" if settings.joint_radius != settings.radius else ""
    )
    measures = [
        (
            "Shell error",
            f"The largest distance by which any point within {radius} of the body's origin{of_joints} is out of place: "
            "position and rotation together, as they show on a body of that size.",
        ),
        ("Position, rotation", "The distance of the origin, and the angle of the rotation, from the recorded ones."),
        (
            "Velocity",
            "How much the origin's velocity differs from the recorded one. A jerk at a key shows here first.",
        ),
        (
            "RMS, 95th percentile, largest",
            "Over all samples of the recording from the first key to the last, with the keys themselves.",
        ),
        (
            "Bytes/s",
            "Size of the keys that were kept: seven double-precision numbers, 56 bytes, for each key. Keys that are "
            "not evenly spaced also need their times, which are not counted. With a mode for every segment, a key has "
            "one byte more.",
        ),
    ]
    return element(
        "section",
        element("h2", "Modes and measures"),
        element("dl", modes, class_="cards"),
        element("h3", "How errors are measured"),
        element(
            "dl",
            [element("div", element("dt", name), element("dd", meaning)) for name, meaning in measures],
            class_="cards",
        ),
        id="modes",
    )


# -- this run ---------------------------------------------------------------------------------------------------------


FACTS = {Uniform: "Rates", Budget: "Budgets of keys", Tolerance: "Tolerances"}


def _settings_section(summaries: Sequence[Summary], settings: Settings) -> Markup:
    facts: list[tuple[str, Content]] = [
        ("Program", settings.program),
        ("Blender", settings.blender),
        *((FACTS[summary.kind], f"{listed(summary.amounts)} {summary.kind.unit}".strip()) for summary in summaries),
        ("Modes", [[element("code", mode), " "] for mode in summaries[0].modes]),
        ("Radius of the shell", f"{settings.radius:g} m, of joints {settings.joint_radius:g} m"),
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
            "metrics.csv beside this page has all numbers at full precision. The folders of the clips have the keys "
            "and every in-between, one folder for each choice of keys.",
            class_="note",
        ),
        id="settings",
    )
