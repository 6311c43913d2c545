"""What may be amiss with the constraint of a bone, which an animator can mute, move or remove; and putting it right."""

from __future__ import annotations

import bpy

from ..actions.slots import Binding
from ..transforms import BoneTransform, Transform, shows_differences
from .bone_constraints import constraint_of, ensure_constraint, shown_by, slot_of_differences
from .times import name_of

REMOVED, OTHER_SLOT, MUTED, CHANGED, NOT_FIRST, WEAK = "REMOVED", "OTHER_SLOT", "MUTED", "CHANGED", "NOT_FIRST", "WEAK"
"""The troubles that may keep a bone from being seen where its in-betweens have it: the constraint is gone, shows
another slot, is muted, has other settings, comes behind another constraint, or has an influence below 1."""


def trouble_of(user: Transform, binding: Binding) -> str:
    """Return what is amiss with the constraint by which a bone shows the differences of a slot, "" where nothing is.

    An influence that is animated or driven is meant so.
    """
    desired, name, is_behind = slot_of_differences(binding), name_of(binding), False
    for constraint in user.carrier.constraints:
        if not shows_differences(constraint):
            is_behind |= constraint.enabled and constraint.influence > 0.0
        elif shown_by(constraint) == desired:
            return _trouble_with(constraint, user, binding, is_behind=is_behind)
    present = user.carrier.constraints.get(name)
    return OTHER_SLOT if present is not None and shows_differences(present) else REMOVED


def _trouble_with(constraint: bpy.types.ActionConstraint, user: Transform, binding: Binding, *, is_behind: bool) -> str:
    if not constraint.enabled:
        return MUTED
    if any(getattr(constraint, setting) != value for setting, value in user.constraint_settings.items()):
        return CHANGED
    if is_behind:
        return NOT_FIRST
    return WEAK if constraint.influence < 1.0 and not _is_influence_animated(constraint, user, binding) else ""


def _is_influence_animated(constraint: bpy.types.ActionConstraint, user: Transform, binding: Binding) -> bool:
    path = f'{binding.prefix}constraints["{bpy.utils.escape_identifier(constraint.name)}"].influence'
    channelbag, drivers = binding.slot.channelbag, user.animated.animation_data.drivers
    return (channelbag is not None and channelbag.fcurves.find(path) is not None) or drivers.find(path) is not None


def restore(user: BoneTransform, binding: Binding) -> None:
    """Have a bone show the differences of a slot in full: by its constraint as it was made, or by a new one."""
    constraints, desired, name = user.carrier.constraints, slot_of_differences(binding), name_of(binding)
    if constraint_of(user, binding) is None:
        # One that was given another name, or frames by a target, still shows them.
        for item in constraints:
            if item.type == "ACTION" and shown_by(item) == desired:
                item.name, item.use_eval_time = name, True
                break
    ensure_constraint(user, binding)
    constraint = constraint_of(user, binding)
    for setting, value in user.constraint_settings.items():
        setattr(constraint, setting, value)
    constraint.enabled = True
    if not _is_influence_animated(constraint, user, binding):
        constraint.influence = 1.0
    constraints.move(list(constraints).index(constraint), 0)
