"""From channels to the poses of a body, and back to what the channels differ by."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...motion import Poses
from ...motion.eulers import quaternions_from_extrinsic_eulers
from ...motion.quaternions import conjugate, multiply
from .components import LOCATION, ROTATION, ROWS, SCALE
from .sources import Source


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
    """Return the axes that the location of each segment's owner runs along, (S, 3, 3);
    None where all have their own.
    """
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
