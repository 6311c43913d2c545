"""Doing something to .blend files: to which objects and bones, where the result goes, and what is said of it."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy

from rigid_motion.animation.transforms import BoneTransform, Transform
from rigid_motion_batch.command_line import folder_path
from rigid_motion_batch.keying.blend_files import (
    HERE,
    FileProblem,
    Missing,
    Unreadable,
    changed_at,
    missing_data,
    named,
    only_overridden,
    open_file,
    refuse_long_name,
    refuse_read_only,
    refuse_to_replace,
    write_file,
)
from rigid_motion_batch.keying.sessions import Note, Outcome, StopIfAsked, tell_failure
from rigid_motion_batch.keying.targets import Action, Result, groups_of, matching, matching_missing, title_of


@dataclass(frozen=True)
class Job:
    """A file to be done."""

    source: Path
    output: Path
    """The same where it is done in place."""

    @property
    def title(self) -> str:
        return self.source.name


def jobs_of(files: Sequence[Path], suffix: str, folder: Path | None, *, in_place: bool) -> list[Job]:
    """What to read and where to write it; a file that is named twice is one.

    Raises
    ------
    ValueError
        Where two files would be written to one place, or one over another that is to be read.
    """
    sources: dict[str, Path] = {}
    for path in files:
        sources.setdefault(place_of(path), path)
    jobs, places = [], {}
    for path in sources.values():
        output = path if in_place else (folder or path.parent) / f"{path.stem}{suffix}.blend"
        place = place_of(output)
        if place in places:
            raise ValueError(
                f"{places[place]} and {path} would both be written to {output}: do them one after the other, with "
                "another --output"
            )
        if not in_place and place in sources:
            raise ValueError(f"{path} would be written over {output}, which is to be read too: leave one of them out")
        places[place] = path
        jobs.append(Job(path, output))
    return jobs


def place_of(path: Path) -> str:
    """Where a path leads to; the same for all paths that lead there."""
    return os.path.normcase(os.path.realpath(path))  # Path.resolve of Python 3.11 fails where links go in circles.


def add_target_options(parser: argparse.ArgumentParser, which: str) -> None:
    """Add --objects, which says of "all" bones which those are, and --dry-run."""
    parser.add_argument(
        "--objects",
        type=_names,
        metavar="NAME,...",
        help="only these objects, and of rigs all of their bones; Rig/Hand is one bone; * and ? stand for any letters, "
        f"as in 'Tool*' and 'Rig/*' (all with {which})",
    )
    parser.add_argument("--dry-run", action="store_true", help="do everything but write, and say what would be written")


def add_file_options(parser: argparse.ArgumentParser) -> None:
    """Add a group of options that say where to write."""
    places = parser.add_argument_group("files")
    places.add_argument("--output", type=folder_path, metavar="FOLDER", help="where to write (beside each file)")
    places.add_argument("--overwrite", action="store_true", help="replace files of an earlier run")
    places.add_argument("--in-place", action="store_true", help="save the .blend files themselves")


def refuse_odd_places(options: argparse.Namespace) -> None:
    """Raise ValueError where the options of that group do not go together, or say no folder."""
    if options.in_place and options.output:
        raise ValueError("--in-place saves the files themselves, --output writes others: give one of them")
    if options.output and options.output.exists() and not options.output.is_dir():
        raise ValueError(f"--output {options.output} is a file: give a folder")


def _names(text: str) -> list[str]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise argparse.ArgumentTypeError("name an object, or several as in Camera,'Tool*','Rig/*'")
    return names


class BlendRun:
    """Doing files, one after the other."""

    def __init__(self, options: argparse.Namespace, action: Action, note: Note, stop_if_asked: StopIfAsked) -> None:
        self.options, self.action = options, action
        self._note, self._stop_if_asked = note, stop_if_asked
        self._would = "would be " if options.dry_run else ""
        self._changed: int | None = None

    def do(self, job: Job) -> Outcome:
        """Open a file, do what is in it, and write it."""
        outcome = Outcome()
        try:
            if job.output == job.source:
                refuse_long_name(job.source.with_name(f"{job.source.name}1"))
            else:
                refuse_to_replace(job.output, overwrite=self.options.overwrite)
            self._changed = changed_at(job.source)
            open_file(job.source)
            self._stop_if_asked()
            missing = missing_data()
            for library in missing.libraries:
                self._note(f"{job.source}: {library}")
            if missing.hides_objects and self.options.objects is None:
                outcome.incomplete = True
                self._note(
                    f"{job.source}: incomplete, for there may be objects to be {self.action.done} in what is missing"
                )
            self._do_objects(job, outcome, missing)
            self._finish(job, outcome)
        except FileProblem as problem:
            outcome = Outcome(failed=True, unreadable=isinstance(problem, Unreadable), matched=outcome.matched)
            self._note(f"{job.source}: {problem}")
        except Exception as error:
            outcome = Outcome(failed=True, matched=outcome.matched)
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
                fitting = {
                    target: {"*"} if self._asked is None else matching(target, self._asked) for target in targets
                }
                concerned = self.action.concerned([target for target, names in fitting.items() if names])
                if concerned:
                    self._begin(job, outcome, set().union(*(fitting[target] for target in concerned)))
                    self._do_targets(job, outcome, concerned)
                    self._stop_if_asked()

    @property
    def _asked(self) -> list[str] | None:
        return self.options.objects

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
            self._note(f"{job.source}: {result.told_of_left()}")

    def _refuse(self, job: Job, outcome: Outcome, name: str, reason: str, count: int = 1) -> None:
        outcome.refused += count
        self._note(f"{job.source}: {name}: not {self.action.done}: {reason}")

    def _tell_done(self, job: Job, outcome: Outcome, result: Result) -> None:
        targets = result.done
        bones = sum(isinstance(target, BoneTransform) for target in targets)
        outcome.bones += bones
        outcome.objects += len(targets) - bones
        told = f"{self._would}{self.action.done}{result.told}"
        self._note(f"{job.source}: {title_of(targets)}{' ' if len(targets) > 1 else ': '}{told}")

    def _finish(self, job: Job, outcome: Outcome) -> None:
        if not outcome.done:
            why = "nothing could be" if outcome.refused else "nothing to be"
            self._note(f"{job.source}: {why} {self.action.done}; left alone")
            return
        if (before := bpy.data.version[:2]) < HERE:
            self._note(
                f"{job.source}: was saved by Blender {named(before)}; what is written is of Blender {named(HERE)}"
            )
        if not self.options.dry_run:
            overwrite = self.options.overwrite or job.output == job.source
            write_file(job.source, job.output, self._stop_if_asked, overwrite=overwrite, opened=self._changed)
        self._note(f"{job.source}: {self._would}written to {job.output}")
        outcome.add_written(job.output)
