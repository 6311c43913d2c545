"""Reducing glTF files for `reduce.py`: the same file with fewer keys in all clips. No Blender is needed here."""

from __future__ import annotations

import multiprocessing
import signal
import tempfile
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rigid_motion.gltf import Document, GltfError, Options, ReducedClip, Report, read_document, reduced
from rigid_motion.gltf.documents import objects
from rigid_motion.motion.skeleton_stretches import Run
from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.command_line import printable
from rigid_motion_batch.supervising import end_with_parent

from .planning import place_of
from .records import Unreadable
from .reductions import Reductions, as_length, as_text, doubt, off
from .work import ClipNumbers, Numbers, RunningJob


def do_gltf(doing: RunningJob, how: Reductions, export: Callable[[Path], None] | None = None) -> None:
    """Read a file, or the file that `export` writes to a path, reduce its clips, and write it."""
    with doing.failing():
        doing.require_free(doing.job.output)
        reduce_gltf(doing, how, doing.job.output, export)


def reduce_gltf(
    doing: RunningJob,
    how: Reductions,
    output: Path,
    export: Callable[[Path], None] | None = None,
    per_unit: float = 1.0,
) -> None:
    """Reduce without checking the output path; raises FileProblem. A tolerance without a unit is in `per_unit` metres.

    An exported file is written even if nothing in it could be reduced.
    """
    job, outcome = doing.job, doing.outcome
    try:
        document = read_document(job.file) if export is None else _export_document(export)
        tolerance = None if how.tolerance is None else how.tolerance.metres(per_unit)
        with side_by_side(doing.work.processes) as run:
            names = ("radius", "shared", "count", "channels", "feet", "curves", "meshopt")
            own = {name: getattr(how, name) for name in names}
            report = reduced(document, Options(tolerance, **own, run=run))
    except GltfError as error:
        raise Unreadable(str(error)) from None
    except OSError as error:  # Can also occur during the reduction.
        raise Unreadable(f"this cannot be read ({error.strerror}): see to its path, and who may read it") from None
    length = how.tolerance or as_length(report.tolerance)
    for clip in report.clips:
        summary = _summary(clip, length, per_unit, doing.would, by_number=how.count is not None)
        doing.say(f"{printable(clip.name)}: {summary}")
    if report.size:
        doing.say(f"{report.size:.3g} m large{doubt(report.size, _joint_count(document), how.tolerance, per_unit)}")
    if report.reduced_before is not None:
        within = as_text(report.reduced_before)
        doing.say(f"reduced before within {within}: errors add up; reduce the original instead")
    done = 0 if report.left_alone else sum(clip.tracks is not None for clip in report.clips)
    outcome.clips += done
    _add_numbers(outcome.numbers, report)
    reason = "" if done else printable(report.left_alone)
    if reason and export is None:
        doing.leave_alone(reason)
        return
    if reason:
        doing.say(f"{reason}; {doing.would}written as it was exported")
    _write(doing, output, document, report)
    if how.report:
        from .views import place_of_views, views_of, write_views

        views = place_of_views(output)
        write_views(views, views_of(document, report, how.radius))
        outcome.beside.append(views)
    doing.tell_written(output)


def _write(doing: RunningJob, output: Path, document: Document, report: Report) -> None:
    files, folder = report.document.files(output.name), doing.job.file.parent
    if document.chunks is None:
        doing.outcome.read = [folder / name for name, path in document.companions(folder).items() if path]
        if place_of(output.parent) != place_of(folder):
            companions = report.document.companions(folder)
            files = {name: path.read_bytes() for name, path in companions.items() if path} | files
            for name in (name for name, path in companions.items() if not path):
                doing.say(f"{printable(name)} is outside of the folder of the file; left out")
    if doing.work.dry_run:
        return
    for name, content in files.items():
        place = output.parent / name
        if place != output:
            doing.outcome.beside.append(place)
            if _has_content(place, content):
                continue  # Several files may share an image.
            doing.record.refuse_to_replace(place)
        with doing.record.writing(place) as beside:
            beside.write_bytes(content)


def _has_content(path: Path, content: bytes) -> bool:
    """Return whether a file already has this content."""
    try:
        return path.read_bytes() == content
    except OSError:
        return False


def _add_numbers(numbers: Numbers, report: Report) -> None:
    """Add the numbers of a reduced file to those of its input."""
    numbers.size, numbers.tolerance = report.size, report.tolerance
    numbers.bytes_before = (numbers.bytes_before or 0) + report.before
    numbers.bytes_after = (numbers.bytes_after or 0) + report.after
    for clip in report.clips:
        keys, reason = (clip.before.keys, clip.after.keys), clip.reason or report.left_alone
        numbers.clips.append(ClipNumbers(clip.name, *keys, clip.error, clip.where, reason))


def _joint_count(document: Document) -> int:
    """Return the number of joints of the largest skin."""
    return max((len(skin["joints"]) for skin in objects(document.json, "skins")), default=0)


def _export_document(export: Callable[[Path], None]) -> Document:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "exported.glb"
        export(path)
        return read_document(path, in_memory=True)


def _summary(clip: ReducedClip, tolerance: Tolerance, per_unit: float, would: str, *, by_number: bool) -> str:
    """Return a sentence on the outcome of a clip."""
    if clip.tracks is None:
        return f"stays as it was, {clip.before.keys} keys in {clip.before.size} bytes: {clip.reason}"
    before, after = clip.before, clip.after
    done = "reduced" if after.keys <= before.keys else "stored in fewer bytes"
    summary = f"{would}{done}, {before.keys} -> {after.keys} keys, {before.size} -> {after.size} bytes"
    summary += off(tolerance, clip.error, per_unit, by_number=by_number)
    summary += f", {printable(clip.where)}" if clip.where else ""
    if clip.lines:
        between = tolerance.alike(clip.between, per_unit)
        summary += (
            f"; at frames, and up to {between} from lines between them; lines need {clip.lines} keys for the same"
        )
    if clip.slides[0] > 0.0:
        slid, slides = (tolerance.alike(slide, per_unit) for slide in clip.slides)
        summary += f"; feet slide {slides}, and {slid} before"
    return summary


@contextmanager
def side_by_side(processes: int) -> Iterator[Run]:
    """Yield a parallel `map`. Processes start with its first call, and arguments are made only as they are needed."""
    pool: ProcessPoolExecutor | None = None

    def run(function: Callable[[Any], Any], arguments: Iterable[Any]) -> Iterator[Any]:
        nonlocal pool
        pool = pool or ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), _init_worker)
        waiting: deque[Future[Any]] = deque()
        for argument in arguments:
            waiting.append(pool.submit(function, argument))
            if len(waiting) > processes:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()

    try:
        yield run if processes > 1 else map
    finally:
        if pool:
            pool.shutdown(cancel_futures=True)


def _init_worker() -> None:
    """Set up a worker: ignore Ctrl-C, and end together with the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
