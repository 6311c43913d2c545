"""Reducing objects and bones of the open file for `reduce.py`: Reduce Keys to Poses, as in Blender's window."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import bpy

from rigid_motion import animation
from rigid_motion.animation import NeedsItsKeys, Reduction, Refused
from rigid_motion.animation.queries.polls import with_more_keys_than
from rigid_motion.animation.transforms import Transform
from rigid_motion.animation.transforms.sizes import first_tolerance, metres_per_unit, rig_size
from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.keying.jobs import Operation, Result, title_of
from rigid_motion_batch.keying.reductions import Reductions, as_length, doubt, off
from rigid_motion_batch.keying.sessions import counted
from rigid_motion_batch.keying.work import ClipNumbers

MIN_KEYS = 2
"""The fewest keys that a motion has."""


def reducing(how: Reductions, asked: Sequence[str] | None = None) -> Operation:
    """Return the operation that reduces targets with more than two keys. It includes targets requested by their exact
    names, if only to report why they cannot be reduced.
    """

    def concerned(targets: Sequence[Transform]) -> list[Transform]:
        keyed = set(with_more_keys_than(targets, MIN_KEYS))
        named = set(asked or ())
        return [target for target in targets if target in keyed or (target.name in named and not _has_bones(target))]

    def reduce(targets: Sequence[Transform]) -> Result:
        return reduced(targets, how)

    return Operation(concerned, reduce, whole_rigs=True)


def reduced(targets: Sequence[Transform], how: Reductions) -> Result:
    """Reduce targets of the open file to the few keys that they need."""
    scene = cast(bpy.types.Scene, bpy.context.scene)
    unit = metres_per_unit(scene)
    tolerance = how.tolerance or as_length(first_tolerance(scene, targets, shared=how.shared) * unit)
    before = list(map(_bake_count, targets))
    refusals: list[Refused] = []
    animation.reduce_keys_of(
        targets,
        animation.NATIVE if how.curves else how.mode,
        tolerance.metres(unit) / unit,
        None if how.radius is None else how.radius / unit,
        shared=how.shared,
        count=how.count,
        refused=refusals,
    )
    done = [target for target, count in zip(targets, before, strict=True) if _bake_count(target) > count]
    # Refusals come in the order of the targets. A target that shares its keys with another one is reduced anyway.
    problems = dict(zip([target for target in targets if target not in done], refusals, strict=False))
    doubt = _unit_hint(targets, how.tolerance, unit)
    left = {target for target, refusal in problems.items() if isinstance(refusal, NeedsItsKeys)}
    reasons = {target: _reason(target, refusal) for target, refusal in problems.items()}
    by_number = how.count is not None
    reduction = animation.reduction_of(done)
    summary = f"{_describe_reduction(reduction, tolerance, unit, by_number=by_number)}{doubt}" if reduction else ""
    if how.discard and done:
        animation.discard_dense_keys(done)
    return Result(
        done,
        {target: reason for target, reason in reasons.items() if target not in left},
        {target: f"{reason}{doubt}" for target, reason in reasons.items() if target in left},
        summary,
        [ClipNumbers(title_of(done), reduction.before, reduction.after, reduction.largest_error * unit)]
        if reduction
        else [],
    )


def _describe_reduction(reduction: Reduction, tolerance: Tolerance, unit: float, *, by_number: bool) -> str:
    """Return text on the numbers of keys and the error of a reduction, whose lengths are in units of `unit` metres."""
    rig = reduction.rig
    summary = f", {reduction.before} -> {reduction.after} keys"
    summary += f" on {counted(rig.frames, 'frame')}" if rig else ""
    summary += off(tolerance, reduction.largest_error * unit, unit, by_number=by_number)
    if reduction.between:
        summary += f" on frames, {tolerance.alike(reduction.between * unit, unit)} between them"
    others = [(_mode_name(mode), count) for mode, count in reduction.needed.items() if mode != reduction.mode]
    if others:
        told = " and ".join(f"{name} would leave {count} keys" for name, count in others)
        summary += f"; {_mode_name(reduction.mode)}, as {told}"
    before, after = reduction.channel_keys
    if after > before:
        summary += f"; channels have {after} keys together, and had {before}"
    if rig and rig.slide_before > 0.0:
        slid, slides = (tolerance.alike(slide * unit, unit) for slide in (rig.slide_before, rig.slide_after))
        summary += f"; feet slide {slides}, and {slid} before"
    if rig and rig.not_promised:
        bones = ", ".join(rig.not_promised)
        summary += f"; not guaranteed for bones that follow constraints or drivers, or their children: {bones}"
    return summary


def _mode_name(mode: str) -> str:
    return "curves of Blender's own" if mode == animation.NATIVE else mode


def _unit_hint(targets: Sequence[Transform], tolerance: Tolerance | None, unit: float) -> str:
    """Return a hint if a tolerance is in metres but a rig probably is not: importers keep units of their own."""
    rig = targets[0].animated
    if not targets[0].is_part or rig.pose is None:
        return ""
    return doubt(rig_size(rig) * unit, len(rig.pose.bones), tolerance, unit)


def _bake_count(target: Transform) -> int:
    return len(cast(Any, target.motion).bakes)


def _has_bones(target: Transform) -> bool:
    """Return whether the name of an object stands for the bones of its rig."""
    return not target.is_part and target.animated.pose is not None


def _reason(target: Transform, refusal: Refused) -> str:
    """Return a refusal without the leading name of the target or its rig."""
    names = (f"{name}{end}" for name in (target.name, target.animated.name) for end in (": ", " "))
    begin = next((name for name in names if str(refusal).startswith(name)), "")
    return str(refusal).removeprefix(begin)
