"""Pose bones, and objects that are exact between frames: an Action constraint, first in the stack, adds differences.

The differences are in a second slot of the Action that has the keys. Nothing but constraints uses it. Which frame of it
a constraint takes, its evaluation time says, see `times`.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Iterator, Sequence

import bpy
import numpy as np
from mathutils import Quaternion

from ..actions.records import record_constraint, recorded_digest, remove_records
from ..actions.slots import Binding, Curves, Slot, bindings_for, bindings_of, is_time, slot_with, slots_alone
from ..compute.components import LOCATION, PART_OF, REST, ROTATION, ROWS, SCALE
from ..transforms import (
    CONSTRAINT,
    WIDTHS,
    Channel,
    Transform,
    is_part,
    prefix_of,
    rotation_of,
    set_rotation,
    shows_differences,
    split_path,
)
from .bone_constraints import (
    constraint_of,
    curves_shown_by,
    ensure_constraint,
    has_constraint,
    has_stale_constraint,
    remove_constraints,
    slot_of_differences,
)
from .sampled import Layout, Pieces, remove_if_empty, replace_samples
from .times import held_by, is_line, name_of, new_line, remove_time, says, time_of, write_line, write_time

AT_REST = "Rigid Motion Rest"
"""The group of what a slot of differences holds of objects that has no samples."""


class ConstraintWriter:
    """What `DeltaWriter` does, by constraints."""

    def write(self, binding: Binding, points: dict[Channel, np.ndarray], layout: Layout | None, pieces: Pieces) -> None:
        if points:
            _avoid_names(binding)
            _ensure_channelbag(binding)
            # Quaternions that get samples need the room.
            _keep_at_rest(binding, {})
            replace_samples(binding, points, layout, pieces)
            _keep_at_rest(binding, points)
            write_time(binding, layout)
            for user in binding.users:
                if user.animated.is_editable and not has_constraint(user, binding):
                    ensure_constraint(user, binding)
        elif binding.filled:
            remove_time(binding)
            replace_samples(binding, {}, None, {})
            _keep_at_rest(binding, {})
            _remove_slot_if_empty(binding.slot)

    def is_shown(self, binding: Binding, layout: Layout, channels: Collection[Channel]) -> bool:
        if not channels:
            return True
        time = time_of(binding)
        return time is not None and says(time, layout) and all(has_constraint(user, binding) for user in binding.users)

    def prepare(self, binding: Binding) -> None:
        return

    def show(self, binding: Binding) -> None:
        for user in binding.users:
            if user.animated.is_editable:
                if binding.filled and not has_constraint(user, binding):
                    ensure_constraint(user, binding)
                if has_stale_constraint(user, binding):
                    self.release([user])

    def difference(self, binding: Binding, user: Transform, frame: float) -> np.ndarray:
        filled, constraint = binding.filled, constraint_of(user, binding)
        if not filled or constraint is None or not constraint.enabled:
            return _no_difference(user)
        time = constraint.eval_time
        if (fcurve := time_of(binding)) is not None:
            time = min(max(fcurve.evaluate(frame), 0.0), 1.0)
        return _difference_at(constraint, time, filled, user)

    def shown_differences(self, user: Transform) -> list[tuple[np.ndarray, set[str]]]:
        return [
            (_difference_at(constraint, constraint.eval_time, shown, user), parts)
            for constraint, shown, parts in _shown_on(user)
        ]

    def shown_parts(self, user: Transform) -> set[str]:
        return set().union(*(parts for *_, parts in _shown_on(user)))

    def hide(self, binding: Binding, user: Transform) -> None:
        constraint, time = constraint_of(user, binding), time_of(binding)
        if constraint is not None and time is not None:
            constraint.eval_time = min(max(time.evaluate(_frame_of_a_key(binding)), 0.0), 1.0)

    def hold(self, binding: Binding, beside: Sequence[Binding]) -> bool:
        held = held_by(binding, beside)
        # An influence that has keys is the animator's.
        present = {
            channel: fcurve
            for channel, fcurve in binding.curves.items()
            if is_time(fcurve) and fcurve != time_of(binding) and not fcurve.keyframe_points
        }
        for channel, fcurve in present.items():
            if channel not in held or not is_line(fcurve, held[channel]):
                binding.channelbag.fcurves.remove(binding.curves.pop(channel))
        missing = [channel for channel in held if channel not in binding.curves]
        for path, index in missing:
            write_line(binding, path, held[path, index])
        if len(present) > len(held):
            remove_if_empty(binding.channelbag, binding.group)
        return bool(missing) or len(present) > len(held)

    def release(self, transforms: Iterable[Transform]) -> None:
        bones = [
            bone for bone in transforms if bone.motion.mounted or any(map(shows_differences, bone.carrier.constraints))
        ]
        if not bones:
            return
        shown: dict[Transform, set[tuple[bpy.types.Action, int]]] = {}
        for binding in bindings_of(bones):
            if binding.filled:
                for user in binding.users:
                    shown.setdefault(user, set()).add(slot_of_differences(binding))
        for bone in bones:
            if bone.animated.is_editable:
                remove_constraints(bone, shown.get(bone, set()))


def remove_orphans(slot: Slot) -> None:
    """Take out what a slot has for bones that are in none of its users any more, and are not keyed in it either.

    So it is left of a bone that was renamed. What was deleted, keys and all, may come back.
    """
    differences = slot.bones_channelbag
    groups = () if differences is None else differences.groups
    prefixes = {record.prefix for record in slot.records if is_part(record.prefix)}
    prefixes |= {prefix_of(group.name) for group in groups}
    present = {prefix_of(bone.name) for user in slot.users if user.pose is not None for bone in user.pose.bones}
    if gone := prefixes - present:
        paths = (split_path(fcurve.data_path) for fcurve in slot.fcurves)
        gone -= {prefix for prefix, prop in paths if prop in WIDTHS}
    if not gone:
        return
    for bag in filter(None, (slot.channelbag, differences)):
        for fcurve in list(bag.fcurves):
            if split_path(fcurve.data_path)[0] in gone and (bag == differences or is_time(fcurve)):
                bag.fcurves.remove(fcurve)
    remove_records(slot, gone)
    for group in [group for group in groups if not group.channels]:
        differences.groups.remove(group)
    _remove_slot_if_empty(slot)


def _avoid_names(binding: Binding) -> None:
    """Give the constraint of a slot a name that no other constraint of its users has."""
    taken = {
        constraint.name
        for user in binding.users
        for constraint in user.carrier.constraints
        if not shows_differences(constraint)
    }
    # Where it is all that moves them, nothing else can have the name.
    tracked = [
        user
        for user in binding.users
        if len(user.animated.animation_data.nla_tracks) and len(slots_alone(user.animated)) > 1
    ]
    others = (other for user in tracked for other in bindings_for(user) if other.slot.key != binding.slot.key)
    taken |= {name_of(other) for other in others if recorded_digest(other)}
    if name_of(binding) in taken:
        remove_time(binding)
        numbered = (f"{CONSTRAINT}.{number:03d}" for number in itertools.count(1))
        name = next(name for name in itertools.chain((CONSTRAINT,), numbered) if name not in taken)
        record_constraint(binding, name)


def _ensure_channelbag(binding: Binding) -> None:
    """Make where the differences of the bones of a slot are, if there is nothing yet."""
    if binding.slot.bones_channelbag is None:
        action = binding.slot.action
        pairs = action.rigid_motion.bone_slots
        pair = next((pair for pair in pairs if pair.handle == binding.slot.handle), None) or pairs.add()
        slot = slot_with(action, pair.differences) or action.slots.new("OBJECT", CONSTRAINT)
        pair.handle, pair.differences = binding.slot.handle, slot.handle
        action.layers[0].strips[0].channelbag(slot, ensure=True)


def _remove_slot_if_empty(slot: Slot) -> None:
    channelbag = slot.bones_channelbag
    if channelbag is not None and not len(channelbag.fcurves):
        pairs = slot.action.rigid_motion.bone_slots
        slot.action.slots.remove(slot_with(slot.action, slot.differences))
        pairs.remove(next(number for number, pair in enumerate(pairs) if pair.handle == slot.handle))


def _shown_on(user: Transform) -> Iterator[tuple[bpy.types.ActionConstraint, Curves, set[str]]]:
    """Yield the constraints that add to a user, what they show, and which of location, rotation and scale that is."""
    for constraint in user.carrier.constraints:
        if shows_differences(constraint) and constraint.enabled:
            shown = curves_shown_by(constraint, user)
            if parts := {PART_OF[row] for row, channel in user.differences.items() if channel in shown}:
                yield constraint, shown, parts


def _no_difference(user: Transform) -> np.ndarray:
    difference = REST.copy()
    if user.order is not None:
        difference[ROWS[ROTATION]] = 0.0
    return difference


def _difference_at(constraint: bpy.types.ActionConstraint, time: float, filled: Curves, user: Transform) -> np.ndarray:
    """Return what a constraint adds to a bone at an evaluation time, as components (10,)."""
    difference = _no_difference(user)
    at = constraint.frame_start + time * (constraint.frame_end - constraint.frame_start)
    for row, channel in user.differences.items():
        if (fcurve := filled.get(channel)) is not None:
            difference[row] = fcurve.evaluate(at)
    return _with_original(_weighted(difference, constraint.influence, user), user)


def _frame_of_a_key(binding: Binding) -> float:
    """Return a frame on which there is no difference: that of a key, and a whole one if there is any."""
    frames = [
        key.co.x
        for (path, _), fcurve in binding.curves.items()
        if path.removeprefix(binding.prefix) in WIDTHS and not fcurve.mute
        for key in fcurve.keyframe_points
    ]
    return min(frames, key=lambda frame: (abs(frame - round(frame)), frame), default=0.0)


def _keep_at_rest(binding: Binding, points: Collection[Channel]) -> None:
    """Hold the quaternions that a slot of differences has no samples of.

    Blender evaluates the slot on an object whose quaternions are zero, and takes these for half a turn.
    """
    if binding.kind.is_part or (channelbag := binding.slot.bones_channelbag) is None:
        return
    held = set()
    if points and binding.users[0].rotation == "rotation_quaternion":
        held = {("delta_rotation_quaternion", 0)}
        if all(path != "rotation_quaternion" for path, _ in points):
            held.add(("rotation_quaternion", 0))
    group = channelbag.groups.get(AT_REST)
    present = {(item.data_path, item.array_index): item for item in (() if group is None else group.channels)}
    for channel in present.keys() - held:
        channelbag.fcurves.remove(present[channel])
    remove_if_empty(channelbag, AT_REST)
    for path, index in held - present.keys():
        new_line(channelbag, AT_REST, (path, index), (1.0, 0.0))


def _with_original(difference: np.ndarray, user: Transform) -> np.ndarray:
    """Return a difference that comes on top of a user's original one, together with that."""
    original = user.original()
    if np.array_equal(original, REST):
        return difference
    difference[ROWS[LOCATION]] += original[ROWS[LOCATION]]
    difference[ROWS[SCALE]] *= original[ROWS[SCALE]]
    turned = rotation_of(difference, user.order) @ Quaternion(original[ROWS[ROTATION]])
    set_rotation(difference, user.order, turned)
    return difference


def _weighted(difference: np.ndarray, influence: float, user: Transform) -> np.ndarray:
    """Return a difference as the influence of a constraint lets it through."""
    if influence == 1.0:
        return difference
    difference[ROWS[LOCATION]] *= influence
    difference[ROWS[SCALE]] = 1.0 + influence * (difference[ROWS[SCALE]] - 1.0)
    turned = Quaternion().slerp(rotation_of(difference, user.order).normalized(), influence)
    set_rotation(difference, user.order, turned)
    return difference
