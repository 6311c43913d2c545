"""The steps of the reproduction, for a work plan: each reads files, calls a room beside this one, and writes files.

What is on the page comes from these files and from nowhere else. Paths are below the output folder.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from rigid_motion.motion import MODES
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.comparison.version import step_versions
from rigid_motion_batch.files import write_text
from rigid_motion_batch.recordings.clip_reading import folder_names, read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.rows import read_all_rows, read_rows, write_rows
from rigid_motion_batch.scenes.film import render_film, render_still
from rigid_motion_batch.workplan import Job, Plan, Task, step

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
    assets: Sequence[Path],
    recordings: Sequence[Path],
    bodies: Sequence[Path] = (),
    *,
    pictures: bool,
    film: bool,
    rounds: int,
    version: str,
) -> Plan:
    """Everything that is to be done.

    Parameters
    ----------
    assets, recordings : sequence of Path
        Files, each with a motion. The figures take `throw` and `reach` among the assets. Whole bodies among the
        recordings are studied as such as well.
    bodies : sequence of Path
        Files, each with a whole body.
    pictures, film : bool
        Whether to render them.
    rounds : int
        Of the races.
    version : str
        Of the program.

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
    tasks = [_measuring(name, path, of) for name, (path, of) in zip(names, files, strict=True)]
    measuring = tuple(task.name for task in tasks)
    tables = ("table.csv", "errors.csv", "bows.csv", "look_ahead.csv", "clips.csv", "run.json")
    tasks += [
        _task("Table 1", "tabulate", tables, measuring, arguments={"names": names}),
        _task(
            "running time",
            "race",
            ("timing.csv",),
            ("Table 1",),
            source=asset["reach"],
            arguments={"rounds": rounds},
            weight=40.0,
        ),
        _task("bytes", "count_bytes", ("bandwidth.csv",), source=asset["reach"]),
        _task("catching", "view_catching", ("catching.csv",), source=asset["throw"]),
        _task("engines", "draw_engines", ("paper/engines.svg",)),
        _task("shell error", "draw_shell_error", ("paper/shell_error.svg",)),
        _task("figures in numbers", "count_figures", ("triangle.csv", "strips.csv")),
    ]
    if pictures:
        tasks += [
            _task("triangle", "render_triangle", ("paper/triangle.png",), weight=5.0),
            _task("strips", "render_strips", ("paper/strips.png",), weight=5.0),
            _task(
                "catching, a still", "render_catching", ("paper/catching.png",), ("catching",), source=asset["throw"]
            ),
        ]
    if pictures and film:
        outputs = ("paper/catching.mp4",)
        tasks.append(
            _task("catching, a film", "film_catching", outputs, ("catching",), source=asset["throw"], weight=90.0)
        )
    studied, sent = _studying(recordings, bodies), _sending(assets, recordings)
    tasks += [*sent, *studied]
    partly = [*sent[:-1], *studied[:-1]]
    before = {task.name: tuple(task.outputs) for task in tasks if task.name not in measuring and task not in partly}
    tasks.append(_task("page", "write", (PAGE,), tuple(before), arguments={"files": before}, partial=True))
    return _planned(tasks, version)


def plan_bodies(recordings: Sequence[Path], bodies: Sequence[Path], *, version: str) -> Plan:
    """What is to be done for the section on bodies alone; as in `plan`, of which it is a part but for the last task.

    Raises
    ------
    ValueError
        Where no file may hold a body.
    """
    tasks = _studying(recordings, bodies)
    if not tasks:
        raise ValueError("there is no whole body to study; give --bodies FILE_OR_FOLDER")
    return _planned([*tasks, _writing("bodies", tasks[-1])], version)


def plan_sending(assets: Sequence[Path], recordings: Sequence[Path], *, version: str) -> Plan:
    """What is to be done for the section on streams that are sent when needed alone; as in `plan`."""
    tasks = _sending(assets, recordings)
    return _planned([*tasks, _writing("sending", tasks[-1])], version)


def _writing(section: str, after: Task) -> Task:
    return _task("section", "write_section", (SECTIONS[section],), (after.name,), arguments={"section": section})


def _planned(tasks: Sequence[Task], version: str) -> Plan:
    # These take minutes: they are done again where what they use has changed, and nothing else.
    modules = (body_steps.__name__, sending_steps.__name__)
    slow = {task.function for task in tasks if task.function.startswith(modules)}
    return Plan(tasks, version, versions=step_versions(sorted(slow)))


def _clips(assets: Sequence[Path], recordings: Sequence[Path]) -> tuple[list[tuple[Path, str]], list[str]]:
    """All files with the sets that they are of, and the names of their clips."""
    files = [(path, ASSETS) for path in assets] + [(path, RECORDINGS) for path in recordings]
    return files, folder_names(path.stem for path, _ in files)


def _sending(assets: Sequence[Path], recordings: Sequence[Path]) -> list[Task]:
    """The tasks of a study of streams that are sent when needed, the last of which brings them together."""
    files, names = _clips(assets, recordings)
    tasks = [
        _task(
            f"sending {name}",
            "measure_sending",
            tuple(f"sending/{name}/{part}" for part in ("clip.csv", "even.csv", "sent.csv")),
            source=str(path),
            arguments={"name": name, "of": of},
            module=sending_steps.__name__,
            weight=1.0 + path.stat().st_size / 1000.0,
        )
        for name, (path, of) in zip(names, files, strict=True)
    ]
    before = tuple(task.name for task in tasks)
    outputs = ("sent.csv", "sending.csv")
    gathering = _task(
        "sending", "gather_sending", outputs, before, arguments={"names": names}, module=sending_steps.__name__
    )
    return [*tasks, gathering]


def _studying(recordings: Sequence[Path], wanted: Sequence[Path]) -> list[Task]:
    """The tasks of a study of bodies, the last of which brings them together; none where there is no body."""
    # A file that is given in both ways may be called differently.
    given = {path.resolve(): path for path in [*recordings, *wanted] if path in wanted or bodies.may_hold_a_body(path)}
    files = list(given.values())
    if not files:
        return []
    names = folder_names(path.stem for path in files)
    tasks = []
    for name, path in zip(names, files, strict=True):
        arguments = {"name": name}
        outputs = tuple(f"bodies/{name}/{part}" for part in bodies.FILES if part != "bodies_needed.csv")
        tasks += [
            _task(
                f"errors of {name}",
                "measure_body",
                outputs,
                source=str(path),
                arguments=arguments,
                module=body_steps.__name__,
                weight=5.0,
            ),
            _task(
                f"key poses of {name}",
                "count_key_poses",
                (f"bodies/{name}/bodies_needed.csv",),
                source=str(path),
                arguments=arguments,
                module=body_steps.__name__,
                weight=60.0,
            ),
        ]
    asked = [name for name, path in zip(names, files, strict=True) if path in wanted]
    arguments = {"names": names, "asked": asked}
    before = tuple(task.name for task in tasks)
    return [*tasks, _task("bodies", "gather_bodies", tuple(bodies.FILES), before, arguments=arguments)]


def _task(
    name: str,
    function: str,
    outputs: tuple[str, ...],
    after: tuple[str, ...] = (),
    *,
    source: str = "",
    arguments: dict[str, Any] | None = None,
    module: str = __name__,
    **options: Any,
) -> Task:
    """A task of this module, or of another, that may read a clip."""
    given = {"source": source} if source else {}
    inputs = (source,) if source else ()
    return Task(name, f"{module}:{function}", given | (arguments or {}), inputs, outputs, after, **options)


def _measuring(name: str, path: Path, of: str) -> Task:
    outputs = tuple(f"clips/{name}/{part}" for part in ("clip.csv", "errors.csv", "bows.csv"))
    # A recording takes about 50 bytes to say a sample, and a second for 500 of them.
    weight = 1.0 + path.stat().st_size / 25_000.0
    arguments = {"name": name, "of": of}
    return _task(f"measuring {name}", "measure", outputs, source=str(path), arguments=arguments, weight=weight)


# -- the table ---------------------------------------------------------------------------------------------------------


@step
def measure(job: Job, *, name: str, source: str, of: str) -> None:
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


@step
def tabulate(job: Job, *, names: list[str]) -> None:
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


@step
def race(job: Job, *, source: str, rounds: int) -> None:
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


@step
def gather_bodies(job: Job, *, names: list[str], asked: list[str]) -> None:
    """Bring the bodies together. Recordings that are none are not spoken of, unless they were given for bodies."""
    looked_at = {name: read_rows(job.reads(f"bodies/{name}/bodies.csv"), bodies.Body) for name in names}
    kept = [name for name in names if name in asked or not looked_at[name][0].left_out]
    for name in kept:
        if looked_at[name][0].left_out:
            job.note(f"{name} does not count among bodies: {looked_at[name][0].left_out}")
    for part, kind in bodies.FILES.items():
        write_rows(job.writes(part), kind, read_all_rows((job.reads(f"bodies/{name}/{part}") for name in kept), kind))


# -- the figures -------------------------------------------------------------------------------------------------------


@step
def count_bytes(job: Job, *, source: str) -> None:
    """The example of the text."""
    write_rows(job.writes("bandwidth.csv"), Bandwidth, bandwidths(_asset(source)))


@step
def count_figures(job: Job) -> None:
    """The first two figures in numbers."""
    write_rows(job.writes("triangle.csv"), triangle.Step, triangle.steps())
    write_rows(job.writes("strips.csv"), strips.Instant, strips.instants())


@step
def draw_engines(job: Job) -> None:
    """The sequence diagram."""
    write_text(job.writes("paper/engines.svg"), engines.draw())


@step
def draw_shell_error(job: Job) -> None:
    """What errors are measured by."""
    write_text(job.writes("paper/shell_error.svg"), shell.draw())


@step
def view_catching(job: Job, *, source: str) -> None:
    """The last figure in numbers."""
    write_rows(job.writes("catching.csv"), catching.View, catching.views(_asset(source)))


@step
def render_triangle(job: Job) -> None:
    """The triangle."""
    render_still(triangle.build(), job.writes("paper/triangle.png"))


@step
def render_strips(job: Job) -> None:
    """The drill in strips."""
    render_still(strips.build(), job.writes("paper/strips.png"))


@step
def render_catching(job: Job, *, source: str) -> None:
    """The catch."""
    views = read_rows(job.reads("catching.csv"), catching.View)
    render_still(catching.build(_asset(source), views, film=False), job.writes("paper/catching.png"))


@step
def film_catching(job: Job, *, source: str) -> None:
    """The throw and the catch."""
    views = read_rows(job.reads("catching.csv"), catching.View)
    scene = catching.build(_asset(source), views, film=True)
    render_film(scene, job.writes("paper/catching.mp4"), lambda done, of: job.progress(done, of, f"{done}/{of}"))


@step
def write(job: Job, *, files: dict[str, list[str]]) -> None:
    """The page, of the files that there are: those of each task before this one that is done."""
    there = [path for task, paths in files.items() if task in job.finished for path in paths]
    write_text(job.writes(PAGE), write_page(Results.read(job.output, there)))


@step
def write_section(job: Job, *, section: str) -> None:
    """A section alone."""
    if section == "bodies":
        lines = bodies_section.bodies_section(bodies_section.BodyResults.read(job.output, bodies.FILES))
    else:
        lines = sending_section.sending_section(
            read_rows(job.reads("sending.csv"), sending.SentNeeded), (RECORDINGS, ASSETS)
        )
    write_text(job.writes(SECTIONS[section]), "\n".join([*lines, ""]))


def _asset(source: str) -> Clip:
    """A clip of our own."""
    (clip,), _ = read_clips([source], "blender")
    return clip
