"""From Blender's data to sources: what is keyed of a transform in a slot, and how much influence the NLA gives it.

What modifiers add to a channel stays on top of the mode: its F-curve has it, and the difference does not know of it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..compute.components import PART_OF, REST, ROTATION, ROWS, rows_left_to
from ..compute.sources import Source
from ..curves.keys import Keys
from ..transforms import Channel, Refused, Transform
from .channels import read_keys
from .records import recorded, recorded_digest, recorded_mode
from .refusals import (
    is_added,
    refuse_channel,
    refuse_different_steps,
    refuse_drivers,
    refuse_numbers,
    refuse_what_is_taken,
)
from .slots import Binding, Slot

Influence = tuple[tuple[float, float], ...]
"""Frames of the Action, and the influence on them; straight lines between."""


def influence_of(slot: Slot) -> Influence | None:
    """Return the influence of the only strip that shows a slot, with nothing below it; None where that is full."""
    if len(slot.users) != 1 or None in slot.strips or len(slot.strips) != 1:
        return None
    data = slot.users[0].animation_data
    tracks = [
        [strip for strip in track.strips if not strip.mute]
        for track in data.nla_tracks
        if not track.mute and not (any(item.is_solo for item in data.nla_tracks) and not track.is_solo)
    ]
    lowest = next((strips for strips in tracks if strips), [])
    showing = [strip for strips in tracks for strip in strips if strip.action == slot.action]
    if data.use_tweak_mode or len(showing) != 1 or showing[0] not in lowest:
        return None
    return _of_strip(showing[0])


def _of_strip(strip: bpy.types.NlaStrip) -> Influence | None:
    """Return the influence of a strip which replaces what is below, and plays its Action once, forwards."""
    if strip.blend_type != "REPLACE" or strip.repeat != 1.0 or strip.use_reverse or strip.use_animated_time:
        return None
    if strip.use_animated_influence:
        fcurve = strip.fcurves.find("influence")
        frames = np.arange(np.floor(strip.frame_start), np.ceil(strip.frame_end) + 1.0)
        values = [min(max(fcurve.evaluate(frame), 0.0), 1.0) for frame in frames.tolist()]
    else:
        rises, falls = strip.frame_start + strip.blend_in, strip.frame_end - strip.blend_out
        if rises > falls:
            return None
        frames = np.array((strip.frame_start, rises, falls, strip.frame_end))
        values = [0.0 if strip.blend_in else 1.0, 1.0, 1.0, 0.0 if strip.blend_out else 1.0]
    if min(values) == 1.0:
        return None
    frames = strip.action_frame_start + (frames - strip.frame_start) / strip.scale
    return tuple(zip(frames.tolist(), values, strict=True))


def read(binding: Binding, mode: int | None = None) -> Source:
    """Return what is keyed of a transform in a slot.

    Parameters
    ----------
    binding : Binding
    mode : int, optional
        Read it as if it had the mode of this number throughout.

    Raises
    ------
    Refused
        Where that cannot be filled in.
    """
    (source,) = keyed_in([binding])
    if isinstance(source, Refused):
        raise source
    if mode is not None:
        source = replace(source, mode=mode)
    refuse_numbers(binding.name, source)
    return source


def keyed_in(bindings: Sequence[Binding]) -> list[Source | Refused]:
    """Return what is keyed in each of several bindings, or why it cannot be filled in.

    Where several users of a slot differ in what in-betweens depend on, it is what the leading one of them has: that by
    which the in-betweens were made that are there, or else the first one that the channels turn.

    Numbers and modes are as they are, which may be any in a damaged file: see `refuse_numbers`.
    """
    result = sources_of_users(bindings)
    return [leading(binding, users) for binding, users in zip(bindings, result, strict=True)]


def differing_users(binding: Binding, sources: list[Source | Refused]) -> list[Transform]:
    """Return the users of a slot that are moved by the in-betweens of another one, which do not fit them.

    `sources` is what is keyed as each of the users has it.
    """
    leader = leading(binding, sources)
    if isinstance(leader, Refused):
        return []
    return [
        user
        for user, source in zip(binding.users, sources, strict=True)
        if isinstance(source, Refused) or source.digest != leader.digest
    ]


def sources_of_users(bindings: Sequence[Binding]) -> list[list[Source | Refused]]:
    """Return what is keyed in each of the bindings as each of its users has it."""
    result: list[list[_Keyed | Refused]] = []
    drivers: dict[bpy.types.ID, set[Channel]] = {}
    for binding in bindings:
        users: list[_Keyed | Refused] = []
        for user in binding.users:
            if user.animated not in drivers:
                driving = user.animated.animation_data.drivers
                drivers[user.animated] = {(item.data_path, item.array_index) for item in driving if not item.mute}
            try:
                users.append(_keyed_for(user, binding, drivers[user.animated]))
            except Refused as problem:
                users.append(problem)
        result.append(users)
    readable = [keyed for users in result for keyed in users if isinstance(keyed, _Keyed)]
    channels = iter(read_keys([list(keyed.channels.values()) for keyed in readable]))
    modes, turns = (iter(read_keys(curves)) for curves in ([k.modes for k in readable], [k.turns for k in readable]))
    return [
        [
            _source(keyed, binding, next(channels), next(modes), next(turns)) if isinstance(keyed, _Keyed) else keyed
            for keyed in users
        ]
        for binding, users in zip(bindings, result, strict=True)
    ]


def leading(binding: Binding, users: list[Source | Refused]) -> Source | Refused:
    """Return the source of the leading user: see `keyed_in`."""
    if len(users) == 1:
        return users[0]
    digest = recorded_digest(binding)
    readable = [source for source in users if isinstance(source, Source)]
    if not readable:
        return users[0]

    def precedence(source: Source) -> tuple[bool, int]:
        return source.digest == digest, len(source.keyed)

    return max(readable, key=precedence)


class _Keyed(NamedTuple):
    """Which channels of a slot one of its users is moved by."""

    channels: dict[int, bpy.types.FCurve]
    """The channels with keys, by the rows of their components."""

    modes: list[bpy.types.FCurve]
    """The mode channel, if there is one with keys."""

    turns: list[bpy.types.FCurve]
    """The channel of turns likewise."""

    others: dict[str, Any]
    """What else a `Source` has of it."""


def _keyed_for(user: Transform, binding: Binding, drivers: Collection[Channel]) -> _Keyed:
    """Return what of a slot moves one of its users. `Refused` where that cannot be filled in."""
    refuse_what_is_taken(user, binding, drivers)
    keyed, channels = {}, user.channels
    driven = frozenset(row for row, channel in channels.items() if channel in drivers) if drivers else frozenset()
    left = rows_left_to(driven) if driven else ()
    for row, channel in channels.items():
        fcurve = binding.curves.get(channel)
        if fcurve is not None and row not in left and _has_say(user, fcurve):
            keyed[row] = fcurve
    if not keyed:
        refuse_drivers(user, driven)
    has_modifiers = [row for row, fcurve in keyed.items() if fcurve.modifiers]
    if has_modifiers:
        refuse_different_steps(user.name, keyed.values())
    modes, turns = (
        [fcurve] if (fcurve := binding.curves.get(channel)) is not None and _has_say(user, fcurve) else []
        for channel in (user.mode_channel, user.turns_channel)
    )
    names = frozenset(map(PART_OF.__getitem__, keyed))
    if keyed and turns and ROWS[ROTATION].start not in left and any(key.co.y for key in turns[0].keyframe_points):
        names |= {ROTATION}  # It turns, with keys of its rotation or without.
    rest = {
        row: 0.0 if row in driven else getattr(user.carrier, path.removeprefix(user.prefix))[index]
        for row, (path, index) in channels.items()
        if row not in keyed and PART_OF[row] in names
    }
    original = user.original()
    # Delta transforms of its own would be blended along.
    is_blended = not user.has_difference_slot and np.array_equal(original, REST)
    others = {
        "order": user.order,
        "keyed": names,
        "rest": rest,
        "original": original,
        "location_axes": user.location_axes,
        "turns_axis": recorded(binding).turns_axis,
        "in_nla": binding.slot.in_nla,
        "modified": frozenset(row for row in has_modifiers if is_modified(keyed[row])),
        "driven": driven,
        "influence": influence_of(binding.slot) if is_blended else None,
        "is_on_top": user.has_difference_slot,
    }
    return _Keyed(keyed, modes, turns, others)


def _source(
    keyed: _Keyed,
    binding: Binding,
    channels: list[tuple[list[int], Keys]],
    modes: list[tuple[list[int], Keys]],
    turns: list[tuple[list[int], Keys]],
) -> Source:
    """Return what is keyed in a slot, as one of its users has it, from the keys that were read of its channels."""
    rows, goes_on = list(keyed.channels), any(keys.linear or keys.cycles is not None for _, keys in channels)
    return Source(
        channels=tuple(([rows[number] for number in numbers], keys) for numbers, keys in channels),
        mode=modes[0][1] if modes else recorded_mode(binding),
        turns=turns[0][1] if turns else None,
        seen=binding.slot.seen if goes_on else None,
        **keyed.others,
    )


def _has_say(user: Transform, fcurve: bpy.types.FCurve) -> bool:
    """Return whether a channel has keys that count. `Refused` where it has something else that does."""
    if fcurve.mute:
        return False
    has_keys = len(fcurve.keyframe_points) > 0
    if fcurve.modifiers or not has_keys:
        refuse_channel(user.name, fcurve)
    return has_keys


def is_modified(fcurve: bpy.types.FCurve) -> bool:
    """Return whether a channel that in-betweens can follow has something added to it."""
    return any(is_added(modifier) and not modifier.mute for modifier in fcurve.modifiers)


def added_values(binding: Binding, user: Transform, source: Source, frames: np.ndarray) -> np.ndarray:
    """Return what modifiers add to the channels of a slot on these frames (m,) of its Action, shape (10, m)."""
    added = np.zeros((10, len(frames)))
    if source.modified:
        native = source.values_at(source.held(frames))
        for row in source.modified:
            fcurve = binding.curves[user.channels[row]]
            added[row] = [fcurve.evaluate(frame) for frame in frames.tolist()] - native[row]
    return added
