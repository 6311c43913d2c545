"""From channels to rows of values, and to the poses of a body.

Values are rows of components, each of many sources behind the other. Progress in a segment is the share of the chord
over all channels, a radian counting as much as a unit of length. Where no channel changes, and the body makes whole
turns all the same, it is what the interpolation of the keys says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import itemgetter
from typing import Any

import numpy as np

from ...motion import Poses
from ...motion.eulers import quaternions_from_extrinsic_eulers
from ...motion.quaternions import multiply
from ...motion.segments import STILL
from ..fcurves.evaluation import evaluate
from ..fcurves.keys import Keys
from .components import AXIS_ANGLE, LOCATION, PART_OF, REST, ROTATION, ROWS, SCALE
from .sources import Source, each, sampled

LEAST_SCALE = 1e-3
"""The least scale whose growth is measured, and that a body has on keys of other parts than its scale."""

NO_AXIS = 1e-35
"""The square of the length up to which an axis is none, and turns by nothing: Blender's."""


def channels_at_ends(
    segments: list[tuple[Source, slice]], *, unit_elastic: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Return the channels' own values where each segment starts and where it ends, (10, S) each.

    Of what is beside a location, those that they are to have; beside a rotation or scale, where a segment is not joint,
    those of something at rest.
    """
    sources = [source for source, _ in segments]
    bounds = [source.bounds for source in sources]
    pairs = zip(sources, bounds, strict=True)
    frames = [source.key_frames if source.cyclic is None else np.unique(np.concatenate(both)) for source, both in pairs]
    keys = each(sources, map(len, frames))
    rows = sampled(keys, frames, unit_elastic=unit_elastic)
    for (source, span), at in zip(keys, frames, strict=True):
        if source.beside is not None:
            rows[3:, span] = source.beside(at)
    start, end = (
        rows[
            :,
            np.concatenate(
                [
                    span.start + np.searchsorted(at, both[side])
                    for (_, span), at, both in zip(keys, frames, bounds, strict=True)
                ]
            ),
        ]
        for side in (0, 1)
    )
    for source, span in segments:
        if source.part in (ROTATION, SCALE):
            # A segment of its own is that of a body with nothing else.
            rest = REST[:, None].copy()
            rest[3] = source.order is None
            for side in (start, end):
                side[:, span] = np.where(source.counting, side[:, span], rest)
    return start, end


def progress_weights(
    start: np.ndarray, end: np.ndarray, order: str | None, counting: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return what the progress in S segments is made of: weights of channels (10, S), and what to take off, (S,).

    Of the channels those that are `counting` (10, S) have a say.
    """
    chord = np.where(counting, end - start, 0.0)
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

    def numbered(points: np.ndarray) -> np.ndarray:
        points = points.copy()
        points[0, :, 1] = numbers
        return points

    cycles = keys.cycles
    if cycles is not None:
        before, after = ("REPEAT_OFFSET" if mode == "REPEAT" else mode for mode in (cycles.before, cycles.after))
        cycles = replace(cycles, before=before, after=after)
    sides: dict[str, Any] = {
        name: numbered(side) for name in ("left", "right") if (side := getattr(keys, name)) is not None
    }
    return replace(keys, points=numbered(keys.points), cycles=cycles, **sides)


def turn_into_quaternions(rows: np.ndarray, order: str | None) -> None:
    """Put unit quaternions in place of what the channels (10, m) turn by."""
    turns = rows[ROWS[ROTATION]]
    if order == AXIS_ANGLE:
        squared = np.einsum("rm,rm->m", turns[1:], turns[1:])
        half = np.where(squared > NO_AXIS, 0.5 * turns[0], 0.0)
        turns[1:] *= np.sin(half) / np.sqrt(np.where(squared > NO_AXIS, squared, 1.0))
        turns[0] = np.cos(half)
        return
    if order is not None:
        rows[ROWS[ROTATION]] = quaternions_from_extrinsic_eulers(rows[3:6].T, order).T
        return
    lengths = np.sqrt(np.einsum("rm,rm->m", turns, turns))
    if not lengths.all():
        # Blender turns by half a turn about x where a quaternion has no length.
        turns[1, lengths == 0.0] = lengths[lengths == 0.0] = 1.0
    turns /= lengths


def body_poses(rows: np.ndarray, original: np.ndarray, axes: np.ndarray | None, source: Source) -> Poses:
    """Return the poses (S, k) of S segments that channels (10, S, k) give.

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


def location_axes(sources: Sequence[Source], owners: np.ndarray) -> np.ndarray | None:
    """Return the axes that the location of each segment runs along, (S, 3, 3), None where all have their own."""
    if all(source.location_axes is None for source in sources):
        return None
    same = np.eye(3)
    return np.stack([same if (axes := source.location_axes) is None else axes for source in sources])[owners]


def measured_in(times: np.ndarray, segments: list[tuple[Source, slice]], moments: np.ndarray) -> np.ndarray:
    """Return the channels' own values in each of S segments, from frames (S, 2), at k moments of it, shape (10, S, k).

    Of what is beside a location those that they are to have, where its segments are its own.
    """
    sources = [source for source, _ in segments]
    at = times[:, :1] + (times[:, 1:] - times[:, :1]) * moments
    frames = [at[span].ravel() for _, span in segments]
    samples = each(sources, map(len, frames))
    rows = sampled(samples, frames)
    for (source, span), of_source in zip(samples, frames, strict=True):
        if source.beside is not None:
            joint = source.joint.repeat(len(moments))
            rows[3:, span] = np.where(joint, rows[3:, span], source.beside(of_source))
    return rows.reshape(10, -1, len(moments))
