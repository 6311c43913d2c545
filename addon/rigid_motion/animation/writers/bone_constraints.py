"""Constraints on bones: each shows the differences of one slot, and who takes one off does so on purpose."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from ..actions.slots import Binding, Curves, uses_of
from ..transforms import BoneTransform, Transform, shows_differences
from .times import constraint_path, name_of, span_of


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
    """Return the Action and the handle of the slot in it that a constraint shows,
    or will when its rig leaves Edit Mode.
    """
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
    for constraint in _constraints_on(rig):
        if constraint.action_slot_handle:
            constraint.action_slot = None


def attach_slots(rig: bpy.types.Object) -> None:
    """Have the constraints of a rig that were detached show their slots again."""
    for constraint in _constraints_on(rig):
        if not constraint.action_slot_handle and (slot := _last_slot(constraint)) is not None:
            constraint.action_slot = slot


def _constraints_on(rig: bpy.types.Object) -> Iterator[bpy.types.ActionConstraint]:
    return (constraint for bone in rig.pose.bones for constraint in bone.constraints if shows_differences(constraint))


def _last_slot(constraint: bpy.types.ActionConstraint) -> bpy.types.ActionSlot | None:
    action = constraint.action
    return None if action is None else action.slots.get(constraint.last_slot_identifier)


def slot_of_differences(binding: Binding) -> tuple[bpy.types.Action, int]:
    """Return the Action and the handle of the slot in it that the differences are in, 0 where there is none yet."""
    pairs = binding.slot.action.rigid_motion.bone_slots
    handle = next((pair.differences for pair in pairs if pair.handle == binding.slot.handle), 0)
    return binding.slot.action, handle


def has_constraint(user: Transform, binding: Binding) -> bool:
    """Return whether a bone has its constraint as it has to be, or it was taken off."""
    constraint = constraint_of(user, binding)
    if constraint is None:
        return not _may_add_constraint(user, binding)
    return (constraint.name, constraint.frame_start, constraint.frame_end) == (name_of(binding), *span_of(binding))


def has_stale_constraint(user: BoneTransform, binding: Binding) -> bool:
    """Return whether a bone has a constraint that shows what is shown already,
    or what does not move its rig any more.
    """
    shown = [shown_by(constraint) for constraint in user.carrier.constraints if shows_differences(constraint)]
    if not shown or shown == [slot_of_differences(binding)]:
        return False
    return len(set(shown)) < len(shown) or not set(shown) <= _in_use(user.animated)


def _may_add_constraint(user: Transform, binding: Binding) -> bool:
    """Return whether a bone lacks a constraint that was not taken off it."""
    name = name_of(binding)
    present = user.carrier.constraints.get(name)
    return name not in user.motion.mounted.split("\n") or (present is not None and shows_differences(present))


def ensure_constraint(user: BoneTransform, binding: Binding) -> None:
    """Have a bone show the differences of a slot, by a constraint that it has already or by a new one."""
    constraints, name = user.carrier.constraints, name_of(binding)
    constraint = constraint_of(user, binding) or constraints.get(name)
    if constraint is not None and not (shows_differences(constraint) and _can_be_reused(constraint, user, binding)):
        # This slot gets a constraint of another name when it is written.
        return
    if constraint is None:
        constraint = _new(user, 0, name)
    names = [item for item in user.motion.mounted.split("\n") if item not in ("", name, constraint.name)]
    if constraint.name != name:
        constraint = _renamed(constraint, name, user, binding)
    action, handle = slot_of_differences(binding)
    if shown_by(constraint) != (action, handle):
        constraint.action = action
        constraint.action_slot = next(slot for slot in action.slots if slot.handle == handle)
    constraint.frame_start, constraint.frame_end = span_of(binding)
    if (mounted := "\n".join((*names, name))) != user.motion.mounted:
        user.motion.mounted = mounted
    if user.is_part and not user.animated.rigid_motion.has_bones:
        user.animated.rigid_motion.has_bones = True


def _new(user: BoneTransform, index: int, name: str) -> bpy.types.ActionConstraint:
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
    constraint: bpy.types.ActionConstraint, name: str, user: BoneTransform, binding: Binding
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
    keyed = binding.curves.pop((f"{constraint_path(binding, before)}.influence", 0), None)
    if keyed is not None:
        keyed.data_path = f"{constraint_path(binding, name)}.influence"
        binding.curves[keyed.data_path, 0] = keyed
    return constraint


def _can_be_reused(constraint: bpy.types.ActionConstraint, user: BoneTransform, binding: Binding) -> bool:
    """Return whether a constraint shows a slot already, or one that does not move the rig any more."""
    shown = shown_by(constraint)
    return shown == slot_of_differences(binding) or shown not in _in_use(user.animated)


def _in_use(rig: bpy.types.Object) -> set[tuple[bpy.types.Action, int]]:
    """Return the Actions of a rig, and the handles of the slots in them that differences of its bones are in."""
    return {
        (action, pair.differences)
        for action, handle, _ in uses_of(rig).values()
        for pair in action.rigid_motion.bone_slots
        if pair.handle == handle
    }


def remove_constraints(user: BoneTransform, shown: set[tuple[bpy.types.Action, int]]) -> None:
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
