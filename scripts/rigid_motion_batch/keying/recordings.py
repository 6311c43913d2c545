"""What `reduce.py` does to recordings: the few samples that a mode needs as keys, in a table or in a .blend file.

A rigid motion becomes NAME-keys.csv, in the recording's own axes and units, and on request NAME-keys.blend; a whole
body becomes NAME-keys.blend, with a rig. With --glb either becomes NAME-reduced.glb instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rigid_motion.motion import reduce_keys
from rigid_motion_batch.analysis.metrics import write_poses
from rigid_motion_batch.analysis.radii import RIGID
from rigid_motion_batch.analysis.reconstructions import fill_in
from rigid_motion_batch.keying.blend_files import write_file
from rigid_motion_batch.keying.exporting import export_glb
from rigid_motion_batch.keying.gltf_files import GltfRun
from rigid_motion_batch.keying.keyed_files import key_body, key_densely, key_object, new_file
from rigid_motion_batch.keying.output_files import FileProblem, Unreadable, refuse_read_only
from rigid_motion_batch.keying.planning import ALL, Job
from rigid_motion_batch.keying.recorded import GLB_SUFFIX, SUFFIX, TOLERANCE, Reading, Writing, name_of
from rigid_motion_batch.keying.records import Record
from rigid_motion_batch.keying.sessions import Note, Outcome, Stopped, counted, stop_if_asked, tell_failure
from rigid_motion_batch.keying.wishes import Wishes, fewer, off
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import folder_names, read_source
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.recordings import NoMotion


class RecordingRun:
    """Doing a recording."""

    def __init__(
        self, wishes: Wishes, reading: Reading, writing: Writing, record: Record, note: Note, *, dry_run: bool
    ) -> None:
        self.wishes, self.reading, self.writing, self.dry_run = wishes, reading, writing, dry_run
        self._record, self._note = record, note
        self._would = "would be " if dry_run else ""

    @property
    def _wishes(self) -> Wishes:
        """With a tolerance; but key poses are few by what is large for the body."""
        return self.wishes if self.wishes.shared else replace(self.wishes, tolerance=self.wishes.tolerance or TOLERANCE)

    def do(self, job: Job) -> Outcome:
        """Read a recording, and write the keys of each of its bodies."""
        outcome = Outcome(job.source)
        try:
            clips, note = read_source(job.source, self.reading.axes, self.reading.options)
        except TrajectoryError as error:
            if job.is_found and isinstance(error, NoMotion):
                self._note(f"{job.source}: {error.problem}; left alone")
                return outcome
            self._note(str(error))
            return Outcome(job.source, failed=True, unreadable=True)
        except Exception as error:
            tell_failure(self._note, job.source, error)
            return Outcome(job.source, failed=True)
        if note:
            self._note(note)
        suffix = GLB_SUFFIX if self.writing.glb else SUFFIX
        for clip, name in zip(clips, _names(job.file, clips), strict=True):
            output = job.folder / f"{name}{suffix}" if job.source.endswith(ALL) else job.output
            title = job.source if len(clips) == 1 else f"{job.source} ({clip.name})"
            try:
                stop_if_asked()
                self._do_clip(title, clip, name, output, job.ending, outcome)
            except Stopped as stopped:
                stopped.partly = outcome
                raise
            except FileProblem as problem:
                outcome.failed = True
                outcome.unreadable = isinstance(problem, Unreadable) and not outcome.written
                self._note(f"{title}: {problem}")
            except Exception as error:
                outcome.failed = True
                tell_failure(self._note, title, error)
        return outcome

    def _do_clip(self, title: str, clip: Clip, name: str, output: Path, ending: str, outcome: Outcome) -> None:
        """Write the keys of a body, into files that are called as `output` and may have to end as this."""
        for repair in clip.repairs:
            self._note(f"{title}: {repair}")
        if self.wishes.tolerance and self.wishes.count is None:
            try:
                self.wishes.tolerance.require_within(clip, self.wishes.radius or RIGID)
            except ValueError as error:
                raise Unreadable(str(error)) from None
        table, scene, glb = (output.with_name(f"{output.name}{end}") for end in (ending or ".csv", ".blend", ".glb"))
        if self.writing.glb:
            self._do_glb(title, clip, name, glb, outcome)
        elif clip.rest_body is not None:
            if ending not in ("", ".blend"):
                raise FileProblem(f"a whole body becomes a .blend file: name that with --output, and not {ending}")
            self._do_body(title, clip, name, scene, outcome)
        else:
            if table == scene and not self.writing.blend:
                raise FileProblem("a rigid motion becomes a table: name a .csv file with --output, or add --blend")
            table = output.with_name(f"{output.name}.csv") if table == scene else table
            self._do_rigid(title, clip, name, table, scene if self.writing.blend else None, outcome)

    def _do_rigid(self, title: str, clip: Clip, name: str, table: Path, scene: Path | None, outcome: Outcome) -> None:
        for path in filter(None, (table, scene)):
            self._refuse(path)
        mode, radius, tolerance = self.wishes.mode, self.wishes.radius or RIGID, self.wishes.tolerance or TOLERANCE
        frames = new_file(clip, tolerance.tolerance(clip), self.writing.fps) if scene else None
        count = self.wishes.count
        if count is None:
            keys = tolerance.keys(clip, mode, radius)
        else:
            budget = min(count, len(clip.times))
            keys = reduce_keys(clip.times, clip.poses, mode, radius=radius / clip.metres_per_unit, budget=budget)
        largest = float(fill_in(clip, tolerance, {mode: keys}, radius).errors[mode].shell.max())
        stop_if_asked()
        if frames is not None:
            key_object(clip, keys, frames, mode, name)
        summary = fewer(len(clip.times), len(keys)) + off(
            tolerance, largest, clip.metres_per_unit, by_number=count is not None
        )
        self._note(f"{title}: {self._would}reduced{summary}")
        if not self.dry_run:
            try:
                with self._record.writing(table) as beside:
                    write_poses(beside, clip.times[keys], clip.poses[keys])
            except OSError as error:
                raise FileProblem(f"{table} could not be written ({error.strerror}): use another --output") from None
        outcome.objects += 1
        self._tell_written(title, table, outcome)
        if scene:
            self._save(scene)
            self._tell_written(title, scene, outcome)

    def _do_body(self, title: str, clip: Clip, name: str, scene: Path, outcome: Outcome) -> None:
        self._refuse(scene)
        frames = new_file(clip, (self.wishes.tolerance or TOLERANCE).tolerance(clip), self.writing.fps)
        result = key_body(clip, frames, self._wishes, name)
        stop_if_asked()
        for bones, reason, count in result.refusals():
            outcome.refused += count
            self._note(f"{title}: {bones}: not reduced: {reason}")
        if result.left:
            self._note(f"{title}: {result.describe_kept()}")
        if result.done:
            self._note(f"{title}: {counted(len(result.done), 'bone')} {self._would}reduced{result.summary}")
        if not (result.done or result.left):
            why = "nothing could be reduced" if result.refused else "nothing of this body moves"
            self._note(f"{title}: {why}; left alone")
            return
        self._save(scene)
        outcome.bones += len(result.done)
        self._tell_written(title, scene, outcome)

    def _do_glb(self, title: str, clip: Clip, name: str, path: Path, outcome: Outcome) -> None:
        self._refuse(path)
        frames = new_file(clip, (self.wishes.tolerance or TOLERANCE).tolerance(clip), self.writing.fps)
        key_densely(clip, frames, name)
        stop_if_asked()
        wishes = self._wishes if clip.rest_body else replace(self._wishes, radius=self.wishes.radius or RIGID)
        gltf = GltfRun(wishes, self._record, self._note, dry_run=self.dry_run)
        gltf.reduce(Job(title, path.parent, path), outcome, export_glb, clip.metres_per_unit)

    def _refuse(self, path: Path) -> None:
        """Raise FileProblem where a file must not or cannot be written: better said before hours go into it."""
        self._record.refuse_to_replace(path)
        refuse_read_only(path)

    def _save(self, scene: Path) -> None:
        if not self.dry_run:
            write_file(scene, self._record)

    def _tell_written(self, title: str, path: Path, outcome: Outcome) -> None:
        self._note(f"{title}: {self._would}written to {path}")
        outcome.add_written(path)


def _names(file: Path, clips: Sequence[Clip]) -> list[str]:
    """Return what the files of bodies of a recording are called."""
    if len(clips) == 1:
        return [name_of(file, clips[0].body)]
    return [f"{file.stem}-{body}" for body in folder_names(clip.name.removeprefix(f"{file.stem}-") for clip in clips)]
