"""HTML pages of the report: fills the templates with the other modules' results, the viewer and its data.

A content security policy forbids every request, and every script except the page's own; films, and data too large for
the page, are separate files next to it.
"""

from __future__ import annotations

import base64
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, fields
from datetime import datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from markupsafe import Markup, escape

from rigid_motion_batch.analysis.choices import Choice
from rigid_motion_batch.analysis.held import PairSlips
from rigid_motion_batch.analysis.metrics import Metrics
from rigid_motion_batch.analysis.modes import description_of, label_of
from rigid_motion_batch.analysis.needed import KeysNeeded
from rigid_motion_batch.analysis.results import ClipResult
from rigid_motion_batch.files import line_of, write_text
from rigid_motion_batch.palette import ERROR_COLOURS, colours_on_pages
from rigid_motion_batch.recordings.clips import ClipFacts

from . import charts, tables
from .data import Mesh, clip_data, drill, json_in_page, mesh_data
from .held import MOST_SAID, slip_grids, slip_sentences, still_sentences
from .numbers import LARGEST_AT, MEASURES, MINUS, RMS_IS, Gathering, Numbers, digits, error_is, percent, who_else
from .rendering import SCRIPTS, address, script_of, shaders, style, write_page
from .settings import PageSettings
from .tables import Joints, joints_of
from .verdict import verdict

IN_THE_PAGE = 5_000_000
"""Maximum bytes of data of all clips in the page; above it, each clip has a file next to the page."""

MOST_TABS = 8
"""Maximum number of clips shown as tabs; more become a list to choose from."""

NO_BREAK = "\u00a0"

MOST_WARNINGS = 3
"""Maximum number of warnings shown; more are folded."""

Films = Mapping[tuple[str, str], Path | None]
"""(clip name, name of the choice) to its film, which may not exist yet; None if it could not be made."""


def write_report(
    path: Path,
    clips: Iterable[ClipResult],
    settings: PageSettings,
    films: Films | None = None,
    *,
    folder: Path | None = None,
    mesh: Mesh | None = None,
    slips: Sequence[PairSlips] = (),
    overview: str = "",
    advance: Callable[[], object] = lambda: None,
) -> None:
    """Write one page about the given clips; data that are too large for it go into a folder beside it, named after it.

    Parameters
    ----------
    path : Path
        The page's file.
    clips : iterable of ClipResult
        Iterated once, with only one clip in memory at a time.
    settings : Settings
    films : mapping, optional
        Empty if the run makes no films.
    folder : Path, optional
        The page's final folder, which links are relative to. Defaults to that of `path`.
    mesh : Mesh, optional
        The object that single rigid bodies move in the viewer; a drill by default.
    slips : sequence of PairSlips
        Slips of clips that hold one another.
    overview : str
        The link to a page of more clips; empty if there is none.
    advance : callable
        Called once for every clip.

    Raises
    ------
    ValueError
        If there is nothing to report.
    """
    folder = folder or path.parent
    films, mesh = films or {}, mesh or drill()
    gathering, page = Gathering(settings.reference), _Clips(path, films, folder, mesh)
    for clip in clips:
        page.facts.append(clip.facts)
        if clip.choices:
            gathering.add(clip.facts.name, [result.numbers for result in clip.choices])
            page.add(clip)
        advance()
    numbers = gathering.numbers()
    context = _context(numbers, page.facts, page.needed, settings, slips)
    start = _initial_view(numbers, page.choices, context["verdict"].choice)
    context |= {
        "clips": page,
        "overview": overview,
        "script": script_of(SCRIPTS),
        "start": start,
        "warnings": page.warnings(start[1]),
        "grids": [
            grid
            for clip in (None, *(range(len(numbers.clips)) if len(numbers.clips) > 1 else ()))
            for grid in tables.grids(numbers, clip)
        ],
        "page": json_in_page(
            {
                "clips": page.places,
                "modes": list(numbers.modes),
                "mesh": mesh_data(mesh),
                "shaders": shaders(),
                "ramp": ERROR_COLOURS,
                "start": {"clip": start[0], "choice": start[1]},
            }
        ),
    }
    write_page(path, "page.html.j2", context)


def write_overview(
    path: Path,
    clips: Iterable[ClipResult],
    settings: PageSettings,
    pages: Mapping[str, str | None],
    *,
    slips: Sequence[PairSlips] = (),
    advance: Callable[[], object] = lambda: None,
) -> None:
    """Write the page of many clips, most important first: clips with warnings, then by the largest error.

    Parameters
    ----------
    path, clips, settings, slips, advance
        As in `write_report`; only the numbers of the clips are used.
    pages : mapping
        Clip name to the link from this page to the clip's page; None if there is none.

    Raises
    ------
    ValueError
        If there is nothing to report.
    """
    gathering = Gathering(settings.reference)
    needed: list[KeysNeeded] = []
    facts: list[ClipFacts] = []
    for clip in clips:
        if clip.choices:
            gathering.add(clip.facts.name, [result.numbers for result in clip.choices])
            facts.append(clip.facts)
        if clip.needed:
            needed.append(clip.needed)
        advance()
    numbers = gathering.numbers()
    context = _context(numbers, facts, needed, settings, slips) | {
        "script": script_of(("tables",)),
        "grids": tables.grids(numbers),
        "rows": _overview_rows(numbers, facts, pages),
        "count": len(facts),
        "warned": sum(bool(fact.warnings) for fact in facts),
    }
    write_page(path, "overview.html.j2", context)


# -- clips of a page --------------------------------------------------------------------------------------------------


class _Clips:
    """The contents of a page about its clips, gathered one clip at a time."""

    def __init__(self, path: Path, films: Films, folder: Path, mesh: Mesh) -> None:
        self.facts: list[ClipFacts] = []
        self.needed: list[KeysNeeded] = []
        self.choices: list[tuple[str, tuple[Choice, ...]]] = []
        self.metrics: list[Metrics] = []
        self.joints: list[Joints] = []
        self.films: list[tuple[int, Choice, str | None]] = []
        self.places: list[dict[str, Any]] = []
        """Names of the clips and addresses of their data files, for the script."""
        self.inside: list[str] = []
        """The clips' data, as JSON."""
        self._too_large = False
        self._warned: list[tuple[str, tuple[Any, ...], float]] = []
        self._path, self._films, self._folder, self._mesh = path, films, folder, mesh

    def add(self, clip: ClipResult) -> None:
        name, place = clip.facts.name, len(self.places)
        numbers = Gathering()
        numbers.add(clip.facts.name, [result.numbers for result in clip.choices])
        own = numbers.numbers()
        self.choices.append((name, tuple(result.choice for result in clip.choices)))
        self._warned.append((name, clip.facts.warnings, float(clip.times[0])))
        if clip.needed:
            self.needed.append(clip.needed)
        for result in clip.choices:
            self.metrics += [row for motion in result.motions for row in motion.metrics]
            if (name, result.choice.name) in self._films:
                self.films.append((place, result.choice, self._link(self._films[name, result.choice.name])))
            if joints := joints_of(place, clip, result, own):
                self.joints.append(joints)
        self.places.append({"name": name, "data": ""})
        self.inside.append(json_in_page(clip_data(clip, own.label, self._mesh)))
        self._too_large |= sum(map(len, self.inside)) > IN_THE_PAGE
        if self._too_large:
            self._move_out()

    def _move_out(self) -> None:
        """Move the data of all clips so far to files next to the page; script elements load them, even from a disk."""
        beside = self._path.with_name(f"{self._path.stem}_data")
        for place, data in enumerate(self.inside):
            if data:
                file = beside / f"{place + 1}.js"
                write_text(file, f"rigidMotionClips[{place}]({data});\n")
                self.places[place]["data"] = f"{quote(beside.name)}/{file.name}"
                self.inside[place] = ""

    def _link(self, film: Path | None) -> str | None:
        return None if film is None else quote(Path(os.path.relpath(film, self._folder)).as_posix())

    def warnings(self, choice: str) -> list[dict[str, str]]:
        """Return all warnings, with links to their moments under a choice."""
        return [
            {
                "clip": name,
                "text": item.text,
                "way_out": item.way_out,
                "address": address(name, choice, None if item.start_s is None else item.start_s - begin),
            }
            for name, warned, begin in self._warned
            for item in warned
        ]


def _initial_view(
    numbers: Numbers, choices: Sequence[tuple[str, tuple[Choice, ...]]], spoken_of: Choice | None
) -> tuple[str, str]:
    """Return the clip with the largest error and the verdict's choice, which the page opens with."""
    at = numbers.choices.index(spoken_of) if spoken_of else 0
    mode = numbers.modes.index(numbers.reference) if numbers.reference else 0
    largest = numbers.values[LARGEST_AT, :, at, mode]
    clip = int(np.nanargmax(largest)) if np.isfinite(largest).any() else 0
    choice = numbers.choices[at]
    return numbers.clips[clip], choice.name if choice in choices[clip][1] else choices[clip][1][0].name


# -- many clips -------------------------------------------------------------------------------------------------------


def _overview_rows(
    numbers: Numbers, facts: Sequence[ClipFacts], pages: Mapping[str, str | None]
) -> Iterator[dict[str, Any]]:
    groups = [group[0] for group in numbers.groups()]
    columns = [numbers.modes.index(mode) for mode in groups]
    beside = numbers.modes.index(numbers.reference or numbers.modes[0])
    shown = numbers.values[LARGEST_AT]
    largest = shown.max(axis=(1, 2), initial=0.0, where=np.isfinite(shown))
    order = sorted(range(len(facts)), key=lambda place: (not facts[place].warnings, -largest[place]))
    for place in order:
        cells = []
        for choice in range(len(numbers.choices)):
            own = numbers.values[numbers.deciding(choice), place, choice]
            if not np.isfinite(own[columns]).any():
                cells.append(tables.TableCell("too short", value=-1.0))
                continue
            best = columns[int(np.nanargmin(own[columns]))]
            share = own[best] / own[beside] - 1.0 if own[beside] > 0.0 else 0.0
            name = numbers.label(numbers.modes[best])
            gain = f"{name} {MINUS}{percent(-share)}" if share < -0.005 else ""
            cells.append(tables.TableCell(digits(own[beside]), gain, value=float(np.nan_to_num(own[beside]))))
        page = pages.get(facts[place].name)
        yield {
            "facts": facts[place],
            "page": quote(page) if page else "",
            "warnings": len(facts[place].warnings),
            "largest": digits(largest[place]),
            "cells": cells,
        }


# -- templates --------------------------------------------------------------------------------------------------------


def _context(
    numbers: Numbers,
    facts: Sequence[ClipFacts],
    needed: Sequence[KeysNeeded],
    settings: PageSettings,
    slips: Sequence[PairSlips],
) -> dict[str, Any]:
    said = verdict(numbers, needed)
    bodies = [bool(clip.joints) for clip in facts]
    rigid, joint = None if all(bodies) else settings.radius, settings.joint_radius if any(bodies) else None
    return {
        "numbers": numbers,
        "verdict": said,
        "settings": settings,
        "date": datetime.now(),
        "needed": needed,
        "slips": slip_sentences(slips, numbers, said.choice),
        "still": still_sentences(numbers, said.choice),
        "error_is": f"{error_is(rigid, joint, 1)}. {RMS_IS}",
        "who_else": who_else(numbers),
        "slip_grids": slip_grids(slips, numbers),
        "most_said": MOST_SAID,
        "measures": MEASURES,
        "deciding": numbers.deciding(0),
        "colours": [colours_on_pages(mode) for mode in numbers.modes],
        "descriptions": [description_of(mode) for mode in numbers.modes],
        "style": style(),
        "most_tabs": MOST_TABS,
        "most_warnings": MOST_WARNINGS,
        "ramp": ERROR_COLOURS,
        "chart": charts.chart,
        "needed_rows": tables.needed_rows,
        "csv": _csv,
        "label_of": label_of,
        "marked": marked,
    }


def _csv(rows: Sequence[Metrics]) -> str:
    """Return a table as in metrics.csv, as a data URL."""
    lines = (line_of(("" if cell is None else cell) for cell in astuple(row)) for row in rows)
    text = "".join((line_of(column.name for column in fields(Metrics)), *lines))
    return f"data:text/csv;base64,{base64.b64encode(text.encode()).decode('ascii')}"


def marked(sentence: str, numbers: Numbers) -> Markup:
    """Return a sentence as HTML with its numbers in bold and the names of modes in their colours."""
    names = {str(escape(numbers.label(mode))): place for place, mode in enumerate(numbers.modes)}
    known = "|".join(map(re.escape, sorted(names, key=len, reverse=True)))

    def mark(match: re.Match[str]) -> str:
        tag = f'span class="mode" style="color:var(--m{names[match[1]]})"' if match[1] else "b"
        return f"<{tag}>{match[0].replace(' ', NO_BREAK)}</{tag.partition(' ')[0]}>"

    return Markup(re.sub(rf"({known})|\b\d[\d.]*(?: (?:%|mm))?", mark, str(escape(sentence))))
