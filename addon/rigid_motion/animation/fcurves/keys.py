"""F-curves as arrays: their keys, the segments between them as cubics, and Cycles modifiers that fold frames back.

Frames and values are Blender's, in single precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .solvers import bezier_cubics

_EASED = ("BACK", "BOUNCE", "CIRC", "CUBIC", "ELASTIC", "EXPO", "QUAD", "QUART", "QUINT", "SINE")

INTERPOLATIONS = dict(enumerate(("CONSTANT", "LINEAR", "BEZIER", *_EASED)))
"""From the code of `bpy.types.Keyframe.interpolation` to its name."""

CONSTANT, LINEAR, BEZIER, *_ = INTERPOLATIONS
ELASTIC = 3 + _EASED.index("ELASTIC")

EASINGS = dict(enumerate(("AUTO", "EASE_IN", "EASE_OUT", "EASE_IN_OUT")))
"""From the code of `bpy.types.Keyframe.easing` to its name."""

AUTO_EASING = 0

CODE = np.uint8
"""The type in which Blender stores codes: reading into any other type is slower."""

KEY_TOLERANCE = float(np.float32(1e-4))
"""The distance from a key, in frames, within which Blender uses the key's value."""

MAX_NUMBER = 1e30
"""Frames and values from this size on are damage. An infinite one, typed or set by a script, becomes 3.4e38."""


@dataclass(frozen=True)
class Cycles:
    """A Cycles modifier. Modes are NONE, REPEAT, REPEAT_OFFSET or MIRROR; a count of 0 means endless."""

    before: str
    after: str
    before_count: int
    after_count: int

    @property
    def endless(self) -> Cycles:
        """Cycles with endless rounds on both sides, as a mode sees them that looks across the seam of a round."""
        before, after = self.before, self.after
        return Cycles(after if before == "NONE" else before, before if after == "NONE" else after, 0, 0)


@dataclass(frozen=True, eq=False)
class Keys:
    """c F-curves that are keyed together: n keys each, on the same frames, with the same extrapolation and cycles.

    Frames and values are in single precision; codes are those of `INTERPOLATIONS` and `EASINGS`. Fields that do not
    affect the values of the curves are None.
    """

    points: np.ndarray
    """Frame and value, shape (c, n, 2)."""

    interpolation: np.ndarray
    """Interpolation codes of the segments that the keys begin, shape (c, n)."""

    left: np.ndarray | None = None
    """The left handles of the keys, frame and value, shape (c, n, 2)."""

    right: np.ndarray | None = None
    """The right handles of the keys, frame and value, shape (c, n, 2)."""

    easing: np.ndarray | None = None
    """Easing codes, shape (c, n)."""

    easing_settings: np.ndarray | None = None
    """BACK's overshoot, ELASTIC's amplitude, and ELASTIC's period in frames, shape (3, c, n)."""

    linear: bool = False
    """True if the curves continue with their slope outside of the keys, False if they hold their value."""

    cycles: Cycles | None = None

    breakdowns: np.ndarray | None = None
    """True for the keys of type *Breakdown*, shape (n,); None if there are none."""

    automatic: np.ndarray | None = None
    """True for handles that Blender computes from the neighbouring keys, left and right, shape (c, n, 2); None unless
    requested."""

    is_sound: bool = True
    """True if all numbers read are smaller than `MAX_NUMBER`, and the keys are in the order of their frames."""

    @cached_property
    def times(self) -> np.ndarray:
        """Frames of the keys, shape (n,), in double precision."""
        return self.points[0, :, 0].astype(np.float64)

    @property
    def values(self) -> np.ndarray:
        """Values of the keys, shape (c, n)."""
        return self.points[..., 1]

    @cached_property
    def rates(self) -> np.ndarray:
        """One over the number of frames from each key to the next, 0 where that is 0, shape (n,)."""
        durations = np.diff(self.times, append=self.times[-1:])
        return np.divide(1.0, durations, out=np.zeros_like(durations), where=durations != 0.0)

    @cached_property
    def cubics(self) -> tuple[np.ndarray, np.ndarray | None]:
        """Value and time from each key to the next as cubics of a parameter from 0 to 1.

        Values are coefficients of 1, t, t^2 and t^3, (4, c, n), or (2, c, n) if no segment is BEZIER; segments with
        easing are linear here. Times, from 0 to 1, are coefficients of t, t^2 and t^3, shape (3, c, n), or (3, 1, n) if
        they are the same for all curves; None if time itself is the parameter.
        """
        following = np.roll(self.points, -1, axis=1)
        is_moving = (self.rates != 0.0) & (self.interpolation != CONSTANT)
        values, times = np.zeros((4, *is_moving.shape)), np.zeros((3, *is_moving.shape))
        values[0], values[1] = self.values, np.where(is_moving, following[..., 1] - self.values, 0.0)
        curved = is_moving & (self.interpolation == BEZIER)
        if self.left is None or self.right is None or not curved.any():
            return values[:2], None
        ends = self.points, self.right, np.roll(self.left, -1, axis=1), following
        cubics = bezier_cubics(*(points[curved] for points in ends))
        times[0] = 1.0
        times[:, curved] = cubics[..., 0] * self.rates[np.nonzero(curved)[1]]
        values[1:, curved] = cubics[..., 1]
        return values, times[:, :1] if (times == times[:, :1]).all() else times

    def only(self, channels: Sequence[int]) -> Keys:
        """Return the keys of only these channels."""
        return self._part((channels,))

    def at(self, chosen: np.ndarray) -> Keys:
        """Return the chosen keys, given a mask of shape (n,)."""
        part = self._part((slice(None), chosen))
        return part if self.breakdowns is None else replace(part, breakdowns=self.breakdowns[chosen])

    def _part(self, part: tuple) -> Keys:
        names = ("points", "interpolation", "left", "right", "easing", "automatic")
        arrays = {name: getattr(self, name) for name in names}
        parts = {name: array[part] for name, array in arrays.items() if array is not None}
        settings = None if self.easing_settings is None else self.easing_settings[(slice(None), *part)]
        return replace(self, **parts, easing_settings=settings)

    @property
    def raw(self) -> bytes:
        """All fields as bytes, for a digest that tells whether anything has changed."""
        names = ("points", "interpolation", "left", "right", "easing", "easing_settings", "breakdowns", "automatic")
        present = [array for name in names if (array := getattr(self, name)) is not None]
        header = f"{self.points.shape} {len(present)} {self.linear} {self.cycles};"
        return b"".join((header.encode(), *(array.tobytes() for array in present)))


def cycled(keys: Keys, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return times (m,) folded back into the range of the keys by their Cycles, and whether time runs backwards there.

    Times that no cycle reaches are unchanged.
    """
    return fold(keys, np.asarray(times))[:2]


@np.errstate(all="ignore")
def fold(keys: Keys, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the results of `cycled`, and how many times to add the change from the first to the last key.

    Outside of the keys, the computation is in single precision and in Blender's order of steps, which decides on which
    side of a key a frame falls. Times between the keys are unchanged.
    """
    result, folded = times.astype(np.float64), times.astype(np.float32)
    backwards, rounds = np.zeros(times.shape, dtype=bool), np.zeros(times.shape, np.float32)
    frames = keys.points[0, :, 0]
    if keys.cycles is None or not len(frames) or frames[0] == frames[-1]:
        return result, backwards, rounds
    begin, end = frames[0], frames[-1]
    period = end - begin
    for mode, count, outside, side in (
        (keys.cycles.before, keys.cycles.before_count, folded < begin, -1),
        (keys.cycles.after, keys.cycles.after_count, folded > end, 1),
    ):
        if mode == "NONE":
            continue
        near, far = (begin, end) if side < 0 else (end, begin)
        distance = folded[outside] - near
        cycle = side * distance / period
        reached = (cycle <= count) | (count == 0)
        at = np.flatnonzero(outside)[reached]
        distance, cycle = distance[reached], cycle[reached]
        remainder = np.fmod(distance, period)
        odd = (np.trunc(cycle) % 2 == 1) & (mode == "MIRROR")
        reverse = (np.trunc(cycle.astype(np.float64) + 1.0) % 2 == 1) & (mode == "MIRROR")
        time = np.where(reverse, near - remainder, begin + remainder)
        time = np.where(remainder == 0.0, np.where(odd, far, near), time)
        result[at] = np.where(time < begin, time + period, time)
        backwards[at] = reverse
        if mode == "REPEAT_OFFSET":
            away_from_keys = np.floor if side < 0 else np.ceil
            rounds[at] = away_from_keys(distance / period)
    return result, backwards, rounds
