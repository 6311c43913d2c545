"""Bones that were renamed: Blender renames the F-curves of their Actions, and the records of these have to follow.

A bone keeps the name that records have it under. Where it has another one by now, it was renamed. Several are followed
at once, so that two can swap their names. Actions from before keys were baked or reduced, which nothing plays, Blender
leaves as they are: there the F-curves follow as well.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping

import bpy

from ..transforms import Transform, bone_name, prefix_of, split_path, transform_of
from .records import NOTHING_RECORDED, forget_in_betweens, keep_name, recorded, rename_records
from .slots import Binding, Slot, in_action, slots_in, slots_of


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
    channelbag = slot.channelbag
    keyed = {split_path(fcurve.data_path)[0] for fcurve in channelbag.fcurves} if channelbag is not None else set()
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
    played = {(other.action, other.handle) for other in slots_in(actions)}
    result = (in_action(action, slot) for action in actions)
    return [item for item in result if item is not None and (item.action, item.handle) not in played]


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
