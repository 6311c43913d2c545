"""Runs: stretches of keys with the same holder, each evaluated as a source of its own.

The channels of a held object are its pose in the space of the holder. So values between keys with different holders are
no motion: the motion of the earlier keys continues until the key with the new holder. If the switch takes some frames,
which begin before that key, both motions continue at their speed. Otherwise an object that is picked up or put down has
come to rest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...motion.channel_curves import auto_clamped_slopes
from ..fcurves.evaluation import evaluate
from ..fcurves.keys import Keys
from .marks import SAME_FRAME, SAME_VALUE, Marks, distinct

MOST_FRAMES = 63
"""The largest number of frames that a switch from one holder to the next may take."""


PASS_LEAD_FRAMES = 1.0 / 64.0
"""The frames by which a switch is complete before its key. Blender merges keys that are closer than 0.01 frames."""


class Switch(NamedTuple):
    """The key at which an object switches from one holder to another; 0 is none, that is, its parent or the world."""

    frame: float
    before: int
    after: int

    begin: float
    """The first frame of the switch; equal to `frame` if it is instantaneous."""

    @property
    def there(self) -> float:
        """The frame at which the switch is complete, just before its key: on the key, nothing hides a new pose."""
        return self.frame - min(PASS_LEAD_FRAMES, (self.frame - self.begin) / 2)

    @property
    def is_at_once(self) -> bool:
        return self.begin >= self.frame


@dataclass(frozen=True)
class Stretch:
    """A run of keys, and the frames on which its motion is shown."""

    first: float
    """The frame of the first key; the motion is shown from there on."""

    until: float
    """The frame of the first key of the next run, or infinity."""

    comes: bool
    """True if the motion extends to before the first key, False if it rests there."""

    goes: bool
    """True if the motion extends beyond the last key, False if it rests there."""


def switches_of(keyed_frames: np.ndarray, held: Marks | None) -> tuple[Switch, ...]:
    """Return the switches of keys on these frames (n,) with these holds, in order of time."""
    frames = distinct(keyed_frames)
    if held is None or not len(frames):
        return ()
    numbers, over = np.divmod(held.at(frames), MOST_FRAMES + 1)
    result: list[Switch] = []
    earliest = float(frames[0])
    for place in (np.flatnonzero(np.diff(numbers)) + 1).tolist():
        frame = float(frames[place])
        begin = max(frame - float(over[place]), earliest)
        result.append(Switch(frame, int(numbers[place - 1]), int(numbers[place]), begin))
        earliest = frame
    return tuple(result)


def stretches_of(keyed_frames: np.ndarray, switches: tuple[Switch, ...], *, is_linear: bool) -> list[Stretch]:
    """Return the stretches of time between switches; the outermost may extend beyond all keys."""
    firsts = [float(keyed_frames[0]), *(switch.frame for switch in switches)]
    passing = [is_linear, *(not switch.is_at_once for switch in switches), is_linear]
    return [
        Stretch(first, until, *ends)
        for (first, until), ends in zip(pairwise([*firsts, np.inf]), pairwise(passing), strict=True)
    ]


def keys_in(keys: Keys, stretch: Stretch) -> Keys | None:
    """Return the keys of a stretch as if there were no others; None if it has none."""
    chosen = (keys.times >= stretch.first) & (keys.times < stretch.until)
    if not chosen.any():
        return None
    if keys.breakdowns is not None and not stretch.goes:
        # A breakdown that rests where the key before it is does not shape the motion towards that key.
        rests = np.abs(np.diff(keys.values)) <= SAME_VALUE * np.maximum(1.0, np.abs(keys.values[:, 1:]))
        shapes = chosen & np.append(True, ~(keys.breakdowns[1:] & chosen[:-1] & rests.all(axis=0)))
        chosen[np.flatnonzero(shapes)[-1] + 1 :] = False
    part = replace(keys.at(chosen), linear=stretch.comes or stretch.goes, cycles=None)
    if part.left is None or part.right is None or part.automatic is None:
        return part
    times, values, count = part.times, part.values.astype(np.float64), len(part.times)
    slopes, durations = np.zeros(values.shape), np.ones(1)
    if count > 1:
        durations = np.maximum(np.diff(times), SAME_FRAME)
        slopes, chords = auto_clamped_slopes(durations, values), np.diff(values) / durations
        slopes[:, 0] = chords[:, 0] if stretch.comes else 0.0
        slopes[:, -1] = chords[:, -1] if stretch.goes else 0.0
    # If some handles are the animator's, Blender's others keep their values, except at the ends. A single key rests.
    is_end = np.isin(np.arange(count), (0, count - 1))[:, None]
    automatic = part.automatic & (part.automatic.all(axis=(1, 2), keepdims=True) | is_end) | (count == 1)
    before, after = np.append(durations[:1], durations)[:count], np.append(durations, durations[-1:])[-count:]
    left = np.stack((np.broadcast_to(times - before / 3, values.shape), values - slopes * before / 3), axis=-1)
    right = np.stack((np.broadcast_to(times + after / 3, values.shape), values + slopes * after / 3), axis=-1)
    return replace(
        part,
        left=np.where(automatic[..., :1], left, part.left).astype(np.float32),
        right=np.where(automatic[..., 1:], right, part.right).astype(np.float32),
    )


def resting_in(keys: Keys, stretch: Stretch) -> np.ndarray:
    """Return the values (c,) of channels without a key in a stretch: their values at its start."""
    return evaluate([keys], [np.array([stretch.first])])[0][:, 0]
