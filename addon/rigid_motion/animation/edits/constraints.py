"""Constraints of objects that are exact between frames, and of bones: given, taken, put right where they are amiss."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy
from bpy.app.translations import pgettext_n as n_

from ..actions.records import recorded, recorded_digest
from ..actions.refusals import refuse_linked
from ..actions.slots import Binding, bindings_for, bindings_of, slots_alone
from ..live import follower
from ..transforms import Refused, Transform, transform_of
from ..transforms.sizes import metres_per_channel_unit
from ..writers.filling import clear
from ..writers.table import WRITERS, writer_of
from .apply import Readings, Targets, apply_edit, transforms_of


def set_exact(targets: Targets, is_exact: bool = True, *, refused: list[Refused] | None = None) -> None:
    """Have objects be exact between frames as well, by a constraint; or by delta transforms on whole frames alone.

    What moves by the same Action slot comes along.

    Parameters
    ----------
    targets : bpy.types.Object, or several of them
    is_exact : bool
    refused : list, optional
        Takes the refusals, and all others are changed.

    Raises
    ------
    Refused
        For what cannot be edited, where there is no list to take that. Nothing is changed then. Bones are exact anyway.
    """
    chosen, refusals = [], []
    for transform in transforms_of(targets):
        try:
            refuse_linked(transform)
            if transform.is_part:
                raise Refused(n_("{name} is a bone, and exact between frames anyway"), name=transform.name)
            chosen.append(transform)
        except Refused as refusal:
            refusals.append(refusal)
    if refusals and refused is None:
        raise Refused("\n".join(map(str, refusals)))
    if refused is not None:
        refused.extend(refusals)
    bindings = bindings_of(chosen)
    users = dict.fromkeys((*chosen, *(user for binding in bindings for user in binding.users)))
    changed = [user for user in users if user.animated.is_editable and user.motion.is_exact != is_exact]
    if not changed:
        return
    with follower.paused():
        clear([binding for binding in bindings if binding.slot.action.is_editable])
        for user in changed:
            user.motion.is_exact = is_exact
    follower.refresh([transform_of(user.carrier) for user in changed])


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

    Parameters
    ----------
    targets : bpy.types.PoseBone, or several of them
        Where nothing is amiss, nothing changes.
    refused : list, optional
        Takes the refusals, and those of all others are put back.

    Raises
    ------
    Refused
        Where something has no in-betweens that a constraint would show, or cannot be edited, and there is no list to
        take that. Nothing is changed then.
    """

    def plan(transform: Transform, readings: Readings) -> list[Binding]:
        refuse_linked(transform)
        bindings = [binding for binding, _ in readings if binding.filled and writer_of(binding).uses_constraints]
        if not bindings:
            raise Refused(
                n_("{name} has no constraint to restore: choose a mode for keys of a bone first"), name=transform.name
            )
        return [binding for binding in bindings if writer_of(binding).trouble_of(transform, binding)]

    def act(transform: Transform, bindings: list[Binding]) -> None:
        for binding in bindings:
            writer_of(binding).restore(transform, binding)

    apply_edit(targets, plan, act, refused)


def _troubles(transforms: Iterable[Transform]) -> Iterator[tuple[Transform, str]]:
    """Yield what is amiss with the constraints of each."""
    by_prefix: dict[bpy.types.Object, dict[str, Transform]] = {}
    for transform in transforms:
        if WRITERS[transform.kind].uses_constraints:
            by_prefix.setdefault(transform.animated, {})[transform.prefix] = transform
    for animated, same in by_prefix.items():
        for slot in slots_alone(animated):
            for record in slot.records:
                if not record.digest or (user := same.get(record.prefix)) is None:
                    continue
                # The constraint alone is looked at, not the channels.
                binding = Binding(slot, user.prefix, None, (user,), dict)
                if trouble := writer_of(binding).trouble_of(user, binding):
                    yield user, trouble
