"""From Blender's data to sources: what is keyed in a slot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ..motion.eulers import ORDERS, quaternions_from_extrinsic_eulers
from .fcurves import Keys, read_keys
from .refusals import refuse_channel, refuse_numbers, refuse_what_is_taken
from .slots import MODE_PATH, Curves, Refused, Slot, Transformable
from .sources import MODE_IDS, PART_OF, REST, ROTATION, ROWS, UNKNOWN, Source


def read(slot: Slot, curves: Curves, mode: int | None = None) -> Source:
    """What is keyed in a slot, for all of its users together.

    Parameters
    ----------
    slot : Slot
    curves : dict
        Its F-curves, see `curves_in`.
    mode : int, optional
        Read it as if it had this mode throughout.

    Raises
    ------
    Refused
        Where that cannot be filled in.
    """
    (source,) = keyed_in([(slot, curves)])
    if isinstance(source, Refused):
        raise source
    if mode is not None:
        source = replace(source, mode=mode)
    refuse_numbers(slot.users[0].name, source)
    return source


def keyed_in(readings: Sequence[tuple[Slot, Curves]]) -> list[Source | Refused]:
    """What is keyed in each of several slots, or why it cannot be filled in.

    Numbers and modes are as they are, which may be any in a damaged file: see `refuse_numbers`.
    """
    found: list[list[_Keyed] | Refused] = []
    for slot, curves in readings:
        try:
            found.append([_keyed_for(Transformable.of(obj), slot, curves) for obj in slot.users])
        except Refused as problem:
            found.append(problem)
    everyone = [keyed for users in found if not isinstance(users, Refused) for keyed in users]
    channels = iter(read_keys([list(keyed.channels.values()) for keyed in everyone]))
    modes = iter(read_keys([keyed.modes for keyed in everyone]))
    return [
        users
        if isinstance(users, Refused)
        else _in_common(slot, [_source(keyed, slot, next(channels), next(modes)) for keyed in users])
        for (slot, _), users in zip(readings, found, strict=True)
    ]


def _in_common(slot: Slot, sources: list[Source]) -> Source | Refused:
    """What is keyed in a slot for all of its users together, from what is for each of them."""
    source, *others = sources
    for obj, other in zip(slot.users[1:], others, strict=True):
        if other.digest != source.digest:
            return Refused(
                f"{obj.name} moves by the same Action slot as {slot.users[0].name}, but has another mode, rotation "
                "mode or delta transform: give it an Action of its own (Object > Relations > Make Single User)"
            )
    return source


@dataclass(frozen=True)
class _Keyed:
    """Which channels of a slot one of its users is moved by."""

    what: Transformable

    names: frozenset[str]
    """Which of location, rotation and scale are keyed."""

    channels: dict[int, bpy.types.FCurve]
    """The channels with keys, by the rows of their components."""

    rest: dict[int, float]
    """The values of the other components of what is keyed."""

    modes: list[bpy.types.FCurve]
    """The mode channel, if there is one with keys."""


def _keyed_for(what: Transformable, slot: Slot, curves: Curves) -> _Keyed:
    """What of a slot moves one of its users. `Refused` where that cannot be filled in."""
    refuse_what_is_taken(what, slot, curves)
    keyed = {}
    for row, key in what.channels.items():
        fcurve = curves.get(key)
        if fcurve is not None and _has_say(what, fcurve):
            keyed[row] = fcurve
    names = frozenset(map(PART_OF.__getitem__, keyed))
    rest = {
        row: getattr(what.carrier, path.removeprefix(what.prefix))[index]
        for row, (path, index) in what.channels.items()
        if row not in keyed and PART_OF[row] in names
    }
    mode = curves.get((what.prefix + MODE_PATH, 0))
    modes = [mode] if mode is not None and _has_say(what, mode) else []
    return _Keyed(what, names, keyed, rest, modes)


def _source(
    keyed: _Keyed, slot: Slot, channels: list[tuple[list[int], Keys]], modes: list[tuple[list[int], Keys]]
) -> Source:
    """What is keyed in a slot, as one of its users has it, from the keys that were read of its channels."""
    carrier, rows = keyed.what.carrier, list(keyed.channels)
    own_span = any(keys.linear or keys.cycles is not None for _, keys in channels)
    return Source(
        order=None if keyed.what.rotation == "rotation_quaternion" else carrier.rotation_mode,
        keyed=keyed.names,
        channels=tuple(([rows[place] for place in places], keys) for places, keys in channels),
        rest=keyed.rest,
        own=own_deltas(carrier),
        mode=modes[0][1] if modes else mode_of(carrier),
        span=slot.span if own_span else None,
    )


def _has_say(what: Transformable, fcurve: bpy.types.FCurve) -> bool:
    """Whether a channel has keys that count. `Refused` where it has something else that does."""
    if fcurve.mute:
        return False
    has_keys = len(fcurve.keyframe_points) > 0
    if fcurve.modifiers or not has_keys:
        refuse_channel(what.name, fcurve)
    return has_keys


def mode_of(obj: bpy.types.Object) -> int:
    """The mode of an object as it is now, as `MODE_IDS` counts them; `UNKNOWN` where it is none of them."""
    mode = obj.rigid_motion.mode
    return MODE_IDS.index(mode) if mode in MODE_IDS else UNKNOWN


def own_deltas(obj: bpy.types.Object) -> np.ndarray:
    """The delta transforms that an object has of its own, (10,): remembered while in-betweens are in their place."""
    motion = obj.rigid_motion
    location, quaternion, euler, scale = motion.filled
    rotation = REST[ROWS[ROTATION]]
    if obj.rotation_mode in ORDERS:
        angles = (motion.own_euler if euler else obj.delta_rotation_euler)[:]
        if any(angles):
            rotation = quaternions_from_extrinsic_eulers(np.array((angles,)), obj.rotation_mode)[0]
    else:
        components = (motion.own_quaternion if quaternion else obj.delta_rotation_quaternion)[:]
        if length := math.hypot(*components):
            rotation = [component / length for component in components]
    return np.array(
        (
            *(motion.own_location if location else obj.delta_location),
            *rotation,
            *(motion.own_scale if scale else obj.delta_scale),
        )
    )
