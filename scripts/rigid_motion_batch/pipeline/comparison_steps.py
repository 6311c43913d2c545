"""The steps of a comparison: from recordings to clips, from clips to numbers, from numbers to films and pages.

What passes between them are the values of `recordings` and `analysis` themselves, written by `values`. Those that need
Blender load nothing but NumPy and bpy. Every step imports what it needs when it is done.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import groupby, zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from rigid_motion_batch.analysis.choices import Choice
from rigid_motion_batch.analysis.radii import Radii
from rigid_motion_batch.recordings.clips import Clip, ClipFacts
from rigid_motion_batch.recordings.options import ReadingOptions
from rigid_motion_batch.report.settings import Settings
from rigid_motion_batch.scenes.settings import SceneSettings, SubjectError

from . import values
from .steps import Job, TaskError, step

if TYPE_CHECKING:
    from rigid_motion_batch.analysis.bodies import BodyReconstruction
    from rigid_motion_batch.analysis.results import ChoiceResult, ClipResult

RECORDINGS = ("rigid_motion/motion", "recordings", "axes.py", "command_line.py", "files.py", "rows.py")
ANALYSIS = (*RECORDINGS, "analysis")
SCENES = (*ANALYSIS, "rigid_motion/animation", "scenes", "palette.py", "silencing.py")
REPORT = (*ANALYSIS, "report", "palette.py")
MODEL = (*ANALYSIS, "rigid_motion/gltf", "report/glb.py", "report/mesh.py", "palette.py")

ROWS, JOINT_ROWS, FILM, BLEND, PAGE = "rows.csv", "joints.csv", "comparison.mp4", "comparison.blend", "report.html"
PIECE, MESH, GLB = "piece.mkv", "mesh.npz", "comparison.glb"
PAGE_DATA = "report_data/"
"""The folder of what is too large for a page."""


@contextmanager
def _told(what: str) -> Iterator[None]:
    """Raise what Blender cannot do as an error of the task."""
    try:
        yield
    except (RuntimeError, SubjectError) as error:
        raise TaskError(f"{what}: {' '.join(str(error).split())}") from None


# -- recordings -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Read:
    source: str
    """The source as the user gave it."""

    axes: str | None
    options: ReadingOptions
    blender: str = ""
    """The version of Blender, for formats that it reads."""

    against: str = ""
    """Another motion of the same, as a source."""

    called: str = ""
    """The name of that motion."""


def _read(job: Job, parameters: Read) -> None:
    """Read a source, and repair its clips."""
    import numpy as np

    from rigid_motion_batch.recordings import TrajectoryError, against, clip_reading

    source, other, how = parameters.source, parameters.against, (parameters.axes, parameters.options)
    try:
        clips, note = clip_reading.read_source(source, *how)
        if other:
            if len(clips) > 1:
                raise TrajectoryError(source, f"{len(clips)} bodies", "name the one that --against is of")
            clip, more = against.with_against(clips[0], other, parameters.called, *how)
            clips, note = [clip], "; ".join(filter(None, (note, more)))
    except TrajectoryError as error:
        raise TaskError(str(error)) from None
    for number, clip in enumerate(clips):
        values.write(job.folder / f"{number}", clip)
        np.save(job.folder / f"{number}.times.npy", clip.times)
    values.write(job.folder / "facts", (note, tuple(map(ClipFacts.of, clips))))


@step(rooms=RECORDINGS, stage="read")
def read(job: Job, parameters: Read) -> None:
    _read(job, parameters)


@step(rooms=(*RECORDINGS, "rigid_motion/animation"), stage="read", blender=True)
def read_in_blender(job: Job, parameters: Read) -> None:
    _read(job, parameters)


@dataclass(frozen=True)
class ClipOf:
    """A clip of a source that was read."""

    name: str
    """The name of the clip in this run."""

    body: int = 0
    """The number of the body in the source, from 0."""

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
    """The form of the tables of poses."""


@step(rooms=ANALYSIS, stage="measure")
def measure(job: Job, parameters: Measure) -> None:
    """Choose keys of a clip, let the modes fill them in, and measure what was lost. Before: the recording."""
    from rigid_motion_batch.analysis import body_metrics, metrics, results

    clip, choice, radii = parameters.clip.read(job.results[0]), parameters.choice, parameters.radii
    made = results.made_of(clip, choice, parameters.modes, radii, shared=parameters.shared)
    if made is None:
        raise TaskError(f"{clip.name}: too short for two keys {choice.phrase}")
    result = results.measured(made, radii)
    results.write_tables(job.folder, made, parameters.form)
    metrics.write_metrics(job.folder / ROWS, result.rows)
    if result.joints:
        body_metrics.write_joint_metrics(job.folder / JOINT_ROWS, result.joints)
    values.write(job.folder / "result", result)
    values.write(job.folder / "numbers", result.numbers)


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
    from rigid_motion_batch.analysis.body_needed import ways_of
    from rigid_motion_batch.analysis.modes import single_modes

    done = iter(range(1, len(needed.RATES) + 1))
    ways = ways_of(parameters.clip.read(job.results[0]), parameters.radii, fit=parameters.fit)
    modes = single_modes(parameters.modes)
    result = needed.keys_needed(ways, modes, advance=lambda: job.progress(next(done), len(needed.RATES)))
    needed.write_keys_needed(job.folder / ROWS, [result])
    values.write(job.folder / "needed", result)


@step(rooms=SCENES, stage="measure", blender=True)
def decimate(job: Job, parameters: Measure) -> None:
    """See what Blender's Decimate needs to be as good as the keys of a whole body. Before: recording, measurement."""
    from rigid_motion_batch.analysis.body_decimated import write_keys_of_bodies
    from rigid_motion_batch.analysis.results import made_again
    from rigid_motion_batch.scenes.decimating import beside_decimate

    clip, result = parameters.clip.read(job.results[0]), result_in(job.results[1])
    made = cast("BodyReconstruction", made_again(clip, result, parameters.radii, shared=parameters.shared))
    known = [row for row in result.rows if row.keys]
    with _told(f"{clip.name} {result.choice.phrase}: not compared with Blender's Decimate"):
        rows = beside_decimate(made, parameters.radii.of(clip.whole_body.joints), known)
    write_keys_of_bodies(job.folder / ROWS, rows)
    values.write(job.folder / "decimated", tuple(rows))


@dataclass(frozen=True)
class Model:
    clip: ClipOf
    radii: Radii
    shared: bool


@step(rooms=MODEL, stage="report")
def model(job: Job, parameters: Model) -> None:
    """Write all motions side by side, for any viewer. Before: the recording, and what was measured."""
    from rigid_motion.gltf import GltfError
    from rigid_motion_batch.analysis.results import made_again
    from rigid_motion_batch.report.glb import comparison_glb

    clip, result = parameters.clip.read(job.results[0]), result_in(job.results[1])
    made = made_again(clip, result, parameters.radii, shared=parameters.shared)
    try:
        content = comparison_glb(made, [motion.modes for motion in result.motions])
    except GltfError as error:
        raise TaskError(f"{clip.name} {result.choice.phrase}: no {GLB}: {error}") from None
    (job.folder / GLB).write_bytes(content)


@dataclass(frozen=True)
class Join:
    rows: str
    """The name of the part of the table in every result."""


@step(rooms=("analysis", "files.py"), stage="report", partial=True)
def tabulate(job: Job, parameters: Join) -> None:
    """Write the table of all clips. Before: its parts."""
    from rigid_motion_batch.analysis.body_metrics import join_tables

    join_tables(job.folder / "table.csv", [folder / parameters.rows for folder in job.results])


def result_in(folder: Path) -> ChoiceResult:
    from rigid_motion_batch.analysis.results import ChoiceResult

    return values.read(ChoiceResult, folder / "result")


# -- films ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Build:
    clip: ClipOf
    radii: Radii
    shared: bool
    stage: SceneSettings
    blender: str
    """The version of Blender."""


@step(rooms=SCENES, stage="build", blender=True)
def build(job: Job, parameters: Build) -> None:
    """Build the scene of a film, and save it. Before: the recording, and what was measured."""
    from rigid_motion_batch.analysis.reconstructions import Reconstruction
    from rigid_motion_batch.analysis.results import made_again
    from rigid_motion_batch.scenes.body_scene import build_body_scene
    from rigid_motion_batch.scenes.film import save_blend
    from rigid_motion_batch.scenes.scene import build_scene

    clip, result, radii = parameters.clip.read(job.results[0]), result_in(job.results[1]), parameters.radii
    with _told(f"{clip.name} {result.choice.phrase}: no video"):
        made = made_again(clip, result, radii, shared=parameters.shared)
        if isinstance(made, Reconstruction):
            build_scene(made, parameters.stage)
        else:
            build_body_scene(made, parameters.stage, radii.of(clip.whole_body.joints))
        save_blend(job.folder / BLEND)


@dataclass(frozen=True)
class Frames:
    title: str
    first: int
    last: int


@step(rooms=SCENES, stage="render", blender=True)
def render(job: Job, parameters: Frames) -> dict[str, float]:
    """Render some frames of a film. Before: its scene."""
    from rigid_motion_batch.scenes.film import render_piece

    blend, piece = job.results[0] / BLEND, job.folder / PIECE
    with _told(f"{parameters.title}: no video"):
        return {"rendering": render_piece(blend, parameters.first, parameters.last, piece, job.progress)}


@step(rooms=SCENES, stage="encode", blender=True)
def encode(job: Job, parameters: Frames) -> dict[str, float]:
    """Join the pieces of a film. Before: its scene, and the pieces."""
    from rigid_motion_batch.scenes.film import join_pieces

    scene, *others = job.results
    pieces = [folder / PIECE for folder in others]
    with _told(f"{parameters.title}: no video"):
        seconds = join_pieces(
            scene / BLEND, pieces, job.folder / FILM, lambda done, total: job.progress(done, total, "encoding")
        )
    return {"rendering": seconds}


# -- pages ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Subject:
    requested: str
    blender: str
    """The version of Blender."""


@step(rooms=SCENES, stage="report", blender=True)
def subject(job: Job, parameters: Subject) -> None:
    """Read the object that rigid bodies move, simple enough for a page."""
    import numpy as np

    from rigid_motion_batch.scenes.simplified import simplified

    with _told("the report shows a drill"):
        np.savez(job.folder / MESH, **cast(dict[str, Any], simplified(parameters.requested)))


@dataclass(frozen=True, slots=True)
class Part:
    """The result of a task before a page."""

    what: str
    """The name of its step's function."""

    clip: ClipOf = ClipOf("")
    choice: str = ""
    """The name of the choice of keys."""


@dataclass(frozen=True)
class Page:
    parts: tuple[Part, ...]
    """Parts of the tasks before it, clip by clip, and the films last; these may be still to come."""

    settings: Settings
    coming: bool = False
    """True if films are still being made."""

    overview: str = ""
    """The way to the page of all clips."""

    folder: str = ""
    """The folder of the page, in the output folder."""

    @property
    def clips(self) -> list[str]:
        return list(dict.fromkeys(part.clip.name for part in self.parts if part.clip.name))


def _clips(job: Job, parameters: Page) -> Iterator[ClipResult]:
    """Yield the results before a page, one clip in memory at a time, without those that could not be made."""
    from rigid_motion_batch.analysis.body_decimated import KeysOfBody
    from rigid_motion_batch.analysis.needed import KeysNeeded
    from rigid_motion_batch.analysis.results import clip_result

    before = zip(parameters.parts, job.before, strict=False)
    for clip, parts in groupby(before, key=lambda each: each[0].clip):
        made = {(part.what, part.choice): folder for part, folder in parts if folder}
        result = []
        for what, choice in made:
            if what == "measure":
                rows = made.get(("decimate", choice))
                decimated = values.read(tuple[KeysOfBody, ...], rows / "decimated") if rows else ()
                result.append(replace(result_in(made[what, choice]), decimated=decimated))
        needed, recording = made.get(("count_keys", "")), made.get(("read", ""))
        if recording and result:
            keys = values.read(KeysNeeded, needed / "needed") if needed else None
            yield clip_result(clip.read(recording), result, keys)


@step(rooms=REPORT, stage="report", partial=True)
def page(job: Job, parameters: Page) -> None:
    """Write a page of some clips. Before: what `Page.parts` says."""
    import numpy as np

    from rigid_motion_batch.report.mesh import Mesh
    from rigid_motion_batch.report.pages import write_report

    films: dict[tuple[str, str], Path | None] = {}
    models: dict[tuple[str, str], Path] = {}
    mesh = None
    for part, folder in zip_longest(parameters.parts, job.before):
        if part.what == "encode":
            there = folder or parameters.coming
            films[part.clip.name, part.choice] = Path(part.clip.name, part.choice, FILM) if there else None
        elif part.what == "model" and folder:
            models[part.clip.name, part.choice] = Path(part.clip.name, part.choice, GLB)
        elif part.what == "subject" and folder:
            mesh = Mesh(**np.load(folder / MESH))
    write_report(
        job.folder / PAGE,
        _clips(job, parameters),
        parameters.settings,
        films,
        models,
        folder=Path(parameters.folder),
        mesh=mesh,
        overview=parameters.overview,
        advance=_counted(job, parameters),
    )


@step(rooms=REPORT, stage="report", partial=True)
def overview(job: Job, parameters: Page) -> None:
    """Write the page of many clips. Before: what `Page.parts` says, and then their pages."""
    from rigid_motion_batch.report.pages import write_overview

    there = zip(parameters.clips, job.before[len(parameters.parts) :], strict=True)
    pages = {name: f"{name}/{PAGE}" if made else None for name, made in there}
    advance = _counted(job, parameters)
    write_overview(job.folder / PAGE, _clips(job, parameters), parameters.settings, pages, advance=advance)


def _counted(job: Job, parameters: Page) -> Callable[[], None]:
    """Return a function that reports of every clip that it is on the page."""
    total = len(parameters.clips)
    done = iter(range(1, total + 1))
    return lambda: job.progress(next(done), total)
