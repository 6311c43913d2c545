"""What `reduce.py` does to glTF files: the same file with fewer keys in all of its clips. No Blender is needed here."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from rigid_motion.gltf import Document, GltfError, Options, ReducedClip, Report, read_document, reduced
from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.command_line import printable

from .output_files import FileProblem, Unreadable, refuse_read_only
from .planning import Job, place_of
from .records import Record
from .sessions import Note, Outcome, stop_if_asked, tell_failure
from .side_by_side import side_by_side
from .wishes import Wishes, doubt, fewer, off

ENDINGS = (".glb", ".gltf")

MILLIMETRES = 1e3
"""In a metre."""


class GltfRun:
    """Doing a glTF file."""

    def __init__(self, wishes: Wishes, record: Record, note: Note, *, dry_run: bool, processes: int = 1) -> None:
        self.wishes, self.dry_run, self.processes = wishes, dry_run, processes
        self._record, self._note = record, note
        self._would = "would be " if dry_run else ""

    def do(self, job: Job, export: Callable[[Path], None] | None = None) -> Outcome:
        """Read a file, or what `export` makes of it at a path, reduce its clips, and write it."""
        outcome = Outcome(job.source)
        try:
            self._record.refuse_to_replace(job.output)
            refuse_read_only(job.output)
            self.reduce(job, outcome, export)
        except FileProblem as problem:
            outcome.failed, outcome.unreadable = True, isinstance(problem, Unreadable)
            self._note(f"{job.source}: {problem}")
        except Exception as error:
            outcome.failed = True
            tell_failure(self._note, job.source, error)
        return outcome

    def reduce(
        self, job: Job, outcome: Outcome, export: Callable[[Path], None] | None = None, per_unit: float = 1.0
    ) -> None:
        """Reduce without refusals of places; raises FileProblem. A tolerance without a unit is in `per_unit` metres.

        What was exported is written also where nothing of it could be reduced.
        """
        wishes = self.wishes
        try:
            document = _read(job.file) if export is None else _exported(export)
            if job.is_found and not document.json.get("animations"):
                self._note(f"{job.source}: no animations; left alone")
                return
            tolerance = None if wishes.tolerance is None else wishes.tolerance.metres(per_unit)
            with side_by_side(self.processes) as run:
                report = reduced(
                    document,
                    Options(tolerance, wishes.radius, wishes.shared, wishes.count, wishes.vertices, run),
                )
        except GltfError as error:
            raise Unreadable(str(error)) from None
        except OSError as error:  # It is read while it is worked on.
            raise _unreadable(error) from None
        stop_if_asked()
        length = wishes.tolerance or Tolerance(f"{MILLIMETRES * report.tolerance:.6f}mm")
        by_number = wishes.count is not None
        for clip in report.clips:
            summary = _summary(clip, length, per_unit, self._would, by_number=by_number)
            self._note(f"{job.source}: {printable(clip.name)}: {summary}")
        if report.size:
            size = f"{report.size:.3g} m large"
            self._note(f"{job.source}: {size}{doubt(report.size, wishes.tolerance, per_unit)}")
        outcome.clips += sum(clip.tracks is not None for clip in report.clips)
        if not outcome.clips and export is None:
            self._note(f"{job.source}: nothing could be reduced; left alone")
            return
        self._write(job, document, report, outcome)
        self._note(f"{job.source}: {self._would}written to {job.output}")
        outcome.add_written(job.output)

    def _write(self, job: Job, document: Document, report: Report, outcome: Outcome) -> None:
        files = report.document.files(job.output.name)
        if document.chunks is None:
            companions = document.companions(job.file.parent)
            outcome.read = [job.file.parent / name for name in companions]
            if place_of(job.output.parent) != place_of(job.file.parent):
                files = report.document.companions(job.file.parent) | files
        if self.dry_run:
            return
        for name, content in files.items():
            place = job.output.parent / name
            try:
                if place != job.output:
                    outcome.beside.append(place)
                    if _holds(place, content):
                        continue  # Several files may share an image.
                    self._record.refuse_to_replace(place)
                with self._record.writing(place) as beside:
                    beside.write_bytes(content)
            except OSError as error:
                reason = error.strerror or error
                raise FileProblem(f"{place} could not be written ({reason}): write elsewhere with --output") from None


def _read(path: Path) -> Document:
    try:
        return read_document(path)
    except OSError as error:
        raise _unreadable(error) from None


def _unreadable(error: OSError) -> Unreadable:
    return Unreadable(f"this cannot be read ({error.strerror}): see to its path, and who may read it")


def _holds(path: Path, content: bytes) -> bool:
    """Return whether a file has this content already."""
    try:
        return path.read_bytes() == content
    except OSError:
        return False


def _exported(export: Callable[[Path], None]) -> Document:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "exported.glb"
        export(path)
        return read_document(path, in_memory=True)


def _summary(clip: ReducedClip, tolerance: Tolerance, per_unit: float, would: str, *, by_number: bool) -> str:
    """Return what became of a clip."""
    if clip.tracks is None:
        return f"stays as it was, {clip.before.keys} keys in {clip.before.size} bytes: {clip.reason}"
    summary = f"{would}reduced{fewer(clip.before.keys, clip.after.keys)}, {clip.before.size} -> {clip.after.size} bytes"
    summary += off(tolerance, clip.error, per_unit, by_number=by_number)
    if clip.vertices is not None:
        summary += f"; vertices {tolerance.alike(clip.vertices, per_unit)} at most"
    if clip.slides[0] > 0.0:
        before, after = (tolerance.alike(slide, per_unit) for slide in clip.slides)
        summary += f"; feet slide {after}, and {before} before"
    return summary
