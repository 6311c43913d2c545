"""Pose bones: differences are put on top of a bone by an Action constraint, first in its stack.

The differences are in a second slot of the Action that has the keys. Nothing but constraints uses it. Which frame of it
a constraint takes, its evaluation time says, from 0 for frame 0, which no sample is before, to 1 for a power of two: so
Blender comes to whole frames again without an error, in single precision. That is animated beside the bone's own
channels, by an F-curve without keys, and so it goes through strips as they do.

Where several Actions of a rig fill in the same bone, in strips of the NLA, each has a constraint of its own, of another
name, that has no influence while another Action plays. From one strip to the next both influences blend, as Blender
blends what is keyed, and so that the times do not, each Action has the time of the others as well.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable

import bpy
import numpy as np
from mathutils import Euler, Quaternion

from ...actions.channels import add_cycles, replace_keys
from ...actions.records import ensure_record, record_of, recorded_digest
from ...actions.slots import Slot, SlotTransform, slot_transforms_of, strips_of, uses_of
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
    prefix_of,
    split_path,
)
from ..layout import Layout
from .outlet import Outlet
from .sampled import put_away, remove_if_empty, replace_samples

SETTINGS = {
    "use_eval_time": True,
    "mix_mode": "BEFORE_SPLIT",
    "owner_space": "LOCAL",
    "target_space": "LOCAL",
}
"""How the constraint mixes: location added, rotation from the left, scale multiplied, and transforms by hand see it."""

MOST_FRAMES = 1_048_574
"""The last frame that Blender lets a constraint have."""


class Constraints(Outlet):
    def layout(self, source: Source) -> Layout:
        return Layout.apart(source)

    def write(self, place: SlotTransform, points: dict[Channel, np.ndarray], layout: Layout | None) -> None:
        present = place.filled
        if points:
            _avoid_names(place)
            curves, _ = replace_samples(_channelbag(place), bone_name(place.prefix), present, points, layout)
            place.has_filled(curves)
            _write_time(place, layout)
            self.show(place)
        elif present:
            _remove_time(place)
            replace_samples(place.slot.bones_channelbag, bone_name(place.prefix), present, {}, None)
            place.has_filled({})
            _remove_slot_if_empty(place.slot)
            self.release(place.users)

    def is_shown(self, place: SlotTransform, layout: Layout, channels: Collection[Channel]) -> bool:
        if not channels:
            return True
        time = _time(place)
        return time is not None and _says(time, layout) and all(_is_mounted(user, place) for user in place.users)

    def show(self, place: SlotTransform) -> None:
        for user in place.users:
            if user.animated.is_editable:
                if place.filled and not _is_mounted(user, place):
                    mount(user, place)
                if _has_stale(user):
                    self.release([user])

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
        held = _held(place)
        present = {
            channel: fcurve
            for channel, fcurve in place.curves.items()
            if channel[0].startswith(_constraint_path(place, CONSTRAINT)[:-2]) and fcurve != _time(place)
        }
        for channel, fcurve in present.items():
            if channel not in held or not _is_line(fcurve, held[channel]):
                place.channelbag.fcurves.remove(place.curves.pop(channel))
        missing = [channel for channel in held if channel not in place.curves]
        for path, index in missing:
            _write_line(place, path, held[path, index])
        if len(present) > len(held):
            remove_if_empty(place.channelbag, bone_name(place.prefix))
        return bool(missing) or len(present) > len(held)

    def release(self, transforms: Iterable[Transform]) -> None:
        bones = [bone for bone in transforms if bone.motion.mounted or any(map(is_ours, bone.carrier.constraints))]
        if not bones:
            return
        shown: dict[Transform, set[tuple[bpy.types.Action, int]]] = {}
        for place in slot_transforms_of(bones):
            if place.filled:
                for user in place.users:
                    shown.setdefault(user, set()).add(slot_of_differences(place))
        for bone in bones:
            if bone.animated.is_editable:
                _dismount(bone, shown.get(bone, set()))


def remove_orphans(slot: Slot) -> None:
    """Take out what a slot has for bones that are in none of its users any more, and are not keyed in it either.

    So it is left of a bone that was renamed. What was deleted, keys and all, may come back.
    """
    action, channelbag, differences = slot.action, slot.channelbag, slot.bones_channelbag
    records = action.rigid_motion.slots
    prefixes = {record.prefix for record in records if record.handle == slot.handle and record.prefix}
    groups = () if differences is None else differences.groups
    prefixes |= {prefix_of(group.name) for group in groups}
    gone = {
        prefix
        for prefix in prefixes
        if all(user.pose is None or bone_name(prefix) not in user.pose.bones for user in slot.users)
    }
    if gone and channelbag is not None:
        gone -= {prefix for prefix, prop in (split_path(one.data_path) for one in channelbag.fcurves) if prop in WIDTHS}
    if not gone:
        return
    for bag in (channelbag, differences):
        for fcurve in list(bag.fcurves) if bag is not None else ():
            prefix, prop = split_path(fcurve.data_path)
            if prefix in gone and (bag is differences or prop.startswith(f'constraints["{CONSTRAINT}')):
                bag.fcurves.remove(fcurve)
    for number, record in reversed(list(enumerate(records))):
        if record.handle == slot.handle and record.prefix in gone:
            records.remove(number)
    for group in [group for group in groups if not group.channels]:
        differences.groups.remove(group)
    _remove_slot_if_empty(slot)


def constraint_of(user: Transform, place: SlotTransform) -> bpy.types.ActionConstraint | None:
    """The constraint that shows the differences of a slot on a bone."""
    wanted = slot_of_differences(place)
    return next((one for one in user.carrier.constraints if is_ours(one) and shown_by(one) == wanted), None)


def shown_by(constraint: bpy.types.ActionConstraint) -> tuple[bpy.types.Action | None, int]:
    """The Action and the handle of the slot in it that a constraint shows."""
    return constraint.action, constraint.action_slot_handle


def slot_of_differences(place: SlotTransform) -> tuple[bpy.types.Action, int]:
    """The Action and the handle of the slot in it that the differences are in, 0 where there is none yet."""
    pairs = place.slot.action.rigid_motion.bone_slots
    handle = next((pair.differences for pair in pairs if pair.handle == place.slot.handle), 0)
    return place.slot.action, handle


def _is_mounted(user: Transform, place: SlotTransform) -> bool:
    """Whether a bone has its constraint as it has to be, or somebody took it off."""
    constraint = constraint_of(user, place)
    if constraint is None:
        return not _is_free_to_mount(user, place)
    return (constraint.name, constraint.frame_start, constraint.frame_end) == (name_of(place), *_span(place))


def _has_stale(user: BoneTransform) -> bool:
    """Whether a bone has a constraint that shows what is shown already, or what does not move its rig any more."""
    shown = [shown_by(constraint) for constraint in filter(is_ours, user.carrier.constraints)]
    return len(set(shown)) < len(shown) or (bool(shown) and not set(shown) <= _in_use(user.animated))


def _in_use(rig: bpy.types.Object) -> set[tuple[bpy.types.Action, int]]:
    """The Actions of a rig, and the handles of the slots in them that differences of its bones are in."""
    return {
        (action, pair.differences)
        for action, handle, _ in uses_of(rig).values()
        for pair in action.rigid_motion.bone_slots
        if pair.handle == handle
    }


def _is_free_to_mount(user: Transform, place: SlotTransform) -> bool:
    """Whether a bone lacks a constraint that nobody took off it."""
    name = name_of(place)
    present = user.carrier.constraints.get(name)
    return name not in user.motion.mounted.split("\n") or (present is not None and is_ours(present))


def mount(user: BoneTransform, place: SlotTransform) -> None:
    """Have a bone show the differences of a slot, by a constraint that it has already or by a new one."""
    constraints, name = user.carrier.constraints, name_of(place)
    constraint = constraint_of(user, place) or constraints.get(name)
    if constraint is not None and not (is_ours(constraint) and _is_to_be_had(constraint, user, place)):
        # This slot gets a constraint of another name when it is written.
        return
    if constraint is None:
        constraint = constraints.new("ACTION")
        for setting, value in SETTINGS.items():
            setattr(constraint, setting, value)
        constraints.move(len(constraints) - 1, 0)
        constraint = constraints[0]
        constraint.show_expanded = False
    names = [one for one in user.motion.mounted.split("\n") if one not in ("", name, constraint.name)]
    if constraint.name != name:
        constraint.name = name
    action, handle = slot_of_differences(place)
    if shown_by(constraint) != (action, handle):
        constraint.action = action
        constraint.action_slot = next(slot for slot in action.slots if slot.handle == handle)
    constraint.frame_start, constraint.frame_end = _span(place)
    if (mounted := "\n".join((*names, name))) != user.motion.mounted:
        user.motion.mounted = mounted
    if not user.animated.rigid_motion.has_bones:
        user.animated.rigid_motion.has_bones = True


def _is_to_be_had(constraint: bpy.types.ActionConstraint, user: BoneTransform, place: SlotTransform) -> bool:
    """Whether a constraint shows a slot already, or one that does not move the rig any more."""
    shown = shown_by(constraint)
    return shown == slot_of_differences(place) or shown not in _in_use(user.animated)


def _dismount(user: BoneTransform, shown: set[tuple[bpy.types.Action, int]]) -> None:
    """Take the constraints off a bone that show something else than these."""
    constraints, names, left = user.carrier.constraints, [], set(shown)
    for constraint in [one for one in constraints if is_ours(one)]:
        if (what := shown_by(constraint)) in left:
            left.remove(what)
            names.append(constraint.name)
        else:
            constraints.remove(constraint)
    taken_off = [name for name in user.motion.mounted.split("\n") if name and name not in names] if shown else []
    mounted = "\n".join((*names, *taken_off))
    if user.motion.mounted != mounted:
        user.motion.mounted = mounted


def _span(place: SlotTransform) -> tuple[int, int]:
    """The frames that an evaluation time of 0 and one of 1 stand for."""
    points = next(iter(place.filled.values())).sampled_points
    return 0, _duration(math.ceil(points[len(points) - 1].co[0]))


def _duration(last: int) -> int:
    """The power of two that this frame of the samples is not behind."""
    return min(1 << max(last - 1, 0).bit_length(), MOST_FRAMES)


def name_of(place: SlotTransform) -> str:
    record = record_of(place)
    return (record is not None and record.constraint) or CONSTRAINT


def _constraint_path(place: SlotTransform, name: str) -> str:
    return f'{place.prefix}constraints["{name}"]'


def _time_path(place: SlotTransform) -> str:
    return f"{_constraint_path(place, name_of(place))}.eval_time"


def _influence_path(place: SlotTransform) -> str:
    return f"{_constraint_path(place, name_of(place))}.influence"


def _time(place: SlotTransform) -> bpy.types.FCurve | None:
    """The channel of its own constraint's evaluation time."""
    return place.curves.get((_time_path(place), 0)) if place.filled else None


Line = tuple[float, float]
"""What a channel is at frame 0, and by how much it grows in a frame."""


def _held(place: SlotTransform) -> dict[Channel, Line]:
    """What an Action has of constraints in the NLA of a rig: of its own the influence, of the others the time too."""
    user = place.users[0]
    if not (len(user.animated.animation_data.nla_tracks) and _moves_bone(place)):
        return {}
    held: dict[Channel, Line] = {}
    others = [other for other in slot_transforms_of([user]) if not _is_same(other, place) and _moves_bone(other)]
    for other in others:
        if other.filled:
            held[_influence_path(other), 0] = (0.0, 0.0)
            held[_time_path(other), 0] = _time_seen_from(place, other, user.animated)
    if others and place.filled:
        held[_influence_path(place), 0] = (1.0, 0.0)
    return held


def _moves_bone(place: SlotTransform) -> bool:
    return any(path.removeprefix(place.prefix) in WIDTHS for path, _ in place.curves)


def _time_seen_from(place: SlotTransform, other: SlotTransform, rig: bpy.types.Object) -> Line:
    """The time of another Action's constraint at frames of this one; of its first frame, where there is no one time."""
    line = next((_line_of(fcurve) for fcurve in (_time(other),) if fcurve is not None), None)
    own, others = (_frames_of(rig, one.slot) for one in (place, other))
    if line is None or own is None or others is None:
        return 0.0, 0.0
    # From this Action's frames to the scene's, on to the other's, and on to its time.
    (begin, speed), (other_begin, other_speed), (time, rate) = own, others, line
    return (
        time + rate * (begin - other_begin) / other_speed,
        rate * speed / other_speed,
    )


def _frames_of(rig: bpy.types.Object, slot: Slot) -> Line | None:
    """The scene's frames by those of an Action, where it plays once."""
    data = rig.animation_data
    lines: list[Line | None] = []
    if (data.action, data.action_slot_handle) == (slot.action, slot.handle):
        lines.append((0.0, 1.0))
    for strip in strips_of(rig):
        if (strip.action, strip.action_slot_handle) == (slot.action, slot.handle) and not strip.mute:
            if strip.repeat > 1.0 or strip.use_animated_time:
                lines.append(None)
            elif strip.use_reverse:
                lines.append((strip.frame_start + strip.action_frame_end * strip.scale, -strip.scale))
            else:
                lines.append((strip.frame_start - strip.action_frame_start * strip.scale, strip.scale))
    return lines[0] if len(lines) == 1 else None


def _write_time(place: SlotTransform, layout: Layout) -> None:
    if (present := _time(place)) is not None:
        if _says(present, layout):
            return
        _remove_time(place)
    path = _time_path(place)
    if layout.cycles is None:
        _write_line(place, path, _line(layout))
        return
    fcurve = place.curves[path, 0] = place.channelbag.fcurves.new(path)
    frames, times = np.array(_seams(layout)).T
    replace_keys(fcurve, frames, times)
    add_cycles(fcurve, _without_offset(layout.cycles))
    put_away(place.channelbag, bone_name(place.prefix), fcurve)


def _write_line(place: SlotTransform, path: str, line: Line) -> None:
    """An F-curve that is a line, without keys."""
    fcurve = place.curves[path, 0] = place.channelbag.fcurves.new(path)
    generator = fcurve.modifiers.new("GENERATOR")
    generator.poly_order = 1
    generator.coefficients = line
    put_away(place.channelbag, bone_name(place.prefix), fcurve)


def _line_of(fcurve: bpy.types.FCurve) -> Line | None:
    """The line that an F-curve is, None where it is none, or has been changed."""
    modifiers = list(fcurve.modifiers)
    plain = len(modifiers) == 1 and not (fcurve.mute or len(fcurve.keyframe_points) or len(fcurve.sampled_points))
    if not plain or modifiers[0].type != "GENERATOR" or modifiers[0].mute or modifiers[0].poly_order != 1:
        return None
    return tuple(modifiers[0].coefficients)


def _is_line(fcurve: bpy.types.FCurve, line: Line) -> bool:
    return _line_of(fcurve) == tuple(np.float32(line).tolist())


def _says(fcurve: bpy.types.FCurve, layout: Layout) -> bool:
    """Whether an evaluation time goes through the samples as they lie."""
    if layout.cycles is None:
        return _is_line(fcurve, _line(layout))
    modifiers = list(fcurve.modifiers)
    if fcurve.mute or [modifier.type for modifier in modifiers] != ["CYCLES"]:
        return False
    (modifier,) = modifiers
    cycles = Cycles(modifier.mode_before, modifier.mode_after, modifier.cycles_before, modifier.cycles_after)
    return cycles == _without_offset(layout.cycles) and np.array_equal(
        [key.co for key in fcurve.keyframe_points], np.float32(_seams(layout))
    )


def _line(layout: Layout) -> Line:
    """From frames to the evaluation times of their samples."""
    duration = _duration(layout.last + layout.shift)
    return layout.shift / duration, 1.0 / duration


def _seams(layout: Layout) -> list[tuple[float, float]]:
    """The outermost frames, and the evaluation times of their samples."""
    start, step = _line(layout)
    return [(frame, start + step * frame) for frame in (layout.first, layout.last)]


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
        taken |= {name_of(other) for other in others if recorded_digest(other) and not _is_same(other, place)}
    if name_of(place) in taken:
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


def _remove_slot_if_empty(slot: Slot) -> None:
    channelbag = slot.bones_channelbag
    if channelbag is not None and not len(channelbag.fcurves):
        pairs = slot.action.rigid_motion.bone_slots
        number, pair = next((number, pair) for number, pair in enumerate(pairs) if pair.handle == slot.handle)
        slot.action.slots.remove(next(one for one in slot.action.slots if one.handle == pair.differences))
        pairs.remove(number)


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
