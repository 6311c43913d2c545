"""Slots that were duplicated in their Action, or moved into another: their F-curves come along, and no records of them.

*Merge Animation* leaves the differences of bones where they were, and their records with them.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import bpy
import numpy as np

from ..compute.modes import MODE_NUMBERS
from ..transforms import Refused
from .reading import read
from .records import has_mode, recorded_digest
from .slots import Binding, is_time


def original_of(binding: Binding) -> Binding | None:
    """Return the same transform in the slot with a mode that this is a duplicate of, None where it is none.

    It has what only in-betweens have, none of which are recorded, and its F-curves are those of the other slot.
    """
    if recorded_digest(binding) or not (binding.filled or any(map(is_time, binding.curves.values()))):
        return None
    differences = {pair.differences for pair in binding.slot.action.rigid_motion.bone_slots}
    handles = {slot.handle for slot in binding.slot.action.slots} - differences - {binding.slot.handle}
    others = (replace(binding, slot=replace(binding.slot, handle=handle)) for handle in sorted(handles))
    # To look at F-curves takes longer, and those that Actions hold for one another in the NLA look like in-betweens.
    with_modes = (other.read_again() for other in others if has_mode(other))
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
