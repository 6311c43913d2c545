"""Keys of constraint influences from the holds of keys, and the poses in which objects arrive at their holders."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..evaluation.differences import seen_values
from ..evaluation.runs import PASS_LEAD_FRAMES
from ..evaluation.sources import KeyedTransform
from ..fcurves.keys import BEZIER, CONSTANT

SUBFRAME_POSES = 8
"""The number of poses per frame while a moving object arrives: renderers blur motion over such parts of a frame."""


class InfluenceKeys(NamedTuple):
    """The n keys of an influence."""

    frames: np.ndarray
    values: np.ndarray
    interpolations: np.ndarray
    """Interpolation codes. At BEZIER both handles are level and a third of the segment long: a smoothstep."""


class Passing(NamedTuple):
    """The arrival poses while an object passes from one holder to another, for one passing after the other."""

    frames: np.ndarray
    """Rising frames on a clock of their own that starts at 0, shape (m,)."""

    rows: np.ndarray
    """The channels in the space of the holder being passed to, shape (10, m)."""

    numbers: np.ndarray
    """The number of that holder, shape (m,)."""

    clocks: dict[int, np.ndarray]
    """For each of these holders, frames and clock values at both ends of each passing, shape (2 p, 2)."""


def holding_keys(source: KeyedTransform, number: int) -> InfluenceKeys:
    """Return the influence keys for being held in the holder of this number: 0 or 1."""
    switches = source.switches
    first = source.keyed_range[0] if source.channels else 0.0
    frames = [first, *(switch.frame for switch in switches)]
    holders = np.array([source.hold_at(first)[0], *(switch.after for switch in switches)])
    values = (holders == number).astype(float)
    changes = np.flatnonzero(np.append(True, np.diff(values) != 0.0))
    return InfluenceKeys(np.array(frames)[changes], values[changes], np.full(len(changes), CONSTANT))


def passing_keys(source: KeyedTransform, number: int) -> InfluenceKeys:
    """Return the influence keys for passing to the holder of this number."""
    first = source.keyed_range[0] if source.channels else 0.0
    keys = [(first, 0.0, CONSTANT)]
    for switch in source.switches:
        if switch.after == number and not switch.is_at_once:
            keys = [key for key in keys if key[0] < switch.begin]
            keys += [(switch.begin, 0.0, BEZIER), (switch.there, 1.0, CONSTANT), (switch.frame, 0.0, CONSTANT)]
    frames, values, codes = zip(*keys, strict=True)
    return InfluenceKeys(np.array(frames), np.array(values), np.array(codes))


def passing(source: KeyedTransform) -> Passing | None:
    """Return the arrival poses at all holders that an object passes to; None if it passes to none."""
    frames, rows, numbers, clocks, clock = [], [], [], dict[int, list[tuple[float, float]]](), 0.0
    for switch, run in zip(source.switches, source.runs[1:], strict=True):
        if switch.is_at_once:
            continue
        last = switch.frame + PASS_LEAD_FRAMES
        inside = np.arange(np.ceil(switch.begin * SUBFRAME_POSES), last * SUBFRAME_POSES) / SUBFRAME_POSES
        at = np.unique(np.concatenate(((switch.begin,), inside, (switch.frame, last))))
        values = seen_values(run.source, run.moments(at))
        if np.ptp(values, axis=1).max() == 0.0:
            at, values = at[[0, -1]], values[:, [0, -1]]
        frames.append(at - switch.begin + clock)
        rows.append(values)
        numbers.append(np.full(len(at), switch.after))
        ends = [(switch.begin, clock), (last, frames[-1][-1])]
        clocks[switch.after] = [key for key in clocks.get(switch.after, ()) if key[0] < switch.begin] + ends
        clock = float(np.ceil(frames[-1][-1])) + 1.0
    if not frames:
        return None
    every = (np.concatenate(frames), np.concatenate(rows, axis=1), np.concatenate(numbers))
    return Passing(*every, {number: np.array(keys) for number, keys in clocks.items()})
