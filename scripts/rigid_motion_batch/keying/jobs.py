"""Operations on .blend files: which objects and bones they act on, where the result goes, and what is reported."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, cast

import bpy

from rigid_motion.animation.transforms import Transform, transform_of
from rigid_motion_batch.keying.blend_files import (
    THIS_VERSION,
    missing_data,
    named,
    only_overridden,
    open_file,
    write_file,
)
from rigid_motion_batch.keying.records import changed_at, refuse_read_only
from rigid_motion_batch.keying.work import ClipNumbers, Outcome, RunningJob


def do_blend(doing: RunningJob, action: Operation) -> None:
    """Open a file, process its objects, and write it. If that fails, nothing in the file counts as done."""
    with doing.failing():
        _do_file(doing, action)
    if doing.outcome.failed:
        before = doing.outcome
        doing.outcome = Outcome(
            before.source, failed=True, unreadable=before.unreadable, matched=before.matched, reason=before.reason
        )


def _do_file(doing: RunningJob, action: Operation) -> None:
    job, outcome = doing.job, doing.outcome
    if not job.in_place:
        doing.record.refuse_to_replace(job.output)
    changed = changed_at(job.file)
    open_file(job.file)
    outcome.read = [Path(bpy.path.abspath(library.filepath)) for library in bpy.data.libraries]
    missing = missing_data()
    for library in missing.libraries:
        doing.say(library)
    if missing.hides_objects and doing.work.objects is None:
        outcome.incomplete = True
        doing.say(f"incomplete, for there may be objects to be {doing.work.done} in what is missing")
    _do_objects(doing, action, missing.reasons)
    if not outcome.done:
        doing.leave_alone(f"{'nothing could be' if outcome.refused else 'nothing to be'} {doing.work.done}")
        return
    if (before := cast(Any, bpy.data.version)[:2]) < THIS_VERSION:
        doing.say(f"was saved by Blender {named(before)}; what is written is of Blender {named(THIS_VERSION)}")
    if not doing.work.dry_run:
        write_file(job.output, None if job.in_place else doing.record, changed)
    doing.tell_written(job.output)


def _do_objects(doing: RunningJob, action: Operation, missing: dict[bpy.types.Object, str]) -> None:
    asked, overridden = doing.work.objects, only_overridden()
    for obj in [obj for obj in bpy.data.objects if obj not in overridden]:
        if obj in missing:
            if fitting := {"*"} if asked is None else matching_missing(obj, asked):
                _note_matches(doing, fitting)
                doing.refuse(obj.name, missing[obj])
            continue
        for targets in groups_of(obj, whole_rigs=action.whole_rigs):
            fit = {target: {"*"} if asked is None else matching(target, asked) for target in targets}
            if concerned := action.concerned([target for target, names in fit.items() if names]):
                _note_matches(doing, set().union(*(fit[target] for target in concerned)))
                _do_targets(doing, action, concerned)


def _note_matches(doing: RunningJob, fitting: set[str]) -> None:
    """Record which names and patterns matched something to do."""
    if not doing.outcome.matched:  # Only files with something to do are written.
        refuse_read_only(doing.job.output)
    doing.outcome.matched |= fitting


def _do_targets(doing: RunningJob, action: Operation, targets: Sequence[Transform]) -> None:
    """Act on an object, or on bones of a rig."""
    library = targets[0].animated.library
    if library is not None:
        reason = f"it is linked from {library.filepath}: use --in-place on that file, or make it local"
        doing.refuse(title_of(targets), reason, len(targets))
        return
    result = action.act(targets)
    doing.outcome.numbers.clips += result.numbers
    for name, reason, count in result.refusals():
        doing.refuse(name, reason, count)
    if result.done:
        bones = sum(target.is_part for target in result.done)
        doing.outcome.bones += bones
        doing.outcome.objects += len(result.done) - bones
        between = " " if len(result.done) > 1 else ": "
        doing.say(f"{title_of(result.done)}{between}{doing.would}{doing.work.done}{result.summary}")
    if result.left:
        doing.say(result.describe_kept())


@dataclass
class Result:
    """The outcome of acting on several targets."""

    done: list[Transform] = field(default_factory=list)

    refused: dict[Transform, str] = field(default_factory=dict)
    """Why each of these failed, and what the user can do."""

    left: dict[Transform, str] = field(default_factory=dict)
    """Why these were left unchanged after all."""

    summary: str = ""
    """Text about the targets that were done; begins with a comma or a semicolon."""

    numbers: list[ClipNumbers] = field(default_factory=list)
    """The numbers of their keys, if counted."""

    def refusals(self) -> Iterator[tuple[str, str, int]]:
        """Yield the name of each refused target, the reason, and a count. All bones of a rig are one entry if they
        share the reason.
        """
        reasons = set(self.refused.values())
        if len(reasons) == 1 < len(self.refused) and not (any(item.is_part for item in self.done) or self.left):
            yield title_of(list(self.refused)), reasons.pop(), len(self.refused)
        else:
            yield from ((target.name, reason, 1) for target, reason in self.refused.items())

    def describe_kept(self) -> str:
        """Return which targets were left as they are, and why; for several bones, the reason of the first."""
        (first, reason), *others = self.left.items()
        example = f", such as {first.name}" if any(other != reason for _, other in others) else ""
        left = "are left as they are" if others else "is left as it is"
        return f"{title_of(list(self.left))} {left}{example}: {reason}"


@dataclass(frozen=True)
class Operation:
    """An operation on targets, such as baking."""

    concerned: Callable[[Sequence[Transform]], list[Transform]]
    """Returns the targets that the operation applies to, whether or not it can succeed."""

    act: Callable[[Sequence[Transform]], Result]
    """Acts on several targets of one object together."""

    whole_rigs: bool = False
    """True if the bones of a rig and its own motion are handled together."""


def groups_of(obj: bpy.types.Object, *, whole_rigs: bool) -> Iterator[list[Transform]]:
    """Yield the targets of an object that are handled together: all bones of a rig, then (or with them) its own motion.

    In the other order, each bone would be compared with its motion in the Action that has been copied already.
    """
    bones = [transform_of(bone) for bone in obj.pose.bones] if obj.pose is not None else []
    if bones and not whole_rigs:
        yield bones
        bones = []
    yield [*bones, transform_of(obj)]


def matching(target: Transform, asked: Iterable[str]) -> set[str]:
    """Return the names and patterns that match a target. The name of a rig matches its bones too; RIG/BONE matches one
    bone.
    """
    return {item for item in asked for name in {target.name, target.animated.name} if _is_match(name, item)}


def matching_missing(obj: bpy.types.Object, asked: Iterable[str]) -> set[str]:
    """Return the names and patterns that match an object, or may match its bones, which cannot be read."""
    return {item for item in asked if _is_match(obj.name, item) or _is_match(obj.name, item.rpartition("/")[0])}


def _is_match(name: str, pattern: str) -> bool:
    return name == pattern or fnmatchcase(name, pattern)


def title_of(targets: Sequence[Transform]) -> str:
    """Return a title: the name of a single target, or the rig with its number of bones and any keys of its own."""
    rig, bones = targets[0].animated.name, sum(target.is_part for target in targets)
    if len(targets) == 1:
        return targets[0].name
    return f"{rig}: {bones} bone{'s' if bones > 1 else ''}{' and its own keys' if bones < len(targets) else ''}"
