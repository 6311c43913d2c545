"""Why rigid motion cannot act on something: every reason, and the way out of each."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable

import bpy
import numpy as np
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from ..compute.components import MODE_NAMES, UNKNOWN
from ..compute.sources import Source
from ..curves.keys import LARGEST, Keys, TooManyRounds
from ..transforms import GROUP, LINKED, Channel, Refused, Transform
from .channels import read_steps
from .records import recorded_digest, recorded_rows
from .slots import Binding, is_filled_in

FOLLOWED = ("CYCLES", "STEPPED")
"""Types of F-curve modifiers that change which moment is shown, for all of the motion alike."""

MOST_FRAMES = 250_000
"""The longest motion that is filled in: two hours and a quarter at 30 frames a second."""

MOST_TURNS = 1000
"""Whole turns from one key to the next."""

COMPONENTS = (
    *(n_("Location X"), n_("Location Y"), n_("Location Z")),
    *(n_("Rotation W"), n_("Rotation X"), n_("Rotation Y"), n_("Rotation Z")),
    *(n_("Scale X"), n_("Scale Y"), n_("Scale Z")),
)
"""Names of the rows of a source."""

CHANNELS = {
    "location": n_("Location"),
    "rotation_quaternion": n_("Rotation Quaternion"),
    "rotation_euler": n_("Rotation Euler"),
    "scale": n_("Scale"),
    "delta_location": n_("Delta Location"),
    "delta_rotation_quaternion": n_("Delta Rotation Quaternion"),
    "delta_rotation_euler": n_("Delta Rotation Euler"),
    "delta_scale": n_("Delta Scale"),
}
"""Properties of what is moved, as the Dope Sheet names their channels."""

MODIFIED = n_(
    "{name}: {channel} has a modifier of type {modifier}, which rigid in-betweens cannot follow: "
    "mute or remove it, or bake the channel (Graph Editor, Channel)"
)
REPLACED = n_(
    "{name}: {channel} has a modifier of type {modifier} that does not just add to it, which rigid in-betweens cannot "
    "follow: have it add (Blend Type or Additive), mute or remove it, or bake the channel (Graph Editor, Channel)"
)
DIFFERENT_STEPS = n_(
    "{name}: {channel} and {other} have different Stepped modifiers, and rigid in-betweens hold all channels together: "
    "copy one to the other (Graph Editor, sidebar, Modifiers), or mute them"
)
MODIFIED_IN_PART = n_(
    "{name}: {channel} has a modifier of type {modifier} with a restricted range or influence, which rigid "
    "in-betweens cannot follow: mute or remove it, or bake the channel (Graph Editor, Channel)"
)

TURNED_INTO_KEYS = n_(
    "{name}: {channel} has in-betweens that were turned into keys: "
    "delete that channel, and they are made anew (Dope Sheet, X)"
)
ANIMATED = n_(
    "{name}: {channel} is animated already: move that animation to a parent, or to "
    "{other} (Object > Apply > Animated Transforms to Deltas does the reverse)"
)
SAMPLED = n_(
    "{name}: {channel} is sampled and has no keys: turn its samples into keys (Graph Editor, Channel > Samples to Keys)"
)
CHANGED_BY_MODIFIERS = n_(
    "{name} has Stepped modifiers, or such as add to its channels: mute them while its keys are reduced, "
    "or bake them into the keys first"
)
TOO_LONG = n_(
    "{name} has keys over {frames:.0f} frames, at most {most} can be filled in: delete the keys that are far off"
)
GOES_ON = n_(
    "{name} goes on outside of its keys for all {frames} frames of its scene, at most {most} "
    "can be filled in: shorten the scene, or give the channels constant extrapolation and no cycles"
)
VALUE_NOT_FINITE = n_("{name}: {channel} is not a finite number: set it anew (sidebar, Item)")
OUT_OF_ORDER = n_(
    "{name}: the keys of {channel} are not in the order of their frames: move one of them and back (Dope Sheet, G)"
)
NO_SUCH_MODE = n_(
    "{name}: key {number} of the mode channel has no mode that this version knows: "
    "delete it (Dope Sheet, X), or choose a mode for the whole object"
)
NO_SUCH_TURNS = n_(
    "{name}: key {number} of the channel Turns does not have a number of turns up to {most}: "
    "delete it (Dope Sheet, X), or set the turns anew"
)

KEY = n_("key {number} of {channel}")
LEFT_HANDLE = n_("left handle of key {number} of {channel}")
RIGHT_HANDLE = n_("right handle of key {number} of {channel}")
EASING = n_("easing of key {number} of {channel}")
"""The parts that keys are made of, channels and keys first."""

NOT_FINITE = n_("{name}: {key} is not a finite number: delete it (Dope Sheet, X)")
BAD_FRAME = n_(
    "{name}: {key} has the frame {number:g}, which no motion can be computed from: delete it (Dope Sheet, X)"
)
BAD_VALUE = n_(
    "{name}: {key} has the value {number:g}, which no motion can be computed from: delete it (Dope Sheet, X)"
)
BAD_SETTING = n_(
    "{name}: {key} has the setting {number:g}, which no motion can be computed from: delete it (Dope Sheet, X)"
)


def refuse_what_is_taken(user: Transform, binding: Binding, drivers: Collection[Channel]) -> None:
    """Raise `Refused` where what a user's differences go into is not to be had.

    `drivers` are the channels of the user's data-block that are driven.
    """
    refuse_linked(user, binding)
    # Differences that are in a slot of their own take the place of nothing.
    for channel in () if user.has_difference_slot else user.differences.values():
        if channel in drivers:
            _refuse_driver(user.name, channel)
        fcurve = binding.curves.get(channel)
        if fcurve is not None and not (is_filled_in(fcurve) or _was_filled_in(fcurve, user, binding)):
            if fcurve.group is not None and fcurve.group.name == GROUP:
                raise Refused(TURNED_INTO_KEYS, name=user.name, channel=_label(fcurve))
            raise Refused(
                ANIMATED, name=user.name, channel=_label(fcurve), other=_label_of(channel[0].rpartition("delta_")[2])
            )


def refuse_drivers(user: Transform, driven: Collection[int]) -> None:
    """Raise `Refused` where any of the components of a user is driven, which are given by their rows."""
    for row in sorted(driven):
        _refuse_driver(user.name, user.channels[row])


def _refuse_driver(name: str, channel: Channel) -> None:
    raise Refused(
        n_("{name}: {channel} is driven: remove the driver, or bake it to keys"), name=name, channel=_label_at(*channel)
    )


def _was_filled_in(fcurve: bpy.types.FCurve, user: Transform, binding: Binding) -> bool:
    """Return whether in-betweens are in an F-curve that has been put into another group, or into none."""
    channels = user.differences
    written = [channels.get(row) for row in recorded_rows(binding)] if recorded_digest(binding) else []
    return (fcurve.data_path, fcurve.array_index) in written and not fcurve.keyframe_points


def refuse_linked(user: Transform, binding: Binding | None = None) -> None:
    """Raise `Refused` where what is moved, or the Action that moves it, belongs to another file."""
    if not user.animated.is_editable:
        raise Refused(user.linked_text, name=user.animated.name)
    if binding is not None and not binding.slot.action.is_editable:
        raise Refused(LINKED, name=binding.slot.action.name)


def refuse_channel(name: str, fcurve: bpy.types.FCurve) -> None:
    """Raise `Refused` where a channel has modifiers, or values without keys, that rigid in-betweens cannot follow."""
    for modifier in fcurve.modifiers:
        if modifier.mute or (modifier.type in FOLLOWED and is_whole(modifier)):
            continue
        if not (is_added(modifier) and fcurve.keyframe_points):
            kinds = modifier.bl_rna.properties["type"]
            text = MODIFIED_IN_PART if modifier.type in FOLLOWED else MODIFIED
            if may_add(modifier) and fcurve.keyframe_points:
                text = REPLACED
            raise Refused(
                text,
                name=name,
                channel=_label(fcurve),
                modifier=iface_(kinds.enum_items[modifier.type].name, kinds.translation_context),
            )
    if not fcurve.keyframe_points and fcurve.sampled_points:
        raise Refused(SAMPLED, name=name, channel=_label(fcurve))


def may_add(modifier: bpy.types.FModifier) -> bool:
    """Return whether modifiers of this type add something, or can be set to."""
    return modifier.type in ("NOISE", "GENERATOR", "FNGENERATOR")


def is_added(modifier: bpy.types.FModifier) -> bool:
    """Return whether a modifier adds something to the value that depends on the time alone."""
    if modifier.type == "NOISE":
        return modifier.blend_type != "MULTIPLY"
    return may_add(modifier) and modifier.use_additive


def is_whole(modifier: bpy.types.FModifier) -> bool:
    """Return whether a modifier acts in full and everywhere. That of a Stepped one Blender does not show to Python."""
    return not (modifier.use_restricted_range or (modifier.use_influence and modifier.influence < 1.0))


def refuse_different_steps(name: str, fcurves: Iterable[bpy.types.FCurve]) -> None:
    """Raise `Refused` where channels with several keys do not hold the same frames."""
    moving = [(fcurve, read_steps(fcurve.modifiers)) for fcurve in fcurves if len(fcurve.keyframe_points) > 1]
    for fcurve, steps in moving:
        if steps != moving[0][1]:
            raise Refused(DIFFERENT_STEPS, name=name, channel=_label(moving[0][0]), other=_label(fcurve))


def refuse_modified(name: str, source: Source) -> None:
    """Raise `Refused` where modifiers change what keys say, so that other keys would not say the same."""
    if source.steps or source.modified:
        raise Refused(CHANGED_BY_MODIFIERS, name=name)


def refuse_numbers(name: str, source: Source) -> None:
    """Raise `Refused` where the numbers of a source make no motion, or too long a one."""
    _refuse_modes(name, source.mode)
    _refuse_turns(name, source.turns)
    if not source.channels:
        return
    numbers = (*source.original.tolist(), *source.rest.values())
    if not (all(map(math.isfinite, numbers)) and all(keys.is_sound for keys in source.curves)):
        _explain_numbers(name, source)
    first, last = source.keyed_range
    if last - first > MOST_FRAMES:
        raise Refused(TOO_LONG, name=name, frames=last - first, most=MOST_FRAMES)
    first, last = source.seen_range
    if last - first > MOST_FRAMES and not source.repeats:
        raise Refused(GOES_ON, name=name, frames=last - first, most=MOST_FRAMES)
    try:
        source.key_frames  # noqa: B018 - raises where cycles make too many
    except TooManyRounds as problem:
        text = rpt_("{rounds:.0f} rounds of {period:g} frames are too many: give Cycles a count")
        raise Refused(f"{name}: {text.format(rounds=problem.rounds, period=problem.period)}") from None


def _numbers(keys: Keys) -> dict[str, np.ndarray]:
    """Return all that keys are made of, channels and keys first, by what it is to a key."""
    settings = None if keys.easing_settings is None else np.moveaxis(keys.easing_settings, 0, -1)
    parts = {KEY: keys.points, LEFT_HANDLE: keys.left, RIGHT_HANDLE: keys.right, EASING: settings}
    return {part: numbers for part, numbers in parts.items() if numbers is not None}


def _explain_numbers(name: str, source: Source) -> None:
    """Raise `Refused` with the first number of a source that is not finite, or the first channel out of order."""

    def label(row: int) -> str:
        by_angles = source.order is not None and 3 <= row < 6
        return iface_(COMPONENTS[row + 1 if by_angles else row])

    for row, value in source.rest.items():
        if not math.isfinite(value):
            raise Refused(VALUE_NOT_FINITE, name=name, channel=label(row))
    for rows, keys in source.channels:
        for part, numbers in _numbers(keys).items():
            # What is no number is not smaller, either.
            unusable = np.argwhere(~(np.abs(numbers) < LARGEST))
            if len(unusable):
                channel, key, *axis = unusable[0].tolist()
                number = numbers[tuple(unusable[0])]
                text = NOT_FINITE
                if math.isfinite(number):
                    text = BAD_SETTING if part == EASING else (BAD_FRAME, BAD_VALUE)[axis[0]]
                which = rpt_(part).format(number=key + 1, channel=label(rows[channel]))
                raise Refused(text, name=name, key=which, number=number)
        if np.any(np.diff(keys.times) < 0.0):
            raise Refused(OUT_OF_ORDER, name=name, channel=label(rows[0]))
    raise Refused(
        n_("{name}: a delta transform is not a finite number: set it anew (Object Properties, Delta Transform)"),
        name=name,
    )


def _refuse_modes(name: str, mode: int | Keys) -> None:
    """Raise `Refused` where an object, or a key of its mode channel, has what is no mode."""
    if not isinstance(mode, Keys):
        if mode == UNKNOWN:
            raise Refused(n_("{name} has a mode that this version does not know: choose another"), name=name)
        return
    known = np.isin(np.rint(mode.values[0]), list(MODE_NAMES)) & np.isfinite(mode.times)
    if not known.all():
        raise Refused(NO_SUCH_MODE, name=name, number=int(np.argmin(known)) + 1)


def _refuse_turns(name: str, turns: Keys | None) -> None:
    """Raise `Refused` where a key of the channel of turns has more of them than anything turns."""
    if turns is None:
        return
    usable = (np.abs(turns.values[0]) <= MOST_TURNS) & np.isfinite(turns.times)
    if not usable.all():
        raise Refused(NO_SUCH_TURNS, name=name, number=int(np.argmin(usable)) + 1, most=MOST_TURNS)


def _label(fcurve: bpy.types.FCurve) -> str:
    """Return a channel as the Dope Sheet names it."""
    return _label_at(fcurve.data_path, fcurve.array_index)


def _label_at(path: str, index: int) -> str:
    name = path.rpartition(".")[2]
    axes = "WXYZ" if name.endswith("quaternion") else "XYZ"
    return f"{_label_of(name)} {axes[index]}" if index < len(axes) else name


def _label_of(name: str) -> str:
    """Return a property as the Dope Sheet names its channels."""
    return iface_(CHANNELS.get(name, name))
