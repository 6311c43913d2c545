"""Ends of segments: the poses at their keys, their turns, the neighbouring keys, and the poses of each mode.

Arrays are of S segments, one after the other.

A smooth mode looks at the keys next to a segment and, with handles, at how fast the motion passes its keys. The
direction of the tangent at a key is that of the mode, a mean of the twists before and after it. Progress in a segment
comes from the channels, as in other modes, along the segment's chord. The screws on both sides of a key differ in speed
and direction. So the tangent on either side is as long as that screw is along the mean of both, which makes the speed
equal where handles are smooth and the path is straight. On a bent path, progress is corrected by the speed that is
lacking to that of Blender's own in-betweens in that direction. With two keys, or if no handle has an effect, nothing
changes.

Twists (6, S) are along the body's own axes at the key, with a radian counting as one unit of length; segments are along
the last axis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from ...motion import KEYFRAME_MODES, Poses
from ...motion.curves import twist_shares
from ...motion.poses import step_repeated
from ...motion.segments import prepare_within
from .bodies import between, body_poses, location_axes
from .sources import KeyedTransform
from .turning import Turning, needs_turning, turning_of, without_spins

SLOPE_STEP_RATIO = 1.0 / 8.0
"""The fraction of a segment over which slopes are measured: exact for cubics in time, finite for vertical handles."""

SLOPE_WEIGHTS = np.array((18.0, -9.0, 2.0)) / (6.0 * SLOPE_STEP_RATIO)
"""Weights that give the slope at 0 of the cubic through 0 and three values `SLOPE_STEP_RATIO` apart."""

SLOPE_MOMENTS = np.concatenate((np.arange(1, 4) * SLOPE_STEP_RATIO, 1.0 - np.arange(3, 0, -1) * SLOPE_STEP_RATIO))
"""The times in a segment, 0 to 1, at which slopes are measured: next to its first key, and next to its second."""

AT_REST = 1e-9
"""A body that moves and turns by less from key to key is at rest, except for rounding."""

MAX_SLOPE = 3.0
"""The largest slope of progress that is corrected: up to here a cubic between two keys does not turn back.
Source: Fritsch and Carlson, "Monotone piecewise cubic interpolation", 1980."""

MIN_TANGENT_LENGTH = 0.1
"""Shorter tangents count as this long when progress is corrected for them."""

MIN_MEAN_SPEED_RATIO = 0.01
"""The smallest squared mean speed as a fraction of the squared speeds it is made of: if the motion turns back on
itself there is no direction to measure along."""


def with_neighbours(
    times: np.ndarray, keys: Poses, holds: np.ndarray, pairs: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, Poses]:
    """Return frames and poses (S, 4) of the keys around each segment, from those (S, 2) at its ends.

    `pairs` are the adjacent segments found by `meeting`. Without a neighbour, or if a cycle jumps, the motion goes on
    as in the segment; if the neighbour holds, it rests.
    """
    rows = packed(keys)
    previous, following = packed(step_repeated(keys[:, 0], keys[:, 1])), packed(step_repeated(keys[:, 1], keys[:, 0]))
    # Segments between two keys on one frame are empty, and the segments on either side meet there.
    lasts = times[:, 1] > times[:, 0]
    duration = np.where(lasts, times[:, 1] - times[:, 0], 1.0)
    left, right = pairs
    previous[right] = np.where(holds[left, None], rows[right, 0], rows[left, 0])
    following[left] = np.where(holds[right, None], rows[left, 1], rows[right, 1])
    before, behind = duration.copy(), duration.copy()
    before[right], behind[left] = duration[left], duration[right]
    start, end = times[:, 0], np.where(lasts, times[:, 1], times[:, 0] + duration)
    four = np.stack((previous, rows[:, 0], rows[:, 1], following), axis=1)
    return (
        np.stack((start - before, start, end, end + behind), axis=1),
        Poses(four[..., :3], four[..., 3:7], None if keys.scales is None else four[..., 7]),
    )


def spins_of_neighbours(
    signs: np.ndarray, spins: np.ndarray, around: Poses, holds: np.ndarray, pairs: tuple[np.ndarray, np.ndarray]
) -> tuple[Poses, np.ndarray]:
    """Return `with_neighbours` with spins: the keys (S, 4) with signs that say which way round segments turn, and the
    angular velocities (3, 2, S, 3) that spins add at both ends of the three segments between them.

    Takes the signs (S,) and velocities (3, 2, S) of the segments.
    """
    quaternions = around.quaternions.copy()
    # A segment without a neighbour continues its own motion.
    steps = signs[:, None].repeat(3, axis=1)
    beside = np.stack((spins[:, [0, 0]], spins, spins[:, [1, 1]]), axis=3)
    left, right = pairs
    for segments, others, side in ((right, left, 0), (left, right, 2)):
        steps[segments, side] = np.where(holds[others], 1.0, signs[others])
        beside[:, :, segments, side] = np.where(holds[others], 0.0, spins[:, :, others])
    quaternions[:, 1:] *= np.cumprod(steps, axis=1)[..., None]
    return Poses(around.positions, quaternions, around.scales), beside


def meeting(owners: np.ndarray, times: np.ndarray, keys: Poses) -> tuple[np.ndarray, np.ndarray]:
    """Return the segments (p,) before and after each key where two segments meet with the same pose."""
    rows, lasts = packed(keys), np.flatnonzero(times[:, 1] > times[:, 0])
    left, right = lasts[:-1], lasts[1:]
    meet = (owners[right] == owners[left]) & np.all(rows[right, 0] == rows[left, 1], axis=1)
    return left[meet], right[meet]


def packed(poses: Poses) -> np.ndarray:
    """Return positions, quaternions and scales in one array (..., 7 or 8)."""
    scales = () if poses.scales is None else (poses.scales[..., None],)
    return np.concatenate((poses.positions, poses.quaternions, *scales), axis=-1)


def native_twists(keys: Poses, measured: Poses) -> np.ndarray:
    """Return Blender's own twists at both ends, and the growth of log scale, shape (2, 7, S), in unit time.

    Takes the poses at both keys (S, 2) and those of Blender's own in-betweens at the moments `SLOPE_MOMENTS` (S, 6).
    """
    count = len(keys.positions)
    ends = keys[np.arange(count).repeat(6), np.tile((0, 0, 0, 1, 1, 1), count)]
    scales = None if measured.scales is None else measured.scales.ravel()
    flat = Poses(measured.positions.reshape(-1, 3), measured.quaternions.reshape(-1, 4), scales)
    result = between(ends, flat).reshape(7, -1, 6)
    return np.stack((result[..., :3] @ SLOPE_WEIGHTS, -(result[..., :2:-1] @ SLOPE_WEIGHTS)))


def tangents_and_lacks(
    slopes: np.ndarray,
    native: np.ndarray,
    screws: np.ndarray,
    times: np.ndarray,
    pairs: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lengths of tangents at both ends of S segments, and the slopes that progress lacks there, (2, S) each.

    Takes the slopes of progress (2, S) and, as (2, 7, S), Blender's own twists and those from key to key, at both ends
    in unit time. The growth of log scale counts only if nothing else changes. `pairs` are the segments before and after
    each shared key (p,); at other ends tangents are 1 and no slope is lacking.
    """
    tangents, lacks = np.ones(slopes.shape), np.zeros(slopes.shape)
    durations = times[:, 1] - times[:, 0]
    speeds = screws / np.where(durations > 0.0, durations, np.inf)
    before, after = pairs
    moves = np.abs(np.stack((screws[1][:6, before], screws[0][:6, after]))).max(axis=(0, 1), initial=0.0) > AT_REST
    counting = np.ones((7, len(before)))
    counting[6] = ~moves
    of_before, of_after = (counting * speeds[side][:, pairs[1 - side]] for side in (1, 0))
    share = twist_shares(durations[before], durations[after])
    parts = share * of_before, (1.0 - share) * of_after
    mean = parts[0] + parts[1]
    squared = np.maximum(_dot(mean, mean), MIN_MEAN_SPEED_RATIO * sum(_dot(part, part) for part in parts))
    for side, segments, of_side, alone in ((1, before, of_before, share == 1.0), (0, after, of_after, share == 0.0)):
        length = _ratio(_dot(of_side, mean), squared)
        speed = _ratio(_dot(counting * native[side][:, segments], mean), durations[segments] * squared)
        slope = speed / np.copysign(np.maximum(np.abs(length), MIN_TANGENT_LENGTH), length)
        tangents[side, segments] = length
        lack = np.clip(slope, -MAX_SLOPE, MAX_SLOPE) - np.clip(slopes[side, segments], -MAX_SLOPE, MAX_SLOPE)
        lacks[side, segments] = np.where(alone, 0.0, lack)
    return tangents, lacks


def corrected(progress: np.ndarray, elapsed: np.ndarray, lacks: np.ndarray) -> np.ndarray:
    """Return progress (m,) plus the slopes that it lacks (2, m) at both ends, at times from 0 to 1 in its segment."""
    left = 1.0 - elapsed
    added = elapsed * left * (left * lacks[0] - elapsed * lacks[1])
    return np.where((elapsed > 0.0) & (left > 0.0), progress + added, progress)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("rs,rs->s", a, b)


def _ratio(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a / b, 0 where b is 0."""
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0.0)


@dataclass(frozen=True, eq=False)
class Ends:
    """The ends of S segments of several sources, including the objects' own delta transforms."""

    owners: np.ndarray
    """The index of the source of each segment, shape (S,)."""

    times: np.ndarray
    """The frames of both keys, shape (S, 2)."""

    keys: Poses
    """The poses at both keys, shape (S, 2)."""

    axes: np.ndarray | None
    """The axes that location runs along, as columns in the axes of the poses, (S, 3, 3); None if both are the same."""

    original: np.ndarray
    """The objects' own delta transforms, shape (10, S)."""

    pairs: tuple[np.ndarray, np.ndarray] | None = None
    """For smooth modes, the segments before and after each key where two segments meet."""

    around: tuple[np.ndarray, Poses] | None = None
    """For smooth modes, frames and poses of the four keys around each segment, shape (S, 4)."""

    turning: Turning | None = None
    """The turning of the segments, None if all of them turn the shortest way."""

    whole: Turning | None = None
    """For smooth modes, the turning in whole turns only."""

    spins: np.ndarray | None = None
    """For smooth modes, the velocities that spins add at both ends of the three segments around, shape (3, 2, S, 3)."""

    tangents: np.ndarray | None = None
    """The lengths of the tangents of smooth modes at both keys, shape (2, S); None if all are 1."""

    prepared: dict[str, Callable[..., Poses]] = field(default_factory=dict)
    """The pose functions of the modes used so far, each for all segments."""

    @classmethod
    def of(
        cls, start: np.ndarray, end: np.ndarray, segments: list[tuple[KeyedTransform, slice]], smooth: np.ndarray
    ) -> Ends:
        """Return the ends of segments with these channels (10, S) at each end; `smooth` marks those of smooth modes."""
        sources = [source for source, _ in segments]
        owners = np.repeat(np.arange(len(sources)), [span.stop - span.start for _, span in segments])
        firsts, lasts = ([source.key_frames[part] for source in sources] for part in (slice(-1), slice(1, None)))
        times = np.stack((np.concatenate(firsts), np.concatenate(lasts)), axis=1)
        original = np.stack([source.original for source in sources], axis=1)[:, owners]
        axes = location_axes(sources, owners)
        keys = body_poses(np.stack((start, end), axis=2), original[..., None], axes, sources[0])
        turned = whole = None
        if any(map(needs_turning, sources)):
            turned, whole = turning_of(sources, start, end, keys, original)
        ends = cls(owners, times, keys, axes, original, turning=turned, whole=whole)
        if not smooth.any():
            return ends
        holds, pairs = np.concatenate([source.holds for source in sources]), meeting(owners, times, keys)
        (frames, around), spins = with_neighbours(times, keys, holds, pairs), None
        if whole is not None:
            signs = np.where(np.einsum("si,si->s", whole.second, keys.quaternions[:, 1]) < 0.0, -1.0, 1.0)
            around, spins = spins_of_neighbours(signs, whole.twists, around, holds, pairs)
        return replace(ends, pairs=pairs, around=(frames, around), spins=spins)

    @cached_property
    def screws(self) -> np.ndarray:
        """The twists from key to key with spins, at both ends, and the growths of log scale, (2, 7, S)."""
        first, second = self.keys[:, 0], self.keys[:, 1]
        turned = second.quaternions if self.whole is None else self.whole.second
        second = replace(second, quaternions=turned)
        screws = np.stack(2 * (between(first, second, shortest=self.whole is None),))
        if self.whole is not None:
            screws[:, :3] += np.moveaxis(self.whole.twists, 1, 0)
        return screws

    def at_keys(
        self, progress: np.ndarray, measured: np.ndarray, source: KeyedTransform
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return `tangents_and_lacks`, from progress (S, 6) and channels (., S, 6) at the moments `SLOPE_MOMENTS`."""
        slopes = np.stack((progress[:, :3] @ SLOPE_WEIGHTS, (1.0 - progress[:, :2:-1]) @ SLOPE_WEIGHTS))
        poses = body_poses(measured, self.original[..., None], self.axes, source)
        if self.whole is not None:
            # Angles turn by spins, too. These are known, and the rest is less than half a turn.
            poses = without_spins(poses, self.whole.by_angles, progress)
        native = native_twists(self.keys, poses)
        assert self.pairs is not None
        if self.whole is not None:
            native[:, :3] += slopes[:, None] * np.moveaxis(self.whole.twists, 1, 0)
        return tangents_and_lacks(slopes, native, self.screws, self.times, self.pairs)

    def poses(self, counts: np.ndarray, progress: np.ndarray, mode: str) -> Poses:
        """Return the poses of a mode in the segments, for samples with this progress (m,), numbering `counts` (S,).

        Positions are along the body's own axes at rest.
        """
        if mode not in self.prepared:
            self.prepared[mode] = self._prepare(mode)
        is_smooth = KEYFRAME_MODES[mode].is_smooth
        # The middle one of the three segments between four keys.
        of_each = np.multiply.outer(counts, (0, 1, 0)).ravel() if is_smooth else counts
        poses = self.prepared[mode](of_each, progress, slice(0, len(of_each)))
        turning = self.whole if is_smooth else self.turning
        return poses if turning is None else turning.spins.add_to(poses, counts, progress)

    def _prepare(self, mode: str) -> Callable[..., Poses]:
        curves: Callable[..., Any] = KEYFRAME_MODES[mode].curves
        if KEYFRAME_MODES[mode].is_smooth:
            assert self.around is not None
            times, keys = self.around
            tangents = None if self.tangents is None else self.tangents[..., None]
            curves = partial(curves, tangents=tangents, spins=self.spins)
        else:
            times, keys = np.broadcast_to((0.0, 1.0), self.times.shape), self.keys
            if self.turning is not None:
                keys = replace(keys, quaternions=np.stack((self.turning.first, self.turning.second), axis=1))
        return prepare_within(curves, times, keys, is_aligned=self.turning is not None)
