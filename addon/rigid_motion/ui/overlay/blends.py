"""Blending of two transforms as Blender's constraints do it: origins and scales linearly, rotations by slerp."""

from __future__ import annotations

import numpy as np

from ...motion.affine import AffineMaps
from ...motion.quaternions import from_matrices, matrices, turned, turns_between


def blended(first: AffineMaps, second: AffineMaps, share: np.ndarray) -> AffineMaps:
    """Return maps (n,) without shear, blended from the first to the second by a fraction (n,).

    Rotations take the shorter way round.
    """
    part = share[:, None]
    (before, length), (after, other) = (_rotations_and_lengths(maps.axes) for maps in (first, second))
    turns = turned(before, part * turns_between(before, after))
    axes = np.moveaxis(matrices(turns), -1, 0) * (length + part * (other - length))[:, None]
    return AffineMaps(axes, first.origins + part * (second.origins - first.origins))


def _rotations_and_lengths(axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotations of axes (n, 3, 3) as quaternions (n, 4), and their lengths (n, 3)."""
    lengths = np.linalg.norm(axes, axis=1)
    return from_matrices(axes / np.where(lengths > 0.0, lengths, 1.0)[:, None]), lengths


def smoothstep(share: np.ndarray) -> np.ndarray:
    """Return the eased progress of a transition at a fraction of its duration."""
    return share * share * (3.0 - 2.0 * share)
