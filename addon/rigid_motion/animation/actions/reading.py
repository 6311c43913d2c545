"""Reading sources: the keys of a transform in a slot, converted from Blender's data to arrays.

The effect of the animator's own modifiers comes on top of the mode, so a source does not include it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import bpy
import numpy as np

from ..evaluation.components import MODE_NAMES, PART_OF, ROTATION, ROWS, UNKNOWN_MODE, rows_left_to
from ..evaluation.differences import seen_values
from ..evaluation.sources import OUTSIDE_REACH_FRAMES, SAME_FRAME, TURN_AXES, KeyedTransform, Marks
from ..transforms import Channel, Refused, Transform
from .channels import ReadChannels, read_keys
from .marks import carried_on, has_marks, hold
from .modifiers import is_term, longest_step, on_top
from .refusals import refuse_drivers, refuse_envelope, refuse_linked, refuse_moving_deltas, refuse_numbers
from .slots import Binding

DIGEST_COUNT = 2**24
"""The number of digests that fit in the influence of a term, which is in single precision."""


def read(binding: Binding) -> KeyedTransform:
    """Return the keys of a transform in a slot as a source. Raises `Refused` if it cannot have in-betweens."""
    (source,) = keyed_in([binding])
    if isinstance(source, Refused):
        raise source
    refuse_numbers(binding.name, source)
    return source


def keyed_in(bindings: Sequence[Binding]) -> list[KeyedTransform | Refused]:
    """Return the source of each of several bindings, or why it cannot have in-betweens.

    If the users of a slot differ in something that in-betweens depend on, the `leading` user counts.

    Numbers and modes are not checked, and may be anything in a damaged file: see `refuse_numbers`.
    """
    return list(map(leading, sources_of_users(bindings)))


def leading(users: list[KeyedTransform | Refused]) -> KeyedTransform | Refused:
    """Return the source of the user with the most parts moved by the slot, or the first of several such users."""
    return max(users, key=lambda source: len(source.keyed) if isinstance(source, KeyedTransform) else -1)


def planned_from(binding: Binding) -> int | None:
    """Return the digest of the source that the terms in a slot were planned from, None if there are no terms.

    If some of the terms are missing or duplicated, the digest matches no source.
    """
    modifiers = (modifier for fcurve in binding.moving.values() for modifier in fcurve.modifiers)
    kept, count = next((modifier.influence for modifier in modifiers if is_term(modifier)), None), 0
    if kept is None:
        return None
    for fcurve in binding.moving.values():
        influences = np.empty(len(fcurve.modifiers), np.float32)
        fcurve.modifiers.foreach_get("influence", influences)
        count += int(np.count_nonzero(influences == np.float32(kept)))
    return (round(kept * DIGEST_COUNT) - count) % DIGEST_COUNT


def influence_for(source: KeyedTransform, count: int) -> float:
    """Return the influence, otherwise unused, that terms store: the digest of their source plus the number of terms."""
    return (source.digest24 + count) % DIGEST_COUNT / DIGEST_COUNT


def sources_of_users(bindings: Sequence[Binding]) -> list[list[KeyedTransform | Refused]]:
    """Return the source of each user of each binding."""
    drivers: dict[bpy.types.ID, set[Channel]] = {}

    def source_of(user: Transform, binding: Binding) -> KeyedTransform | Refused:
        if user.animated not in drivers:
            data = user.animated.animation_data
            driving = () if data is None else data.drivers
            drivers[user.animated] = {(item.data_path, item.array_index) for item in driving if not item.mute}
        try:
            return _source(user, binding, drivers[user.animated])
        except Refused as problem:
            return problem

    return [[source_of(user, binding) for user in binding.users] for binding in bindings]


def _source(user: Transform, binding: Binding, drivers: Collection[Channel]) -> KeyedTransform:
    """Return the keys in a slot as one of its users has them. Raises `Refused` if it cannot have in-betweens."""
    refuse_linked(user, binding)
    refuse_moving_deltas(user, binding, drivers)
    channels = user.channels
    curves = {row: fcurve for row, channel in channels.items() if (fcurve := binding.curves.get(channel)) is not None}
    driven = {row for row, channel in channels.items() if channel in drivers}
    driven |= {row for row, fcurve in curves.items() if not fcurve.keyframe_points and fcurve.sampled_points}
    still = driven | {row for row, fcurve in curves.items() if fcurve.mute}
    left = rows_left_to(still)
    keyed = {row: fcurve for row, fcurve in curves.items() if row not in left and fcurve.keyframe_points}
    for fcurve in keyed.values():
        refuse_envelope(user.name, fcurve)
    if not keyed:
        refuse_drivers(user, binding, still)
    curve = binding.curves.get(user.turns_channel)
    turns = [curve] if curve is not None and not curve.mute and curve.keyframe_points else []
    names = frozenset(map(PART_OF.__getitem__, keyed))
    if keyed and turns and ROWS[ROTATION].start not in left and any(key.co.y for key in turns[0].keyframe_points):
        names |= {ROTATION}  # The Turns channel turns the object, even without keys of its rotation.
    rest = {
        row: 0.0 if row in driven else getattr(user.carrier, path.removeprefix(user.prefix))[index]
        for row, (path, index) in channels.items()
        if row not in keyed and PART_OF[row] in names
    }
    reads, of_turns = read_keys(list(keyed.values())), read_keys(turns)
    rows, goes_on = list(keyed), any(read.keys.linear or read.keys.cycles is not None for read in reads)
    axes = _marks_in(of_turns)
    return KeyedTransform(
        channels=tuple(([rows[number] for number in read.numbers], read.keys) for read in reads),
        mode=_modes_in(reads),
        turns=of_turns[0].keys if of_turns else None,
        turns_axis=TURN_AXES[0] if axes is None else replace(axes, numbers=axes.numbers % len(TURN_AXES)),
        seen=binding.slot.seen if goes_on else None,
        reach=max([OUTSIDE_REACH_FRAMES, *map(longest_step, keyed.values())]) if goes_on else OUTSIDE_REACH_FRAMES,
        order=user.order,
        keyed=names,
        rest=rest,
        original=user.original(),
        location_axes=user.location_axes,
        driven=frozenset(still),
        held=_holds_in(reads),
    )


def _modes_in(channels: list[ReadChannels]) -> int | Marks:
    """Return the modes that keys store, 0 if none does; modes unknown to this version become `UNKNOWN_MODE`."""
    said = _marks_in(channels)
    if said is None:
        return 0
    numbers = np.where(np.isin(said.numbers, list(MODE_NAMES)), said.numbers, UNKNOWN_MODE)
    return int(numbers[0]) if np.all(numbers == numbers[0]) else Marks(said.frames, numbers)


def _marks_in(reads: list[ReadChannels]) -> Marks | None:
    """Return the marks of keys and the frames that they apply from, as numbers from 0; None if there are no marks."""
    return _on_frames(reads, [read.marks for read in reads])


def _holds_in(reads: list[ReadChannels]) -> Marks | None:
    """Return the holds of keys and the frames that they apply from, see `marks.hold`; None if no key has a holder."""
    holds = _on_frames(reads, [read.holds + 1 for read in reads])
    return None if holds is None or not (holds.numbers >= hold(1)).any() else holds


def _on_frames(reads: list[ReadChannels], of_keys: list[np.ndarray]) -> Marks | None:
    """Return numbers of keys, (c, n) for each read, from 1 (0: none), as numbers from 0 that apply from frames on.

    If channels disagree on a frame, most marked keys win, or else the first: typing into a setting removes the mark.
    """
    if not any(numbers.any() for numbers in of_keys):
        return None
    parts = []
    for read, numbers in zip(reads, of_keys, strict=True):
        votes = (read.marks > 0).astype(int)
        if (numbers == numbers[0]).all() and (votes == votes[0]).all():
            numbers, votes = numbers[:1], votes[:1] * len(votes)
        parts.append((np.tile(read.keys.times, len(numbers)), numbers.ravel(), votes.ravel()))
    frames, numbers, votes = map(np.concatenate, zip(*parts, strict=True))
    order = np.argsort(frames, kind="stable")
    frames, numbers, votes = frames[order], numbers[order], votes[order]
    # NaN is not a new frame.
    with np.errstate(invalid="ignore"):
        first = ~(np.diff(frames, prepend=-np.inf) <= SAME_FRAME)
    size = int(numbers.max()) + 1
    codes, place, at = np.unique(np.cumsum(first) * size + numbers, return_index=True, return_inverse=True)
    best = np.lexsort((place, -np.bincount(at, weights=votes), codes // size))
    best = best[np.diff(codes[best] // size, prepend=0) > 0]
    return Marks(frames[first], carried_on(codes[best] % size) - 1)


def is_marked(binding: Binding) -> bool:
    """Return whether the keys of a slot store a mode, Blender's own included."""
    return any(map(has_marks, binding.keyed))


def modes_said(binding: Binding) -> int | Marks:
    """Return the modes that the keys of a slot store, as in a `KeyedTransform`."""
    keyed = [fcurve for fcurve in binding.keyed if not fcurve.mute]
    return _modes_in(read_keys(keyed))


def added_values(binding: Binding, user: Transform, source: KeyedTransform, frames: np.ndarray) -> np.ndarray:
    """Return the offsets that the animator's modifiers add to the channels of a slot on frames (m,), shape (10, m)."""
    added = np.zeros((10, len(frames)))
    curves = {row: binding.curves.get(channel) for row, channel in user.channels.items()}
    changed = {row: fcurve for row, fcurve in curves.items() if fcurve is not None and any(on_top(fcurve))}
    if changed:
        seen = seen_values(source, frames)
        for row, fcurve in changed.items():
            added[row] = [fcurve.evaluate(frame) for frame in frames.tolist()] - seen[row]
    return added
