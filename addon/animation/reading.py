"""From Blender's data to sources: what is keyed in a slot."""

from __future__ import annotations

import math
from dataclasses import replace

import bpy
import numpy as np

from ..motion.eulers import ORDERS, quaternions_from_eulers
from .fcurves import Keys, read_keys
from .refusals import refuse_channel, refuse_numbers, refuse_what_is_taken
from .slots import MODE_PATH, WIDTHS, Curves, Refused, Slot, Transformable
from .sources import MODE_IDS, ROWS, UNKNOWN, Source


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
    source = keyed_in(slot, curves)
    if mode is not None:
        source = replace(source, mode=mode)
    refuse_numbers(slot.users[0].name, source)
    return source


def keyed_in(slot: Slot, curves: Curves) -> Source:
    """The same with numbers and modes as they are, which may be any in a damaged file; see `refuse_numbers`."""
    source, *others = (_read_for(Transformable.of(obj), slot, curves) for obj in slot.users)
    for obj, other in zip(slot.users[1:], others, strict=True):
        if other.digest != source.digest:
            raise Refused(
                f"{obj.name} moves by the same Action slot as {slot.users[0].name}, but has another mode, rotation "
                "mode or delta transform: give it an Action of its own (Object > Relations > Make Single User)"
            )
    return source


def _read_for(what: Transformable, slot: Slot, curves: Curves) -> Source:
    """What is keyed in a slot, as one of its users has it."""
    refuse_what_is_taken(what, slot, curves)
    keyed, rows, fcurves, rest = [], [], [], {}
    for name, prop in what.properties.items():
        first, unkeyed = ROWS[name].start, []
        for index in range(WIDTHS[prop]):
            fcurve = curves.get((what.prefix + prop, index))
            if fcurve is not None and _has_say(what, fcurve):
                rows.append(first + index)
                fcurves.append(fcurve)
            else:
                unkeyed.append(index)
        if len(unkeyed) < WIDTHS[prop]:
            keyed.append(name)
            if unkeyed:
                values = getattr(what.carrier, prop)
                rest |= {first + index: values[index] for index in unkeyed}
    read_together = read_keys(fcurves)
    own_span = any(keys.linear or keys.cycles is not None for _, keys in read_together)
    return Source(
        order=None if what.rotation == "rotation_quaternion" else what.carrier.rotation_mode,
        keyed=frozenset(keyed),
        channels=tuple(([rows[place] for place in places], keys) for places, keys in read_together),
        rest=rest,
        own=own_deltas(what.carrier),
        mode=_mode(what, curves),
        span=slot.span if own_span else None,
    )


def _mode(what: Transformable, curves: Curves) -> int | Keys:
    fcurve = curves.get((what.prefix + MODE_PATH, 0))
    if fcurve is None or not _has_say(what, fcurve):
        return mode_of(what.carrier)
    ((_, keys),) = read_keys([fcurve])
    return keys


def _has_say(what: Transformable, fcurve: bpy.types.FCurve) -> bool:
    """Whether a channel has keys that count. `Refused` where it has something else that does."""
    if fcurve.mute:
        return False
    has_keys = bool(fcurve.keyframe_points)
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
    if obj.rotation_mode in ORDERS:
        angles = motion.own_euler if euler else obj.delta_rotation_euler
        rotation = quaternions_from_eulers(np.array(angles)[None], obj.rotation_mode)[0]
    else:
        rotation = motion.own_quaternion if quaternion else obj.delta_rotation_quaternion
        length = math.hypot(*rotation)
        rotation = [component / length for component in rotation] if length else (1.0, 0.0, 0.0, 0.0)
    return np.array(
        (
            *(motion.own_location if location else obj.delta_location),
            *rotation,
            *(motion.own_scale if scale else obj.delta_scale),
        )
    )
