"""F-curves as arrays: their keys, what their codes mean, and the modifiers that say which frame of them is shown.

Frames and values are Blender's, in its single precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

_EASED = ("BACK", "BOUNCE", "CIRC", "CUBIC", "ELASTIC", "EXPO", "QUAD", "QUART", "QUINT", "SINE")

INTERPOLATIONS = dict(enumerate(("CONSTANT", "LINEAR", "BEZIER", *_EASED)))
"""From the code of `bpy.types.Keyframe.interpolation` to its name."""

CONSTANT, LINEAR, BEZIER, *_ = INTERPOLATIONS
ELASTIC = 3 + _EASED.index("ELASTIC")

EASINGS = dict(enumerate(("AUTO", "EASE_IN", "EASE_OUT", "EASE_IN_OUT")))
"""From the code of `bpy.types.Keyframe.easing` to its name."""

AUTO = 0

CODE = np.uint8
"""The type that Blender keeps codes in: any other takes longer to read."""

KEY_TOLERANCE = float(np.float32(1e-4))
"""Frames from a key within which Blender takes its value."""

LARGEST = 1e30
"""Frames and values from here on are damage. An infinite one that is typed, or set by a script, becomes 3.4e38."""

MAX_COPIES = 2**22
"""The largest number of key times that `cyclic_times` returns."""


@dataclass(frozen=True)
class Stepped:
    """A Stepped modifier with full influence: from `start` to `end` every `step` frames, counted from `offset`, hold.

    Without an end on one side that is infinite.
    """

    step: float
    offset: float
    start: float = -np.inf
    end: float = np.inf


def held(steps: Sequence[Stepped], times: np.ndarray) -> np.ndarray:
    """Return the frames whose values a curve with these modifiers, first to last, has at these times (m,).

    In single precision and in Blender's order of steps: it decides on which side of a key a frame falls. Blender rounds
    towards the offset, so before that a hold shows the frame that it ends on.
    """
    if not steps:
        return times
    result = np.asarray(times).astype(np.float32)
    # Blender asks the last one first.
    for item in reversed(steps):
        step, offset = np.float32(item.step), np.float32(item.offset)
        blocks = np.trunc((result - offset) / step)
        result = np.where((result >= item.start) & (result <= item.end), blocks * step + offset, result)
    return result.astype(np.float64)


@dataclass(frozen=True)
class Cycles:
    """A Cycles modifier. Modes are NONE, REPEAT, REPEAT_OFFSET or MIRROR; a count of 0 is without end."""

    before: str
    after: str
    before_count: int
    after_count: int

    @property
    def without_offset(self) -> Cycles:
        """Those of the difference: it repeats as it is also where the channels go on from where they have come."""
        before, after = (mode.removesuffix("_OFFSET") for mode in (self.before, self.after))
        return replace(self, before=before, after=after)


@dataclass(frozen=True, eq=False)
class Keys:
    """c F-curves that are keyed together: n keys each, on the same frames, with the same extrapolation and cycles.

    Frames and values are in single precision, codes are `INTERPOLATIONS` and `EASINGS`. What does not bear on the
    values of the curves is None.
    """

    points: np.ndarray
    """Frame and value, shape (c, n, 2)."""

    interpolation: np.ndarray
    """Codes of the segments that the keys begin, shape (c, n)."""

    left: np.ndarray | None = None
    """The handles before the keys, frame and value, shape (c, n, 2)."""

    right: np.ndarray | None = None
    """The handles behind the keys, frame and value, shape (c, n, 2)."""

    easing: np.ndarray | None = None
    """Codes, shape (c, n)."""

    easing_settings: np.ndarray | None = None
    """BACK's overshoot, ELASTIC's amplitude and ELASTIC's period in frames, shape (3, c, n)."""

    linear: bool = False
    """True if the curves go on at their slope outside of the keys, instead of holding their value."""

    cycles: Cycles | None = None

    steps: tuple[Stepped, ...] = ()
    """Stepped modifiers, first to last. The values of curves are worked out without: see `held`."""

    breakdowns: np.ndarray | None = None
    """True for the keys of type *Breakdown*, shape (n,), where any is."""

    is_sound: bool = True
    """True if all numbers that were read are smaller than `LARGEST`, and the keys in the order of their frames."""

    @cached_property
    def times(self) -> np.ndarray:
        """Frames of the keys, shape (n,), double precision."""
        return self.points[0, :, 0].astype(np.float64)

    @property
    def values(self) -> np.ndarray:
        """Values of the keys, shape (c, n)."""
        return self.points[..., 1]

    def only(self, channels: Sequence[int]) -> Keys:
        """Return the keys of these channels alone."""
        return self._part((channels,))

    def at(self, chosen: np.ndarray) -> Keys:
        """Return the chosen ones of the keys, by a mask of shape (n,)."""
        part = self._part((slice(None), chosen))
        return part if self.breakdowns is None else replace(part, breakdowns=self.breakdowns[chosen])

    def _part(self, part: tuple) -> Keys:
        arrays = {name: getattr(self, name) for name in ("points", "interpolation", "left", "right", "easing")}
        parts = {name: array[part] for name, array in arrays.items() if array is not None}
        settings = None if self.easing_settings is None else self.easing_settings[(slice(None), *part)]
        return replace(self, **parts, easing_settings=settings)

    @property
    def raw(self) -> bytes:
        """All of it as bytes, for a digest that tells whether anything has changed."""
        arrays = (self.points, self.interpolation, self.left, self.right, self.easing, self.easing_settings)
        arrays += (self.breakdowns,)
        present = [array for array in arrays if array is not None]
        header = f"{self.points.shape} {len(present)} {self.linear} {self.cycles}{self.steps or ''};"
        return b"".join((header.encode(), *(array.tobytes() for array in present)))


class TooManyRounds(ValueError):
    """Cycles that are so short, and so many, that there would be millions of keys."""

    def __init__(self, rounds: float, period: float) -> None:
        super().__init__(rounds, period)
        self.rounds, self.period = rounds, period


def cycled(keys: Keys, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return times folded back into the range of the keys by the curve's cycles.

    Parameters
    ----------
    keys : Keys
        The curve. Without cycles times stay what they are.
    times : array, shape (m,)
        Frames.

    Returns
    -------
    folded : array, shape (m,)
        In the range of the keys, or as they were where no cycle reaches.
    backwards : array of bool, shape (m,)
        Whether time runs backwards there.
    """
    with np.errstate(all="ignore"):
        folded, backwards, _ = fold(keys, np.asarray(times))
    return folded, backwards


def cyclic_times(keys: Keys, times: np.ndarray, first: float, last: float) -> np.ndarray:
    """Return key times and their copies in the curve's cycles.

    Parameters
    ----------
    keys : Keys
        The curve whose cycles count. Times outside the range of its keys are not copied.
    times : array, shape (k,)
        Key times, of this curve or of several.
    first, last : float
        Frames that the times returned are between, both included.

    Returns
    -------
    array, shape (c,)
        Rising, each time once.

    Raises
    ------
    TooManyRounds
        Where there would be more than `MAX_COPIES`.
    """
    times = np.asarray(times, dtype=np.float64)
    copies = [times]
    if keys.cycles is not None and len(keys.times):
        begin, end = keys.times[[0, -1]].tolist()
        period = end - begin
        inside = times[(times >= begin) & (times <= end)]
        for mode, count, length, side in (
            (keys.cycles.before, keys.cycles.before_count, begin - first, -1.0),
            (keys.cycles.after, keys.cycles.after_count, last - end, 1.0),
        ):
            if mode == "NONE" or not (0.0 < period < np.inf and length > 0.0) or count < 0:
                continue
            rounds = np.ceil(length / period)
            rounds = min(rounds, count) if count else rounds
            if rounds * len(inside) > MAX_COPIES:
                raise TooManyRounds(rounds, period)
            number = np.arange(1.0, rounds + 1.0)[:, None]
            mirrored = (number % 2 == 1) & (mode == "MIRROR")
            copies.append((np.where(mirrored, begin + end - inside, inside) + side * number * period).ravel())
    copied = np.unique(np.concatenate(copies))
    return copied[(copied >= first) & (copied <= last)]


def fold(keys: Keys, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times folded, whether they run backwards, and how many times the change from first to
    last key is to be added.

    All in single precision and in Blender's order of steps: it decides on which side of a key a frame falls.
    """
    folded = times.astype(np.float32)
    backwards, rounds = np.zeros(times.shape, dtype=bool), np.zeros(times.shape, np.float32)
    frames = keys.points[0, :, 0]
    if keys.cycles is None or not len(frames) or frames[0] == frames[-1]:
        return folded.astype(np.float64), backwards, rounds
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
        folded[at] = np.where(time < begin, time + period, time)
        backwards[at] = reverse
        if mode == "REPEAT_OFFSET":
            away_from_keys = np.floor if side < 0 else np.ceil
            rounds[at] = away_from_keys(distance / period)
    return folded.astype(np.float64), backwards, rounds
