"""Constraints of bones that somebody has removed, muted, changed or moved: noticing it, and putting them right."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy
from bpy.app.translations import pgettext_rpt as rpt_

from ..actions.refusals import refuse_linked
from ..actions.slots import Binding, Slot, uses_of
from ..transforms import Refused, Transform, transform_of
from ..writers.table import WRITERS, writer_of
from .apply import Readings, Targets, apply_edit


def constraint_trouble(target: bpy.types.PoseBone | bpy.types.Object | Transform) -> str:
    """Return why a bone is not seen where its in-betweens have it.

    Returns
    -------
    str
        `REMOVED`, `OTHER_SLOT`, `MUTED`, `CHANGED`, `NOT_FIRST` or `WEAK`, see `constraint_repair`; "" where its
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
                rpt_("{name} has no constraint to restore: choose a mode for keys of a bone first").format(
                    name=transform.name
                )
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
        for action, handle, strips in uses_of(animated).values():
            slot = Slot(action, handle, (animated,), frozenset(strips))
            for record in action.rigid_motion.slots:
                if record.handle != handle or not record.digest or (user := same.get(record.prefix)) is None:
                    continue
                # The constraint alone is looked at, not the channels.
                binding = Binding(slot, user.prefix, None, (user,), dict)
                if trouble := writer_of(binding).trouble_of(user, binding):
                    yield user, trouble
