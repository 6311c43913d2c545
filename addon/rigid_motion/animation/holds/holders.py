"""Holders: the constraints that hold a transform, numbered so that keys can refer to them.

The number is stored in the constraint itself, where it has no effect: a passing constraint has it in the name of a
bone of no object, a holding one in the last row of its inverse. So the constraint is recognised after being renamed or
copied, and the F-curves of its influence may be deleted.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple, cast

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_
from mathutils import Matrix

from ..actions.marks import MAX_MARK, hold
from ..actions.slots import Binding, slots_alone
from ..evaluation.sources import KeyedTransform
from ..transforms import Channel, Refused, Transform, transform_of
from .placing import channel_space, converted, hang_of, hangs_on_bone, world_of

Constraint = Any
"""A *Child Of* or *Action* constraint; the two types have different properties."""

HOLD_KINDS = {"CHILD_OF": "Held In", "ACTION": "Pass To"}
"""The types of this extension's constraints, and the beginning of their names."""

_HOLDER_NAME = re.compile(r"rigid_motion (\d+)")

_INVERSE_MARK = 2.0**-100
"""The unit of the number in the last row of an inverse: it vanishes in any product that Blender forms with it."""

MAX_SCALE_ROUNDING = 1e-5
"""Scales that differ from one by less do so only by rounding."""

TOO_MANY = n_("{name} has had {most} holders, the most that keys can distinguish: remove constraints that hold nothing")


class Holder(NamedTuple):
    """An object or bone that can hold a transform."""

    number: int
    """The number that keys refer to; 0 is the parent of the transform or the world."""

    target: bpy.types.Object | None
    bone: str
    """The name of a bone of the target, "" for none."""

    offset: Matrix = Matrix()
    """The space of channels relative to the holder. Channels keep their units: the offset removes the scale that the
    holder had when it first held something, and applies that of the transform's own parent."""

    @property
    def name(self) -> str:
        """The name for menus and messages."""
        if self.target is None:
            return ""
        return self.bone or self.target.name

    def matrix(self, depsgraph: bpy.types.Depsgraph) -> Matrix:
        """Return the world matrix of the channel space in this holder."""
        assert self.target is not None
        return world_of(self.target, self.bone, depsgraph) @ self.offset


def world_in(
    user: Transform, holder: Holder | None, basis: Matrix, depsgraph: bpy.types.Depsgraph | None = None
) -> Matrix:
    """Return the world matrix of a transform with this channel matrix in a holder; None for its parent or the world."""
    if holder is None:
        return converted(user, basis, "LOCAL", "WORLD", depsgraph)
    return holder.matrix(depsgraph or bpy.context.evaluated_depsgraph_get()) @ basis


def basis_in(
    user: Transform, holder: Holder | None, world: Matrix, depsgraph: bpy.types.Depsgraph | None = None
) -> Matrix:
    """Return the channel matrix that gives a transform this world matrix in a holder."""
    if holder is None:
        return converted(user, world, "WORLD", "LOCAL", depsgraph)
    return holder.matrix(depsgraph or bpy.context.evaluated_depsgraph_get()).inverted_safe() @ world


def number_of(constraint: Constraint) -> int | None:
    """Return the holder number of a constraint; None if it is not one of this extension's."""
    if constraint.type == "CHILD_OF":
        number = constraint.inverse_matrix[3][0] / _INVERSE_MARK
        return int(number) if 1.0 <= number <= MAX_MARK else None
    found = _HOLDER_NAME.fullmatch(constraint.subtarget) if constraint.type == "ACTION" else None
    return int(found[1]) if found else None


def is_ours(constraint: Constraint) -> bool:
    """Return whether a constraint is one of this extension's holding or passing constraints."""
    return number_of(constraint) is not None


def constraints_to(user: Transform) -> dict[int, Constraint]:
    """Return the constraints that hold a transform, by holder number."""
    ours = [(number_of(item), item) for item in user.carrier.constraints if item.type == "CHILD_OF"]
    return {number: constraint for number, constraint in reversed(ours) if number is not None}


def passings_of(user: Transform) -> list[Constraint]:
    """Return the passing constraints of a transform, in all its Actions."""
    return [item for item in user.carrier.constraints if item.type == "ACTION" and is_ours(item)]


def passings_in(user: Transform, action: bpy.types.Action) -> dict[int, Constraint]:
    """Return the passing constraints of a transform in an Action, by the number of the holder they pass to.

    NLA strips may have others: each constraint shows the poses of one Action. A constraint with an Action that the
    transform no longer uses is available to any Action.
    """
    others = {slot.action for slot in slots_alone(user.animated)} - {action}
    ours = [(number_of(item), item) for item in passings_of(user) if item.action not in others]
    return {number: item for number, item in ours if number is not None}


def channel_of(user: Transform, constraint: Constraint, prop: str = "influence") -> Channel:
    """Return the channel of a property of a constraint."""
    return f'{user.prefix}constraints["{bpy.utils.escape_identifier(constraint.name)}"].{prop}', 0


def holders_of(user: Transform) -> list[Holder]:
    """Return the holders of a transform from its constraints, in the order of their numbers."""
    result = []
    for number, constraint in sorted(constraints_to(user).items()):
        offset = constraint.inverse_matrix.copy()
        offset[3][0] = 0.0
        result.append(Holder(number, constraint.target, constraint.subtarget, offset @ hang_of(user)))
    return result


def add_holder(binding: Binding, target: bpy.types.Object, bone: str) -> int:
    """Add a holder to the transforms of a binding, and return its number.

    If possible, the number is the one that others use for it, so that keys may be pasted between them.
    """
    taken = {number for user in binding.users for number in constraints_to(user)}
    for holder in holders_of(binding.users[0]):
        if (holder.target, holder.bone) == (target, bone):
            return holder.number
    known = [holder.number for holder in _all_holders() if (holder.target, holder.bone) == (target, bone)]
    elsewhere = {holder.number for holder in _all_holders()}
    choices = [*known, *(n for n in range(1, MAX_MARK) if n not in elsewhere), *range(1, MAX_MARK)]
    number = next((number for number in choices if number not in taken), None)
    if number is None:
        raise Refused(TOO_MANY, name=binding.name, most=MAX_MARK - 1)
    label = f"{HOLD_KINDS['CHILD_OF']} {bone or target.name}"
    while any(label in user.carrier.constraints for user in binding.users):
        label += "'"
    added = [(user, add_constraint(user, Holder(number, target, bone), label)) for user in binding.users]
    if not target.evaluated_get(bpy.context.evaluated_depsgraph_get()).is_evaluated:
        # A hidden target is evaluated from now on, as something depends on it.
        cast(bpy.types.ViewLayer, bpy.context.view_layer).update()
        for user, constraint in added:
            set_offset(constraint, user, number)
    return number


def own_space(user: Transform) -> tuple[str, bpy.types.Object | None, str]:
    """Return the space of a transform's channels when no holder holds it: its kind, object and bone.

    Blender's local space of an object includes its parent, but not the parent bone. Objects without parents are in the
    world anyway, and would be in a space of their own with delta transforms.
    """
    if hangs_on_bone(user):
        return "CUSTOM", user.animated.parent, user.animated.parent_bone
    return "LOCAL" if user.is_part or user.animated.parent is not None else "WORLD", None, ""


def known_holder(binding: Binding, number: int) -> tuple[Holder, str] | None:
    """Return a holder that keys refer to but that has no constraint yet, and a name for the constraint.

    It comes from the other users of the slot, or from the file if all holders with this number are the same there.
    """
    for other in binding.users:
        if (constraint := constraints_to(other).get(number)) is not None and constraint.target is not None:
            return Holder(number, constraint.target, constraint.subtarget), constraint.name
    known = {holder[:3]: holder for holder in _all_holders() if holder.number == number and holder.target is not None}
    if len(known) != 1:
        return None
    (holder,) = known.values()
    return holder, f"{HOLD_KINDS['CHILD_OF']} {holder.name}"


def _all_holders() -> Iterator[Holder]:
    """Yield all holders in the file."""
    for obj in bpy.data.objects:
        for carrier in (obj, *(() if obj.pose is None else obj.pose.bones)):
            if len(carrier.constraints):
                yield from holders_of(transform_of(carrier))


def add_constraint(user: Transform, holder: Holder, label: str) -> Constraint:
    """Add a constraint to a holder, with the holder's offset, or else one that removes the holder's present scale."""
    constraint = _insert_constraint(user, "CHILD_OF", label)
    constraint.target, constraint.subtarget = holder.target, holder.bone
    constraint.set_inverse_pending, constraint.target_space = False, "WORLD"
    keep_space(constraint, user)
    if holder.offset == Matrix():
        set_offset(constraint, user, holder.number)
    else:
        _set_inverse(constraint, holder.offset @ hang_of(user).inverted_safe(), holder.number)
    return constraint


def keep_space(constraint: Constraint, user: Transform) -> bool:
    """Make a constraint see a transform's channels as they are without a holder. Returns whether it was changed.

    If the object's parent bone has changed, was added or removed, a holding constraint gets a new offset.
    """
    kind, obj, bone = own = own_space(user)
    before = constraint.owner_space, constraint.space_object, constraint.space_subtarget
    if before == own or (before[0] == kind and obj is None):
        return False
    constraint.owner_space = kind
    if obj is not None:
        constraint.space_object, constraint.space_subtarget = obj, bone
    number = number_of(constraint) if constraint.type == "CHILD_OF" else None
    if number is not None and "CUSTOM" in (before[0], kind) and constraint.target is not None:
        set_offset(constraint, user, number)
    return True


def set_offset(constraint: Constraint, user: Transform, number: int) -> None:
    """Set the inverse of a holding constraint from the present scale of its holder: see `Holder.offset`."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    there = world_of(constraint.target, constraint.subtarget, depsgraph)
    location, rotation, _ = there.decompose()
    # If scale is left out, Blender rotates by angles, which jitter near gimbal lock: so scale is removed once, here.
    unscaled = there.inverted_safe() @ Matrix.LocRotScale(cast(Any, location), rotation, None)
    units = abs(channel_space(user, depsgraph).to_3x3().determinant()) ** (1 / 3)
    _set_inverse(constraint, _without_noise(unscaled @ Matrix.Scale(units, 4)) @ hang_of(user).inverted_safe(), number)


def _set_inverse(constraint: Constraint, inverse: Matrix, number: int) -> None:
    inverse[3][0] = number * _INVERSE_MARK
    constraint.inverse_matrix = inverse


def _without_noise(matrix: Matrix) -> Matrix:
    """Return a matrix without location, replaced by the identity if it differs from that only by rounding."""
    matrix.translation = 0.0, 0.0, 0.0
    return Matrix() if np.abs(np.array(matrix) - np.eye(4)).max() < MAX_SCALE_ROUNDING else matrix


def add_passing(user: Transform, holder: Holder, label: str) -> Constraint:
    """Add a constraint that passes a transform to a holder; to its parent or the world if the holder has no target."""
    constraint = _insert_constraint(user, "ACTION", label)
    constraint.subtarget = f"rigid_motion {holder.number}"
    # Setting the mix mode changes the space.
    constraint.mix_mode, constraint.use_eval_time = "REPLACE", True
    if holder.target is None:
        keep_space(constraint, user)
    else:
        constraint.owner_space, constraint.space_object = "CUSTOM", holder.target
        constraint.space_subtarget = holder.bone
    return constraint


def _insert_constraint(user: Transform, kind: str, label: str) -> Constraint:
    """Add a constraint in front of all foreign constraints; holding constraints go in front of passing ones."""
    constraints: Any = user.carrier.constraints
    before = sum(is_ours(item) and kind in ("ACTION", item.type) for item in constraints)
    constraint = constraints.new(kind)
    constraint.name, constraint.show_expanded, constraint.influence = label, False, 0.0
    constraints.move(len(constraints) - 1, before)
    _key_zero_influence(user, channel_of(user, constraints[before]))
    return constraints[before]


def _key_zero_influence(user: Transform, influence: Channel) -> None:
    """Key an influence at 0 in all Actions without it: if only some strips key it, the others leave it at 1."""
    path, index = influence
    for slot in slots_alone(user.animated):
        if slot.is_editable and (bag := slot.channelbag) is not None and bag.fcurves.find(path, index=index) is None:
            first = min((curve.range()[0] for curve in bag.fcurves if curve.keyframe_points), default=0.0)
            bag.fcurves.new(path, index=index).keyframe_points.insert(first, 0.0)


def spoken_of(source: KeyedTransform) -> tuple[dict[int, float], set[int]]:
    """Return the numbers of the holders of keys, with their first frames, and of the holders that are passed to."""
    if source.held is None:
        return {}, set()
    frames = source.keyed_frames
    numbers = (source.held.at(frames) // hold(1)).tolist()
    held = {number: frame for number, frame in zip(reversed(numbers), reversed(frames.tolist()), strict=True) if number}
    return held, {switch.after for switch in source.switches if not switch.is_at_once}
