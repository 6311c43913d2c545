"""The steps of a comparison: what the tasks of its plan (`planning`) do, each from files to files.

What passes between tasks lies in `PARTS` of the output folder: recordings (`storage`), results (`results`), charts.
Every step imports what it alone needs, so that it is done again where that changes, and not where another step's does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scripts.files import write_text
from scripts.workplan import Job, TaskError, step

from .study.choices import Choice, choice_from
from .study.storage import ClipReference, file_names, read_clip, read_keys, write_keys, write_recording

if TYPE_CHECKING:
    from .report.clip_section import Films
    from .study.metrics import Metrics
    from .study.needed import KeysNeeded
    from .study.results import ClipResults

PARTS = ".parts"

METRICS, KEYS_NEEDED, REPORT, FILM = "metrics.csv", "keys_needed.csv", "report.html", "comparison.mp4"


# -- where things are, and the tasks that make them -------------------------------------------------------------------


def measuring(clip: str, choice: Choice) -> str:
    """The task that measures a clip under a choice of keys."""
    return f"measure {clip}/{choice.name}"


def counting(clip: str) -> str:
    """The task that finds the keys that a clip needs."""
    return f"count keys {clip}"


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
    from scripts.trajectories import ReadingOptions, TrajectoryError

    from .study.reading import read_source

    try:
        clips, note = read_source(source, axes, ReadingOptions(**options))
    except TrajectoryError as error:
        raise TaskError(str(error)) from None
    arrays, facts = file_names(recording)
    write_recording(job.writes(arrays), job.writes(facts), clips, note)


@step
def measure(job: Job, *, clip: Mapping[str, Any], choice: Sequence[str], modes: Sequence[str], radius: float) -> None:
    """Choose keys of a clip, let the modes fill them in, and measure what was lost."""
    from .report.error_charts import errors_over_time
    from .study.metrics import write_reconstruction
    from .study.reconstructions import reconstruct
    from .study.results import Result, write_result

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
def count_keys(job: Job, *, clip: Mapping[str, Any], modes: Sequence[str], radius: float, fit: bool) -> None:
    """Find how many keys every mode needs on a clip."""
    from .study import needed
    from .study.modes import single_modes

    whole = read_clip(job.output, ClipReference(**clip))
    found = needed.keys_needed(whole, single_modes(modes), radius, fit=fit, advance=_counted(job, needed.RATES))
    write_text(job.writes(needed_of(whole.name)), needed.to_json(found))


@step
def tabulate(job: Job, *, studies: Sequence[Any]) -> None:
    """Write the tables of all clips."""
    from .study.metrics import write_metrics

    advance = _counted(job, studies)

    def rows() -> Iterator[Metrics]:
        for clip in Clips(job, studies):
            for result in clip.results:
                yield from result.rows
            advance()

    write_metrics(job.writes(METRICS), rows())


@step
def tabulate_keys(job: Job, *, studies: Sequence[Any]) -> None:
    """Write the table of the keys that all clips need."""
    from .study.needed import write_keys_needed

    found = [clip.needed for clip in Clips(job, studies) if clip.needed]
    write_keys_needed(job.writes(KEYS_NEEDED), found)


# -- films ------------------------------------------------------------------------------------------------------------
# Blender is loaded by those who need it.


@step
def build(job: Job, *, clip: Mapping[str, Any], choice: Sequence[str], radius: float, stage: Mapping[str, Any]) -> None:
    """Build the stage of a film, and save it."""
    from .stage.film import save_blend
    from .stage.scene import build_stage
    from .stage.settings import StageSettings, SubjectError

    whole, chosen = read_clip(job.output, ClipReference(**clip)), choice_from(*choice)
    made = read_keys(job.reads(keys_of(whole.name, chosen)), whole, chosen, radius)
    try:
        build_stage(made, StageSettings(**{**stage, "resolution": tuple(stage["resolution"])}))
        save_blend(job.writes(blend_of(whole.name, chosen)))
    except (RuntimeError, SubjectError) as error:
        raise TaskError(f"{whole.name} {chosen.phrase}: no video: {error}") from None


@step
def render(job: Job, *, clip: str, choice: Sequence[str], first: int, last: int) -> dict[str, float]:
    """Render some frames of a film."""
    from .stage.film import render_piece

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
    from .stage.film import join_pieces

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
        from .study.results import ClipResults, read_result

        for clip, choices in self._studies:
            read = [
                read_result(*map(self._job.reads, result_of(clip, choice)))
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

    def _needed(self, clip: str) -> KeysNeeded | None:
        from .study import needed

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
