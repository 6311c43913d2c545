"""What `reduce.py` does to the objects and bones of the open file: Reduce Keys to Poses, as in Blender's window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy

from rigid_motion import animation
from rigid_motion.animation import NeedsItsKeys, Reduction, Refused
from rigid_motion.animation.baking.sizes import metres_per_unit
from rigid_motion.animation.inbetweens.polls import with_more_keys_than
from rigid_motion.animation.transforms import Transform
from rigid_motion_batch.blend_targets import Action, Result
from rigid_motion_batch.comparison.study.choices import Tolerance

FEWEST = 2
"""So many keys are as few as a motion has."""


@dataclass(frozen=True)
class Wishes:
    """How few keys are wanted, of what."""

    mode: str
    tolerance: Tolerance
    radius: float | None
    """Of the shell in metres; what each object and bone measures, or what `compare` takes of recordings, where None."""

    shared: bool
    """Whether all bones of a rig get keys on the same frames."""


def reducing(wishes: Wishes, asked: Sequence[str] | None = None) -> Action:
    """Fewer keys for what has more than two; and for what was asked for by its very name, if only to say why not."""

    def concerned(targets: Sequence[Transform]) -> list[Transform]:
        keyed = set(with_more_keys_than(targets, FEWEST))
        named = set(asked or ())
        return [target for target in targets if target in keyed or (target.name in named and not _has_bones(target))]

    def reduce(targets: Sequence[Transform]) -> Result:
        return reduced(targets, wishes)

    return Action("Reducing", "reduced", "-reduced", concerned, reduce)


def reduced(targets: Sequence[Transform], wishes: Wishes) -> Result:
    """Leave targets of the open file the few keys that they need."""
    unit = metres_per_unit(bpy.context.scene)
    before = [len(target.motion.bakes) for target in targets]
    refusals: list[Refused] = []
    animation.reduce_keys_of(
        targets,
        wishes.mode,
        wishes.tolerance.metres(unit) / unit,
        None if wishes.radius is None else wishes.radius / unit,
        shared=wishes.shared,
        refused=refusals,
    )
    done = [target for target, count in zip(targets, before, strict=True) if len(target.motion.bakes) > count]
    # Refusals come in the order of what refused.
    problems = dict(zip([target for target in targets if target not in done], refusals, strict=True))
    left = {target for target, refusal in problems.items() if isinstance(refusal, NeedsItsKeys)}
    reasons = {target: _reason(target, refusal) for target, refusal in problems.items()}
    told = described(animation.total_reduction(done), wishes, unit) if done else ""
    return Result(
        done,
        {target: reason for target, reason in reasons.items() if target not in left},
        {target: reason for target, reason in reasons.items() if target in left},
        told,
    )


def described(reduction: Reduction, wishes: Wishes, unit: float) -> str:
    """How many keys there were and are, and how far off they are; lengths of the reduction are of `unit` metres."""
    off = wishes.tolerance.alike(reduction.largest_error * unit, unit)
    rig = reduction.rig
    frames = f" on {rig.frames} frames" if rig else ""
    text = f", {reduction.before} -> {reduction.after} keys{frames}, {off} off at most"
    if rig and rig.slide_before > 0.0:
        before, after = (wishes.tolerance.alike(slide * unit, unit) for slide in (rig.slide_before, rig.slide_after))
        text += f", feet slide {after} where they slid {before}"
    return text


def _has_bones(target: Transform) -> bool:
    """Whether the name of an object stands for the bones of a rig."""
    return not target.prefix and target.carrier.pose is not None


def _reason(target: Transform, refusal: Refused) -> str:
    """A refusal without the name that it begins with."""
    return str(refusal).removeprefix(target.name).removeprefix(":").strip()
