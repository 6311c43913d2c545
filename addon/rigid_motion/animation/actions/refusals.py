"""Why rigid motion cannot act on something: every reason, and the way out of each."""

from __future__ import annotations

import math
from collections.abc import Mapping

import bpy
import numpy as np

from ..curves import LARGEST, Keys
from ..transforms import GROUP, Refused, Transform
from .slots import SlotTransform, is_filled_in
from .sources import MODE_NAMES, UNKNOWN, Source

MOST_FRAMES = 250_000
"""The longest motion that is filled in: two hours and a quarter at 30 frames a second."""

COMPONENTS = (
    *(f"Location {axis}" for axis in "XYZ"),
    *(f"Rotation {axis}" for axis in "WXYZ"),
    *(f"Scale {axis}" for axis in "XYZ"),
)
"""What the rows of a source are called."""


def refuse_what_is_taken(user: Transform, place: SlotTransform, drivers: Mapping[str, bpy.types.FCurve]) -> None:
    """Raise `Refused` where a user's channels, or what the differences go into, are not to be had.

    `drivers` are those of the user's data-block, by their data paths.
    """
    refuse_linked(user, place)
    differences = user.differences.values()
    for path, _ in (*user.channels.values(), *differences) if drivers else ():
        if path in drivers:
            raise Refused(f"{user.name}: {_label(drivers[path])} is driven: remove the driver, or bake it to keys")
    # The differences of bones are in a slot of their own.
    for channel in () if place.prefix else differences:
        fcurve = place.curves.get(channel)
        if fcurve is not None and not is_filled_in(fcurve):
            if fcurve.group is not None and fcurve.group.name == GROUP:
                raise Refused(
                    f"{user.name}: {_label(fcurve)} has in-betweens that were turned into keys: "
                    "delete that channel, and they are made anew (Dope Sheet, X)"
                )
            prop = channel[0].rpartition("delta_")[2]
            raise Refused(
                f"{user.name}: {_label(fcurve)} is animated already: move that animation to a parent, or to "
                f"{prop.replace('_', ' ')} (Object > Apply > Animated Transforms to Deltas does the reverse)"
            )


def refuse_linked(user: Transform, place: SlotTransform | None = None) -> None:
    """Raise `Refused` where what is moved, or the Action that moves it, belongs to another file."""
    if not user.animated.is_editable:
        way_out = "make it local first (Object > Relations > Make Local)"
        if user.prefix:
            way_out = "make an override of it first (Object > Library Override > Make)"
        raise Refused(f"{user.animated.name} is linked from another file: {way_out}")
    if place is not None and not place.slot.action.is_editable:
        raise Refused(
            f"{place.slot.action.name} is linked from another file: "
            "make it local first (Object > Relations > Make Local)"
        )


def refuse_channel(name: str, fcurve: bpy.types.FCurve) -> None:
    """Raise `Refused` where a channel has modifiers, or values without keys, that rigid in-betweens cannot follow."""
    for modifier in fcurve.modifiers:
        plain = modifier.type == "CYCLES" and not modifier.use_restricted_range and not modifier.use_influence
        if not plain and not modifier.mute:
            raise Refused(
                f"{name}: {_label(fcurve)} has a modifier of type {modifier.type.title()}"
                f"{' with a restricted range or influence' if modifier.type == 'CYCLES' else ''}, which rigid "
                "in-betweens cannot follow: mute or remove it, or bake the channel (Graph Editor, Channel)"
            )
    if not fcurve.keyframe_points and fcurve.sampled_points:
        raise Refused(
            f"{name}: {_label(fcurve)} is sampled and has no keys: turn its samples into keys "
            "(Graph Editor, Channel > Samples to Keys)"
        )


def refuse_numbers(name: str, source: Source) -> None:
    """Raise `Refused` where the numbers of a source make no motion, or too long a one."""
    _refuse_modes(name, source.mode)
    if not source.channels:
        return
    numbers = (*source.original.tolist(), *source.rest.values())
    if not (all(map(math.isfinite, numbers)) and all(keys.is_sound for keys in source.curves)):
        _explain_numbers(name, source)
    first, last = source.keyed_range
    if last - first > MOST_FRAMES:
        raise Refused(
            f"{name} has keys over {last - first:.0f} frames, at most {MOST_FRAMES} can be filled in: "
            "delete the keys that are far off"
        )
    first, last = source.seen_range
    if last - first > MOST_FRAMES and not source.repeats:
        raise Refused(
            f"{name} goes on outside of its keys for all {last - first} frames of its scene, at most {MOST_FRAMES} "
            "can be filled in: shorten the scene, or give the channels constant extrapolation and no cycles"
        )
    try:
        source.key_frames  # noqa: B018 - raises where cycles make too many
    except ValueError as problem:
        raise Refused(f"{name}: {problem}") from None


def _numbers(keys: Keys) -> dict[str, np.ndarray]:
    """All that keys are made of, channels and keys first, by what it is to a key."""
    settings = None if keys.easing_settings is None else np.moveaxis(keys.easing_settings, 0, -1)
    parts = {
        "": keys.points,
        "left handle of ": keys.left,
        "right handle of ": keys.right,
        "easing of ": settings,
    }
    return {part: numbers for part, numbers in parts.items() if numbers is not None}


def _explain_numbers(name: str, source: Source) -> None:
    """Raise `Refused` with the first number of a source that is not finite, or the first channel out of order."""

    def label(row: int) -> str:
        return f"Rotation {'XYZ'[row - 3]}" if source.order is not None and 3 <= row < 6 else COMPONENTS[row]

    for row, value in source.rest.items():
        if not math.isfinite(value):
            raise Refused(f"{name}: {label(row)} is not a finite number: set it anew (sidebar, Item)")
    for rows, keys in source.channels:
        for part, numbers in _numbers(keys).items():
            # What is no number is not smaller, either.
            unusable = np.argwhere(~(np.abs(numbers) < LARGEST))
            if len(unusable):
                channel, key, *axis = unusable[0].tolist()
                number = numbers[tuple(unusable[0])]
                what = "is not a finite number"
                if math.isfinite(number):
                    quantity = "setting" if part.startswith("easing") else ("frame", "value")[axis[0]]
                    what = f"has the {quantity} {number:g}, which no motion can be computed from"
                raise Refused(
                    f"{name}: {part}key {key + 1} of {label(rows[channel])} {what}: delete it (Dope Sheet, X)"
                )
        if np.any(np.diff(keys.times) < 0.0):
            raise Refused(
                f"{name}: the keys of {label(rows[0])} are not in the order of their frames: "
                "move one of them and back (Dope Sheet, G)"
            )
    raise Refused(f"{name}: a delta transform is not a finite number: set it anew (Object Properties, Delta Transform)")


def _refuse_modes(name: str, mode: int | Keys) -> None:
    """Raise `Refused` where an object, or a key of its mode channel, has what is no mode."""
    if not isinstance(mode, Keys):
        if mode == UNKNOWN:
            raise Refused(f"{name} has a mode that this version does not know: choose another")
        return
    known = np.isin(np.rint(mode.values[0]), list(MODE_NAMES)) & np.isfinite(mode.times)
    if not known.all():
        raise Refused(
            f"{name}: key {int(np.argmin(known)) + 1} of the mode channel has no mode that this version knows: "
            "delete it (Dope Sheet, X), or choose a mode for the whole object"
        )


def _label(fcurve: bpy.types.FCurve) -> str:
    """A channel as the Dope Sheet names it."""
    name = fcurve.data_path.rpartition(".")[2]
    axes = "WXYZ" if name.endswith("quaternion") else "XYZ"
    return f"{name.replace('_', ' ').title()} {axes[fcurve.array_index]}" if fcurve.array_index < len(axes) else name
