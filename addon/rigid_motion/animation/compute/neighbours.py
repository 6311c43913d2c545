"""The keys beside a segment, which a smooth mode looks at: arrays of S segments, one behind the other."""

from __future__ import annotations

import numpy as np

from ...motion import Poses
from ...motion.poses import beyond


def with_neighbours(
    times: np.ndarray, keys: Poses, holds: np.ndarray, pairs: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, Poses]:
    """Return frames and poses (S, 4) of the keys around each segment, from those (S, 2) at its ends.

    `pairs` are the segments that meet, as `meeting` finds them. Where there is none, or a cycle jumps, the motion goes
    on as in the segment; where a segment holds, it rests.
    """
    rows = packed(keys)
    previous, following = packed(beyond(keys[:, 0], keys[:, 1])), packed(beyond(keys[:, 1], keys[:, 0]))
    # Between two keys on one frame there is nothing, and what is on either side meets there.
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
    """Return what spins make of `with_neighbours`: the keys (S, 4) in signs that say which way round segments turn, and
    the angular velocities (3, 2, S, 3) that spins add at both ends of the three segments between them.

    From the signs (S,) and velocities (3, 2, S) of the segments.
    """
    quaternions = around.quaternions.copy()
    # Where nothing is beside a segment, its motion goes on.
    steps = signs[:, None].repeat(3, axis=1)
    beside = np.stack((spins[:, [0, 0]], spins, spins[:, [1, 1]]), axis=3)
    left, right = pairs
    for segments, others, side in ((right, left, 0), (left, right, 2)):
        steps[segments, side] = np.where(holds[others], 1.0, signs[others])
        beside[:, :, segments, side] = np.where(holds[others], 0.0, spins[:, :, others])
    quaternions[:, 1:] *= np.cumprod(steps, axis=1)[..., None]
    return Poses(around.positions, quaternions, around.scales), beside


def meeting(owners: np.ndarray, times: np.ndarray, keys: Poses) -> tuple[np.ndarray, np.ndarray]:
    """Return the segments (p,) before and after each key at which two of them meet: both have the same pose there."""
    rows, lasts = packed(keys), np.flatnonzero(times[:, 1] > times[:, 0])
    left, right = lasts[:-1], lasts[1:]
    meet = (owners[right] == owners[left]) & np.all(rows[right, 0] == rows[left, 1], axis=1)
    return left[meet], right[meet]


def packed(poses: Poses) -> np.ndarray:
    """Return positions, quaternions and scales in one array (..., 7 or 8)."""
    scales = () if poses.scales is None else (poses.scales[..., None],)
    return np.concatenate((poses.positions, poses.quaternions, *scales), axis=-1)
