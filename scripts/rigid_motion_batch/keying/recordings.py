"""Reducing recordings for `reduce.py`: writes the few samples that a mode needs as keys to a table or .blend file.

A rigid motion becomes NAME-keys.csv, in the recording's own axes and units, and on request NAME-keys.blend; a whole
body becomes NAME-keys.blend, with a rig. With --glb either becomes NAME-reduced.glb instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rigid_motion.motion import reduce_keys
from rigid_motion_batch.analysis.choices import RIGID_RADIUS_M
from rigid_motion_batch.analysis.metrics import write_poses
from rigid_motion_batch.analysis.reconstructions import Reconstruction
from rigid_motion_batch.keying.gltf_files import reduce_gltf
from rigid_motion_batch.keying.planning import ALL
from rigid_motion_batch.keying.records import FileProblem, Unreadable
from rigid_motion_batch.keying.reductions import GLB_SUFFIX, SUFFIX, TOLERANCE, Reductions, name_of, off
from rigid_motion_batch.keying.sessions import counted
from rigid_motion_batch.keying.work import ClipNumbers, RunningJob
from rigid_motion_batch.recordings.clip_reading import folder_names, read_source
from rigid_motion_batch.recordings.clips import Clip


def do_recording(doing: RunningJob, how: Reductions) -> None:
    """Read a recording, and write the keys of each of its bodies."""
    job = doing.job
    clips: list[Clip] = []
    with doing.failing(), doing.reading():
        clips, note = read_source(job.source, how.axes, how.reading)
        if note:
            doing.note(note)
    for clip, name in zip(clips, _file_names(job.file, clips), strict=True):
        suffix = GLB_SUFFIX if how.glb else SUFFIX
        doing.title = job.source if len(clips) == 1 else f"{job.source} ({clip.name})"
        with doing.failing():
            _ClipJob(doing, how, clip, name).do(
                job.folder / f"{name}{suffix}" if job.source.endswith(ALL) else job.output
            )


class _ClipJob:
    """A recorded body whose keys are written."""

    def __init__(self, doing: RunningJob, how: Reductions, clip: Clip, name: str) -> None:
        self.doing, self.clip, self.name = doing, clip, name
        # Without a tolerance, key poses of a rig use one in proportion to the body.
        self.given, self.tolerance = how.tolerance, how.tolerance or TOLERANCE
        self.how = how if how.shared else replace(how, tolerance=self.tolerance)
        self.radius = how.radius or RIGID_RADIUS_M

    def do(self, output: Path) -> None:
        """Write the keys to files named like `output`, with the ending that the job requires, if any."""
        clip, ending = self.clip, self.doing.job.ending
        for repair in clip.repairs:
            self.doing.say(repair)
        if self.given and self.how.count is None and (problem := self.given.problem_with(clip, self.radius)):
            raise Unreadable(problem)
        table, scene, glb = (output.with_name(f"{output.name}{end}") for end in (ending or ".csv", ".blend", ".glb"))
        if self.how.glb:
            self._write_glb(glb)
        elif clip.rest_body is not None or self.how.curves:
            if ending not in ("", ".blend"):
                what = "what has curves" if clip.rest_body is None else "a whole body"
                raise FileProblem(f"{what} becomes a .blend file: name that with --output, and not {ending}")
            self._write_body(scene)
        else:
            if table == scene and not self.how.blend:
                raise FileProblem("a rigid motion becomes a table: name a .csv file with --output, or add --blend")
            table = output.with_name(f"{output.name}.csv") if table == scene else table
            self._write_rigid(table, scene if self.how.blend else None)

    def _write_rigid(self, table: Path, scene: Path | None) -> None:
        for path in filter(None, (table, scene)):
            self.doing.require_free(path)
        clip, mode, tolerance = self.clip, self.how.mode, self.tolerance
        frames = self._new_file() if scene else None
        count = self.how.count
        if count is None:
            (keys,) = tolerance.keys(clip, mode, self.radius)
        else:
            budget = min(count, len(clip.times))
            keys = reduce_keys(clip.times, clip.poses, mode, radius=self.radius / clip.metres_per_unit, budget=budget)
        made = Reconstruction(clip, tolerance, {mode: (keys,)}, np.array([self.radius]))
        largest = float(made.shell(mode).max())
        if frames is not None:
            from .keyed_files import key_object

            key_object(clip, keys, frames, mode, self.name)
        error = off(tolerance, largest, clip.metres_per_unit, by_number=count is not None)
        self.doing.say(f"{self.doing.would}reduced, {len(clip.times)} -> {len(keys)} keys{error}")
        if not self.doing.work.dry_run:
            with self.doing.record.writing(table) as beside:
                write_poses(beside, clip.times[keys], clip.poses[keys])
        self.doing.outcome.objects += 1
        self._add_numbers(ClipNumbers(clip.name, len(clip.times), len(keys), largest))
        self.doing.tell_written(table)
        if scene:
            self._save(scene)

    def _write_body(self, scene: Path) -> None:
        from .keyed_files import key_body

        doing = self.doing
        doing.require_free(scene)
        how = self.how if self.clip.rest_body else replace(self.how, radius=self.radius)
        result = key_body(self.clip, self._new_file(), how, self.name)
        for bones, reason, count in result.refusals():
            doing.refuse(bones, reason, count)
        if result.left:
            doing.say(result.describe_kept())
        if result.done:
            what = f"{counted(len(result.done), 'bone')} " if self.clip.rest_body else ""
            doing.say(f"{what}{doing.would}reduced{result.summary}")
        if not (result.done or result.left):
            doing.leave_alone("nothing could be reduced" if result.refused else "nothing of this body moves")
            return
        self._add_numbers(*(replace(numbers, name=self.clip.name) for numbers in result.numbers))
        self._save(scene)
        if self.clip.rest_body:
            doing.outcome.bones += len(result.done)
        else:
            doing.outcome.objects += len(result.done)

    def _write_glb(self, path: Path) -> None:
        from .exporting import export_glb
        from .keyed_files import key_densely

        self.doing.require_free(path)
        key_densely(self.clip, self._new_file(), self.name)
        how = self.how if self.clip.rest_body else replace(self.how, radius=self.radius)
        reduce_gltf(self.doing, how, path, export_glb, self.clip.metres_per_unit)

    def _new_file(self) -> np.ndarray:
        from .keyed_files import new_file

        return new_file(self.clip, self.tolerance.tolerance(self.clip), self.how.fps)

    def _add_numbers(self, *clips: ClipNumbers) -> None:
        numbers, tolerance = self.doing.outcome.numbers, self.how.tolerance
        numbers.tolerance = tolerance.tolerance(self.clip) if tolerance else None
        numbers.clips += clips

    def _save(self, scene: Path) -> None:
        from .blend_files import write_file

        if not self.doing.work.dry_run:
            write_file(scene, self.doing.record)
        self.doing.tell_written(scene)


def _file_names(file: Path, clips: Sequence[Clip]) -> list[str]:
    """Return the base names for the files of a recording's bodies."""
    if len(clips) == 1:
        return [name_of(file, clips[0].body)]
    return [f"{file.stem}-{body}" for body in folder_names(clip.name.removeprefix(f"{file.stem}-") for clip in clips)]
