"""Doing something to .blend files: to which objects and bones, where the result goes, and what is said of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import bpy

from rigid_motion.animation.transforms import BoneTransform, Transform
from rigid_motion_batch.keying.blend_files import (
    HERE,
    Missing,
    missing_data,
    named,
    only_overridden,
    open_file,
    write_file,
)
from rigid_motion_batch.keying.output_files import (
    FileProblem,
    Unreadable,
    changed_at,
    refuse_long_name,
    refuse_read_only,
)
from rigid_motion_batch.keying.planning import Job
from rigid_motion_batch.keying.records import Record
from rigid_motion_batch.keying.sessions import Note, Outcome, Work, stop_if_asked, tell_failure
from rigid_motion_batch.keying.targets import Action, Result, groups_of, matching, matching_missing, title_of


class BlendRun:
    """Doing a file."""

    def __init__(self, work: Work, action: Action, record: Record, note: Note) -> None:
        self.work, self.action = work, action
        self._record, self._note = record, note
        self._would = "would be " if work.dry_run else ""
        self._changed: int | None = None

    def do(self, job: Job) -> Outcome:
        """Open a file, do what is in it, and write it."""
        outcome = Outcome(job.source)
        try:
            if job.in_place:
                refuse_long_name(job.file.with_name(f"{job.file.name}1"))
            else:
                self._record.refuse_to_replace(job.output)
            self._changed = changed_at(job.file)
            open_file(job.file)
            outcome.read = [Path(bpy.path.abspath(library.filepath)) for library in bpy.data.libraries]
            stop_if_asked()
            missing = missing_data()
            for library in missing.libraries:
                self._note(f"{job.source}: {library}")
            if missing.hides_objects and self.work.objects is None:
                outcome.incomplete = True
                self._note(
                    f"{job.source}: incomplete, for there may be objects to be {self.action.done} in what is missing"
                )
            self._do_objects(job, outcome, missing)
            self._finish(job, outcome)
        except FileProblem as problem:
            outcome = Outcome(
                job.source, failed=True, unreadable=isinstance(problem, Unreadable), matched=outcome.matched
            )
            self._note(f"{job.source}: {problem}")
        except Exception as error:
            outcome = Outcome(job.source, failed=True, matched=outcome.matched)
            tell_failure(self._note, job.source, error)
        return outcome

    def _do_objects(self, job: Job, outcome: Outcome, missing: Missing) -> None:
        overridden = only_overridden()
        for obj in [obj for obj in bpy.data.objects if obj not in overridden]:
            if obj in missing.reasons:
                fitting = {"*"} if self._asked is None else matching_missing(obj, self._asked)
                if fitting:
                    self._begin(job, outcome, fitting)
                    self._refuse(job, outcome, obj.name, missing.reasons[obj])
                continue
            for targets in groups_of(obj, whole_rigs=self.action.whole_rigs):
                fit = {target: {"*"} if self._asked is None else matching(target, self._asked) for target in targets}
                concerned = self.action.concerned([target for target, names in fit.items() if names])
                if concerned:
                    self._begin(job, outcome, set().union(*(fit[target] for target in concerned)))
                    self._do_targets(job, outcome, concerned)
                    stop_if_asked()

    @property
    def _asked(self) -> Sequence[str] | None:
        return self.work.objects

    def _begin(self, job: Job, outcome: Outcome, fitting: set[str]) -> None:
        """Note which names and patterns there is something to do for."""
        if not outcome.matched:  # Only a file in which there is something to do is written.
            refuse_read_only(job.output)
        outcome.matched |= fitting

    def _do_targets(self, job: Job, outcome: Outcome, targets: Sequence[Transform]) -> None:
        """Do an object, or bones of a rig."""
        library = targets[0].animated.library
        if library is not None:
            reason = f"it is linked from {library.filepath}: use --in-place on that file, or make it local"
            self._refuse(job, outcome, title_of(targets), reason, len(targets))
            return
        result = self.action.act(targets)
        for name, reason, count in result.refusals():
            self._refuse(job, outcome, name, reason, count)
        if result.done:
            self._tell_done(job, outcome, result)
        if result.left:
            self._note(f"{job.source}: {result.describe_kept()}")

    def _refuse(self, job: Job, outcome: Outcome, name: str, reason: str, count: int = 1) -> None:
        outcome.refused += count
        self._note(f"{job.source}: {name}: not {self.action.done}: {reason}")

    def _tell_done(self, job: Job, outcome: Outcome, result: Result) -> None:
        targets = result.done
        bones = sum(isinstance(target, BoneTransform) for target in targets)
        outcome.bones += bones
        outcome.objects += len(targets) - bones
        summary = f"{self._would}{self.action.done}{result.summary}"
        self._note(f"{job.source}: {title_of(targets)}{' ' if len(targets) > 1 else ': '}{summary}")

    def _finish(self, job: Job, outcome: Outcome) -> None:
        if not outcome.done:
            why = "nothing could be" if outcome.refused else "nothing to be"
            self._note(f"{job.source}: {why} {self.action.done}; left alone")
            return
        if (before := cast(Any, bpy.data.version)[:2]) < HERE:
            self._note(
                f"{job.source}: was saved by Blender {named(before)}; what is written is of Blender {named(HERE)}"
            )
        if not self.work.dry_run:
            write_file(job.output, None if job.in_place else self._record, self._changed)
        self._note(f"{job.source}: {self._would}written to {job.output}")
        outcome.add_written(job.output)
