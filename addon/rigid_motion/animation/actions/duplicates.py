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
from .slots import SlotTransform, is_time


def original_of(place: SlotTransform) -> SlotTransform | None:
    """Return the same transform in the slot with a mode that this is a duplicate of, None where it is none.

    It has what only in-betweens have, none of which are recorded, and its F-curves are those of the other slot.
    """
    if recorded_digest(place) or not (place.filled or any(map(is_time, place.curves.values()))):
        return None
    differences = {pair.differences for pair in place.slot.action.rigid_motion.bone_slots}
    handles = {slot.handle for slot in place.slot.action.slots} - differences - {place.slot.handle}
    others = (replace(place, slot=replace(place.slot, handle=handle)) for handle in sorted(handles))
    # To look at F-curves takes longer, and those that Actions hold for one another in the NLA look like in-betweens.
    with_modes = (other.read_again() for other in others if has_mode(other))
    return next((other for other in with_modes if _have_same_curves(place, other)), None)


def mode_before_move(place: SlotTransform) -> int | None:
    """Return the number of the mode that a bone had in the Action that its slot was moved from, None where it was not.

    What a slot was moved from has its differences and not the slot; and was filled in from the same keys. Of several,
    it is the one with the mode that the bone shows.
    """
    result = []
    for action in bpy.data.actions if place.kind.has_difference_slot else ():
        moved = {pair.handle for pair in action.rigid_motion.bone_slots} - {slot.handle for slot in action.slots}
        for record in action.rigid_motion.slots if moved and action != place.slot.action else ():
            if record.handle in moved and record.prefix == place.prefix and record.digest:
                number = MODE_NUMBERS.get(record.mode, 0)
                with suppress(Refused):
                    if read(place, number).digest == record.digest:
                        result.append(number)
    shown = {MODE_NUMBERS.get(user.motion.mode) for user in place.users}
    return next((number for number in result if number in shown), result[0] if result else None)


def _have_same_curves(one: SlotTransform, other: SlotTransform) -> bool:
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
