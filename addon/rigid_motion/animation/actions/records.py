"""What an Action keeps about each transform in each of its slots: its mode, and what its in-betweens were made from.

It goes where the Action goes: to another object, into another file, into a strip. The mode of a transform is in its
mode channel where there is one with keys, and in its record otherwise; nowhere else.

Where bones are renamed, Blender renames the F-curves of their Actions, and the records of these have to follow. A bone
keeps the name that records have it under. Where it has another one by now, it was renamed. Several are followed at
once, so that two can swap their names. Actions from before keys were baked or reduced, which nothing plays, Blender
leaves as they are: there the F-curves follow as well.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import NamedTuple

import bpy

from ..compute.components import MODE_NAMES, MODE_NUMBERS, UNKNOWN
from ..compute.sources import SCREW_AXIS
from ..transforms import Transform, bone_name, prefix_of, split_path, transform_of
from .slots import Binding, Slot, in_action, slots_in, slots_of


class Recorded(NamedTuple):
    """What a record says."""

    mode: str | None = None
    """None where none was chosen for the whole, "" for one that this version does not know."""

    digest: str = ""
    rows: str = ""
    constraint: str = ""
    turns_axis: str = SCREW_AXIS
    rate: int = 1
    error: float = 0.0


NOTHING_RECORDED = Recorded()


def recorded(binding: Binding) -> Recorded:
    """Return what is kept about a transform in a slot. It is looked up anew once it was changed by way of here."""
    result = binding.__dict__.get("recorded")
    if result is None:
        record = record_of(binding)
        if record is None:
            result = NOTHING_RECORDED
        else:
            mode = record.mode if record.is_property_set("mode") else None
            axis = record.turns_axis or SCREW_AXIS
            samples = max(record.rate, 1), record.error
            result = Recorded(mode, record.digest, record.rows, record.constraint, axis, *samples)
        binding.__dict__["recorded"] = result
    return result


def recorded_digest(binding: Binding) -> str:
    """Return the digest of the source that a transform was filled in from, "" where it was not."""
    return recorded(binding).digest


def recorded_rows(binding: Binding) -> list[int]:
    """Return the rows of the components that in-betweens were written for."""
    return [int(row, 16) for row in recorded(binding).rows]


def recorded_mode(binding: Binding) -> int:
    """Return the number of the mode that a transform has throughout, `UNKNOWN` where it is none that is known."""
    mode = recorded(binding).mode
    # A number that is no mode, from a damaged file or a later version, reads as an empty name.
    return 0 if mode is None else MODE_NUMBERS.get(mode, UNKNOWN)


def has_mode(binding: Binding) -> bool:
    """Return whether a mode other than Blender's was chosen for all segments of a transform in this slot."""
    return recorded(binding).mode is not None


def has_in_betweens(binding: Binding) -> bool:
    """Return whether a transform was filled in; constants that are held beside strips are none."""
    return (
        bool(recorded_digest(binding))
        or any(len(fcurve.sampled_points) > 2 for fcurve in binding.filled.values())
        or _has_time_of_its_own(binding)
    )


def _has_time_of_its_own(binding: Binding) -> bool:
    """Return whether a bone was filled in, be it in an Action that its slot was in before:
    it has the time of a constraint.

    Those that are held in the NLA for other Actions have no influence.
    """
    influences = (
        binding.curves.get((path.removesuffix("eval_time") + "influence", 0))
        for path, _ in binding.curves
        if binding.kind.has_difference_slot and path.endswith(".eval_time")
    )
    return any(influence is None or influence.evaluate(0.0) > 0.0 for influence in influences)


def record_mode(binding: Binding, number: int) -> None:
    """Keep the mode that a transform has throughout, and have its users show it."""
    mode = MODE_NAMES[number]
    if number == 0:
        if (record := record_of(binding)) is not None:
            record.property_unset("mode")
            _tidy(binding, record)
    elif recorded(binding).mode != mode:
        _ensure_record(binding).mode = mode
    binding.__dict__.pop("recorded", None)
    for user in binding.users:
        if user.motion.mode != mode and user.animated.is_editable:
            user.motion.mode = mode


def record_turns_axis(binding: Binding, axis: str) -> None:
    """Keep what turns are about, one of `TURN_AXES`."""
    if axis != recorded(binding).turns_axis:
        _ensure_record(binding).turns_axis = axis
        binding.__dict__.pop("recorded", None)


def record_in_betweens(binding: Binding, digest: str, rows: Iterable[int], rate: int = 1, error: float = 0.0) -> None:
    """Keep what in-betweens were made from, their components, samples a frame, and the error between these."""
    if digest:
        record = _ensure_record(binding)
        record.digest, record.rows = digest, "".join(f"{row:x}" for row in sorted(rows))
        record.rate, record.error = rate, error
    elif recorded(binding).digest and (record := record_of(binding)) is not None:
        record.digest = record.rows = ""
        _tidy(binding, record)
    binding.__dict__.pop("recorded", None)


def record_constraint(binding: Binding, name: str) -> None:
    """Keep what the constraint of a bone is called, where that is not its usual name."""
    _ensure_record(binding).constraint = name
    binding.__dict__.pop("recorded", None)


def keep_name(binding: Binding) -> None:
    """Have a bone keep the name that its record is under."""
    for user in binding.users if binding.kind.is_part else ():
        if user.motion.recorded_as != user.carrier.name and user.animated.is_editable:
            user.motion.recorded_as = user.carrier.name


def rename_records(slot: Slot, prefixes: Mapping[str, str]) -> None:
    """Give the records of a slot other prefixes, all at once, in place of what bones left that are gone."""
    present = {record.prefix for record in slot.records}
    moved = {old: new for old, new in prefixes.items() if old in present}
    remove_records(slot, set(moved.values()) - set(moved))
    for record in slot.records:
        if record.prefix in moved:
            record.prefix = moved[record.prefix]
            record.name = _key(slot, record.prefix)


def remove_records(slot: Slot, prefixes: Collection[str]) -> None:
    """Take the records of these out of a slot."""
    records = slot.action.rigid_motion.slots
    for number, record in reversed(list(enumerate(records))):
        if record.handle == slot.handle and record.prefix in prefixes:
            records.remove(number)


def forget_in_betweens(slot: Slot, prefixes: Iterable[str]) -> None:
    """Have records of a slot not say what in-betweens were made from: then they are made anew."""
    prefixes = set(prefixes)
    for record in slot.records:
        if record.prefix in prefixes:
            record.digest = ""


def record_of(binding: Binding) -> bpy.types.PropertyGroup | None:
    """Return what an Action keeps about a transform, None where that is nothing."""
    records, key = binding.slot.action.rigid_motion.slots, _key(binding.slot, binding.prefix)
    number = _numbers.get(key, -1)
    if not (0 <= number < len(records) and records[number].name == key):
        number = _numbers[key] = records.find(key)
    return records[number] if number >= 0 else None


_numbers: dict[str, int] = {}
"""The indices at which records were found last, by their names: Blender goes through all of a rig for a name."""


def _key(slot: Slot, prefix: str) -> str:
    """Return the name that a record is found by."""
    return f"{slot.handle} {prefix}"


def _ensure_record(binding: Binding) -> bpy.types.PropertyGroup:
    """Return the record of a transform in a slot, made where there is none yet."""
    record = record_of(binding)
    if record is not None:
        return record
    record = binding.slot.action.rigid_motion.slots.add()
    record.name, record.handle, record.prefix = _key(binding.slot, binding.prefix), binding.slot.handle, binding.prefix
    keep_name(binding)
    return record


def _tidy(binding: Binding, record: bpy.types.PropertyGroup) -> None:
    """Take out a record that says nothing."""
    if not record.digest and not record.is_property_set("mode") and record.turns_axis == SCREW_AXIS:
        records = binding.slot.action.rigid_motion.slots
        records.remove(next(number for number, one in enumerate(records) if one == record))


def follow_renamed(bindings: Iterable[Binding]) -> None:
    """Have records follow the bones of these that were renamed; where there are several, all bones of their rigs."""
    bones = [binding for binding in bindings if binding.kind.is_part]
    users = {user for binding in bones for user in binding.users}
    rigs = {user.animated for user in users}
    looked_at = (bone for rig in rigs for bone in _bones_of(rig)) if len(bones) > 1 else users
    _follow({bone.animated for bone in looked_at if _is_renamed(bone)})
    for binding in bones:
        if recorded(binding) != NOTHING_RECORDED:
            keep_name(binding)


def follow_renamed_in(rig: bpy.types.Object) -> None:
    """Have records follow the bones of a rig that were renamed."""
    if any(map(_is_renamed, _bones_of(rig))):
        _follow({rig})


def _follow(renamed: Collection[bpy.types.Object]) -> None:
    """Have records follow the bones of these rigs, all of which have some that were renamed."""
    for slot in slots_of(renamed) if renamed else ():
        names = _renamed_in(slot)
        if slot.action.is_editable:
            rename_records(slot, names)
            # Of what no constraint shows Blender renames nothing: where two have swapped names, all looks complete.
            if any(user.rigid_motion.detached for user in slot.users):
                forget_in_betweens(slot, names.values())
            _take_out_doubles(slot, names.values())
        for original in _originals_of(slot) if names else ():
            rename_records(original, names)
            for channelbag in filter(None, (original.channelbag, original.bones_channelbag)):
                _rename_channels(channelbag, names)
    for rig in renamed:
        for bone in filter(_is_renamed, _bones_of(rig)):
            bone.motion.recorded_as = bone.carrier.name


def keep_names(rig: bpy.types.Object) -> None:
    """Have all bones of a rig keep their names, for Actions from before keys were baked or reduced."""
    for bone in _bones_of(rig):
        if not bone.motion.recorded_as:
            bone.motion.recorded_as = bone.carrier.name


def forget_names(transforms: Iterable[Transform]) -> None:
    """Forget the names of what no slot moves any more: it has no F-curves that Blender would rename with it."""
    for bone in transforms:
        if bone.is_part and bone.motion.recorded_as and bone.animated.is_editable:
            bone.motion.recorded_as = ""


def _bones_of(rig: bpy.types.Object) -> Iterator[Transform]:
    return map(transform_of, rig.pose.bones) if rig.is_editable else iter(())


def _is_renamed(bone: Transform) -> bool:
    """Return whether records have a bone under another name. So have they a copy of it, which they do not speak of."""
    return bone.motion.recorded_as not in ("", bone.carrier.name)


def _renamed_in(slot: Slot) -> dict[str, str]:
    """Return the prefixes that bones of a slot's users have by now, by those that records have them under.

    Of several, a bone and its copy or bones of two rigs, it is the one that Blender has given the F-curves.
    """
    keyed = {split_path(fcurve.data_path)[0] for fcurve in slot.fcurves}
    names: dict[str, list[str]] = {}
    for bone in (bone for user in slot.users if user.pose is not None for bone in user.pose.bones):
        if known := bone.rigid_motion.recorded_as:
            names.setdefault(known, []).append(bone.name)
    now = {
        known: max(result, key=lambda name, known=known: (prefix_of(name) in keyed, name == known))
        for known, result in names.items()
    }
    return {prefix_of(known): prefix_of(name) for known, name in now.items() if name != known}


def _originals_of(slot: Slot) -> list[Slot]:
    """Return the slots from before keys of rigs were baked or reduced in this one, as far as nothing moves by them."""
    rigs = [user for user in slot.users if user.pose is not None]
    owners = [owner for rig in rigs for owner in (rig, *rig.pose.bones)]
    notes = [entry for owner in owners for entry in owner.rigid_motion.bakes if entry.changed == slot.action]
    actions = {entry.original for entry in notes if entry.original is not None and entry.original.is_editable}
    played = {other.key for other in slots_in(actions)}
    result = (in_action(action, slot) for action in actions)
    return [item for item in result if item is not None and item.key not in played]


def _take_out_doubles(slot: Slot, prefixes: Iterable[str]) -> None:
    """Take out in-betweens that bones have twice: by their own, and by those of bones that are gone, whose names they
    have. Of both Blender makes two groups of one name, and leaves it open which of them counts.
    """
    channelbag = slot.bones_channelbag
    if channelbag is None:
        return
    counts = Counter(group.name for group in channelbag.groups)
    doubled = {prefix for prefix in prefixes if counts[bone_name(prefix)] > 1}
    for fcurve in list(channelbag.fcurves) if doubled else ():
        if split_path(fcurve.data_path)[0] in doubled:
            # Groups that nothing is left in go with it.
            channelbag.fcurves.remove(fcurve)
    forget_in_betweens(slot, doubled)


def _rename_channels(channelbag: bpy.types.ActionChannelbag, prefixes: Mapping[str, str]) -> None:
    """Give F-curves and their groups the names of other bones, all at once, in place of those that are gone."""
    curves = [(fcurve, *split_path(fcurve.data_path)) for fcurve in channelbag.fcurves]
    moved = {prefix for _, prefix, _ in curves} & set(prefixes)
    gone = {prefixes[prefix] for prefix in moved} - moved
    groups: dict[str, bpy.types.ActionGroup] = {}
    for fcurve, prefix, rest in curves:
        if prefix in moved:
            fcurve.data_path = prefixes[prefix] + rest
            if fcurve.group is not None and fcurve.group.name == bone_name(prefix):
                groups[bone_name(prefixes[prefix])] = fcurve.group
        elif prefix in gone:
            channelbag.fcurves.remove(fcurve)
    # Two groups that swap their names cannot have the same one in between.
    for number, group in enumerate(groups.values()):
        group.name = f"#{number}"
    for name, group in groups.items():
        group.name = name
