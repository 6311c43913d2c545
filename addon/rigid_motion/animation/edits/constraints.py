"""Constraints of objects that are exact between frames, and of bones: given, taken, put right where they are amiss."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy
from bpy.app.translations import pgettext_n as n_

from ..actions.records import recorded, recorded_digest
from ..actions.refusals import refuse_linked
from ..actions.slots import Binding, bindings_for, slots_alone
from ..live import follower
from ..transforms import Refused, Transform, transform_of
from ..transforms.sizes import metres_per_channel_unit
from ..writers.bone_constraints import restore, trouble_of
from ..writers.filling import clear
from .apply import Readings, Targets, apply_edit


def set_exact(targets: Targets, is_exact: bool = True, *, refused: list[Refused] | None = None) -> None:
    """Have objects be exact between frames as well, by a constraint; or by delta transforms on whole frames alone.

    What moves by the same Action slot comes along. For targets and refusals see `apply`; bones are exact anyway.
    """

    def plan(transform: Transform, readings: Readings) -> list[Binding]:
        refuse_linked(transform)
        if transform.is_part:
            raise Refused(n_("{name} is a bone, and exact between frames anyway"), name=transform.name)
        return [binding for binding, _ in readings]

    def act(transform: Transform, bindings: list[Binding]) -> list[Transform]:
        users = dict.fromkeys((transform, *(user for binding in bindings for user in binding.users)))
        changed = [user for user in users if user.animated.is_editable and user.motion.is_exact != is_exact]
        if changed:
            clear([binding for binding in bindings if binding.slot.action.is_editable])
        for user in changed:
            user.motion.is_exact = is_exact
        return changed

    done = apply_edit(targets, plan, act, refused)
    if others := [user for changed in done.values() for user in changed if user not in done]:
        # They may move by other slots as well.
        follower.refresh([transform_of(user.carrier) for user in others])


def error_between_frames(target: bpy.types.Object | bpy.types.PoseBone | Transform) -> float:
    """Return how far something is off between frames at most, as estimated when it was filled in, in metres."""
    transform = transform_of(target)
    errors = [recorded(binding).error for binding in bindings_for(transform) if recorded_digest(binding)]
    return max(errors, default=0.0) * metres_per_channel_unit(transform)


def constraint_trouble(target: bpy.types.PoseBone | bpy.types.Object | Transform) -> str:
    """Return why a bone is not seen where its in-betweens have it.

    Returns
    -------
    str
        `REMOVED`, `OTHER_SLOT`, `MUTED`, `CHANGED`, `NOT_FIRST` or `WEAK`, see `bone_constraints`; "" where its
        constraint is as it was made, where there are no in-betweens, and for objects, which need no constraint.
    """
    transform = transform_of(target)
    return next((trouble for _, trouble in _troubles((transform,))), "")


def with_troubles(transforms: Iterable[Transform]) -> Iterator[Transform]:
    """Yield those whose constraints are not as they were made. For polls: no channel is looked at."""
    result = set()
    for transform, _ in _troubles(transforms):
        if transform not in result:
            result.add(transform)
            yield transform


def restore_constraints(targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Put the constraints of bones back: first in their stack, unmuted, with full influence.

    Where nothing is amiss, nothing changes. For targets and refusals see `apply`.
    """

    def plan(transform: Transform, readings: Readings) -> list[Binding]:
        refuse_linked(transform)
        bindings = [binding for binding, _ in readings if binding.filled and binding.kind.has_difference_slot]
        if not bindings:
            raise Refused(
                n_("{name} has no constraint to restore: choose a mode for keys of a bone first"), name=transform.name
            )
        return [binding for binding in bindings if trouble_of(transform, binding)]

    def act(transform: Transform, bindings: list[Binding]) -> None:
        for binding in bindings:
            restore(transform, binding)

    apply_edit(targets, plan, act, refused)


def _troubles(transforms: Iterable[Transform]) -> Iterator[tuple[Transform, str]]:
    """Yield what is amiss with the constraints of each."""
    by_prefix: dict[bpy.types.Object, dict[str, Transform]] = {}
    for transform in transforms:
        if transform.has_difference_slot:
            by_prefix.setdefault(transform.animated, {})[transform.prefix] = transform
    for animated, same in by_prefix.items():
        for slot in slots_alone(animated):
            for record in slot.records:
                if not record.digest or (user := same.get(record.prefix)) is None:
                    continue
                # The constraint alone is looked at, not the channels.
                binding = Binding(slot, user.prefix, None, (user,), dict)
                if trouble := trouble_of(user, binding):
                    yield user, trouble
