"""The mode property of what is moved: it shows the mode in the slot, and waits where there is no slot yet.

The one home of a mode is the Action, see `records`. The property is there to choose by, from Python and by a button,
and for the mode channel to animate; nothing else reads it.

Slots may be duplicated in their Action, or moved into another: their F-curves come along, and no records of them.
*Merge Animation* leaves the differences of bones where they were, and their records with them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace

import bpy
import numpy as np

from ..compute.components import MODE_NAMES, MODE_NUMBERS
from ..transforms import Refused, Transform
from .reading import read
from .records import (
    NOTHING_RECORDED,
    has_in_betweens,
    has_mode,
    record_mode,
    record_turns_axis,
    recorded,
    recorded_digest,
    recorded_mode,
)
from .slots import Binding, handles_of_differences, is_time, read_again


def original_of(binding: Binding) -> Binding | None:
    """Return the same transform in the slot with a mode that this is a duplicate of, None where it is none.

    It has what only in-betweens have, none of which are recorded, and its F-curves are those of the other slot.
    """
    if recorded_digest(binding) or not (binding.filled or any(map(is_time, binding.curves.values()))):
        return None
    action = binding.slot.action
    handles = {slot.handle for slot in action.slots} - handles_of_differences(action) - {binding.slot.handle}
    others = (replace(binding, slot=replace(binding.slot, handle=handle)) for handle in sorted(handles))
    # To look at F-curves takes longer, and those that Actions hold for one another in the NLA look like in-betweens.
    with_modes = read_again([other for other in others if has_mode(other)])
    return next((other for other in with_modes if _have_same_curves(binding, other)), None)


def mode_before_move(binding: Binding) -> int | None:
    """Return the number of the mode that a bone had in the Action that its slot was moved from, None where it was not.

    What a slot was moved from has its differences and not the slot; and was filled in from the same keys. Of several,
    it is the one with the mode that the bone shows.
    """
    result = []
    for action in bpy.data.actions if binding.kind.has_difference_slot else ():
        moved = {pair.handle for pair in action.rigid_motion.bone_slots} - {slot.handle for slot in action.slots}
        for record in action.rigid_motion.slots if moved and action != binding.slot.action else ():
            if record.handle in moved and record.prefix == binding.prefix and record.digest:
                number = MODE_NUMBERS.get(record.mode, 0)
                with suppress(Refused):
                    if read(binding, number).digest == record.digest:
                        result.append(number)
    shown = {MODE_NUMBERS.get(user.motion.mode) for user in binding.users}
    return next((number for number in result if number in shown), result[0] if result else None)


def _have_same_curves(one: Binding, other: Binding) -> bool:
    return one.curves.keys() == other.curves.keys() and all(
        np.array_equal(_numbers_of(fcurve), _numbers_of(other.curves[channel]))
        for channel, fcurve in one.curves.items()
    )


def _numbers_of(fcurve: bpy.types.FCurve) -> np.ndarray:
    """Return the keys or samples of an F-curve, or the line that it is."""
    points = fcurve.keyframe_points if len(fcurve.keyframe_points) else fcurve.sampled_points
    result = np.empty(2 * len(points), np.float32)
    points.foreach_get("co", result)
    lines = (modifier.coefficients for modifier in fcurve.modifiers if modifier.type == "GENERATOR")
    return np.concatenate((result, *lines))


def set_pending_mode(transform: Transform, mode: str) -> None:
    """Keep a mode until there is an Action to keep it."""
    motion = transform.motion
    motion.awaited = mode
    # To set the property is to choose a mode, which leads here.
    if motion.mode != mode:
        motion.mode = mode


def is_keyed(binding: Binding) -> bool:
    """Return whether a mode channel decides."""
    fcurve = binding.curves.get(binding.users[0].mode_channel)
    return fcurve is not None and not fcurve.mute and len(fcurve.keyframe_points) > 0


def has_to_do_with_modes(binding: Binding) -> bool:
    """Return whether a binding has a mode, a channel for it, in-betweens, or a record of any of them."""
    return recorded(binding) != NOTHING_RECORDED or is_keyed(binding) or bool(binding.filled)


def show_modes(bindings: Iterable[Binding]) -> None:
    """Have the property of all users say what is in their slots, and have slots take what their users waited with."""
    for binding in bindings:
        # Of its Action, or of a strip where there is none.
        users = [
            user
            for user in binding.users
            if user.animated.is_editable
            and (user.animated.animation_data.action is None or binding.slot.plays_in(user.animated))
        ]
        keyed = is_keyed(binding)
        if not has_mode(binding) and binding.slot.action.is_editable:
            _adopt(binding, users)
        mode = MODE_NAMES.get(recorded_mode(binding), "BLENDER")
        for user in users:
            motion = user.motion
            if motion.awaited != "BLENDER":
                motion.awaited = "BLENDER"
            if not keyed and motion.mode != mode:
                motion.mode = mode
            if motion.turns and user.turns_channel not in binding.curves:
                motion.turns = 0


def show_pending_modes(transforms: Iterable[Transform]) -> None:
    """Have the property of what no slot moves any more say what it waits with."""
    for transform in transforms:
        motion = transform.motion
        if motion.mode != motion.awaited and transform.animated.is_editable:
            motion.mode = motion.awaited


def _adopt(binding: Binding, users: Sequence[Transform]) -> None:
    """Let a slot without a mode have that which a user waits with.

    Where there are in-betweens already, one of Blender's operators has moved it out of another Action, and it has the
    mode that it had there, or that its user shows. Or it was duplicated, and has that of the slot that it is one of.
    """
    waiting = next((user.motion.awaited for user in users if user.motion.awaited not in ("BLENDER", "")), None)
    if waiting is None and has_in_betweens(binding) and (number := mode_before_move(binding)) is not None:
        waiting = MODE_NAMES[number]
    if waiting is None and (original := original_of(binding)) is not None:
        waiting = MODE_NAMES.get(recorded_mode(original))
        record_turns_axis(binding, recorded(original).turns_axis)
    if waiting is None and has_in_betweens(binding):
        waiting = next((user.motion.mode for user in users if user.motion.mode not in ("BLENDER", "")), None)
    if waiting:
        record_mode(binding, MODE_NUMBERS[waiting])
