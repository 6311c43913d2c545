"""From one place to another as Blender's constraints blend them: origins and scales straight, rotations by slerp."""

from __future__ import annotations

import numpy as np

from ...motion.affine import AffineMaps
from ...motion.quaternions import from_matrices, matrices, turned, turns_between


def blended(first: AffineMaps, second: AffineMaps, share: np.ndarray) -> AffineMaps:
    """Return maps (n,) without shear at a share (n,) of the way from the first to the second, the shorter one round."""
    part = share[:, None]
    (before, length), (after, other) = (_turns_and_lengths(maps.axes) for maps in (first, second))
    turns = turned(before, part * turns_between(before, after))
    axes = np.moveaxis(matrices(turns), -1, 0) * (length + part * (other - length))[:, None]
    return AffineMaps(axes, first.origins + part * (second.origins - first.origins))


def _turns_and_lengths(axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rotations as quaternions (n, 4), and lengths (n, 3) of axes (n, 3, 3)."""
    lengths = np.linalg.norm(axes, axis=1)
    return from_matrices(axes / np.where(lengths > 0.0, lengths, 1.0)[:, None]), lengths


def smoothstep(share: np.ndarray) -> np.ndarray:
    """Return how far something has passed over at a share of the frames that it takes."""
    return share * share * (3.0 - 2.0 * share)
