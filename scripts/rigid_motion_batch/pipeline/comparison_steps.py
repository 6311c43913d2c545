"""The steps of a comparison: from recordings to clips, from clips to numbers, from numbers to films and pages.

Steps pass on the values of `recordings` and `analysis`, written by `values`. Steps that need Blender load nothing but
NumPy and bpy. Every step imports the modules that it needs when it runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import groupby, zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from rigid_motion_batch.analysis.choices import Choice, Radii
from rigid_motion_batch.recordings.clips import Clip, ClipFacts
from rigid_motion_batch.recordings.options import ReadingOptions
from rigid_motion_batch.report.settings import PageSettings
from rigid_motion_batch.scenes.settings import SceneSettings, SubjectError

from . import values
from .steps import Step, StepJob, TaskError

if TYPE_CHECKING:
    from rigid_motion_batch.analysis.held import PairSlips
    from rigid_motion_batch.analysis.results import ChoiceResult, ClipResult

STAGES = ("read", "measure", "slip", "build", "render", "encode", "report")
"""Stages of a comparison; each begins when all stages before it have ended."""

RECORDINGS = ("rigid_motion/motion", "recordings", "axes.py", "command_line.py", "files.py")
ANALYSIS = (*RECORDINGS, "analysis")
SCENES = (*ANALYSIS, "rigid_motion/animation", "scenes", "palette.py", "saving.py", "silencing.py")
REPORT = (*ANALYSIS, "report", "palette.py")

ROWS, JOINT_ROWS, FILM, BLEND, PAGE = "rows.csv", "joints.csv", "comparison.mp4", "comparison.blend", "report.html"
PIECE, MESH = "piece.mkv", "mesh.npz"
PAGE_DATA = "report_data/"
"""The folder of data that is too large for a page."""


@contextmanager
def _raising_task_errors(what: str) -> Iterator[None]:
    """Raise Blender's errors as errors of the task."""
    try:
        yield
    except (RuntimeError, SubjectError) as error:
        raise TaskError(f"{what}: {' '.join(str(error).split())}") from None


# -- recordings -------------------------------------------------------------------------------------------------------


class Read(Step, rooms=RECORDINGS, stage="read"):
    """Read a source, and repair its clips."""

    source: str
    """The source as the user gave it."""

    axes: str | None
    options: ReadingOptions
    version: str = ""
    """The version of Blender, for formats that it reads."""

    against: str = ""
    """The source of another motion of the same clip, to compare with."""

    called: str = ""
    """The name of that motion."""

    def make(self, job: StepJob) -> None:
        import numpy as np

        from rigid_motion_batch.recordings import TrajectoryError, clip_reading

        how = self.axes, self.options
        try:
            clips, note = clip_reading.read_source(self.source, *how)
            if self.against:
                if len(clips) > 1:
                    raise TrajectoryError(self.source, f"{len(clips)} bodies", "name the one that --against is of")
                clip, more = clip_reading.with_against(clips[0], self.against, self.called, *how)
                clips, note = [clip], "; ".join(filter(None, (note, more)))
        except TrajectoryError as error:
            raise TaskError(str(error)) from None
        for number, clip in enumerate(clips):
            values.write(job.folder / f"{number}", clip)
            np.save(job.folder / f"{number}.times.npy", clip.times)
        values.write(job.folder / "facts", (note, tuple(map(ClipFacts.of, clips))))


class ReadInBlender(Read, rooms=(*RECORDINGS, "rigid_motion/animation"), blender=True):
    """Read a source that needs Blender."""


@dataclass(frozen=True)
class ClipOf:
    """A clip of a source, by name and body."""

    name: str
    """The name of the clip in this run."""

    body: int = 0
    """The number of the body in the source, from 0."""

    def read(self, folder: Path) -> Clip:
        return replace(values.read(Clip, folder / f"{self.body}"), name=self.name)


# -- numbers ----------------------------------------------------------------------------------------------------------


class Measure(Step, rooms=ANALYSIS, stage="measure"):
    """Choose keys of a clip, let the modes fill in the rest, and measure the errors. Before: the recording."""

    clip: ClipOf
    choice: Choice
    modes: tuple[str, ...]
    radii: Radii
    shared: bool = False

    def make(self, job: StepJob) -> None:
        from rigid_motion_batch.analysis import metrics, results
        from rigid_motion_batch.analysis.reconstructions import reconstruct
        from rigid_motion_batch.files import write_rows

        clip = self.clip.read(job.results[0])
        made = reconstruct(clip, self.choice, self.modes, self.radii.of(clip), shared=self.shared)
        if made is None:
            raise TaskError(f"{clip.name}: too short for two keys {self.choice.phrase}")
        result = results.measured(made)
        metrics.write_tables(job.folder, made)
        write_rows(job.folder / ROWS, metrics.Metrics, result.rows)
        if result.joints:
            write_rows(job.folder / JOINT_ROWS, metrics.JointMetrics, result.joints)
        values.write(job.folder / "result", result)
        values.write(job.folder / "numbers", result.numbers)


class CountKeys(Step, rooms=ANALYSIS, stage="measure"):
    """Find how many keys every mode needs on a clip. Before: the recording."""

    clip: ClipOf
    modes: tuple[str, ...]
    radii: Radii
    fit: bool
    reference: str
    """The mode that sets the error to match."""

    def make(self, job: StepJob) -> None:
        from rigid_motion_batch.analysis import needed
        from rigid_motion_batch.files import write_rows

        done = iter(range(1, len(needed.RATES) + 1))
        clip = self.clip.read(job.results[0])
        ways = needed.Ways(clip, self.radii.of(clip), self.fit)
        result = needed.keys_needed(
            ways, self.modes, self.reference, advance=lambda: job.progress(next(done), len(needed.RATES))
        )
        write_rows(job.folder / ROWS, needed.NeededRow, needed.rows_of(result))
        values.write(job.folder / "needed", result)


class MeasureSlips(Step, rooms=ANALYSIS, stage="slip", partial=True):
    """Measure how far a held body slips. Before: both recordings, then for each choice both measured results.

    This is a stage of its own, so that the measurements of all shares of a farm are available.
    """

    holder: ClipOf
    held: ClipOf
    radii: Radii
    shared: bool = False

    def make(self, job: StepJob) -> None:
        from rigid_motion_batch.analysis import held
        from rigid_motion_batch.analysis.results import made_again
        from rigid_motion_batch.files import write_rows

        recordings, measured = job.before[:2], job.before[2:]
        pairs = zip(measured[::2], measured[1::2], strict=True) if all(recordings) else ()
        clips = [clip.read(folder) for clip, folder in zip((self.holder, self.held), recordings, strict=True) if folder]
        found = []
        for folders in pairs:
            result = [result_in(folder) for folder in folders if folder]
            if len(result) < len(clips):
                continue
            made = [
                made_again(clip, one, self.radii, shared=self.shared) for clip, one in zip(clips, result, strict=True)
            ]
            if rows := held.slips(*made):
                found.append(held.ChoiceSlips(result[0].choice, rows))
        write_rows(job.folder / ROWS, held.Slip, [row for some in found for row in some.rows])
        values.write(job.folder / "slips", held.PairSlips(self.holder.name, self.held.name, tuple(found)))


class Tabulate(Step, rooms=("analysis", "files.py"), stage="report", partial=True):
    """Write the table of all clips. Before: its parts."""

    rows: str
    """The file name of the rows in every result."""

    def make(self, job: StepJob) -> None:
        from rigid_motion_batch.analysis.metrics import join_tables

        join_tables(job.folder / "table.csv", [folder / self.rows for folder in job.results])


def result_in(folder: Path) -> ChoiceResult:
    from rigid_motion_batch.analysis.results import ChoiceResult

    return values.read(ChoiceResult, folder / "result")


# -- films ------------------------------------------------------------------------------------------------------------


class Build(Step, rooms=SCENES, stage="build", blender=True):
    """Build the scene of a film, and save it. Before: the recording, its measured result, its slips in holders."""

    clip: ClipOf
    radii: Radii
    shared: bool
    settings: SceneSettings
    version: str
    """The version of Blender."""

    def make(self, job: StepJob) -> None:
        from rigid_motion_batch.analysis.held import PairSlips
        from rigid_motion_batch.analysis.results import made_again
        from rigid_motion_batch.scenes.body_scene import build_body_scene
        from rigid_motion_batch.scenes.film import save_blend
        from rigid_motion_batch.scenes.findings import findings_of
        from rigid_motion_batch.scenes.scene import build_scene

        clip, result, radii = self.clip.read(job.results[0]), result_in(job.results[1]), self.radii
        pairs = [values.read(PairSlips, folder / "slips") for folder in job.results[2:]]
        slips = [row for pair in pairs for some in pair.choices if some.choice == result.choice for row in some.rows]
        findings = findings_of(result.rows, slips)
        with _raising_task_errors(f"{clip.name} {result.choice.phrase}: no video"):
            made = made_again(clip, result, radii, shared=self.shared)
            if clip.rest_body is None:
                build_scene(made, self.settings, findings)
            else:
                build_body_scene(made, self.settings, findings)
            save_blend(job.folder / BLEND)


class Render(Step, rooms=SCENES, stage="render", blender=True):
    """Render some frames of a film. Before: its scene."""

    title: str
    first: int
    last: int

    def make(self, job: StepJob) -> None:
        from rigid_motion_batch.scenes.film import render_piece

        with _raising_task_errors(f"{self.title}: no video"):
            render_piece(job.results[0] / BLEND, self.first, self.last, job.folder / PIECE, job.progress)


class Encode(Render, stage="encode"):
    """Join the pieces of a film. Before: its scene, and the pieces."""

    def make(self, job: StepJob) -> None:
        from rigid_motion_batch.scenes.film import join_pieces

        scene, *others = job.results
        pieces = [folder / PIECE for folder in others]
        with _raising_task_errors(f"{self.title}: no video"):
            join_pieces(scene / BLEND, pieces, job.folder / FILM, job.progress)


# -- pages ------------------------------------------------------------------------------------------------------------


class Subject(Step, rooms=SCENES, stage="report", blender=True):
    """Read the object that rigid bodies move, simplified for a page."""

    requested: str
    version: str
    """The version of Blender."""

    def make(self, job: StepJob) -> None:
        import numpy as np

        from rigid_motion_batch.scenes.subject import simplified

        with _raising_task_errors("the report shows a drill"):
            np.savez(job.folder / MESH, **cast(dict[str, Any], simplified(self.requested)))


@dataclass(frozen=True, slots=True)
class Part:
    """The result of a task that a page shows."""

    what: str
    """The kind of result: "read", "measure", "count_keys", "slips", "encode" or "subject"."""

    clip: ClipOf = ClipOf("")
    """The clip; for slips, the held one."""

    choice: str = ""
    """The name of the choice of keys; for slips, the name of the holder's clip."""


class Page(Step, rooms=REPORT, stage="report", partial=True):
    """Write a page of some clips. Before: the results of `parts`."""

    parts: tuple[Part, ...]
    """The parts of the tasks before it, clip by clip, with the films last: films may be still to come."""

    settings: PageSettings
    coming: bool = False
    """Whether films are still being made."""

    overview: str = ""
    """The relative path of the page of all clips."""

    folder: str = ""
    """The folder of the page in the output folder."""

    @property
    def clips(self) -> list[str]:
        return list(dict.fromkeys(part.clip.name for part in self.parts if part.clip.name))

    def make(self, job: StepJob) -> None:
        import numpy as np

        from rigid_motion_batch.report.data import Mesh
        from rigid_motion_batch.report.pages import write_report

        films: dict[tuple[str, str], Path | None] = {}
        mesh = None
        for part, folder in zip_longest(self.parts, job.before):
            if part.what == "encode":
                there = folder or self.coming
                films[part.clip.name, part.choice] = Path(part.clip.name, part.choice, FILM) if there else None
            elif part.what == "subject" and folder:
                mesh = Mesh(**np.load(folder / MESH))
        write_report(
            job.folder / PAGE,
            self._results(job),
            self.settings,
            films,
            folder=Path(self.folder),
            mesh=mesh,
            slips=self._read_slips(job),
            overview=self.overview,
            advance=self._progress_by_clip(job),
        )

    def _results(self, job: StepJob) -> Iterator[ClipResult]:
        """Yield the results for a page, with one clip in memory at a time; skip results that could not be made."""
        from rigid_motion_batch.analysis.needed import KeysNeeded
        from rigid_motion_batch.analysis.results import clip_result

        before = zip(self.parts, job.before, strict=False)
        for clip, parts in groupby(before, key=lambda each: each[0].clip):
            made = {(part.what, part.choice): folder for part, folder in parts if folder}
            result = [result_in(folder) for (what, _), folder in made.items() if what == "measure"]
            needed, recording = made.get(("count_keys", "")), made.get(("read", ""))
            if recording and result:
                keys = values.read(KeysNeeded, needed / "needed") if needed else None
                yield clip_result(clip.read(recording), result, keys)

    def _read_slips(self, job: StepJob) -> list[PairSlips]:
        """Return the slips of all pairs for a page."""
        from rigid_motion_batch.analysis.held import PairSlips

        before = zip(self.parts, job.before, strict=False)
        folders = [folder for part, folder in before if part.what == "slips" and folder]
        return [values.read(PairSlips, folder / "slips") for folder in folders]

    def _progress_by_clip(self, job: StepJob) -> Callable[[], None]:
        """Return a function that reports one more clip on the page as progress."""
        total = len(self.clips)
        done = iter(range(1, total + 1))
        return lambda: job.progress(next(done), total)


class Overview(Page):
    """Write the page of many clips. Before: the results of `parts`, and then the pages of the clips."""

    def make(self, job: StepJob) -> None:
        from rigid_motion_batch.report.pages import write_overview

        there = zip(self.clips, job.before[len(self.parts) :], strict=True)
        pages = {name: f"{name}/{PAGE}" if made else None for name, made in there}
        write_overview(
            job.folder / PAGE,
            self._results(job),
            self.settings,
            pages,
            slips=self._read_slips(job),
            advance=self._progress_by_clip(job),
        )
