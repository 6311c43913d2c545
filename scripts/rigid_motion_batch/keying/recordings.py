"""What `reduce.py` does to recordings: the few samples that a mode needs as keys, in a table or in a .blend file.

A rigid motion becomes NAME-keys.csv, in the recording's own axes and units, and on request NAME-keys.blend; a whole
body becomes NAME-keys.blend, with a rig. With --glb either becomes NAME-reduced.glb instead.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
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
from rigid_motion_batch.keying.options import Job, place_of
from rigid_motion_batch.keying.output_files import (
    FileProblem,
    Unreadable,
    refuse_came_meanwhile,
    refuse_read_only,
    refuse_to_replace,
)
from rigid_motion_batch.keying.recorded import TOLERANCE, Reading, Recorded, Writing
from rigid_motion_batch.keying.sessions import Note, Outcome, StopIfAsked, Stopped, counted, tell_failure
from rigid_motion_batch.keying.wishes import Wishes, fewer, off
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import folder_names, read_source
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.reading import split_source

SUFFIX, GLB_SUFFIX = "-keys", "-reduced"
"""Of the names of files that are written, and of GLB files."""


class RecordingRun:
    """Doing recordings, one after the other.

    Parameters
    ----------
    wishes : Wishes
    reading : Reading
    writing : Writing
    inputs : iterable of str
        All that is to be read, which nothing is written over.
    taken : iterable of Job
        The other files of the run, whose places are theirs.
    note, stop_if_asked : callable
    """

    def __init__(
        self,
        wishes: Wishes,
        reading: Reading,
        writing: Writing,
        inputs: Iterable[str],
        taken: Iterable[Job],
        note: Note,
        stop_if_asked: StopIfAsked,
    ) -> None:
        self.wishes, self.reading, self.writing = wishes, reading, writing
        self._note, self._stop_if_asked = note, stop_if_asked
        self._would = "would be " if writing.dry_run else ""
        self._inputs = {place_of(_file_of(source)) for source in inputs}
        self._written = {place_of(job.output): str(job.source) for job in taken}
        self._gltf = GltfRun(
            wishes, overwrite=writing.overwrite, dry_run=writing.dry_run, note=note, stop_if_asked=stop_if_asked
        )

    def do(self, job: Recorded) -> Outcome:
        """Read a recording, and write the keys of each of its bodies."""
        outcome = Outcome()
        if os.path.isdir(job.source):
            self._note(f"{job.source}: this is a folder: name the files in it, as in {Path(job.source) / '*.bvh'}")
            return Outcome(failed=True, unreadable=True)
        try:
            clips, note = read_source(job.source, self.reading.axes, self.reading.options)
        except TrajectoryError as error:
            self._note(str(error))
            return Outcome(failed=True, unreadable=True)
        except Exception as error:
            tell_failure(self._note, job.source, error)
            return Outcome(failed=True)
        if note:
            self._note(note)
        file = _file_of(job.source)
        for clip, name in zip(clips, _names(file, clips), strict=True):
            title = job.source if len(clips) == 1 else f"{job.source} ({clip.name})"
            try:
                self._stop_if_asked()
                self._do_clip(title, clip, file, name, outcome)
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

    def _do_clip(self, title: str, clip: Clip, file: Path, name: str, outcome: Outcome) -> None:
        for repair in clip.repairs:
            self._note(f"{title}: {repair}")
        if self.wishes.tolerance and self.wishes.count is None:
            try:
                self.wishes.tolerance.require_within(clip, self.wishes.radius or RIGID)
            except ValueError as error:
                raise Unreadable(str(error)) from None
        folder = self.writing.folder or file.parent
        if self.writing.glb:
            self._do_glb(title, clip, name, folder / f"{name}{GLB_SUFFIX}.glb", outcome)
            return
        begin = folder / f"{name}{SUFFIX}"
        if clip.figure is not None:
            self._do_body(title, clip, file, name, begin.with_name(f"{begin.name}.blend"), outcome)
            return
        table = begin.with_name(f"{begin.name}.csv")
        scene = begin.with_name(f"{begin.name}.blend") if self.writing.blend else None
        self._do_rigid(title, clip, file, name, table, scene, outcome)

    def _do_rigid(
        self, title: str, clip: Clip, file: Path, name: str, table: Path, scene: Path | None, outcome: Outcome
    ) -> None:
        for path in filter(None, (table, scene)):
            self._refuse(title, path)
        mode, radius, tolerance = self.wishes.mode, self.wishes.radius or RIGID, self.wishes.tolerance or TOLERANCE
        frames = new_file(clip, tolerance.tolerance(clip), self.writing.fps) if scene else None
        count = self.wishes.count
        if count is None:
            keys = tolerance.keys(clip, mode, radius)
        else:
            budget = min(count, len(clip.times))
            keys = reduce_keys(clip.times, clip.poses, mode, radius=radius / clip.metres_per_unit, budget=budget)
        largest = float(fill_in(clip, tolerance, {mode: keys}, radius).errors[mode].shell.max())
        self._stop_if_asked()
        if frames is not None:
            key_object(clip, keys, frames, mode, name)
        told = fewer(len(clip.times), len(keys)) + off(
            tolerance, largest, clip.metres_per_unit, by_number=count is not None
        )
        self._note(f"{title}: {self._would}reduced{told}")
        if not self.writing.dry_run:
            try:
                write_poses(table, clip.times[keys], clip.poses[keys], overwrite=self.writing.overwrite)
            except OSError as error:
                refuse_came_meanwhile(table, error)
                raise FileProblem(f"{table} could not be written ({error.strerror}): use another --output") from None
        outcome.objects += 1
        self._tell_written(title, table, outcome)
        if scene:
            self._save(file, scene)
            self._tell_written(title, scene, outcome)

    def _do_body(self, title: str, clip: Clip, file: Path, name: str, scene: Path, outcome: Outcome) -> None:
        self._refuse(title, scene)
        tolerance = self.wishes.tolerance or TOLERANCE
        frames = new_file(clip, tolerance.tolerance(clip), self.writing.fps)
        # Key poses are few by what is large for the body.
        wishes = self.wishes if self.wishes.shared else replace(self.wishes, tolerance=tolerance)
        result = key_body(clip, frames, wishes, name)
        self._stop_if_asked()
        for bones, reason, count in result.refusals():
            outcome.refused += count
            self._note(f"{title}: {bones}: not reduced: {reason}")
        if result.left:
            self._note(f"{title}: {result.told_of_left()}")
        if result.done:
            self._note(f"{title}: {counted(len(result.done), 'bone')} {self._would}reduced{result.told}")
        if not (result.done or result.left):
            why = "nothing could be reduced" if result.refused else "nothing of this body moves"
            self._note(f"{title}: {why}; left alone")
            return
        self._save(file, scene)
        outcome.bones += len(result.done)
        self._tell_written(title, scene, outcome)

    def _do_glb(self, title: str, clip: Clip, name: str, path: Path, outcome: Outcome) -> None:
        self._refuse(title, path)
        tolerance = self.wishes.tolerance or TOLERANCE
        frames = new_file(clip, tolerance.tolerance(clip), self.writing.fps)
        key_densely(clip, frames, name)
        self._stop_if_asked()
        self._gltf.reduce(Job(Path(title), path), outcome, export_glb, clip.metres_per_unit)

    def _refuse(self, title: str, path: Path) -> None:
        """Raise FileProblem where a file must not or cannot be written: better said before hours go into it."""
        place = place_of(path)
        if place in self._inputs:
            raise FileProblem(f"this would be written over {path}, which is to be read too: leave one of them out")
        if place in self._written:
            raise FileProblem(f"{self._written[place]} was written to {path} too: use another --output for one of them")
        refuse_to_replace(path, overwrite=self.writing.overwrite)
        refuse_read_only(path)
        self._written[place] = title

    def _save(self, file: Path, scene: Path) -> None:
        if not self.writing.dry_run:
            write_file(file, scene, self._stop_if_asked, overwrite=self.writing.overwrite)

    def _tell_written(self, title: str, path: Path, outcome: Outcome) -> None:
        self._note(f"{title}: {self._would}written to {path}")
        outcome.add_written(path)


def _file_of(source: str) -> Path:
    """The file of a recording, without the body; all of it where there is no such file."""
    try:
        return split_source(source)[0]
    except TrajectoryError:
        return Path(source)


def _names(file: Path, clips: Sequence[Clip]) -> list[str]:
    """What the files of clips are called: as the recording, and where bodies of it were named, as these too."""
    stem = file.stem
    if len(clips) > 1:
        bodies = [clip.name.removeprefix(f"{stem}-") for clip in clips]
    elif clips[0].body:
        bodies = [clips[0].body]
    else:
        return [stem]
    return [f"{stem}-{body}" for body in folder_names(bodies)]
