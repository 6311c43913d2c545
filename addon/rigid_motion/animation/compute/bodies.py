"""From channels to rows of values, to the poses of a body, and back to what the channels differ by.

Values are rows of components, each of many sources behind the other. Progress in a segment is the share of the chord
over all channels, a radian counting as much as a unit of length. Where no channel changes, and the body makes whole
turns all the same, it is what the interpolation of the keys says.

For an NLA strip that has less than full influence, with nothing below it, Blender blends each property with its default
by itself: the channels that are keyed, and the delta transforms beside them. Both together are then not what the same
strip would show with real keys. So delta transforms get those values that, blended likewise, are what is lacking.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import itemgetter

import numpy as np

from ...motion import Poses
from ...motion.eulers import extrinsic_eulers_from_quaternions, quaternions_from_extrinsic_eulers
from ...motion.quaternions import conjugate, multiply, normalise
from ...motion.segments import STILL
from ..curves.evaluation import evaluate
from ..curves.keys import Keys
from .components import LOCATION, PART_OF, REST, ROTATION, ROWS, SCALE
from .sources import FULL_TURN, SAME_FRAME, Source, each, sampled

LEAST = 1e-3
"""The influence below which nothing is to be seen of a strip, and that is not made up for."""


def channels_at_ends(
    segments: list[tuple[Source, slice]], *, unit_elastic: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Return the channels' own values where each segment starts and where it ends, rows as `sampled` has them."""
    sources = [source for source, _ in segments]
    keys = each(sources, (len(source.key_frames) for source in sources))
    rows = sampled(keys, [source.key_frames for source in sources], unit_elastic=unit_elastic)
    begins = np.delete(np.arange(rows.shape[1]), [span.stop - 1 for _, span in keys])
    start, end = rows[:, begins], rows[:, begins + 1]
    for source, span in segments:
        for keyed_rows, channels in source.channels:
            if channels.cycles is None:
                continue
            # A cycle whose ends differ jumps: one round ends on its last value, the next starts on its first.
            jumps = _jumps(channels, source.key_frames)
            for row, values in zip(keyed_rows, channels.values, strict=True):
                start[row, span][jumps[:-1]], end[row, span][jumps[1:]] = values[0], values[-1]
    return start, end


def filled_height(sources: Sequence[Source]) -> int:
    """Return how many of them for what is filled in."""
    return ROWS[SCALE].stop if sources[0].uniform_scale else ROWS[ROTATION].stop


def _jumps(keys: Keys, times: np.ndarray) -> np.ndarray:
    """Return at which of these times a cyclic channel goes from its last value to its first, shape (n,)."""
    cycles = keys.cycles
    first, last = keys.times[[0, -1]]
    if cycles is None or first == last:
        return np.zeros(times.shape, dtype=bool)
    rounds = (times - first) / (last - first)
    whole = np.rint(rounds)
    after = (whole >= 1) & (cycles.after == "REPEAT") & ((whole <= cycles.after_count) | (cycles.after_count == 0))
    before = (whole <= 0) & (cycles.before == "REPEAT") & ((whole > -cycles.before_count) | (cycles.before_count == 0))
    return (np.abs(rounds - whole) * (last - first) < SAME_FRAME) & (after | before)


def progress_weights(start: np.ndarray, end: np.ndarray, order: str | None) -> tuple[np.ndarray, np.ndarray]:
    """Return what the progress in S segments is made of: weights of channels (10, S), and what to take off, (S,)."""
    chord = end - start
    weights = chord.copy()
    if order is None:
        # A unit quaternion moves by half of the angle that the object turns.
        weights[ROWS[ROTATION]] *= 4.0
    total = np.einsum("rs,rs->s", weights, chord)
    weights /= np.where(total > STILL**2, total, np.inf)
    return weights, np.einsum("rs,rs->s", weights, start)


def are_idle(weights: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Return which segments turn although no channel changes, by the weights (., S) of their progress, (S,)."""
    return (turns != 0) & ~weights.any(axis=0)


def idle_progress(source: Source, frames: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Return how far segments have come on frames (m,) where no channel changes: by the interpolation of their keys.

    `first` and `last` are the frames that each runs between, (m,). It is that of a value with the same keys, which
    goes up by one from each to the next, and rests at a key where handles are: those of the first channel that turns.
    """
    turning = [
        (row, keys.only([index]))
        for rows, keys in source.channels
        for index, row in enumerate(rows)
        if PART_OF[row] == ROTATION
    ]
    _, keys = min(turning, key=itemgetter(0), default=(0, source.curves[0].only([0])))
    begin, at, end = evaluate([_counting(keys)] * 3, [first, frames, last])
    way, duration = end - begin, np.where(last > first, last - first, np.inf)
    counted = np.divide(at - begin, way, out=np.zeros_like(at), where=way != 0.0)
    return np.where(way != 0.0, counted, (frames - first) / duration)[0]


def _counting(keys: Keys) -> Keys:
    """Return the curve with the frames and interpolations of these keys, and their numbers for values."""
    numbers = np.arange(len(keys.times), dtype=np.float32)

    def numbered(points: np.ndarray | None) -> np.ndarray | None:
        if points is None:
            return None
        points = points.copy()
        points[0, :, 1] = numbers
        return points

    cycles = keys.cycles
    if cycles is not None:
        before, after = ("REPEAT_OFFSET" if mode == "REPEAT" else mode for mode in (cycles.before, cycles.after))
        cycles = replace(cycles, before=before, after=after)
    return replace(
        keys, points=numbered(keys.points), left=numbered(keys.left), right=numbered(keys.right), cycles=cycles
    )


def turn_into_quaternions(rows: np.ndarray, order: str | None) -> None:
    """Put unit quaternions in place of what the channels (10, m) turn by."""
    if order is not None:
        rows[ROWS[ROTATION]] = quaternions_from_extrinsic_eulers(rows[3:6].T, order).T
        return
    quaternions = rows[ROWS[ROTATION]]
    lengths = np.sqrt(np.einsum("rm,rm->m", quaternions, quaternions))
    if not lengths.all():
        # Blender turns by half a turn about x where a quaternion has no length.
        quaternions[1, lengths == 0.0] = lengths[lengths == 0.0] = 1.0
    quaternions /= lengths


def body_poses(rows: np.ndarray, original: np.ndarray, axes: np.ndarray | None, source: Source) -> Poses:
    """Return the poses (S, k) of S segments that channels (., S, k) give.

    With the objects' own delta transforms (10, S, 1), and along the axes (S, 3, 3) that location has.
    """
    flat = rows.reshape(len(rows), -1).copy()
    turn_into_quaternions(flat, source.order)
    rows = flat.reshape(rows.shape)
    positions = np.moveaxis(rows[ROWS[LOCATION]] + original[ROWS[LOCATION]], 0, -1)
    return Poses(
        positions if axes is None else np.einsum("sij,skj->ski", axes, positions),
        multiply(np.moveaxis(original[ROWS[ROTATION]], 0, -1), np.moveaxis(rows[ROWS[ROTATION]], 0, -1)),
        rows[7] if source.uniform_scale else None,
    )


def differ(poses: Poses, native: np.ndarray, delta: np.ndarray) -> None:
    """Set deltas (., m) to what takes Blender's in-betweens (., m), which may be in their place, to these poses."""
    np.subtract(poses.positions.T, native[ROWS[LOCATION]], out=delta[ROWS[LOCATION]])
    multiply(poses.quaternions, conjugate(native[ROWS[ROTATION]].T), out=delta[ROWS[ROTATION]].T)
    if poses.scales is not None:
        scale = native[ROWS[SCALE]]
        delta[ROWS[SCALE]] = np.divide(poses.scales, scale, out=np.ones_like(scale), where=scale != 0.0)


def location_axes(sources: Sequence[Source], owners: np.ndarray) -> np.ndarray | None:
    """Return the axes that the location of each segment runs along, (S, 3, 3), None where all have their own."""
    if all(source.location_axes is None for source in sources):
        return None
    same = np.eye(3)
    return np.stack([same if (axes := source.location_axes) is None else axes for source in sources])[owners]


def take_off(delta: np.ndarray, original: np.ndarray) -> None:
    """Leave of differences (., m) what comes on top of the original one, in place."""
    delta[ROWS[LOCATION]] -= original[ROWS[LOCATION], None]
    inverse = original[ROWS[ROTATION]] * (1.0, -1.0, -1.0, -1.0)
    delta[ROWS[ROTATION]] = multiply(delta[ROWS[ROTATION]].T, inverse).T
    if len(delta) > ROWS[SCALE].start:
        delta[ROWS[SCALE]] /= np.where(original[ROWS[SCALE]] == 0.0, 1.0, original[ROWS[SCALE]])[:, None]


def align(quaternions: np.ndarray, starts: Sequence[int]) -> None:
    """Take quaternions (4, m) with that sign in which they are nearer to the one before, from each of the starts on.

    On a key the difference is the same rotation as between keys, but where the channels have gone the long way round
    not the same quaternion: straight from one to the other it would pass zero.
    """
    turned = np.einsum("km,km->m", quaternions[:, 1:], quaternions[:, :-1]) < 0.0
    turned[[start - 1 for start in starts if start]] = False
    if turned.any():
        flips = np.concatenate(((0,), np.cumsum(turned)))
        lengths = np.diff((*starts, quaternions.shape[1]))
        odd = (flips - np.repeat(flips[list(starts)], lengths)) % 2 == 1
        np.negative(quaternions, out=quaternions, where=odd)


def influence_at(source: Source, frames: np.ndarray) -> np.ndarray:
    """Return the influence of the strip on frames (m,) of the Action."""
    at, values = np.array(source.influence).T
    return np.interp(frames, at, values)


def blended(source: Source, frames: np.ndarray, native: np.ndarray, delta: np.ndarray) -> None:
    """Turn differences (., m), rotations as quaternions, into those that hold where a strip has its influence.

    For Euler angles they are what `undo_blending` takes afterwards. `native` is what the channels have, shape (., m).
    """
    influence = influence_at(source, frames)
    some = (influence > LEAST) & (influence < 1.0)
    if not some.any():
        return
    # What is blended has a sign that counts.
    delta[ROWS[ROTATION]] *= np.where(delta[ROWS[ROTATION].start] < 0.0, -1.0, 1.0)
    v, turns = influence[some], delta[ROWS[ROTATION]][:, some].T
    if source.order is None:
        channels = native[ROWS[ROTATION]][:, some].T
        desired = multiply(turns, normalise(channels))
        desired = np.where(np.einsum("mi,mi->m", desired, channels)[:, None] < 0.0, -desired, desired)
        lacking = multiply(normalise(_mixed(desired, v)), conjugate(normalise(_mixed(channels, v))))
        lacking = np.where(lacking[:, :1] < 0.0, -lacking, lacking)
        size = np.linalg.norm(_mixed(turns, v), axis=1)[:, None]
        delta[ROWS[ROTATION], some] = ((size * lacking - _mixed(0.0 * turns, v)) / v[:, None]).T
    else:
        angles = native[3:6][:, some].T
        desired = multiply(turns, quaternions_from_extrinsic_eulers(angles, source.order))
        desired = _near(angles, extrinsic_eulers_from_quaternions(desired, source.order), source.order)
        now = quaternions_from_extrinsic_eulers(v[:, None] * angles, source.order)
        desired = quaternions_from_extrinsic_eulers(v[:, None] * desired, source.order)
        delta[ROWS[ROTATION], some] = multiply(desired, conjugate(now)).T
    if len(delta) > ROWS[SCALE].start:
        channels = native[ROWS[SCALE]][:, some]
        now, desired = 1.0 - v + v * channels, 1.0 - v + v * channels * delta[ROWS[SCALE]][:, some]
        delta[ROWS[SCALE], some] = (desired / np.where(now == 0.0, 1.0, now) - 1.0 + v) / v


def undo_blending(source: Source, frames: np.ndarray, angles: np.ndarray) -> None:
    """Make delta angles (3, m) larger by as much as the influence of the strip makes them smaller."""
    influence = influence_at(source, frames)
    angles /= np.where((influence > LEAST) & (influence < 1.0), influence, 1.0)


def _mixed(quaternions: np.ndarray, influence: np.ndarray) -> np.ndarray:
    """Return what Blender makes of quaternions (m, 4) over no rotation."""
    return (1.0 - influence[:, None]) * REST[ROWS[ROTATION]] + influence[:, None] * quaternions


def other_angles(angles: np.ndarray, order: str) -> np.ndarray:
    """Return the other Euler angles (..., 3) that turn alike: half a turn more outside, less in the middle."""
    return np.where(np.arange(3) == "XYZ".index(order[1]), np.pi - angles, angles + np.pi)


def _near(angles: np.ndarray, others: np.ndarray, order: str) -> np.ndarray:
    """Return the same turns as the other angles (m, 3), as near to these as may be."""
    both = others, other_angles(others, order)
    both = np.stack([turned + FULL_TURN * np.rint((angles - turned) / FULL_TURN) for turned in both])
    best = np.abs(both - angles).sum(axis=2).argmin(axis=0)
    return both[best, np.arange(len(angles))]
