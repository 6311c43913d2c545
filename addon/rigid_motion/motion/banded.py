"""Banded least squares: long rows of samples, each tied to the three before it, solved by cyclic reduction.

The matrix is symmetric and positive definite, with three diagonals on either side, so it is block tridiagonal in blocks
of three. Each level eliminates every second block, all at once: ten calls of NumPy a level, and no loop over samples.
Source: Golub and Van Loan, *Matrix Computations*, 4.5.4; the inverse by Takahashi's recursion.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

BLOCK_DIAGONALS = 3
"""Diagonals on either side of the main one, and rows of a block."""


class _Level(NamedTuple):
    """One level of elimination: inverses of the eliminated blocks, times their couplings to the blocks before and
    behind.
    """

    inverses: np.ndarray
    before: np.ndarray
    behind: np.ndarray


class Banded:
    """A factored matrix diag(d) + C' diag(w) C, where row i of C has four numbers, for the samples i to i + 3.

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
        """Return the solution x of A x = b, for right-hand sides of shape (n, k)."""
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
            blocks = _interleaved(blocks, found)
        return blocks.reshape(-1, sides.shape[1])[: self._count]

    def inverse_diagonals(self) -> np.ndarray:
        """Return the diagonal of the inverse and the three above it, shape (4, n): [k, i] is row i, column i + k."""
        own, across = self._last, np.zeros((0, BLOCK_DIAGONALS, BLOCK_DIAGONALS))
        for level in self._levels[::-1]:
            before, behind = level.before, level.behind
            inner, after = len(behind), slice(1, 1 + len(behind))
            middle = level.inverses + before @ own[: len(before)] @ before.swapaxes(1, 2)
            mixed = before[:inner] @ across[:inner] @ behind.swapaxes(1, 2)
            middle[:inner] += behind @ own[after] @ behind.swapaxes(1, 2) + mixed + mixed.swapaxes(1, 2)
            to_middle = -own[: len(before)] @ before.swapaxes(1, 2)
            to_middle[:inner] -= across[:inner] @ behind.swapaxes(1, 2)
            across = _interleaved(to_middle, -before[:inner] @ across[:inner] - behind @ own[after])
            own = _interleaved(own, middle)
        diagonals = np.zeros((BLOCK_DIAGONALS + 1, BLOCK_DIAGONALS * len(own)))
        for row in range(BLOCK_DIAGONALS):
            for apart in range(BLOCK_DIAGONALS + 1):
                column = row + apart
                source = own if column < BLOCK_DIAGONALS else across
                diagonals[apart, row : row + BLOCK_DIAGONALS * len(source) : BLOCK_DIAGONALS] = source[
                    :, row, column % BLOCK_DIAGONALS
                ]
        return diagonals[:, : self._count]


def _interleaved(even: np.ndarray, odd: np.ndarray) -> np.ndarray:
    """Return blocks taken alternately from two lists."""
    both = np.empty((len(even) + len(odd), *even.shape[1:]))
    both[0::2], both[1::2] = even, odd
    return both
