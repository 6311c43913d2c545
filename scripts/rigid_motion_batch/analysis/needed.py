"""Keys needed: how few keys each mode needs to be as good as the reference with many evenly spaced keys.

"As good" means the same RMS shell error over the same samples. The reference keeps keys at the rates of the paper's
table. The other modes keep evenly spaced keys too, or the keys that `reduce_keys` finds, or fewer keys that `fit_keys`
has moved: fitted keys are not samples, but have as many numbers. The same numbers are the points of the curve of error
against keys per second. Errors are in metres.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from operator import itemgetter
from typing import Any, Self, cast

import numpy as np

from rigid_motion.motion import decimate, fit_keys, interpolate, reduce_keys, reduce_skeleton_keys, rms, shell_error
from rigid_motion_batch.recordings.clips import Clip

from .choices import Keys, Uniform
from .metrics import MAX_ROUNDING_M, geometric_mean
from .modes import REFERENCE
from .reconstructions import Reconstruction, same_motions

RATES = ("30", "20", "15", "12", "8", "5")
"""Keys per second of the reference."""

TABLE_RATES = RATES[:4]
"""The rates of the paper's table; the lower ones extend the curve."""

DECIMATIONS = ("uniform", "adaptive", "fitted")
"""The ways to have fewer keys; the last is not always tried."""

MAX_FITS = 3
"""The maximum number of fits in the search for the fewest fitted keys."""

KEY_COUNT_PRECISION_RATIO = 0.02
"""The search for the number of key poses ends at this relative precision: every step reduces keys anew."""


@dataclass(frozen=True)
class NeededRow:
    """A row of keys_needed.csv. The last four fields are None if every sample would be needed."""

    clip: str
    mode: str
    decimation: str
    as_good_as_hz: str
    wanted_rms_shell_m: float
    keys: int | None
    keys_per_s: float | None
    share: float | None
    rms_shell_m: float | None


@dataclass(frozen=True, eq=False)
class KeysNeeded:
    """The keys needed on one clip. The axes are groups of modes, decimations and rates, in the order of the fields."""

    clip: str

    groups: tuple[tuple[str, ...], ...]
    """The modes, grouped by the motion that they give on this clip."""

    rates: tuple[str, ...]
    """Keys per second of the reference."""

    durations: np.ndarray
    """Seconds from the first key of the reference to the last, shape (rates,). NaN if the reference lacks two keys."""

    reference_keys: np.ndarray
    """The number of keys of the reference, shape (rates,)."""

    targets: np.ndarray
    """The RMS shell error of the reference, shape (rates,)."""

    keys: np.ndarray
    """The keys needed, shape (groups, decimations, rates).

    Infinite if only all samples are as good as the reference. NaN if the reference has no error to match: if it lacks
    two keys, or every sample is a key.
    """

    reached: np.ndarray
    """The RMS shell error with these keys, shaped like `keys`."""

    uniform_errors: np.ndarray
    """The RMS shell error with the same evenly spaced keys as the reference, shape (groups, rates)."""

    reference: str = REFERENCE
    """The mode that sets the error to match."""

    @property
    def reference_keys_per_s(self) -> np.ndarray:
        """The actual keys per second of the reference, shape (rates,)."""
        return (self.reference_keys - 1.0) / self.durations

    @property
    def shares(self) -> np.ndarray:
        """The keys as a fraction of the reference's keys, shaped like `keys`."""
        return self.keys / self.reference_keys

    @property
    def keys_per_s(self) -> np.ndarray:
        """The average keys per second, shaped like `keys`: all keys but the first, divided by the duration."""
        return (self.keys - 1.0) / self.durations


@dataclass(frozen=True, eq=False)
class Ways:
    """The ways to have fewer keys on a clip, and how good they are. All errors are RMS shell errors in metres.

    Keys of a single rigid body are where the motion needs them, or moved to where they fit best. Keys of a whole body
    are key poses, the same samples for all joints: either the keys that `reduce_skeleton_keys` finds, which keep the
    largest error small, or evenly spaced keys if these are better. The number of key poses is searched for.
    """

    clip: Clip

    radius: float | np.ndarray
    """The radius of a rigid body's shell, or of the balls at the joints, in metres: one value, or shape (joints,)."""

    fit: bool = False
    """Whether to find fitted keys of a rigid body too, which takes two to three times as long."""

    @property
    def decimations(self) -> tuple[str, ...]:
        """The members of `DECIMATIONS` that are tried."""
        return DECIMATIONS if self.fit else DECIMATIONS[:2]

    def by_motion(self, mode: str, target: float, evenly: int) -> list[tuple[np.ndarray, float]]:
        """Return keys and their error for each way but even spacing; `evenly` is the number of keys that it needs."""
        if self.clip.rest_body:
            return [self._key_poses(mode, target, evenly)]
        adaptive = self._reduced(mode, target)
        result = [(adaptive, self.error(adaptive, mode))]
        return [*result, self._fewest_fitted(mode, target, *result[0])] if self.fit else result

    def between(self, first: int, last: int) -> Self:
        """Return the same ways for the part of the clip from one sample to another."""
        return replace(self, clip=part_of(self.clip, first, last))

    def error(self, keys: np.ndarray, mode: str) -> float:
        """Return the error of a mode with these samples as keys of all joints."""
        radii = np.broadcast_to(np.asarray(self.radius, dtype=float), (self.clip.joints,))
        made = Reconstruction(self.clip, Uniform("1"), {mode: (keys,) * len(radii)}, radii, shared=True)
        return rms(made.shell(mode))

    def _key_poses(self, mode: str, target: float, evenly: int) -> tuple[np.ndarray, float]:
        """Return the fewest key poses within the target, and their error. The search starts at the number `evenly`."""
        samples = len(self.clip.times)
        best_of = cache(lambda budget: self._best_of(budget, mode))
        start = min(evenly, samples)
        return best_of(
            fewest(
                lambda budget: best_of(budget)[1] <= target, start, samples, too_few=1, near=KEY_COUNT_PRECISION_RATIO
            )
        )

    def _best_of(self, budget: int, mode: str) -> tuple[np.ndarray, float]:
        """Return at most `budget` key poses, and their error."""
        clip, budget = self.clip, max(budget, 2)
        if budget >= len(clip.times):
            every = np.arange(len(clip.times))
            return every, self.error(every, mode)
        radius, parents = self.radius / clip.metres_per_unit, clip.whole_body.parents
        result = reduce_skeleton_keys(clip.times, clip.poses, parents, mode, radius=radius, budget=budget, shared=True)
        keys = max(cast(Keys, result), key=len)
        # Keys that minimize the largest error may have a larger RMS error than evenly spaced keys.
        evenly = evenly_spaced(clip, budget - 1)
        return min(((some, self.error(some, mode)) for some in (keys, evenly)), key=itemgetter(1))

    def _reduced(self, mode: str, target: float) -> np.ndarray:
        clip, scale = self.clip, self.clip.metres_per_unit
        return reduce_keys(clip.times, clip.poses, mode, target / scale, float(np.max(self.radius)) / scale, rms=True)

    def _fewest_fitted(
        self, mode: str, target: float, adaptive: np.ndarray, reached: float
    ) -> tuple[np.ndarray, float]:
        """Return the fewest keys that are within the target when fitted, and their error.

        The search starts from the adaptive keys, which reach the error `reached` without fitting.
        """
        clip, best, keys, aim = self.clip, adaptive, adaptive, target
        for number in range(MAX_FITS):
            if number:
                keys = self._reduced(mode, aim)
            fitted = fit_keys(clip.times, clip.poses, keys, mode, float(np.max(self.radius)) / clip.metres_per_unit)
            filled = interpolate(clip.times[keys], fitted, clip.times, mode)
            error = rms(shell_error(clip.in_metres(filled), clip.in_metres(clip.poses), self.radius))
            if error <= target and len(keys) <= len(best):
                best, reached = keys, error
            if error <= MAX_ROUNDING_M:
                break
            aim *= target / error
        return best, reached


def keys_needed(
    ways: Ways,
    modes: Iterable[str],
    reference: str = REFERENCE,
    *,
    advance: Callable[[], object] = lambda: None,
) -> KeysNeeded:
    """Find the keys that each mode needs on a clip.

    Parameters
    ----------
    ways : Ways
        The clip, and the ways to have fewer keys of it.
    modes : iterable of str
    reference : str
        The mode that sets the error to match.
    advance : callable
        Called once for each of `RATES`.

    Notes
    -----
    The adaptive keys begin and end at the ends of the reference's keys. The number of evenly spaced keys is found by
    bisection, as if the error fell with every key: the result is as good as the reference, and one key fewer is not.
    """
    clip, groups = ways.clip, same_motions(ways.clip, tuple(modes))
    shape = len(groups), len(ways.decimations), len(RATES)
    keys, reached = np.full(shape, np.nan), np.full(shape, np.nan)
    durations, reference_keys, targets = np.full((3, len(RATES)), np.nan)
    errors = np.full((len(groups), len(RATES)), np.nan)
    for place, rate in enumerate(RATES):
        kept = decimate(clip.times, float(rate))
        stretch = ways.between(int(kept[0]), int(kept[-1]))
        times, kept = stretch.clip.times, kept - kept[0]
        if len(kept) >= 2:
            durations[place] = times[-1] - times[0]
            reference_keys[place] = len(kept)
            targets[place] = stretch.error(kept, reference)
            errors[:, place] = [stretch.error(kept, group[0]) for group in groups]
        if targets[place] > MAX_ROUNDING_M:
            for row, group in enumerate(groups):
                evenly = kept if reference in group else _fewest_evenly(stretch, group[0], targets[place], kept)
                result = [(evenly, stretch.error(evenly, group[0]))]
                result += stretch.by_motion(group[0], targets[place], len(evenly))
                for column, (own, error) in enumerate(result):
                    keys[row, column, place] = np.inf if len(own) == len(times) else len(own)
                    reached[row, column, place] = error
        advance()
    return KeysNeeded(clip.name, groups, RATES, durations, reference_keys, targets, keys, reached, errors, reference)


def evenly_spaced(clip: Clip, segments: int) -> np.ndarray:
    """Return the samples nearest to the ends of that many segments of equal duration, from first sample to last."""
    return decimate(clip.times, segments / float(clip.times[-1] - clip.times[0]))


def _fewest_evenly(ways: Ways, mode: str, target: float, start: np.ndarray) -> np.ndarray:
    """Return the fewest evenly spaced keys with which a mode is within the target, searched from `len(start)` keys."""

    def good(segments: int) -> bool:
        return ways.error(evenly_spaced(ways.clip, segments), mode) <= target

    # Ticks at twice the number of samples make every sample a key, which is always good.
    return evenly_spaced(ways.clip, fewest(good, len(start) - 1, 2 * len(ways.clip.times)))


def fewest(is_enough: Callable[[int], bool], start: int, most: int, *, too_few: int = 0, near: float = 0.0) -> int:
    """Return the least number that is enough, to a relative precision, as if all above were; `most` always is."""
    enough = start
    while enough < most and not is_enough(enough):
        too_few, enough = enough, min(2 * enough, most)
    while enough - too_few > max(1, near * enough):
        middle = (enough + too_few) // 2
        if is_enough(middle):
            enough = middle
        else:
            too_few = middle
    return enough


def part_of(clip: Clip, first: int, last: int) -> Clip:
    """Return the part of a clip from one sample to another, both included."""
    part = slice(first, last + 1)
    return replace(clip, times=clip.times[part], poses=clip.poses[..., part])


# -- over all clips ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Overall:
    """Geometric means over clips. The axes are groups of modes, decimations and rates."""

    groups: tuple[tuple[str, ...], ...]
    """The modes, grouped by the motion that they give on every clip."""

    rates: tuple[str, ...]

    clips: np.ndarray
    """The number of clips in each mean, those that reached the error, shape (groups, decimations, rates)."""

    asked: np.ndarray
    """The number of clips on which the reference had an error, shape (rates,)."""

    keys_per_s: np.ndarray
    """Shape (groups, decimations, rates), NaN if no clip counts."""

    shares: np.ndarray
    """Fractions of the reference's keys, shape (groups, decimations, rates)."""

    reached: np.ndarray
    """The RMS shell error, shape (groups, decimations, rates)."""

    reference_keys_per_s: np.ndarray
    """Shape (rates,)."""

    uniform_errors: np.ndarray
    """The RMS shell error with as many evenly spaced keys per second as the reference, shape (groups, rates)."""


def overall(clips: Sequence[KeysNeeded]) -> Overall:
    """Return the geometric means over the clips of one run, at least one clip."""
    modes = [mode for group in clips[0].groups for mode in group]
    places = {mode: tuple(_place(clip, mode) for clip in clips) for mode in modes}
    groups = tuple(tuple(mode for mode in modes if places[mode] == same) for same in dict.fromkeys(places.values()))
    rows = [[_place(clip, group[0]) for group in groups] for clip in clips]
    keys = np.stack([clip.keys[row] for clip, row in zip(clips, rows, strict=True)])
    there = np.isfinite(keys)

    def mean(values: Callable[[KeysNeeded], np.ndarray], counted: np.ndarray) -> np.ndarray:
        of_clips = np.stack([values(clip)[row] for clip, row in zip(clips, rows, strict=True)])
        return geometric_mean(np.where(counted, of_clips, np.nan))

    return Overall(
        groups=groups,
        rates=clips[0].rates,
        clips=there.sum(axis=0),
        asked=(~np.isnan(keys)).sum(axis=0)[0, 0],
        keys_per_s=mean(lambda clip: clip.keys_per_s, there),
        shares=mean(lambda clip: clip.shares, there),
        reached=mean(lambda clip: clip.reached, there),
        reference_keys_per_s=geometric_mean(np.stack([clip.reference_keys_per_s for clip in clips])),
        uniform_errors=mean(lambda clip: clip.uniform_errors, ~np.isnan(keys[:, :, 0])),
    )


def _place(clip: KeysNeeded, mode: str) -> int:
    """Return the index of the group of the clip that contains a mode."""
    return next(place for place, group in enumerate(clip.groups) if mode in group)


# -- keys_needed.csv --------------------------------------------------------------------------------------------------


def rows_of(clip: KeysNeeded) -> Iterator[NeededRow]:
    """Yield a row for every mode, decimation and rate, except where the reference has no error to match."""
    for group, decimation, rate in np.argwhere(~np.isnan(clip.keys)).tolist():
        at = group, decimation, rate
        result: list[Any] = [None] * 4
        if np.isfinite(clip.keys[at]):
            result = [
                int(clip.keys[at]),
                *(float(values[at]) for values in (clip.keys_per_s, clip.shares, clip.reached)),
            ]
        for mode in clip.groups[group]:
            yield NeededRow(
                clip.clip, mode, DECIMATIONS[decimation], clip.rates[rate], float(clip.targets[rate]), *result
            )
