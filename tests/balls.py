"""The largest displacement of any point of a ball, by singular values: independent of the program's own formula."""

import numpy as np


def largest_displacements(offsets: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Return how far the farthest points move, shape (...), of balls that move by offsets (..., 3), turn and scale.

    `turns` (..., 3, 3) are differences of two matrices, times the radius: they map the ball to an ellipsoid with an
    axis of symmetry, its shortest axis. The farthest point is in the plane of that axis and the displacement of the
    centre; it is found by search.
    """
    axes, sizes, _ = np.linalg.svd(turns)
    moved = np.abs(np.einsum("...ij,...i->...j", axes, offsets))
    along, across = moved[..., 2], np.hypot(moved[..., 0], moved[..., 1])

    def reached(angles: np.ndarray) -> np.ndarray:
        return np.hypot(along + sizes[..., 2] * np.sin(angles), across + sizes[..., 0] * np.cos(angles))

    middle, width = np.full(along.shape, np.pi / 4.0), np.pi / 4.0
    while width > 1e-9:
        steps = np.linspace(-1.0, 1.0, 33).reshape(33, *[1] * along.ndim)
        angles = np.clip(middle + width * steps, 0.0, np.pi / 2.0)
        middle = np.take_along_axis(angles, np.argmax(reached(angles), axis=0)[None], axis=0)[0]
        width /= 8.0
    return reached(middle)


def displaced(one: np.ndarray, other: np.ndarray, radius: float) -> np.ndarray:
    """Return how far any point of a ball moves from one matrix (..., 4, 4) to the other, shape (...)."""
    off = one - other
    return largest_displacements(off[..., :3, 3], radius * off[..., :3, :3])
