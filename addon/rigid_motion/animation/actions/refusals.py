"""Why rigid motion cannot act on something: every reason, and the way out of each."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace

import bpy
import numpy as np
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from ..evaluation.components import UNKNOWN
from ..evaluation.sources import Source
from ..fcurves.keys import LARGEST, Cycles, Keys
from ..transforms import LINKED, WIDTHS, Channel, Refused, Transform
from .modifiers import has_type, on_top
from .slots import Binding

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
    "rotation_axis_angle": n_("Rotation Axis Angle"),
    "scale": n_("Scale"),
    "delta_rotation_quaternion": n_("Delta Rotation Quaternion"),
    "delta_rotation_euler": n_("Delta Rotation Euler"),
}
"""Properties of what is moved, as the Dope Sheet names their channels."""

ENVELOPED = n_(
    "{name}: {channel} has an Envelope, which in-betweens cannot be put in front of: "
    "mute or remove it, or bake the channel (Graph Editor, Channel)"
)
DIFFERENT_CYCLES = n_(
    "{name} repeats, but not all of it together: give all its channels first and last keys on the same frames, "
    "and Cycles with Key > Rigid Motion > Add Cycles"
)
OTHER_ROUNDS = n_(
    "{name} ends turned or scaled otherwise than it begins, and cannot go on from there in one mode: "
    "choose Repeat or Mirror"
)
SAMPLED = n_(
    "{name}: {channel} is sampled and has no keys: turn its samples into keys (Graph Editor, Channel > Samples to Keys)"
)
CHANGED_BY_MODIFIERS = n_(
    "{name} has F-curve modifiers of yours: mute them while its keys are reduced, or bake them into the keys first"
)
MOVING_DELTA = n_(
    "{name}: {channel} is animated, on top of the rotation that in-betweens are of: move that animation to a parent"
)
DRIVEN = n_("{name}: {channel} is driven: remove the driver, or bake it to keys")
MUTED = n_("{name}: {channel} is muted: unmute or delete it first (Dope Sheet, Channel)")
TOO_LONG = n_(
    "{name} has keys over {frames:.0f} frames, at most {most} can be filled in: delete the keys that are far off"
)
GOES_ON = n_(
    "{name} goes on outside of its keys for all {frames} frames of its scene, at most {most} "
    "can have in-betweens: shorten the scene, or give the channels constant extrapolation"
)
VALUE_NOT_FINITE = n_("{name}: {channel} is not a finite number: set it anew (sidebar, Item)")
OUT_OF_ORDER = n_(
    "{name}: the keys of {channel} are not in the order of their frames: move one of them and back (Dope Sheet, G)"
)
NO_SUCH_MODE = n_("{name}: its keys have a mode that this version does not know: choose another one")
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


def refuse_drivers(user: Transform, binding: Binding, driven: Collection[int]) -> None:
    """Raise `Refused` where any of the components of a user is driven or muted, which are given by their rows."""
    for channel in (user.channels[row] for row in sorted(driven)):
        fcurve = binding.curves.get(channel)
        is_muted = fcurve is not None and fcurve.mute
        raise Refused(MUTED if is_muted else DRIVEN, name=user.name, channel=_label_at(*channel))


def refuse_linked(user: Transform, binding: Binding | None = None) -> None:
    """Raise `Refused` where what is moved, or the Action that moves it, belongs to another file."""
    if not user.animated.is_editable:
        raise Refused(user.linked_text, name=user.animated.name)
    if binding is not None and not binding.slot.is_editable:
        raise Refused(LINKED, name=binding.slot.action.name)


def refuse_moving_deltas(user: Transform, binding: Binding, drivers: Collection[Channel]) -> None:
    """Raise `Refused` where a delta rotation on top of a user's channels moves: its pose is none of a rigid motion."""
    if user.is_part or binding.channelbag is None:
        return
    path = f"delta_{user.rotation}"
    for index in range(WIDTHS[user.rotation]):
        fcurve = binding.channelbag.fcurves.find(path, index=index)
        is_animated = fcurve is not None and not fcurve.mute and not fcurve.is_empty
        if (path, index) in drivers or is_animated:
            raise Refused(MOVING_DELTA, name=user.name, channel=_label_at(path, index))


def refuse_channel(name: str, fcurve: bpy.types.FCurve) -> None:
    """Raise `Refused` where a channel has values without keys, or what nothing can be put in front of."""
    envelopes = [item for item in fcurve.modifiers if item.type == "ENVELOPE"] if has_type(fcurve, "ENVELOPE") else ()
    if any(not envelope.mute for envelope in envelopes):
        raise Refused(ENVELOPED, name=name, channel=_label(fcurve))
    if not fcurve.keyframe_points and fcurve.sampled_points:
        raise Refused(SAMPLED, name=name, channel=_label(fcurve))


def refuse_modified(name: str, binding: Binding) -> None:
    """Raise `Refused` where modifiers change what keys say, so that other keys would not say the same."""
    if any(any(on_top(fcurve)) for fcurve in binding.curves.values()):
        raise Refused(CHANGED_BY_MODIFIERS, name=name)


def refuse_numbers(name: str, source: Source) -> None:
    """Raise `Refused` where the numbers of a source make no motion, or too long a one."""
    if np.any(source.modes_at(source.keyed_frames) == UNKNOWN) if source.channels else source.mode == UNKNOWN:
        raise Refused(NO_SUCH_MODE, name=name)
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
    if last - first > MOST_FRAMES and source.is_linear:
        raise Refused(GOES_ON, name=name, frames=last - first, most=MOST_FRAMES)
    if source.is_live and not source.is_repeatable:
        raise Refused(OTHER_ROUNDS if _without_offsets(source).is_repeatable else DIFFERENT_CYCLES, name=name)


def _without_offsets(source: Source) -> Source:
    """Return a source whose rounds begin where the first one did."""

    def plain(cycles: Cycles) -> Cycles:
        kinds = ("REPEAT" if kind == "REPEAT_OFFSET" else kind for kind in (cycles.before, cycles.after))
        return Cycles(*kinds, cycles.before_count, cycles.after_count)

    channels = (
        (rows, keys if keys.cycles is None else replace(keys, cycles=plain(keys.cycles)))
        for rows, keys in source.channels
    )
    return replace(source, channels=tuple(channels))


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
