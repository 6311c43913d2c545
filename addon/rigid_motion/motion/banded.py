"""Least squares over a long row of samples, of which each is tied to the three before it: solved by cyclic reduction.

The matrix is symmetric and positive definite, with three diagonals on either side, so it is block tridiagonal in blocks
of three. Every second block is eliminated, and again, all of a level at once: ten calls of NumPy a level, and no loop
over samples. Source: Golub and Van Loan, *Matrix Computations*, 4.5.4; the inverse by Takahashi's recursion.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

BLOCK_DIAGONALS = 3
"""Diagonals on either side, and rows of a block."""


class _Level(NamedTuple):
    """What was eliminated: inverses of those blocks, and what they have of the blocks before and behind them."""

    inverses: np.ndarray
    before: np.ndarray
    behind: np.ndarray


class Banded:
    """A factored matrix diag(d) + C' diag(w) C, of which each row of C has four numbers: those of samples i to i + 3.

    Parameters
    ----------
    diagonal : array, shape (n,)
        Positive.
    coefficients : array, shape (n - 3, 4)
        The rows of C.
    weights : array, shape (n - 3,)
        Not negative.
    """

    def __init__(self, diagonal: np.ndarray, coefficients: np.ndarray, weights: np.ndarray) -> None:
        self._count, blocks = len(diagonal), -(-len(diagonal) // BLOCK_DIAGONALS)
        diagonals = np.zeros((BLOCK_DIAGONALS + 1, BLOCK_DIAGONALS * blocks))
        diagonals[0, self._count :] = 1.0
        diagonals[0, : self._count] = diagonal
        for apart in range(BLOCK_DIAGONALS + 1):
            for first in range(BLOCK_DIAGONALS + 1 - apart):
                products = weights * coefficients[:, first] * coefficients[:, first + apart]
                diagonals[apart, first : first + len(weights)] += products
        own, next_ = np.zeros((2, blocks, BLOCK_DIAGONALS, BLOCK_DIAGONALS))
        for row in range(BLOCK_DIAGONALS):
            for column in range(BLOCK_DIAGONALS):
                own[:, row, column] = diagonals[abs(row - column), min(row, column) :: BLOCK_DIAGONALS]
                if column <= row:
                    next_[:, row, column] = diagonals[column + BLOCK_DIAGONALS - row, row::BLOCK_DIAGONALS]
        self._levels: list[_Level] = []
        next_ = next_[:-1]
        while len(own) > 1:
            inverses, left, right = np.linalg.inv(own[1::2]), next_[0::2], next_[1::2]
            level = _Level(inverses, inverses @ left.swapaxes(1, 2), inverses[: len(right)] @ right)
            own = own[0::2].copy()
            own[: len(left)] -= left @ level.before
            own[1 : 1 + len(right)] -= right.swapaxes(1, 2) @ level.behind
            next_ = -left[: len(right)] @ level.behind
            self._levels.append(level)
        self._last = np.linalg.inv(own)

    def solve(self, sides: np.ndarray) -> np.ndarray:
        """Return x of A x = b, for right-hand sides of shape (n, k)."""
        padded = np.zeros((BLOCK_DIAGONALS * -(-self._count // BLOCK_DIAGONALS), sides.shape[1]))
        padded[: self._count] = sides
        blocks, odd = padded.reshape(-1, BLOCK_DIAGONALS, sides.shape[1]), []
        for level in self._levels:
            odd.append(blocks[1::2])
            blocks = blocks[0::2].copy()
            blocks[: len(level.before)] -= level.before.swapaxes(1, 2) @ odd[-1]
            behind = len(level.behind)
            blocks[1 : 1 + behind] -= level.behind.swapaxes(1, 2) @ odd[-1][:behind]
        blocks = self._last @ blocks
        for level, known in zip(self._levels[::-1], odd[::-1], strict=True):
            found = level.inverses @ known - level.before @ blocks[: len(level.before)]
            found[: len(level.behind)] -= level.behind @ blocks[1 : 1 + len(level.behind)]
            blocks = _woven(blocks, found)
        return blocks.reshape(-1, sides.shape[1])[: self._count]

    def inverse_diagonals(self) -> np.ndarray:
        """Return the diagonal of the inverse and the three above it, shape (4, n): [k, i] is in row i, column i + k."""
        own, across = self._last, np.zeros((0, BLOCK_DIAGONALS, BLOCK_DIAGONALS))
        for level in self._levels[::-1]:
            before, behind = level.before, level.behind
            some, after = len(behind), slice(1, 1 + len(behind))
            middle = level.inverses + before @ own[: len(before)] @ before.swapaxes(1, 2)
            mixed = before[:some] @ across[:some] @ behind.swapaxes(1, 2)
            middle[:some] += behind @ own[after] @ behind.swapaxes(1, 2) + mixed + mixed.swapaxes(1, 2)
            to_middle = -own[: len(before)] @ before.swapaxes(1, 2)
            to_middle[:some] -= across[:some] @ behind.swapaxes(1, 2)
            across = _woven(to_middle, -before[:some] @ across[:some] - behind @ own[after])
            own = _woven(own, middle)
        diagonals = np.zeros((BLOCK_DIAGONALS + 1, BLOCK_DIAGONALS * len(own)))
        for row in range(BLOCK_DIAGONALS):
            for apart in range(BLOCK_DIAGONALS + 1):
                column = row + apart
                source = own if column < BLOCK_DIAGONALS else across
                diagonals[apart, row : row + BLOCK_DIAGONALS * len(source) : BLOCK_DIAGONALS] = source[
                    :, row, column % BLOCK_DIAGONALS
                ]
        return diagonals[:, : self._count]


def _woven(even: np.ndarray, odd: np.ndarray) -> np.ndarray:
    """Return blocks of which every second one is of the second list."""
    both = np.empty((len(even) + len(odd), *even.shape[1:]))
    both[0::2], both[1::2] = even, odd
    return both
