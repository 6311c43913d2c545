"""Constraints that show differences, each those of one slot: on bones, and on objects that are exact between frames.

An animator can mute, move or remove them: what is amiss then is told, and put right. Who takes one off does so on
purpose.
"""

from __future__ import annotations

import bpy
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from ..actions.slots import Binding, Curves, slot_with, slots_alone
from ..transforms import Transform, difference_constraints, shows_differences
from .times import name_of, path_of, span_of

REMOVED, OTHER_SLOT, MUTED, CHANGED, NOT_FIRST, WEAK = "REMOVED", "OTHER_SLOT", "MUTED", "CHANGED", "NOT_FIRST", "WEAK"
"""The troubles that may keep a bone from being seen where its in-betweens have it: the constraint is gone, shows
another slot, is muted, has other settings, comes behind another constraint, or has an influence below 1."""


def constraint_of(user: Transform, binding: Binding) -> bpy.types.ActionConstraint | None:
    """Return the constraint that shows the differences of a slot on a bone."""
    desired = slot_of_differences(binding)
    return next(
        (
            constraint
            for constraint in user.carrier.constraints
            if shows_differences(constraint) and shown_by(constraint) == desired
        ),
        None,
    )


def shown_by(constraint: bpy.types.ActionConstraint) -> tuple[bpy.types.Action | None, int]:
    """Return the Action and the handle of the slot that a constraint shows, or will outside of Edit Mode."""
    handle = constraint.action_slot_handle
    if not handle and constraint.id_data.mode == "EDIT" and (slot := _last_slot(constraint)) is not None:
        handle = slot.handle
    return constraint.action, handle


def curves_shown_by(constraint: bpy.types.ActionConstraint, user: Transform) -> Curves:
    """Return the F-curves that a constraint shows on a bone."""
    action, slot = constraint.action, constraint.action_slot
    channelbag = None if action is None or slot is None else action_get_channelbag_for_slot(action, slot)
    group = None if channelbag is None else channelbag.groups.get(user.difference_group(user.prefix))
    return {} if group is None else {(fcurve.data_path, fcurve.array_index): fcurve for fcurve in group.channels}


def detach_slots(rig: bpy.types.Object) -> None:
    """Have the constraints of a rig show no slot for now; they keep its name.

    Blender's Symmetrize mirrors the keys of what Action constraints show, and crashes on F-curves that have none.
    """
    for constraint in difference_constraints(rig):
        if constraint.action_slot_handle:
            constraint.action_slot = None


def attach_slots(rig: bpy.types.Object) -> None:
    """Have the constraints of a rig that were detached show their slots again."""
    for constraint in difference_constraints(rig):
        if not constraint.action_slot_handle and (slot := _last_slot(constraint)) is not None:
            constraint.action_slot = slot


def _last_slot(constraint: bpy.types.ActionConstraint) -> bpy.types.ActionSlot | None:
    action = constraint.action
    return None if action is None else action.slots.get(constraint.last_slot_identifier)


def slot_of_differences(binding: Binding) -> tuple[bpy.types.Action, int]:
    """Return the Action and the handle of the slot in it that the differences are in, 0 where there is none yet."""
    return binding.slot.action, binding.slot.differences


def has_constraint(user: Transform, binding: Binding) -> bool:
    """Return whether a bone has its constraint as it has to be, or it was taken off."""
    constraint = constraint_of(user, binding)
    if constraint is None:
        return not _may_add_constraint(user, binding)
    return (constraint.name, constraint.frame_start, constraint.frame_end) == (name_of(binding), *span_of(binding))


def has_stale_constraint(user: Transform, binding: Binding) -> bool:
    """Return whether a bone has a constraint that shows what another does, or what does not move its rig any more."""
    shown = [shown_by(constraint) for constraint in user.carrier.constraints if shows_differences(constraint)]
    if not shown or shown == [slot_of_differences(binding)]:
        return False
    return len(set(shown)) < len(shown) or not set(shown) <= _in_use(user.animated)


def _may_add_constraint(user: Transform, binding: Binding) -> bool:
    """Return whether a bone lacks a constraint that was not taken off it."""
    name = name_of(binding)
    present = user.carrier.constraints.get(name)
    return name not in user.motion.mounted.split("\n") or (present is not None and shows_differences(present))


def ensure_constraint(user: Transform, binding: Binding) -> None:
    """Have a bone show the differences of a slot, by a constraint that it has already or by a new one."""
    constraints, name = user.carrier.constraints, name_of(binding)
    constraint = constraint_of(user, binding) or constraints.get(name)
    action, handle = desired = slot_of_differences(binding)
    if constraint is None:
        constraint = _new(user, 0, name)
    elif not shows_differences(constraint) or shown_by(constraint) in _in_use(user.animated) - {desired}:
        # This slot gets a constraint of another name when it is written.
        return
    names = [item for item in user.motion.mounted.split("\n") if item not in ("", name, constraint.name)]
    if constraint.name != name:
        constraint = _renamed(constraint, name, user, binding)
    if shown_by(constraint) != desired:
        constraint.action = action
        constraint.action_slot = slot_with(action, handle)
    constraint.frame_start, constraint.frame_end = span_of(binding)
    if (mounted := "\n".join((*names, name))) != user.motion.mounted:
        user.motion.mounted = mounted
    if user.is_part and not user.animated.rigid_motion.has_bones:
        user.animated.rigid_motion.has_bones = True


def _new(user: Transform, index: int, name: str) -> bpy.types.ActionConstraint:
    """Return a constraint of this name, at a place in the stack of a bone."""
    constraints = user.carrier.constraints
    constraint = constraints.new("ACTION")
    constraint.name = name
    for setting, value in user.constraint_settings.items():
        setattr(constraint, setting, value)
    constraints.move(len(constraints) - 1, index)
    constraint = constraints[index]
    constraint.show_expanded = False
    return constraint


def _renamed(
    constraint: bpy.types.ActionConstraint, name: str, user: Transform, binding: Binding
) -> bpy.types.ActionConstraint:
    """Return a constraint of another name in place of one, and channels of it in its slot.

    Where one is renamed, Blender renames channels of the same name as well that other slots of the rig have for
    constraints of their own, of all bones that lack them yet.
    """
    constraints = user.carrier.constraints
    before = constraint.name
    settings = {setting: getattr(constraint, setting) for setting in ("influence", "mute", "show_expanded")}
    index = constraints.find(before)
    constraints.remove(constraint)
    constraint = _new(user, index, name)
    for setting, value in settings.items():
        setattr(constraint, setting, value)
    keyed = binding.curves.pop((path_of(binding, "influence", before), 0), None)
    if keyed is not None:
        keyed.data_path = path_of(binding, "influence", name)
        binding.curves[keyed.data_path, 0] = keyed
    return constraint


def _in_use(rig: bpy.types.Object) -> set[tuple[bpy.types.Action, int]]:
    """Return the Actions of a rig, and the handles of the slots in them that differences of its bones are in."""
    return {(slot.action, slot.differences) for slot in slots_alone(rig)}


def remove_constraints(user: Transform, shown: set[tuple[bpy.types.Action, int]]) -> None:
    """Take the constraints off a bone that show something else than these."""
    constraints, names, left = user.carrier.constraints, [], set(shown)
    for constraint in [item for item in constraints if shows_differences(item)]:
        if (what := shown_by(constraint)) in left:
            left.remove(what)
            names.append(constraint.name)
        else:
            constraints.remove(constraint)
    taken_off = [name for name in user.motion.mounted.split("\n") if name and name not in names] if shown else []
    mounted = "\n".join((*names, *taken_off))
    if user.motion.mounted != mounted:
        user.motion.mounted = mounted


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
    path = path_of(binding, "influence", constraint.name)
    channelbag, drivers = binding.slot.channelbag, user.animated.animation_data.drivers
    return (channelbag is not None and channelbag.fcurves.find(path) is not None) or drivers.find(path) is not None


def restore(user: Transform, binding: Binding) -> None:
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
