"""From Blender's data to sources: what is keyed of a transform in a slot.

What modifiers of the animator's make of a channel comes on top of the mode, and a source does not know of it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..evaluation.components import MODE_NAMES, PART_OF, ROTATION, ROWS, UNKNOWN, rows_left_to
from ..evaluation.differences import seen_values
from ..evaluation.sources import SAME_FRAME, TURN_AXES, Marks, Source
from ..transforms import WIDTHS, Channel, Refused, Transform
from .channels import Read, read_keys
from .marks import carried_on, has_marks
from .modifiers import is_term, on_top
from .refusals import refuse_channel, refuse_drivers, refuse_linked, refuse_moving_deltas, refuse_numbers
from .slots import Binding

FRACTIONS = 2**24
"""The number of digests that a term can keep as its influence, which is in single precision."""


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
        Where there can be no in-betweens of it.
    """
    (source,) = keyed_in([binding])
    if isinstance(source, Refused):
        raise source
    if mode is not None:
        source = replace(source, mode=mode)
    refuse_numbers(binding.name, source)
    return source


def keyed_in(bindings: Sequence[Binding]) -> list[Source | Refused]:
    """Return what is keyed in each of several bindings, or why there can be no in-betweens of it.

    Where several users of a slot differ in what in-betweens depend on, it is what the leading one of them has: that
    which the terms that are there were planned from, or else the first one that the channels turn.

    Numbers and modes are as they are, which may be any in a damaged file: see `refuse_numbers`.
    """
    result = sources_of_users(bindings)
    return [leading(binding, users) for binding, users in zip(bindings, result, strict=True)]


def planned_from(binding: Binding) -> int | None:
    """Return the digest of the source that the terms in a slot were planned from, None where there are none.

    It is that of no source where some of them are missing, or there are copies of them.
    """
    modifiers = (modifier for fcurve in binding.moving.values() for modifier in fcurve.modifiers)
    kept, count = next((modifier.influence for modifier in modifiers if is_term(modifier)), None), 0
    if kept is None:
        return None
    for fcurve in binding.moving.values():
        influences = np.empty(len(fcurve.modifiers), np.float32)
        fcurve.modifiers.foreach_get("influence", influences)
        count += np.count_nonzero(influences == np.float32(kept))
    return (round(kept * FRACTIONS) - count) % FRACTIONS


def influence_for(source: Source, count: int) -> float:
    """Return what terms have for an influence, which is not in use: the digest of their source, and their number."""
    return (source.digest24 + count) % FRACTIONS / FRACTIONS


def differing_users(binding: Binding, sources: list[Source | Refused]) -> list[Transform]:
    """Return the users of a slot that another one's in-betweens do not fit.

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
                data = user.animated.animation_data
                driving = () if data is None else data.drivers
                drivers[user.animated] = {(item.data_path, item.array_index) for item in driving if not item.mute}
            try:
                users.append(_keyed_for(user, binding, drivers[user.animated]))
            except Refused as problem:
                users.append(problem)
        result.append(users)
    readable = [keyed for users in result for keyed in users if isinstance(keyed, _Keyed)]
    channels = iter(read_keys([list(keyed.channels.values()) for keyed in readable]))
    turns = iter(read_keys([keyed.turns for keyed in readable]))
    return [
        [
            _source(keyed, binding, next(channels), next(turns)) if isinstance(keyed, _Keyed) else keyed
            for keyed in users
        ]
        for binding, users in zip(bindings, result, strict=True)
    ]


def leading(binding: Binding, users: list[Source | Refused]) -> Source | Refused:
    """Return the source of the leading user: see `keyed_in`."""
    if len(users) == 1:
        return users[0]
    digest = planned_from(binding)
    readable = [source for source in users if isinstance(source, Source)]
    if not readable:
        return users[0]

    def precedence(source: Source) -> tuple[bool, int]:
        return source.digest24 == digest, len(source.keyed)

    return max(readable, key=precedence)


class _Keyed(NamedTuple):
    """Which channels of a slot one of its users is moved by."""

    channels: dict[int, bpy.types.FCurve]
    """The channels with keys, by the rows of their components."""

    turns: list[bpy.types.FCurve]
    """The channel of turns, if there is one with keys."""

    others: dict[str, Any]
    """What else a `Source` has of it."""


def _keyed_for(user: Transform, binding: Binding, drivers: Collection[Channel]) -> _Keyed:
    """Return what of a slot moves one of its users. `Refused` where there can be no in-betweens of it."""
    refuse_linked(user, binding)
    refuse_moving_deltas(user, binding, drivers)
    channels = user.channels
    curves = {row: binding.curves.get(channel) for row, channel in channels.items()}
    driven = {row for row, channel in channels.items() if channel in drivers}
    muted = {row for row, fcurve in curves.items() if fcurve is not None and fcurve.mute}
    left = rows_left_to(driven | muted)
    some = {row: fcurve for row, fcurve in curves.items() if fcurve is not None and row not in left}
    keyed = {row: fcurve for row, fcurve in some.items() if _has_say(user, fcurve)}
    if not keyed:
        refuse_drivers(user, binding, driven)
    curve = binding.curves.get(user.turns_channel)
    turns = [curve] if curve is not None and _has_say(user, curve) else []
    names = frozenset(map(PART_OF.__getitem__, keyed))
    if keyed and turns and ROWS[ROTATION].start not in left and any(key.co.y for key in turns[0].keyframe_points):
        names |= {ROTATION}  # It turns, with keys of its rotation or without.
    rest = {
        row: 0.0 if row in driven else getattr(user.carrier, path.removeprefix(user.prefix))[index]
        for row, (path, index) in channels.items()
        if row not in keyed and PART_OF[row] in names
    }
    others = {
        "order": user.order,
        "keyed": names,
        "rest": rest,
        "original": user.original(),
        "location_axes": user.location_axes,
        "driven": frozenset(driven | muted),
    }
    return _Keyed(keyed, turns, others)


def _source(keyed: _Keyed, binding: Binding, channels: list[Read], turns: list[Read]) -> Source:
    """Return what is keyed in a slot, as one of its users has it, from the keys that were read of its channels."""
    rows, goes_on = list(keyed.channels), any(read.keys.linear or read.keys.cycles is not None for read in channels)
    axes = _said_by(turns)
    return Source(
        channels=tuple(([rows[number] for number in read.numbers], read.keys) for read in channels),
        mode=_modes_in(channels),
        turns=turns[0].keys if turns else None,
        turns_axis=TURN_AXES[0] if axes is None else replace(axes, numbers=axes.numbers % len(TURN_AXES)),
        seen=binding.slot.seen if goes_on else None,
        **keyed.others,
    )


def _modes_in(channels: list[Read]) -> int | Marks:
    """Return the modes that keys say, those that this version does not know as `UNKNOWN`; 0 where none says any."""
    said = _said_by(channels)
    if said is None:
        return 0
    numbers = np.where(np.isin(said.numbers, list(MODE_NAMES)), said.numbers, UNKNOWN)
    return int(numbers[0]) if np.all(numbers == numbers[0]) else Marks(said.frames, numbers)


def _said_by(reads: list[Read]) -> Marks | None:
    """Return what the marks of keys say from which frame on, as numbers from 0; None where there are none.

    On one frame the channel that comes first has it.
    """
    if not any(read.marks.any() for read in reads):
        return None
    frames = np.concatenate([read.keys.times for read in reads])
    marks = np.concatenate([read.marks for read in reads])
    order = np.lexsort((marks == 0, frames))
    frames, marks = frames[order], marks[order]
    # What is no number is no frame that there was, either.
    first = ~(np.diff(frames, prepend=-np.inf) <= SAME_FRAME)
    return Marks(frames[first], carried_on(marks[first]) - 1)


def _has_say(user: Transform, fcurve: bpy.types.FCurve) -> bool:
    """Return whether a channel has keys that count. `Refused` where there is no way to put in-betweens into it."""
    if fcurve.mute:
        return False
    has_keys = len(fcurve.keyframe_points) > 0
    if fcurve.modifiers or not has_keys:
        refuse_channel(user.name, fcurve)
    return has_keys


def is_marked(binding: Binding) -> bool:
    """Return whether the keys of a slot say a mode, Blender's own among them."""
    return any(map(has_marks, _moving(binding)))


def modes_said(binding: Binding) -> int | Marks:
    """Return the modes that the keys of a slot say, as a `Source` has them."""
    (reads,) = read_keys([[fcurve for fcurve in _moving(binding) if not fcurve.mute]])
    return _modes_in(reads)


def _moving(binding: Binding) -> list[bpy.types.FCurve]:
    """Return the channels of location, rotation and scale in a slot that have keys."""
    return [
        fcurve
        for (path, _), fcurve in binding.curves.items()
        if path.removeprefix(binding.prefix) in WIDTHS and fcurve.keyframe_points
    ]


def added_values(binding: Binding, user: Transform, source: Source, frames: np.ndarray) -> np.ndarray:
    """Return what modifiers of the animator's add to the channels of a slot on these frames (m,), shape (10, m)."""
    added = np.zeros((10, len(frames)))
    curves = {row: binding.curves.get(channel) for row, channel in user.channels.items()}
    changed = {row: fcurve for row, fcurve in curves.items() if fcurve is not None and any(on_top(fcurve))}
    if changed:
        seen = seen_values(source, frames)
        for row, fcurve in changed.items():
            added[row] = [fcurve.evaluate(frame) for frame in frames.tolist()] - seen[row]
    return added
