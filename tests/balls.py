"""The largest displacement of any point of a ball, by singular values: apart from the program's own formula."""

import numpy as np


def largest_displacements(offsets: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """By how much the farthest points move, shape (n,), of balls that move by offsets (n, 3) and turn.

    `turns` (n, 3, 3) are the differences of two rotation matrices, times the radius: they make a disc of the ball, for
    all of its points move across the axis of the turn.
    """
    axes, sizes, _ = np.linalg.svd(turns)
    moved = np.einsum("nij,ni->nj", axes, offsets)
    return np.hypot(moved[:, 2], np.hypot(moved[:, 0], moved[:, 1]) + sizes[:, 0])
