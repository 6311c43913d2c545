"""The steps of a comparison: from recordings to clips, from clips to numbers, from numbers to films and pages.

What passes between them are the values of `recordings` and `analysis` themselves, written by `values`. Those that need
Blender load nothing but NumPy and bpy. Every step imports what it needs when it is done.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rigid_motion_batch.analysis.choices import Choice
from rigid_motion_batch.analysis.radii import Radii
from rigid_motion_batch.recordings.clips import Clip, ClipWarning
from rigid_motion_batch.recordings.options import ReadingOptions
from rigid_motion_batch.scenes.settings import StageSettings

from . import values
from .steps import Job, TaskError, step

if TYPE_CHECKING:
    from rigid_motion_batch.analysis.results import ChoiceResult, ClipResult

RECORDINGS = ("rigid_motion/motion", "recordings", "axes.py", "command_line.py", "files.py", "rows.py")
READING = (*RECORDINGS, "analysis/modes.py")
ANALYSIS = (*RECORDINGS, "analysis")
SCENES = (*ANALYSIS, "rigid_motion/animation", "scenes", "palette.py", "hushing.py")
REPORT = (*ANALYSIS, "report", "palette.py")

ROWS, JOINT_ROWS, FILM, BLEND, PAGE = "rows.csv", "joints.csv", "comparison.mp4", "comparison.blend", "report.html"
PIECE = "piece.mkv"
PAGE_DATA = "report_data/"
"""The folder of what is too large for a page."""


# -- recordings -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Read:
    source: str
    """As the user gave it."""

    axes: str | None
    options: ReadingOptions
    blender: str = ""
    """The version of Blender, for formats that it reads."""

    against: str = ""
    """What somebody else has made of it, as a source."""


@dataclass(frozen=True)
class BodyFacts:
    """What is to be known of a clip to plan its comparison."""

    name: str
    """What it would like to be called."""

    body: str
    repairs: tuple[str, ...]
    warnings: tuple[ClipWarning, ...]
    joints: tuple[str, ...]
    """Of a whole body; none of a single rigid one."""

    against: str = ""
    """What the motion is called that it is compared with beside the modes."""


@dataclass(frozen=True)
class SourceFacts:
    note: str
    bodies: tuple[BodyFacts, ...]


def read_source(job: Job, parameters: Read) -> None:
    """Read a source, and repair its clips."""
    import numpy as np

    from rigid_motion_batch.analysis.modes import name_of_other
    from rigid_motion_batch.recordings import TrajectoryError, against, clip_reading
    from rigid_motion_batch.recordings.reading import split_source

    how = parameters.axes, parameters.options
    try:
        clips, note = clip_reading.read_source(parameters.source, *how)
        if parameters.against:
            if len(clips) > 1:
                raise TrajectoryError(parameters.source, f"{len(clips)} bodies", "name the one that --against is of")
            name = name_of_other(split_source(parameters.against)[0].stem)
            clip, more = against.with_against(clips[0], parameters.against, name, *how)
            clips, note = [clip], "; ".join(filter(None, (note, more)))
    except TrajectoryError as error:
        raise TaskError(str(error)) from None
    bodies = []
    for number, clip in enumerate(clips):
        values.write(job.folder / f"{number}", clip)
        np.save(job.folder / f"{number}.times.npy", clip.times)
        joints = clip.figure.joints if clip.figure else ()
        other = clip.against.name if clip.against else ""
        bodies.append(BodyFacts(clip.name, clip.body, clip.repairs, clip.warnings, joints, other))
    values.write(job.folder / "facts", SourceFacts(note, tuple(bodies)))


@step(rooms=READING, stage="read")
def read(job: Job, parameters: Read) -> None:
    read_source(job, parameters)


@step(rooms=(*READING, "rigid_motion/animation"), stage="read", blender=True)
def read_in_blender(job: Job, parameters: Read) -> None:
    read_source(job, parameters)


@dataclass(frozen=True)
class ClipOf:
    """A clip of a source that was read."""

    name: str
    """In this run."""

    body: int = 0
    """Which of the source's, from 0."""

    def read(self, folder: Path) -> Clip:
        return replace(values.read(Clip, folder / f"{self.body}"), name=self.name)


# -- numbers ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Measure:
    clip: ClipOf
    choice: Choice
    modes: tuple[str, ...]
    radii: Radii
    shared: bool = False
    form: str = "csv"
    """Of the tables of poses."""


@step(rooms=ANALYSIS, stage="measure")
def measure(job: Job, parameters: Measure) -> None:
    """Choose keys of a clip, let the modes fill them in, and measure what was lost. Before: the recording."""
    from rigid_motion_batch.analysis import body_metrics, metrics, results
    from rigid_motion_batch.analysis.bodies import reconstruct_body
    from rigid_motion_batch.analysis.reconstructions import reconstruct

    clip, choice, modes = parameters.clip.read(job.before[0]), parameters.choice, parameters.modes
    if clip.figure is None:
        if made := reconstruct(clip, choice, modes, parameters.radii.rigid):
            metrics.write_reconstruction(job.folder, made, parameters.form)
            found = results.of_rigid_body(made)
    else:
        radii = parameters.radii.of(clip.figure.joints)
        if made := reconstruct_body(clip, choice, modes, radii, shared=parameters.shared):
            body_metrics.write_key_tables(job.folder, made)
            found = results.of_body(made, radii)
            body_metrics.write_joint_metrics(job.folder / JOINT_ROWS, found.joints)
    if made is None:
        raise TaskError(f"{clip.name}: too short for two keys {choice.phrase}")
    metrics.write_metrics(job.folder / ROWS, found.rows)
    values.write(job.folder / "result", found)
    values.write(job.folder / "numbers", found.numbers)


@dataclass(frozen=True)
class CountKeys:
    clip: ClipOf
    modes: tuple[str, ...]
    radii: Radii
    fit: bool


@step(rooms=ANALYSIS, stage="measure")
def count_keys(job: Job, parameters: CountKeys) -> None:
    """Find how many keys every mode needs on a clip. Before: the recording."""
    from rigid_motion_batch.analysis import needed
    from rigid_motion_batch.analysis.body_needed import OfBody
    from rigid_motion_batch.analysis.modes import single_modes

    clip, done = parameters.clip.read(job.before[0]), iter(range(1, len(needed.RATES) + 1))
    if clip.figure is None:
        ways = needed.OfRigidBody(clip, parameters.radii.rigid, fit=parameters.fit)
    else:
        ways = OfBody(clip, parameters.radii.of(clip.figure.joints))
    modes = single_modes(parameters.modes)
    found = needed.keys_needed(ways, modes, advance=lambda: job.progress(next(done), len(needed.RATES)))
    needed.write_keys_needed(job.folder / ROWS, [found])
    values.write(job.folder / "needed", found)


@step(rooms=SCENES, stage="measure", blender=True)
def decimate(job: Job, parameters: Measure) -> None:
    """See what Blender's Decimate needs to be as good as the keys of a whole body. Before: recording, measurement."""
    from rigid_motion_batch.analysis.bodies import BodyReconstruction
    from rigid_motion_batch.analysis.body_decimated import write_keys_of_bodies
    from rigid_motion_batch.scenes.decimating import beside_decimate

    clip, found = parameters.clip.read(job.before[0]), result_in(job.before[1])
    known = [row for row in found.rows if row.keys]
    keys = {row.mode: found.keys[row.mode] for row in known}
    made = BodyReconstruction(clip, found.choice, keys, parameters.shared)
    try:
        rows = beside_decimate(made, parameters.radii.of(clip.figure.joints), known)
    except RuntimeError as error:
        problem = " ".join(str(error).split())
        raise TaskError(f"{clip.name} {found.choice.phrase}: not compared with Blender's Decimate: {problem}") from None
    write_keys_of_bodies(job.folder / ROWS, rows)
    values.write(job.folder / "decimated", tuple(rows))


@dataclass(frozen=True)
class Join:
    rows: str
    """The name of the part of the table in every result."""


@step(rooms=("analysis", "files.py"), stage="report", partial=True)
def tabulate(job: Job, parameters: Join) -> None:
    """Write the table of all clips. Before: its parts."""
    from rigid_motion_batch.analysis.body_metrics import join_tables

    join_tables(job.folder / "table.csv", [folder / parameters.rows for folder in job.before if folder])


def result_in(folder: Path) -> ChoiceResult:
    from rigid_motion_batch.analysis.results import ChoiceResult

    return values.read(ChoiceResult, folder / "result")


# -- films ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Build:
    clip: ClipOf
    radii: Radii
    shared: bool
    stage: StageSettings
    blender: str
    """The version of Blender."""


@step(rooms=SCENES, stage="build", blender=True)
def build(job: Job, parameters: Build) -> None:
    """Build the scene of a film, and save it. Before: the recording, and what was measured."""
    from rigid_motion_batch.analysis.bodies import BodyReconstruction
    from rigid_motion_batch.analysis.reconstructions import fill_in
    from rigid_motion_batch.scenes.body_scene import build_body_stage
    from rigid_motion_batch.scenes.film import save_blend
    from rigid_motion_batch.scenes.scene import build_stage
    from rigid_motion_batch.scenes.settings import SubjectError

    clip, found = parameters.clip.read(job.before[0]), result_in(job.before[1])
    try:
        if clip.figure is None:
            keys = {mode: keys[0] for mode, keys in found.keys.items()}
            made = fill_in(clip, found.choice, keys, parameters.radii.rigid, found.mode_of_segments)
            build_stage(made, parameters.stage)
        else:
            made = BodyReconstruction(clip, found.choice, dict(found.keys), parameters.shared)
            build_body_stage(made, parameters.stage, parameters.radii.of(clip.figure.joints))
        save_blend(job.folder / BLEND)
    except (RuntimeError, SubjectError) as error:
        raise TaskError(f"{clip.name} {found.choice.phrase}: no video: {error}") from None


@dataclass(frozen=True)
class Frames:
    title: str
    first: int
    last: int


@step(rooms=SCENES, stage="render", temporary=True, blender=True)
def render(job: Job, parameters: Frames) -> dict[str, float]:
    """Render some frames of a film. Before: its scene."""
    from rigid_motion_batch.scenes.film import render_piece

    try:
        blend, piece = job.before[0] / BLEND, job.folder / PIECE
        return {"rendering": render_piece(blend, parameters.first, parameters.last, piece, job.progress)}
    except RuntimeError as error:
        raise TaskError(f"{parameters.title}: no video: {error}") from None


@step(rooms=SCENES, stage="encode", blender=True)
def encode(job: Job, parameters: Frames) -> dict[str, float]:
    """Join the pieces of a film. Before: its scene, and the pieces."""
    from rigid_motion_batch.scenes.film import join_pieces

    blend, *pieces = job.before
    try:
        places = [piece / PIECE for piece in pieces]
        seconds = join_pieces(
            blend / BLEND, places, job.folder / FILM, lambda done, of: job.progress(done, of, "encoding")
        )
    except RuntimeError as error:
        raise TaskError(f"{parameters.title}: no video: {error}") from None
    return {"rendering": seconds}


# -- pages ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class About:
    """What a page says of the run, but for its date."""

    program: str
    command: str
    details: Mapping[str, str] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)
    """Of modes that `MODES` does not have."""


@dataclass(frozen=True)
class ClipShown:
    """What a page shows of a clip, in the order of the tasks before: recording, keys needed, and for every choice of
    keys measurement, Decimate and film."""

    clip: ClipOf
    choices: tuple[str, ...]
    needed: bool
    decimated: tuple[str, ...]
    filmed: tuple[str, ...]
    """Names of choices."""


@dataclass(frozen=True)
class Page:
    clips: tuple[ClipShown, ...]
    about: About
    radii: Radii
    coming: bool = False
    """Whether films are still being made."""

    overview: str = ""
    """The way to the page of all clips."""

    folder: str = ""
    """Where the page will be, in the output folder."""


class Clips:
    """The results before a page, one clip in memory at a time."""

    def __init__(self, job: Job, parameters: Page) -> None:
        self.films: dict[tuple[str, str], Path | None] = {}
        self.pages: list[bool] = []
        self._job, self._parameters = job, parameters

    def __iter__(self) -> Iterator[ClipResult]:
        from rigid_motion_batch.analysis.body_decimated import KeysOfBody
        from rigid_motion_batch.analysis.needed import KeysNeeded
        from rigid_motion_batch.analysis.results import clip_result

        before = iter(self._job.before)
        for shown in self._parameters.clips:
            recording, needed = next(before), next(before) if shown.needed else None
            found = []
            for choice in shown.choices:
                measured = next(before)
                decimated = next(before) if choice in shown.decimated else None
                if measured:
                    rows = values.read(tuple[KeysOfBody, ...], decimated / "decimated") if decimated else ()
                    found.append(replace(result_in(measured), decimated=rows))
            keys = values.read(KeysNeeded, needed / "needed") if needed else None
            if recording and found:
                yield clip_result(shown.clip.read(recording), found, keys)


@step(rooms=REPORT, stage="report", partial=True)
def page(job: Job, parameters: Page) -> None:
    """Write a page of some clips. Before: what `ClipShown` says of each, and then its films."""
    from rigid_motion_batch.report import write_report

    clips, films, folder = Clips(job, parameters), {}, Path(parameters.folder)
    numbers = sum(1 + shown.needed + len(shown.choices) + len(shown.decimated) for shown in parameters.clips)
    made = iter(job.before[numbers:])
    for shown in parameters.clips:
        for choice in shown.filmed:
            there = parameters.coming or next(made)
            films[shown.clip.name, choice] = Path(shown.clip.name, choice, FILM) if there else None
    done = iter(range(1, len(parameters.clips) + 1))
    write_report(
        job.folder / PAGE,
        clips,
        _settings(parameters),
        films,
        folder=folder,
        overview=parameters.overview,
        advance=lambda: job.progress(next(done), len(parameters.clips)),
    )


@step(rooms=REPORT, stage="report", partial=True)
def overview(job: Job, parameters: Page) -> None:
    """Write the page of many clips. Before: what `ClipShown` says of each, and then their pages."""
    from rigid_motion_batch.report import write_overview

    there = job.before[-len(parameters.clips) :]
    names = [shown.clip.name for shown in parameters.clips]
    pages = {name: f"{name}/{PAGE}" if made else None for name, made in zip(names, there, strict=True)}
    done = iter(range(1, len(names) + 1))
    write_overview(
        job.folder / PAGE,
        Clips(job, parameters),
        _settings(parameters),
        pages,
        advance=lambda: job.progress(next(done), len(names)),
    )


def _settings(parameters: Page) -> object:
    from rigid_motion_batch.report import Settings

    about, radii = parameters.about, parameters.radii
    return Settings(
        radii.rigid,
        about.program,
        about.command,
        joint_radius=radii.joint,
        details=dict(about.details),
        names=dict(about.names),
    )
