"""Body poses: from channel values to the poses of a body, and its progress in each segment.

Values are rows of components; the values of several sources follow each other in each row. Progress in a segment is the
fraction of the chord over all channels that modes change, with a radian counting as one unit of length. If none of
these channels changes, but the body makes whole turns, progress follows the interpolation of the keys.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...motion import Poses, twists
from ...motion.eulers import quaternions_from_extrinsic_eulers
from ...motion.quaternions import multiply
from ...motion.segments import MAX_SAME_POSE_CHANGE
from ..fcurves.evaluation import evaluate
from .components import AXIS_ANGLE, LOCATION, ROTATION, ROWS, SCALE
from .sources import KeyedTransform, sampled

LEAST_SCALE = 1e-3
"""Smaller scales count as this one when growth is measured."""

NO_AXIS = 1e-35
"""The squared length up to which an axis counts as none and gives no rotation, as in Blender."""


def channels_at_ends(segments: list[tuple[KeyedTransform, slice]]) -> tuple[np.ndarray, np.ndarray]:
    """Return the channels' own values at the start and at the end of each segment, (10, S) each."""
    starts, ends = zip(*(source.bounds for source, _ in segments), strict=True)
    return sampled(segments, starts), sampled(segments, ends)


def progress_weights(start: np.ndarray, end: np.ndarray, like: KeyedTransform) -> tuple[np.ndarray, np.ndarray]:
    """Return the weights of channels (10, S) that give the progress in S segments, and the offsets to subtract, (S,).

    Scale counts only if the modes change it.
    """
    chord = end - start
    chord[ROWS[SCALE]] *= like.uniform_scale
    weights = chord.copy()
    if like.order is None:
        # A unit quaternion moves by half the angle of the rotation.
        weights[ROWS[ROTATION]] *= 4.0
    total = np.einsum("rs,rs->s", weights, chord)
    weights /= np.where(total > MAX_SAME_POSE_CHANGE**2, total, np.inf)
    return weights, np.einsum("rs,rs->s", weights, start)


def idle_progress(source: KeyedTransform, frames: np.ndarray) -> np.ndarray:
    """Return progress on rising frames (m,) in segments where no channel changes: it follows the keys' interpolation.

    Progress is that of a value that rises by one from each key to the next, and rests at keys with handles. It uses the
    keys of the first channel that modes change, or else of the first channel.
    """
    numbered_rows = [(row, place, keys) for rows, keys in source.channels for place, row in enumerate(rows)]
    _, place, keys = min(numbered_rows, key=lambda one: (one[0] not in source.filled_rows, one[0]))
    keys = keys.only([place])
    numbers = np.arange(len(keys.times), dtype=np.float32)

    def numbered(points: np.ndarray) -> np.ndarray:
        return np.stack((points[..., 0], numbers[None]), axis=-1)

    counting = replace(keys, points=numbered(keys.points), cycles=None)
    if keys.left is not None and keys.right is not None:
        counting = replace(counting, left=numbered(keys.left), right=numbered(keys.right))
    ends = source.key_frames
    segment = np.clip(np.searchsorted(ends, frames, side="right") - 1, 0, len(ends) - 2)
    at_ends, at = evaluate([counting] * 2, [ends, frames])
    begin, way = at_ends[0, segment], np.diff(at_ends[0])[segment]
    begins, durations = ends[segment], np.diff(ends)[segment]
    return np.where(way != 0.0, (at[0] - begin) / np.where(way != 0.0, way, 1.0), (frames - begins) / durations)


def turn_into_quaternions(rows: np.ndarray, order: str | None) -> None:
    """Replace the rotation in channels (10, m) by unit quaternions, in place."""
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
        # Blender rotates by half a turn about X if a quaternion has no length.
        turns[1, lengths == 0.0] = lengths[lengths == 0.0] = 1.0
    turns /= lengths


def body_poses(rows: np.ndarray, original: np.ndarray, axes: np.ndarray | None, source: KeyedTransform) -> Poses:
    """Return the poses (S, k) of S segments for channels (10, S, k).

    They include the objects' own delta transforms (10, S, 1); `axes` (S, 3, 3) are those that location runs along.
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


def between(first: Poses, second: Poses, *, shortest: bool = True) -> np.ndarray:
    """Return the twists from poses (n,) to other poses, and the growth of log scale, shape (7, n)."""
    rows = np.zeros((7, len(first.positions)))
    ends = first.positions, first.quaternions, second.positions, second.quaternions
    rows[:6] = twists.between(*ends, shortest=shortest)
    if first.scales is not None and second.scales is not None:
        # Blender's own in-betweens may pass through 0.
        rows[6] = np.log(np.maximum(second.scales, LEAST_SCALE) / np.maximum(first.scales, LEAST_SCALE))
    return rows


def location_axes(sources: Sequence[KeyedTransform], owners: np.ndarray) -> np.ndarray | None:
    """Return the axes that the location of each segment runs along, (S, 3, 3); None if all have their own axes."""
    if all(source.location_axes is None for source in sources):
        return None
    same = np.eye(3)
    return np.stack([same if (axes := source.location_axes) is None else axes for source in sources])[owners]
