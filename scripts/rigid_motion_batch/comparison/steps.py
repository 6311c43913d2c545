"""The steps of a comparison: what the tasks of its plan (`planning`) do, each from files to files.

What passes between tasks lies in `PARTS` of the output folder: recordings (`storage`), results (`results`), charts.
Every step imports what it alone needs, so that it is done again where that changes, and not where another step's does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigid_motion_batch.analysis.choices import Choice, choice_from
from rigid_motion_batch.comparison.storage import (
    ClipReference,
    file_names,
    read_clip,
    read_keys,
    write_keys,
    write_recording,
)
from rigid_motion_batch.files import write_text
from rigid_motion_batch.workplan import Job, TaskError, step

if TYPE_CHECKING:
    from rigid_motion_batch.analysis.metrics import Metrics
    from rigid_motion_batch.analysis.needed import KeysNeeded, Ways
    from rigid_motion_batch.comparison.results import ClipResults

    from .report.clip_section import Films

PARTS = ".parts"

METRICS, JOINT_METRICS, KEYS_NEEDED = "metrics.csv", "metrics_joints.csv", "keys_needed.csv"
DECIMATED = "decimated.csv"
REPORT, FILM = "report.html", "comparison.mp4"


# -- where things are, and the tasks that make them -------------------------------------------------------------------


def measuring(clip: str, choice: Choice) -> str:
    """The task that measures a clip under a choice of keys."""
    return f"measure {clip}/{choice.name}"


def counting(clip: str) -> str:
    """The task that finds the keys that a clip needs."""
    return f"count keys {clip}"


def decimating(clip: str, choice: Choice) -> str:
    """The task that sets the keys of a body beside those of Blender's Decimate."""
    return f"decimate {clip}/{choice.name}"


def filming(clip: str, choice: Choice) -> str:
    """The task at the end of which there is a film."""
    return f"encode {clip}/{choice.name}"


def paging(clip: str) -> str:
    """The task that writes the page of a clip."""
    return f"page {clip}"


def recording_of(digest: str) -> str:
    """Where the recording of a source is, by a digest of how it is read."""
    return f"{PARTS}/recordings/{digest}"


def result_of(clip: str, choice: Choice) -> tuple[str, str]:
    """The files of a result: the numbers, and the charts."""
    return f"{PARTS}/clips/{clip}/{choice.name}.json", f"{PARTS}/clips/{clip}/{choice.name}.html"


def keys_of(clip: str, choice: Choice) -> str:
    """The file of the keys that the modes kept."""
    return f"{PARTS}/clips/{clip}/{choice.name}.npz"


def body_of(clip: str, choice: Choice) -> str:
    """The file of what the report shows of a whole body."""
    return f"{PARTS}/clips/{clip}/{choice.name}.body.html"


def joints_of(clip: str, choice: Choice) -> str:
    """The file of the numbers of a body's joints."""
    return f"{PARTS}/clips/{clip}/{choice.name}.joints.csv"


def decimated_of(clip: str, choice: Choice) -> tuple[str, str]:
    """The files of a body's keys beside Decimate's: the numbers, and what the report shows of them."""
    return f"{PARTS}/clips/{clip}/{choice.name}.decimated.csv", f"{PARTS}/clips/{clip}/{choice.name}.decimated.html"


def needed_of(clip: str) -> str:
    """The file of the keys that a clip needs."""
    return f"{PARTS}/clips/{clip}/needed.json"


def folder_of(clip: str, choice: Choice) -> str:
    """The folder of a clip under a choice of keys."""
    return f"{clip}/{choice.name}"


def piece_of(clip: str, choice: Choice, first: int) -> str:
    """The file of a piece of a film."""
    return f"{PARTS}/films/{clip}/{choice.name}/{first:06}.mkv"


def film_of(clip: str, choice: Choice) -> str:
    return f"{folder_of(clip, choice)}/{FILM}"


def blend_of(clip: str, choice: Choice) -> str:
    return f"{folder_of(clip, choice)}/comparison.blend"


def page_of(clip: str) -> str:
    """The page of a clip, where clips have pages of their own."""
    return f"{clip}/{REPORT}"


# -- workers ----------------------------------------------------------------------------------------------------------


@step
def identify(job: Job, *, path: str) -> None:
    """Write which version of the program this is."""
    from .version import program_version

    write_text(job.writes(path), program_version())


# -- numbers ----------------------------------------------------------------------------------------------------------


@step
def read(job: Job, *, source: str, axes: str, options: Mapping[str, Any], recording: str) -> None:
    """Read a source, and repair its clips."""
    from rigid_motion_batch.recordings import ReadingOptions, TrajectoryError
    from rigid_motion_batch.recordings.clip_reading import read_source

    try:
        clips, note = read_source(source, axes, ReadingOptions(**options))
    except TrajectoryError as error:
        raise TaskError(str(error)) from None
    arrays, facts = file_names(recording)
    write_recording(job.writes(arrays), job.writes(facts), clips, note)


@step
def measure(job: Job, *, clip: Mapping[str, Any], choice: Sequence[str], modes: Sequence[str], radius: float) -> None:
    """Choose keys of a clip, let the modes fill them in, and measure what was lost."""
    from rigid_motion_batch.analysis.metrics import write_reconstruction
    from rigid_motion_batch.analysis.reconstructions import reconstruct
    from rigid_motion_batch.comparison.results import Result, write_result

    from .report.error_charts import errors_over_time

    whole, chosen = read_clip(job.output, ClipReference(**clip)), choice_from(*choice)
    made = reconstruct(whole, chosen, modes, radius)
    if made is None:
        raise TaskError(f"{whole.name}: too short for two keys {chosen.phrase}")
    numbers, charts = result_of(whole.name, chosen)
    write_reconstruction(job.writes(f"{folder_of(whole.name, chosen)}/{modes[0]}.csv").parent, made)
    write_result(job.writes(numbers), whole, Result.of(made))
    write_text(job.writes(charts), errors_over_time(made))
    write_keys(job.writes(keys_of(whole.name, chosen)), made)


@step
def measure_body(
    job: Job,
    *,
    clip: Mapping[str, Any],
    choice: Sequence[str],
    modes: Sequence[str],
    radii: Mapping[str, Any],
    shared: bool,
) -> None:
    """Choose keys of a whole body, let the modes fill them in, and measure what was lost."""
    from rigid_motion_batch.analysis.bodies import reconstruct_body
    from rigid_motion_batch.analysis.body_metrics import measure_modes, write_joint_metrics, write_key_tables
    from rigid_motion_batch.analysis.metrics import body_table_names
    from rigid_motion_batch.analysis.radii import Radii
    from rigid_motion_batch.comparison.body_storage import write_body_keys
    from rigid_motion_batch.comparison.results import Result, write_result

    from .report.body_charts import body_charts, body_curves

    whole, chosen = read_clip(job.output, ClipReference(**clip)), choice_from(*choice)
    of_joints = Radii(**radii).of(whole.figure.joints)
    made = reconstruct_body(whole, chosen, modes, of_joints, shared=shared)
    if made is None:
        raise TaskError(f"{whole.name}: too short for two keys {chosen.phrase}")
    measured = measure_modes(made, of_joints)
    numbers, charts = result_of(whole.name, chosen)
    tables = body_table_names(chosen, modes)
    write_key_tables(job.writes(f"{folder_of(whole.name, chosen)}/{tables[0]}").parent, made)
    write_result(job.writes(numbers), whole, Result.of_body(measured))
    write_joint_metrics(job.writes(joints_of(whole.name, chosen)), measured.joints)
    write_text(job.writes(charts), body_curves(measured))
    write_text(job.writes(body_of(whole.name, chosen)), body_charts(measured))
    write_body_keys(job.writes(keys_of(whole.name, chosen)), made)


@step
def decimate_body(
    job: Job, *, clip: Mapping[str, Any], choice: Sequence[str], radii: Mapping[str, Any], shared: bool
) -> None:
    """See what Blender's Decimate needs to be as good as the keys of a whole body under each mode."""
    from rigid_motion_batch.analysis.body_decimated import write_keys_of_bodies
    from rigid_motion_batch.analysis.radii import Radii
    from rigid_motion_batch.comparison.body_storage import read_body_keys
    from rigid_motion_batch.comparison.results import read_numbers
    from rigid_motion_batch.scenes.decimating import beside_decimate

    from .report.decimated_table import decimated_table

    whole, chosen = read_clip(job.output, ClipReference(**clip)), choice_from(*choice)
    made = read_body_keys(job.reads(keys_of(whole.name, chosen)), whole, chosen, shared=shared)
    _, measured = read_numbers(job.reads(result_of(whole.name, chosen)[0]))
    try:
        rows = beside_decimate(made, Radii(**radii).of(whole.figure.joints), measured.rows)
    except RuntimeError as error:
        problem = " ".join(str(error).split())
        raise TaskError(f"{whole.name} {chosen.phrase}: not compared with Blender's Decimate: {problem}") from None
    numbers, shown = decimated_of(whole.name, chosen)
    write_keys_of_bodies(job.writes(numbers), rows)
    write_text(job.writes(shown), decimated_table(f"{whole.name} {chosen.phrase}", rows, measured.groups))


@step
def count_keys(job: Job, *, clip: Mapping[str, Any], modes: Sequence[str], radius: float, fit: bool) -> None:
    """Find how many keys every mode needs on a clip."""
    from rigid_motion_batch.analysis.needed import OfRigidBody

    whole = read_clip(job.output, ClipReference(**clip))
    _write_needed(job, whole.name, OfRigidBody(whole, radius, fit=fit), modes)


@step
def count_key_poses(job: Job, *, clip: Mapping[str, Any], modes: Sequence[str], radii: Mapping[str, Any]) -> None:
    """Find how many key poses every mode needs on a whole body."""
    from rigid_motion_batch.analysis.body_needed import OfBody
    from rigid_motion_batch.analysis.radii import Radii

    whole = read_clip(job.output, ClipReference(**clip))
    _write_needed(job, whole.name, OfBody(whole, Radii(**radii).of(whole.figure.joints)), modes)


def _write_needed(job: Job, clip: str, ways: Ways, modes: Sequence[str]) -> None:
    from rigid_motion_batch.analysis import needed
    from rigid_motion_batch.analysis.modes import single_modes

    found = needed.keys_needed(ways, single_modes(modes), advance=_counted(job, needed.RATES))
    write_text(job.writes(needed_of(clip)), needed.to_json(found))


@step
def tabulate(job: Job, *, studies: Sequence[Any]) -> None:
    """Write the tables of all clips."""
    from rigid_motion_batch.analysis.metrics import write_metrics

    advance = _counted(job, studies)

    def rows() -> Iterator[Metrics]:
        for clip in Clips(job, studies):
            for result in clip.results:
                yield from result.rows
            advance()

    write_metrics(job.writes(METRICS), rows())


@step
def tabulate_joints(job: Job, *, studies: Sequence[Any]) -> None:
    """Write the table of the joints of all bodies."""
    from rigid_motion_batch.analysis.body_metrics import join_tables, write_joint_metrics

    parts = _parts(job, studies, measuring, joints_of)
    if parts:
        join_tables(job.writes(JOINT_METRICS), parts)
    else:
        write_joint_metrics(job.writes(JOINT_METRICS), ())


@step
def tabulate_decimated(job: Job, *, studies: Sequence[Any]) -> None:
    """Write the table of the keys of all bodies beside Decimate's."""
    from rigid_motion_batch.analysis.body_decimated import write_keys_of_bodies
    from rigid_motion_batch.analysis.body_metrics import join_tables

    parts = _parts(job, studies, decimating, lambda clip, choice: decimated_of(clip, choice)[0])
    if parts:
        join_tables(job.writes(DECIMATED), parts)
    else:
        write_keys_of_bodies(job.writes(DECIMATED), ())


def _parts(
    job: Job, studies: Sequence[Any], task: Callable[[str, Choice], str], file: Callable[[str, Choice], str]
) -> list[Path]:
    """The files of those tasks, one for each clip and choice of keys, that have been done."""
    whole = [(clip, choice_from(*choice)) for clip, choices in studies for choice in choices]
    return [job.reads(file(clip, choice)) for clip, choice in whole if task(clip, choice) in job.finished]


@step
def tabulate_keys(job: Job, *, studies: Sequence[Any]) -> None:
    """Write the table of the keys that all clips need."""
    from rigid_motion_batch.analysis.needed import write_keys_needed

    found = [clip.needed for clip in Clips(job, studies) if clip.needed]
    write_keys_needed(job.writes(KEYS_NEEDED), found)


# -- films ------------------------------------------------------------------------------------------------------------
# Blender is loaded by those who need it.


@step
def build(job: Job, *, clip: Mapping[str, Any], choice: Sequence[str], radius: float, stage: Mapping[str, Any]) -> None:
    """Build the stage of a film, and save it."""
    from rigid_motion_batch.scenes.film import save_blend
    from rigid_motion_batch.scenes.scene import build_stage
    from rigid_motion_batch.scenes.settings import StageSettings, SubjectError

    whole, chosen = read_clip(job.output, ClipReference(**clip)), choice_from(*choice)
    made = read_keys(job.reads(keys_of(whole.name, chosen)), whole, chosen, radius)
    try:
        build_stage(made, StageSettings(**{**stage, "resolution": tuple(stage["resolution"])}))
        save_blend(job.writes(blend_of(whole.name, chosen)))
    except (RuntimeError, SubjectError) as error:
        raise TaskError(f"{whole.name} {chosen.phrase}: no video: {error}") from None


@step
def build_body(
    job: Job,
    *,
    clip: Mapping[str, Any],
    choice: Sequence[str],
    radii: Mapping[str, Any],
    shared: bool,
    stage: Mapping[str, Any],
) -> None:
    """Build the stage of a film of whole bodies, and save it."""
    from rigid_motion_batch.analysis.radii import Radii
    from rigid_motion_batch.comparison.body_storage import read_body_keys
    from rigid_motion_batch.scenes.body_scene import build_body_stage
    from rigid_motion_batch.scenes.film import save_blend
    from rigid_motion_batch.scenes.settings import StageSettings

    whole, chosen = read_clip(job.output, ClipReference(**clip)), choice_from(*choice)
    made = read_body_keys(job.reads(keys_of(whole.name, chosen)), whole, chosen, shared=shared)
    settings = StageSettings(**{**stage, "resolution": tuple(stage["resolution"])})
    try:
        build_body_stage(made, settings, Radii(**radii).of(whole.figure.joints))
        save_blend(job.writes(blend_of(whole.name, chosen)))
    except RuntimeError as error:
        raise TaskError(f"{whole.name} {chosen.phrase}: no video: {error}") from None


@step
def render(job: Job, *, clip: str, choice: Sequence[str], first: int, last: int) -> dict[str, float]:
    """Render some frames of a film."""
    from rigid_motion_batch.scenes.film import render_piece

    chosen = choice_from(*choice)
    blend = job.reads(blend_of(clip, chosen))
    path = job.writes(piece_of(clip, chosen, first))
    try:
        seconds = render_piece(blend, first, last, path, job.progress)
    except RuntimeError as error:
        raise TaskError(f"{clip} {chosen.phrase}: no video: {error}") from None
    return {"rendering": seconds}


@step
def encode(job: Job, *, clip: str, choice: Sequence[str], firsts: Sequence[int]) -> dict[str, float]:
    """Join the pieces of a film."""
    from rigid_motion_batch.scenes.film import join_pieces

    chosen = choice_from(*choice)
    pieces = [job.reads(piece_of(clip, chosen, first)) for first in firsts]
    blend, path = job.reads(blend_of(clip, chosen)), job.writes(film_of(clip, chosen))
    try:
        seconds = join_pieces(blend, pieces, path, lambda done, of: job.progress(done, of, "encoding"))
    except RuntimeError as error:
        raise TaskError(f"{clip} {chosen.phrase}: no video: {error}") from None
    return {"rendering": seconds}


# -- reports ----------------------------------------------------------------------------------------------------------


class Clips:
    """The results that there are of some clips, read anew each time one goes through them.

    Parameters
    ----------
    job : Job
        Its `finished` tasks tell what there is.
    studies : sequence of (name, choices)
        Choices as plain data.
    """

    def __init__(self, job: Job, studies: Sequence[tuple[str, Sequence[Sequence[str]]]]) -> None:
        self._job = job
        self._studies = [(clip, [choice_from(*choice) for choice in choices]) for clip, choices in studies]

    def __iter__(self) -> Iterator[ClipResults]:
        from rigid_motion_batch.comparison.results import ClipResults, read_result

        for clip, choices in self._studies:
            read = [
                read_result(
                    *map(self._job.reads, result_of(clip, choice)),
                    self._job.output / body_of(clip, choice),
                    self._decimated(clip, choice),
                )
                for choice in choices
                if measuring(clip, choice) in self._job.finished
            ]
            if read:
                facts = read[0][0]
                yield ClipResults(facts, tuple(result for _, result in read), self._needed(clip))

    def films(self, filmed: Sequence[tuple[str, Sequence[str]]], *, coming: bool) -> Films:
        """These films, each a clip and a choice as plain data, whether they are there, or coming."""
        films: dict[tuple[str, str], Path | None] = {}
        for clip, parts in filmed:
            choice = choice_from(*parts)
            if coming:
                films[clip, choice.name] = self._job.output / film_of(clip, choice)
            else:
                there = filming(clip, choice) in self._job.finished
                films[clip, choice.name] = self._job.reads(film_of(clip, choice)) if there else None
        return films

    def pages(self) -> dict[str, str | None]:
        """The pages of all of them."""
        names = [clip for clip, _ in self._studies]
        return {clip: page_of(clip) if paging(clip) in self._job.finished else None for clip in names}

    def _decimated(self, clip: str, choice: Choice) -> Path | None:
        if decimating(clip, choice) not in self._job.finished:
            return None
        return self._job.reads(decimated_of(clip, choice)[1])

    def _needed(self, clip: str) -> KeysNeeded | None:
        from rigid_motion_batch.analysis import needed

        if counting(clip) not in self._job.finished:
            return None
        return needed.from_json(self._job.reads(needed_of(clip)).read_text(encoding="utf-8"))


@step
def report(
    job: Job, *, studies: Sequence[Any], settings: Mapping[str, Any], filmed: Sequence[Any], coming: bool
) -> None:
    """Write the report of a few clips on one page."""
    from .report.pages import Settings, write_report

    clips = Clips(job, studies)
    films = clips.films(filmed, coming=coming)
    path = job.writes(REPORT)
    write_report(
        path, clips, films=films, settings=Settings(**settings), folder=job.output, advance=_counted(job, studies)
    )


@step
def clip_page(
    job: Job, *, studies: Sequence[Any], settings: Mapping[str, Any], filmed: Sequence[Any], coming: bool
) -> None:
    """Write the page of a clip, the only one of these studies."""
    from .report.pages import Settings, write_clip_page

    clips = Clips(job, studies)
    (clip,) = clips
    path = page_of(clip.facts.name)
    write_clip_page(
        job.writes(path),
        clip,
        films=clips.films(filmed, coming=coming),
        settings=Settings(**settings),
        folder=(job.output / path).parent,
        overview=f"../{REPORT}",
    )


@step
def overview(job: Job, *, studies: Sequence[Any], settings: Mapping[str, Any]) -> None:
    """Write the page of many clips."""
    from .report.pages import Settings, write_overview

    clips = Clips(job, studies)
    write_overview(
        job.writes(REPORT),
        clips,
        pages=clips.pages(),
        settings=Settings(**settings),
        advance=_counted(job, studies),
    )


def _counted(job: Job, things: Sequence[Any]) -> Callable[[], None]:
    """Something to call once for each of some things, that says how far the job is."""
    done = 0

    def advance() -> None:
        nonlocal done
        done += 1
        job.progress(done, len(things))

    return advance
