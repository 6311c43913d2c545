"""Keys of what segments are: of the channels of modes and turns, on the frames that segments begin on."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import bpy
import numpy as np

from ...motion.quaternions import conjugate, rotate
from ...motion.spins import FULL_TURN
from ..actions.channels import replace_keys
from ..actions.records import recorded_digest
from ..actions.slots import SlotTransform
from ..compute.differences import in_betweens
from ..compute.source_cache import cached_source
from ..compute.sources import MODE_NUMBERS, SAME_FRAME, Source
from ..compute.turning import shortest_turns, turning_in
from ..queries.keyed import frames_in, modes_in, turns_in
from ..transforms import Channel


def set_mode_in(place: SlotTransform, mode: str, frames: Sequence[float]) -> None:
    """Key the mode channel of a slot on these frames, and behind them where another mode goes on."""
    _key_segments(place, place.users[0].mode_channel, MODE_NUMBERS[mode], frames, modes_in)


def set_turns_in(place: SlotTransform, turns: int | Sequence[int], frames: Sequence[float]) -> None:
    """Key the channel of turns likewise, with one number on all of these frames or one on each, rising.

    Where there are none in any segment, the channel goes.
    """
    channel = place.users[0].turns_channel
    _key_segments(place, channel, turns, frames, turns_in)
    if not any(value for _, value, _ in _keys_in(place.curves[channel])):
        place.channelbag.fcurves.remove(place.curves.pop(channel))


def _key_segments(
    place: SlotTransform,
    channel: Channel,
    values: int | Sequence[int],
    frames: Sequence[float],
    values_in: Callable[[SlotTransform, np.ndarray], Sequence[int]],
) -> None:
    """Key values on the frames of keys that begin segments, and behind them where another one goes on.

    `values_in` gives those that segments have so far.
    """
    chosen, keyed = np.asarray(frames, dtype=np.float64), frames_in(place)
    is_chosen = _is_among(chosen, keyed)
    wanted = np.array(values_in(place, keyed))
    wanted[is_chosen] = values
    fcurve = place.curves.get(channel) or _new(place, channel)
    # Muted it has no say. Now it has, and all other segments keep the mode that they had without.
    old = [] if fcurve.mute else _keys_in(fcurve)
    fcurve.mute = False
    keys: list[tuple[float, float, bool]] = []
    passed = 0
    for frame, number, meant in zip(keyed.tolist(), wanted.tolist(), is_chosen.tolist(), strict=True):
        while passed < len(old) and old[passed][0] < frame - SAME_FRAME:
            keys.append(old[passed])
            passed += 1
        replaced = passed < len(old) and old[passed][0] <= frame + SAME_FRAME
        if meant or replaced or not keys or round(keys[-1][1]) != number:
            # Selected as the key of the pose is, so that both move together.
            keys.append((frame, number, meant or (replaced and old[passed][2])))
        passed += replaced
    frames, numbers, selected = zip(*keys, *old[passed:], strict=True)
    replace_keys(fcurve, np.array(frames), np.array(numbers), interpolation="CONSTANT", selected=np.array(selected))


def _keys_in(fcurve: bpy.types.FCurve) -> list[tuple[float, float, bool]]:
    """Frame, value and whether it is selected, of each key."""
    points, selected = (
        np.empty(2 * len(fcurve.keyframe_points), np.float32),
        np.empty(len(fcurve.keyframe_points), bool),
    )
    fcurve.keyframe_points.foreach_get("co", points)
    fcurve.keyframe_points.foreach_get("select_control_point", selected)
    return list(zip(points[::2].tolist(), points[1::2].tolist(), selected.tolist(), strict=True))


def _is_among(chosen: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Which of the frames (n,) are one of the chosen, shape (n,)."""
    chosen = np.sort(chosen)
    return np.searchsorted(chosen, frames + SAME_FRAME) > np.searchsorted(chosen, frames - SAME_FRAME, side="right")


def _new(place: SlotTransform, channel: Channel) -> bpy.types.FCurve:
    fcurve, channelbag, group = place.ensure_curve(channel), place.channelbag, place.users[0].group
    fcurve.group = channelbag.groups.get(group) or channelbag.groups.new(group)
    return fcurve


SAMPLES = 16
"""Of each part of a segment, and of each turn in it, to see how far a motion turns."""


def share_out_turns(place: SlotTransform, source: Source) -> bool:
    """Share the turns of segments out among the parts that keys divide them into, so that the motion stays as it is.

    `source` is what is keyed by now. Returns whether there were any.
    """
    old = cached_source(recorded_digest(place))
    if old is None or old.turns is None or source.turns is None or old.order != source.order or source.cyclic:
        return False
    if source.key_count <= old.key_count:
        return False
    shared: dict[float, int] = {}
    for segment in np.flatnonzero(old.segment_turns):
        first, last = old.key_frames[segment : segment + 2]
        parts = np.flatnonzero((source.key_frames > first - SAME_FRAME) & (source.key_frames < last - SAME_FRAME))
        if len(parts) > 1 and np.all(source.segment_turns[parts] == old.segment_turns[segment]):
            turned = _swept(old, int(segment), source.key_frames[[*parts, parts[-1] + 1]])
            shared.update(zip(source.key_frames[parts].tolist(), _turns_of(source, parts, turned), strict=True))
    if shared:
        set_turns_in(place, list(shared.values()), list(shared))
    return bool(shared)


def _swept(source: Source, segment: int, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """By how much a body turns from each of the frames (p + 1,) in a segment to the next about the axis of its spins,
    in radians (p,), and that axis as it lies in the body on each of them (p, 3)."""
    turned = turning_in(source, segment)
    axis, turns = turned.spins.axes[:, 0], abs(int(turned.spins.turns[0]))
    steps = SAMPLES * (turns + 1)
    samples = np.concatenate([np.linspace(*pair, steps, endpoint=False) for pair in itertools.pairwise(frames)])
    quaternions = in_betweens(source, np.append(samples, frames[-1])).wanted.quaternions
    axes = np.tile(axis, (len(quaternions), 1))
    if turned.spins.in_space[0]:
        axes = rotate(conjugate(quaternions), axes)
    angles = np.einsum("sk,sk->s", shortest_turns(quaternions[:-1], quaternions[1:]).T, axes[:-1])
    return angles.reshape(-1, steps).sum(axis=1), axes[:-1:steps]


def _turns_of(source: Source, parts: np.ndarray, swept: tuple[np.ndarray, np.ndarray]) -> list[int]:
    """How many turns each of these segments needs to turn by so much about an axis in the body, as `_swept` has it."""
    found = []
    for segment, angle, axis in zip(parts.tolist(), *swept, strict=True):
        turned = turning_in(source, segment, turns=1)
        about = float(axis @ turned.spins.axes[:, 0])
        sense = np.copysign(1.0, about * (turned.spins.turns[0] - turned.by_angles.turns[0]))
        there = float(axis @ turned.turn[:, 0]) + FULL_TURN * about * turned.by_angles.turns[0]
        found.append(int(sense * np.rint((angle - there) / FULL_TURN)))
    return found
