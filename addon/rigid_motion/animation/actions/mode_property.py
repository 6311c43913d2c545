"""The mode property of what is moved: it shows the mode in the slot, and waits where there is no slot yet.

The one home of a mode is the Action, see `records`. The property is there to choose by, from Python and by a button,
and for the mode channel to animate; nothing else reads it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..compute.modes import MODE_NAMES, MODE_NUMBERS
from ..transforms import Transform
from .duplicates import mode_before_move, original_of
from .records import (
    NOTHING_RECORDED,
    has_in_betweens,
    has_mode,
    record_mode,
    record_turns_axis,
    recorded,
    recorded_mode,
)
from .slots import Binding


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
        users = [user for user in binding.users if _is_shown(user, binding) and user.animated.is_editable]
        keyed = is_keyed(binding)
        if not has_mode(binding) and has_in_betweens(binding) and not (keyed or binding.slot.action.is_editable):
            # From a library of a version that kept modes on objects.
            continue
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


def adopt_from_properties(transforms: Iterable[Transform]) -> None:
    """Read a file of a version that kept modes on objects: what no slot moves waits with its mode."""
    for transform in transforms:
        motion = transform.motion
        if motion.mode not in ("BLENDER", "", motion.awaited) and transform.animated.is_editable:
            motion.awaited = motion.mode


def _is_shown(user: Transform, binding: Binding) -> bool:
    """Return whether a user's property speaks of a binding: of its Action, or of a strip where it has none."""
    data = user.animated.animation_data
    return data.action is None or (data.action, data.action_slot_handle) == (binding.slot.action, binding.slot.handle)


def _adopt(binding: Binding, users: Sequence[Transform]) -> None:
    """Let a slot without a mode have that which a user waits with.

    Where there are in-betweens already, one of Blender's operators has moved it out of another Action, and it has the
    mode that it had there. Or it was duplicated, and has the mode of the slot that it is a duplicate of. Or it came
    from a version that kept the mode on the object: it goes on as its user shows it.
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
