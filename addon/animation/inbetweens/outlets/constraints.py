"""Pose bones: differences are put on top of a bone by an Action constraint, first in its stack.

The differences are in a second slot of the Action that has the keys. Nothing but constraints uses it. Which frame of it
a constraint takes, its evaluation time says, from 0 for the first sample to 1 for the last: that is animated beside the
bone's own channels, by an F-curve without keys, and so it goes through strips as they do.

Where several Actions of a rig fill in the same bone, each has a constraint of its own, of another name, and holds those
of the others at 0: there is no difference on the first key.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator

import bpy
import numpy as np
from mathutils import Euler, Quaternion

from ...actions.channels import add_cycles, replace_keys
from ...actions.records import ensure_record, record_of, recorded_digest
from ...actions.slots import SlotTransform, slot_transforms_of
from ...actions.sources import Source
from ...curves import Cycles
from ...transforms import (
    CONSTRAINT,
    LOCATION,
    REST,
    ROTATION,
    ROWS,
    SCALE,
    WIDTHS,
    BoneTransform,
    Channel,
    Transform,
    bone_name,
    is_ours,
)
from ..layout import Layout
from .outlet import Outlet
from .sampled import hold_constants, put_away, remove_if_empty, replace_samples

SETTINGS = {
    "use_eval_time": True,
    "mix_mode": "BEFORE_SPLIT",
    "owner_space": "LOCAL",
    "target_space": "LOCAL",
}
"""How the constraint mixes: location added, rotation from the left, scale multiplied, and transforms by hand see it."""

REMOVED, OTHER_SLOT, MUTED, CHANGED, NOT_FIRST, WEAK = "REMOVED", "OTHER_SLOT", "MUTED", "CHANGED", "NOT_FIRST", "WEAK"
"""What may keep a bone from being seen where its in-betweens have it: the constraint is gone, shows another slot, is
muted, has other settings, comes behind another constraint, or has an influence below 1."""


class Constraints(Outlet):
    def layout(self, source: Source) -> Layout:
        return Layout.apart(source)

    def write(self, place: SlotTransform, points: dict[Channel, np.ndarray], layout: Layout | None) -> None:
        present = place.filled
        if points:
            _avoid_names(place)
            replace_samples(_channelbag(place), bone_name(place.prefix), present, points, layout)
            _write_time(place, layout)
            self.show(place)
        elif present or _time(place) is not None:
            replace_samples(place.slot.bones_channelbag, bone_name(place.prefix), present, {}, None)
            _remove_time(place)
            _remove_slot_if_empty(place)
            self.release(place.users)

    def is_shown(self, place: SlotTransform, source: Source, channels: Collection[Channel]) -> bool:
        if not channels:
            return True
        time = _time(place)
        return (
            time is not None
            and _says(time, self.layout(source))
            and all(_is_mounted(user, place) for user in place.users)
        )

    def show(self, place: SlotTransform) -> None:
        if place.filled:
            for user in place.users:
                if user.animated.is_editable and not _is_mounted(user, place):
                    _mount(user, place)

    def difference(self, place: SlotTransform, user: Transform, frame: float | None) -> np.ndarray:
        difference = REST.copy()
        if user.rotation == "rotation_euler":
            difference[ROWS[ROTATION]] = 0.0
        filled, constraint = place.filled, constraint_of(user, place)
        if not filled or constraint is None or not constraint.enabled:
            return difference
        time = constraint.eval_time
        if frame is not None and (fcurve := _time(place)) is not None:
            time = min(max(fcurve.evaluate(frame), 0.0), 1.0)
        at = constraint.frame_start + time * (constraint.frame_end - constraint.frame_start)
        for row, channel in user.differences.items():
            if (fcurve := filled.get(channel)) is not None:
                difference[row] = fcurve.evaluate(at)
        return _weighted(difference, constraint.influence, user)

    def hold(self, place: SlotTransform) -> bool:
        """While another Action plays that keys the bone, and takes the place of this one, the difference of this one
        has to go: each of them has the constraints of the others at the frame where there is none."""
        held = {}
        if any(path.removeprefix(place.prefix) in WIDTHS for path, _ in place.curves):
            tracked = [user for user in place.users if len(user.animated.animation_data.nla_tracks)]
            others = slot_transforms_of(tracked) if tracked else ()
            held = {
                (_time_path(other), 0): 0.0
                for other in others
                if recorded_digest(other) and other.filled and not _is_same(other, place)
            }
            held.pop((_time_path(place), 0), None)
        present = {channel: fcurve for channel, fcurve in _times(place) if len(fcurve.sampled_points)}
        return hold_constants(place, bone_name(place.prefix), present, held)

    def release(self, transforms: Iterable[Transform]) -> None:
        bones = [bone for bone in transforms if bone.motion.mounted or any(map(is_ours, bone.carrier.constraints))]
        if not bones:
            return
        shown: dict[Transform, set[tuple[bpy.types.Action, int]]] = {}
        for place in slot_transforms_of(bones):
            if place.filled:
                for user in place.users:
                    shown.setdefault(user, set()).add(_slot_of_differences(place))
        for bone in bones:
            if bone.animated.is_editable:
                _dismount(bone, shown.get(bone, set()))


def constraint_of(user: Transform, place: SlotTransform) -> bpy.types.ActionConstraint | None:
    """The constraint that shows the differences of a slot on a bone."""
    wanted = _slot_of_differences(place)
    return next((one for one in user.carrier.constraints if is_ours(one) and _shown_by(one) == wanted), None)


def trouble_of(user: Transform, place: SlotTransform) -> str:
    """What is amiss with the constraint by which a bone shows the differences of a slot, "" where nothing is.

    An influence that is animated or driven is meant so.
    """
    wanted, name, is_behind = _slot_of_differences(place), _name(place), False
    for constraint in user.carrier.constraints:
        if not is_ours(constraint):
            is_behind |= constraint.enabled and constraint.influence > 0.0
        elif _shown_by(constraint) == wanted:
            return _trouble_with(constraint, user, place, is_behind=is_behind)
    present = user.carrier.constraints.get(name)
    return OTHER_SLOT if present is not None and is_ours(present) else REMOVED


def _trouble_with(
    constraint: bpy.types.ActionConstraint, user: Transform, place: SlotTransform, *, is_behind: bool
) -> str:
    if not constraint.enabled:
        return MUTED
    if any(getattr(constraint, setting) != value for setting, value in SETTINGS.items()):
        return CHANGED
    if is_behind:
        return NOT_FIRST
    return WEAK if constraint.influence < 1.0 and not _is_influence_animated(constraint, user, place) else ""


def _is_influence_animated(constraint: bpy.types.ActionConstraint, user: Transform, place: SlotTransform) -> bool:
    path = f'{place.prefix}constraints["{bpy.utils.escape_identifier(constraint.name)}"].influence'
    channelbag, drivers = place.slot.channelbag, user.animated.animation_data.drivers
    return (channelbag is not None and channelbag.fcurves.find(path) is not None) or drivers.find(path) is not None


def mend(user: BoneTransform, place: SlotTransform) -> None:
    """Have a bone show the differences of a slot in full: by its constraint as it was made, or by a new one."""
    constraints, wanted, name = user.carrier.constraints, _slot_of_differences(place), _name(place)
    if constraint_of(user, place) is None:
        # One that was given another name, or frames by a target, still shows them.
        for one in constraints:
            if one.type == "ACTION" and _shown_by(one) == wanted:
                one.name, one.use_eval_time = name, True
                break
    _mount(user, place)
    constraint = constraint_of(user, place)
    for setting, value in SETTINGS.items():
        setattr(constraint, setting, value)
    constraint.enabled = True
    if not _is_influence_animated(constraint, user, place):
        constraint.influence = 1.0
    constraints.move(list(constraints).index(constraint), 0)


def _shown_by(constraint: bpy.types.ActionConstraint) -> tuple[bpy.types.Action | None, int]:
    return constraint.action, constraint.action_slot_handle


def _slot_of_differences(place: SlotTransform) -> tuple[bpy.types.Action, int]:
    """The Action and the handle of the slot in it that the differences are in, 0 where there is none yet."""
    pairs = place.slot.action.rigid_motion.bone_slots
    handle = next((pair.differences for pair in pairs if pair.handle == place.slot.handle), 0)
    return place.slot.action, handle


def _is_mounted(user: Transform, place: SlotTransform) -> bool:
    """Whether a bone has its constraint as it has to be, or somebody took it off."""
    constraint = constraint_of(user, place)
    if constraint is None:
        return not _is_free_to_mount(user, place)
    return (constraint.name, constraint.frame_start, constraint.frame_end) == (_name(place), *_span(place))


def _is_free_to_mount(user: Transform, place: SlotTransform) -> bool:
    """Whether a bone lacks a constraint that nobody took off it."""
    name = _name(place)
    present = user.carrier.constraints.get(name)
    return name not in user.motion.mounted.split("\n") or (present is not None and is_ours(present))


def _mount(user: BoneTransform, place: SlotTransform) -> None:
    """Have a bone show the differences of a slot, by a constraint that it has already or by a new one."""
    constraints, name = user.carrier.constraints, _name(place)
    constraint = constraint_of(user, place) or constraints.get(name)
    if constraint is None:
        constraint = constraints.new("ACTION")
        for setting, value in SETTINGS.items():
            setattr(constraint, setting, value)
        constraints.move(len(constraints) - 1, 0)
        constraint = constraints[0]
        constraint.show_expanded = False
    if constraint.name != name:
        constraint.name = name
    action, handle = _slot_of_differences(place)
    if _shown_by(constraint) != (action, handle):
        constraint.action = action
        constraint.action_slot = next(slot for slot in action.slots if slot.handle == handle)
    constraint.frame_start, constraint.frame_end = _span(place)
    names = user.motion.mounted.split("\n") if user.motion.mounted else []
    if name not in names:
        user.motion.mounted = "\n".join((*names, name))
    if not user.animated.rigid_motion.has_bones:
        user.animated.rigid_motion.has_bones = True


def _dismount(user: BoneTransform, shown: set[tuple[bpy.types.Action, int]]) -> None:
    """Take the constraints off a bone that show something else than these."""
    constraints, names, left = user.carrier.constraints, [], set(shown)
    for constraint in [one for one in constraints if is_ours(one)]:
        if (what := _shown_by(constraint)) in left:
            left.remove(what)
            names.append(constraint.name)
        else:
            constraints.remove(constraint)
    taken_off = [name for name in user.motion.mounted.split("\n") if name and name not in names] if shown else []
    mounted = "\n".join((*names, *taken_off))
    if user.motion.mounted != mounted:
        user.motion.mounted = mounted


def _span(place: SlotTransform) -> tuple[int, int]:
    """The frames of the first and the last sample."""
    points = next(iter(place.filled.values())).sampled_points
    first = math.floor(points[0].co[0])
    return first, first + len(points) - 1


def _name(place: SlotTransform) -> str:
    record = record_of(place)
    return (record is not None and record.constraint) or CONSTRAINT


def _time_path(place: SlotTransform) -> str:
    return f'{place.prefix}constraints["{_name(place)}"].eval_time'


def _times(place: SlotTransform) -> Iterator[tuple[Channel, bpy.types.FCurve]]:
    """The channels of evaluation times: of its own constraint, and of those that it holds."""
    begin = f'{place.prefix}constraints["{CONSTRAINT}'
    return ((channel, fcurve) for channel, fcurve in list(place.curves.items()) if channel[0].startswith(begin))


def _time(place: SlotTransform) -> bpy.types.FCurve | None:
    """The channel of its own constraint's evaluation time."""
    return place.curves.get((_time_path(place), 0))


def _write_time(place: SlotTransform, layout: Layout) -> None:
    if (present := _time(place)) is not None:
        if _says(present, layout):
            return
        _remove_time(place)
    path = _time_path(place)
    fcurve = place.curves[path, 0] = place.channelbag.fcurves.new(path)
    if layout.cycles is None:
        generator = fcurve.modifiers.new("GENERATOR")
        generator.poly_order = 1
        generator.coefficients = _line(layout)
    else:
        replace_keys(fcurve, np.array((layout.first, layout.last)), np.array((0.0, 1.0)))
        add_cycles(fcurve, _without_offset(layout.cycles))
    put_away(place.channelbag, bone_name(place.prefix), fcurve)


def _says(fcurve: bpy.types.FCurve, layout: Layout) -> bool:
    """Whether an evaluation time goes through the samples as they lie."""
    if fcurve.mute or len(fcurve.modifiers) != 1 or len(fcurve.sampled_points):
        return False
    (modifier,) = fcurve.modifiers
    if layout.cycles is None:
        return (
            modifier.type == "GENERATOR"
            and not modifier.mute
            and not fcurve.keyframe_points
            and tuple(modifier.coefficients) == tuple(np.float32(_line(layout)).tolist())
        )
    cycles = _without_offset(layout.cycles)
    return (
        modifier.type == "CYCLES"
        and [tuple(key.co) for key in fcurve.keyframe_points] == [(layout.first, 0.0), (layout.last, 1.0)]
        and cycles == Cycles(modifier.mode_before, modifier.mode_after, modifier.cycles_before, modifier.cycles_after)
    )


def _line(layout: Layout) -> tuple[float, float]:
    """The coefficients of the line from 0 on the first frame to 1 on the last."""
    duration = max(layout.last - layout.first, 1)
    return -layout.first / duration, 1.0 / duration


def _without_offset(cycles: Cycles) -> Cycles:
    """The difference repeats as it is also where the channels go on from where they have come."""
    before, after = (mode.removesuffix("_OFFSET") for mode in (cycles.before, cycles.after))
    return Cycles(before, after, cycles.before_count, cycles.after_count)


def _remove_time(place: SlotTransform) -> None:
    fcurve = place.curves.pop((_time_path(place), 0), None)
    if fcurve is not None:
        place.channelbag.fcurves.remove(fcurve)
        remove_if_empty(place.channelbag, bone_name(place.prefix))


def _avoid_names(place: SlotTransform) -> None:
    """Give the constraint of a slot a name that no other constraint of its users has."""
    taken = {
        constraint.name for user in place.users for constraint in user.carrier.constraints if not is_ours(constraint)
    }
    tracked = [user for user in place.users if len(user.animated.animation_data.nla_tracks)]
    if tracked:
        others = slot_transforms_of(tracked)
        taken |= {_name(other) for other in others if recorded_digest(other) and not _is_same(other, place)}
    if _name(place) in taken:
        _remove_time(place)
        numbers = (f"{CONSTRAINT}.{number:03d}" for number in range(1, 1000))
        name = next(name for name in (CONSTRAINT, *numbers) if name not in taken)
        ensure_record(place).constraint = name


def _is_same(one: SlotTransform, other: SlotTransform) -> bool:
    return (one.slot.action, one.slot.handle) == (other.slot.action, other.slot.handle)


def _channelbag(place: SlotTransform) -> bpy.types.ActionChannelbag:
    """Where the differences of the bones of a slot are; made where there is none yet."""
    found = place.slot.bones_channelbag
    if found is not None:
        return found
    action = place.slot.action
    pairs = action.rigid_motion.bone_slots
    pair = next((pair for pair in pairs if pair.handle == place.slot.handle), None) or pairs.add()
    slot = next((slot for slot in action.slots if slot.handle == pair.differences), None)
    slot = slot or action.slots.new("OBJECT", CONSTRAINT)
    pair.handle, pair.differences = place.slot.handle, slot.handle
    return action.layers[0].strips[0].channelbag(slot, ensure=True)


def _remove_slot_if_empty(place: SlotTransform) -> None:
    channelbag = place.slot.bones_channelbag
    if channelbag is not None and not len(channelbag.fcurves):
        action, handle = _slot_of_differences(place)
        action.slots.remove(next(slot for slot in action.slots if slot.handle == handle))
        pairs = action.rigid_motion.bone_slots
        pairs.remove(next(number for number, pair in enumerate(pairs) if pair.handle == place.slot.handle))


def _weighted(difference: np.ndarray, influence: float, user: Transform) -> np.ndarray:
    """A difference as the influence of a constraint lets it through."""
    if influence == 1.0:
        return difference
    location, rotation, scale = ROWS[LOCATION], ROWS[ROTATION], ROWS[SCALE]
    difference[location] *= influence
    difference[scale] = 1.0 + influence * (difference[scale] - 1.0)
    none = Quaternion()
    if user.rotation == "rotation_quaternion":
        difference[rotation] = none.slerp(Quaternion(difference[rotation]).normalized(), influence)
    else:
        order = user.carrier.rotation_mode
        turned = none.slerp(Euler(difference[3:6], order).to_quaternion(), influence)
        difference[3:6] = turned.to_euler(order)
    return difference
