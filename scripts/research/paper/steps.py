"""The tasks of the reproduction: each reads files, calls a module beside this one, and writes files.

What is on the page comes from these files and from nowhere else. Paths are below the output folder.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Sequence
from pathlib import Path

import bpy
import numpy as np

from research.study import Files, Study, page, pictures
from rigid_motion.motion import MODES
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.files import write_text
from rigid_motion_batch.recordings.clip_reading import folder_names, read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.rows import read_all_rows, read_rows, write_rows
from rigid_motion_batch.scenes.film import render_film, render_still

from . import (
    bodies,
    bodies_section,
    body_steps,
    bows,
    catching,
    engines,
    sending,
    sending_section,
    sending_steps,
    shell,
    strips,
    table,
    timing,
    triangle,
)
from .bandwidths import Bandwidth, bandwidths
from .motions import ASSETS, RECORDINGS, Motion, read_motion
from .page import write_page
from .results import Results

ADAPTIVE = (REFERENCE, "motor_spline")
"""Modes that are given keys where they need them as well."""

PAGE = "paper.md"

SECTIONS = {"bodies": "bodies.md", "sending": "sending.md"}
"""The sections that may be written alone, and the files that they are written to."""

ALL = "all clips"


def plan(
    study: Study,
    assets: Sequence[Path],
    recordings: Sequence[Path],
    bodies: Sequence[Path] = (),
    *,
    rendered: bool,
    film: bool,
    rounds: int,
) -> None:
    """Add everything that is to be done to a study.

    Parameters
    ----------
    study : Study
    assets, recordings : sequence of Path
        Files, each with a motion. The figures take `throw` and `reach` among the assets. Whole bodies among the
        recordings are studied as such as well.
    bodies : sequence of Path
        Files, each with a whole body.
    rendered, film : bool
        Whether to render pictures, and a film.
    rounds : int
        Of the races.

    Raises
    ------
    ValueError
        Where one of those assets is missing.
    """
    asset = {path.stem: str(path) for path in assets}
    for wanted in ("reach", "throw"):
        if wanted not in asset:
            raise ValueError(f"{wanted}.csv is not among the assets; python assets/make_assets.py makes it")
    files, names = _clips(assets, recordings)
    measuring = [
        study.add(
            f"measuring {name}",
            measure,
            [f"clips/{name}/{part}" for part in ("clip.csv", "errors.csv", "bows.csv")],
            source=str(path),
            arguments={"name": name, "of": of},
            # A recording takes about 50 bytes to say a sample, and a second for 500 of them.
            weight=1.0 + path.stat().st_size / 25_000.0,
        )
        for name, (path, of) in zip(names, files, strict=True)
    ]
    tables = ("table.csv", "errors.csv", "bows.csv", "look_ahead.csv", "clips.csv", "run.json")
    study.add("Table 1", tabulate, tables, after=measuring, arguments={"names": names})
    shown = ["Table 1"]

    def show(name: str, function: Callable[..., object], outputs: Sequence[str], **options: object) -> None:
        shown.append(study.add(name, function, outputs, **options))

    reach, throw = asset["reach"], asset["throw"]
    timed = {"source": reach, "arguments": {"rounds": rounds}, "after": ["Table 1"], "weight": 40.0}
    show("running time", race, ["timing.csv"], **timed)
    show("bytes", count_bytes, ["bandwidth.csv"], source=reach)
    show("catching", view_catching, ["catching.csv"], source=throw)
    show("engines", draw_engines, ["paper/engines.svg"])
    show("shell error", draw_shell_error, ["paper/shell_error.svg"])
    show("figures in numbers", count_figures, ["triangle.csv", "strips.csv"])
    if rendered:
        caught = {"after": ["catching"], "source": throw, "step": pictures}
        show("triangle", render_triangle, ["paper/triangle.png"], step=pictures, weight=5.0)
        show("strips", render_strips, ["paper/strips.png"], step=pictures, weight=5.0)
        show("catching, a still", render_catching, ["paper/catching.png"], **caught)
        if film:
            show("catching, a film", film_catching, ["paper/catching.mp4"], **caught, weight=90.0)
    shown += filter(None, (_sending(study, assets, recordings), _studying(study, recordings, bodies)))
    before = {name: list(study.tasks[name].publish) for name in shown}
    study.add("page", write, [PAGE], after=shown, arguments={"files": before}, step=page)


def plan_bodies(study: Study, recordings: Sequence[Path], bodies: Sequence[Path]) -> None:
    """Add what is to be done for the section on bodies alone; as in `plan`, of which it is a part.

    Raises
    ------
    ValueError
        Where no file may hold a body.
    """
    last = _studying(study, recordings, bodies)
    if not last:
        raise ValueError("there is no whole body to study; give --bodies FILE_OR_FOLDER")
    _writing(study, "bodies", last)


def plan_sending(study: Study, assets: Sequence[Path], recordings: Sequence[Path]) -> None:
    """Add what is to be done for the section on streams that are sent when needed alone; as in `plan`."""
    _writing(study, "sending", _sending(study, assets, recordings))


def _writing(study: Study, section: str, after: str) -> None:
    study.add("section", write_section, [SECTIONS[section]], after=[after], arguments={"section": section}, step=page)


def _clips(assets: Sequence[Path], recordings: Sequence[Path]) -> tuple[list[tuple[Path, str]], list[str]]:
    """All files with the sets that they are of, and the names of their clips."""
    files = [(path, ASSETS) for path in assets] + [(path, RECORDINGS) for path in recordings]
    return files, folder_names(path.stem for path, _ in files)


def _sending(study: Study, assets: Sequence[Path], recordings: Sequence[Path]) -> str:
    """Add the study of streams that are sent when needed, and return the task that brings it together."""
    files, names = _clips(assets, recordings)
    before = [
        study.add(
            f"sending {name}",
            sending_steps.measure_sending,
            [f"sending/{name}/{part}" for part in ("clip.csv", "even.csv", "sent.csv")],
            source=str(path),
            arguments={"name": name, "of": of},
            weight=1.0 + path.stat().st_size / 1000.0,
        )
        for name, (path, of) in zip(names, files, strict=True)
    ]
    outputs = ["sent.csv", "sending.csv"]
    return study.add("sending", sending_steps.gather_sending, outputs, after=before, arguments={"names": names})


def _studying(study: Study, recordings: Sequence[Path], wanted: Sequence[Path]) -> str:
    """Add the study of bodies, and return the task that brings it together; empty where there is no body."""
    # A file that is given in both ways may be called differently.
    given = {path.resolve(): path for path in [*recordings, *wanted] if path in wanted or bodies.may_hold_a_body(path)}
    files = list(given.values())
    if not files:
        return ""
    names = folder_names(path.stem for path in files)
    needed = "bodies_needed.csv"
    before = []
    for name, path in zip(names, files, strict=True):
        outputs = [f"bodies/{name}/{part}" for part in bodies.FILES if part != needed]
        read = {"source": str(path), "arguments": {"name": name}}
        before.append(study.add(f"errors of {name}", body_steps.measure_body, outputs, **read, weight=5.0))
        found = [f"bodies/{name}/{needed}"]
        before.append(study.add(f"key poses of {name}", body_steps.count_key_poses, found, **read, weight=60.0))
    asked = [name for name, path in zip(names, files, strict=True) if path in wanted]
    arguments = {"names": names, "asked": asked}
    return study.add("bodies", gather_bodies, list(bodies.FILES), after=before, arguments=arguments)


# -- the table ---------------------------------------------------------------------------------------------------------


def measure(job: Files, *, name: str, source: str, of: str) -> None:
    """Read a clip and measure all modes on it. One that cannot be read, or is at rest, is noted and does not count."""
    motion, clip = read_motion(source, name, of)
    points, found = [], []
    if clip is None:
        job.note(f"{name} does not count: {motion.left_out}")
    else:
        total = len(table.rates_for(clip)) + table.TOLERANCES[2]
        done = iter(range(1, total + 1))
        points = table.measure_clip(clip, tuple(MODES), ADAPTIVE, lambda: job.progress(next(done), total))
        found = bows.bows_of(clip)
    write_rows(job.writes(f"clips/{name}/clip.csv"), Motion, [motion])
    write_rows(job.writes(f"clips/{name}/errors.csv"), table.Point, points)
    write_rows(job.writes(f"clips/{name}/bows.csv"), bows.Bow, found)


def tabulate(job: Files, *, names: list[str]) -> None:
    """Bring the clips together, and find what each mode needs."""

    def gathered(part: str, kind: type) -> list:
        return read_all_rows((job.reads(f"clips/{name}/{part}") for name in names), kind)

    motions, points = gathered("clip.csv", Motion), gathered("errors.csv", table.Point)
    cells = table.needed_by(points)
    members = {of: [one.clip for one in motions if one.of == of and not one.left_out] for of in (RECORDINGS, ASSETS)}
    sets = {of: clips for of, clips in members.items() if clips}
    if len(sets) > 1:
        sets[ALL] = [clip for clips in sets.values() for clip in clips]
    means = [cell for of, clips in sets.items() for cell in table.mean_over(cells, of, clips)]
    waits = [row for of in sets for row in table.look_ahead(means, of)]
    write_rows(job.writes("clips.csv"), Motion, motions)
    write_rows(job.writes("errors.csv"), table.Point, points)
    write_rows(job.writes("bows.csv"), bows.Bow, gathered("bows.csv", bows.Bow))
    write_rows(job.writes("table.csv"), table.Needed, [*means, *cells])
    write_rows(job.writes("look_ahead.csv"), table.LookAhead, waits)
    run = {"Blender": bpy.app.version_string, "Python": platform.python_version(), "NumPy": np.__version__}
    write_text(job.writes("run.json"), json.dumps(run, indent=1) + "\n")


def race(job: Files, *, source: str, rounds: int) -> None:
    """Race the engines, at equal rates, at those of the table, and at those of the paper."""
    cells = read_rows(job.reads("table.csv"), table.Needed)
    needed: dict[int, dict[str, float]] = {}
    for one in cells:
        kind = (one.clips, one.decimation, one.yardstick)
        if kind == (cells[0].clips, table.UNIFORM, next(iter(table.YARDSTICKS))) and np.isfinite(one.needed):
            needed.setdefault(one.updates, {})[one.mode] = one.needed
    total = timing.RACES * rounds
    done = iter(range(1, total + 1))
    results = timing.races(_asset(source), needed, rounds, lambda: job.progress(next(done), total))
    write_rows(job.writes("timing.csv"), timing.Timing, results)


# -- bodies ------------------------------------------------------------------------------------------------------------


def gather_bodies(job: Files, *, names: list[str], asked: list[str]) -> None:
    """Bring the bodies together. Recordings that are none are not spoken of, unless they were given for bodies."""
    looked_at = {name: read_rows(job.reads(f"bodies/{name}/bodies.csv"), bodies.Body) for name in names}
    kept = [name for name in names if name in asked or not looked_at[name][0].left_out]
    for name in kept:
        if looked_at[name][0].left_out:
            job.note(f"{name} does not count among bodies: {looked_at[name][0].left_out}")
    for part, kind in bodies.FILES.items():
        write_rows(job.writes(part), kind, read_all_rows((job.reads(f"bodies/{name}/{part}") for name in kept), kind))


# -- the figures -------------------------------------------------------------------------------------------------------


def count_bytes(job: Files, *, source: str) -> None:
    """The example of the text."""
    write_rows(job.writes("bandwidth.csv"), Bandwidth, bandwidths(_asset(source)))


def count_figures(job: Files) -> None:
    """The first two figures in numbers."""
    write_rows(job.writes("triangle.csv"), triangle.Step, triangle.steps())
    write_rows(job.writes("strips.csv"), strips.Instant, strips.instants())


def draw_engines(job: Files) -> None:
    """The sequence diagram."""
    write_text(job.writes("paper/engines.svg"), engines.draw())


def draw_shell_error(job: Files) -> None:
    """What errors are measured by."""
    write_text(job.writes("paper/shell_error.svg"), shell.draw())


def view_catching(job: Files, *, source: str) -> None:
    """The last figure in numbers."""
    write_rows(job.writes("catching.csv"), catching.View, catching.views(_asset(source)))


def render_triangle(job: Files) -> None:
    """The triangle."""
    render_still(triangle.build(), job.writes("paper/triangle.png"))


def render_strips(job: Files) -> None:
    """The drill in strips."""
    render_still(strips.build(), job.writes("paper/strips.png"))


def render_catching(job: Files, *, source: str) -> None:
    """The catch."""
    views = read_rows(job.reads("catching.csv"), catching.View)
    render_still(catching.build(_asset(source), views, film=False), job.writes("paper/catching.png"))


def film_catching(job: Files, *, source: str) -> None:
    """The throw and the catch."""
    views = read_rows(job.reads("catching.csv"), catching.View)
    scene = catching.build(_asset(source), views, film=True)
    render_film(scene, job.writes("paper/catching.mp4"), lambda done, of: job.progress(done, of, f"{done}/{of}"))


def write(job: Files, *, files: dict[str, list[str]]) -> None:
    """The page, of the files that there are: those of each task before this one that is done."""
    there = [path for task, paths in files.items() if task in job.finished for path in paths]
    write_text(job.writes(PAGE), write_page(Results.read(job.reads, there)))


def write_section(job: Files, *, section: str) -> None:
    """A section alone."""
    if section == "bodies":
        lines = bodies_section.bodies_section(bodies_section.BodyResults.read(job.reads, bodies.FILES))
    else:
        lines = sending_section.sending_section(
            read_rows(job.reads("sending.csv"), sending.SentNeeded), (RECORDINGS, ASSETS)
        )
    write_text(job.writes(SECTIONS[section]), "\n".join([*lines, ""]))


def _asset(source: str) -> Clip:
    """A clip of our own."""
    (clip,), _ = read_clips([source], "blender")
    return clip
