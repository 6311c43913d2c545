"""Power series that stand for a curve piece by piece, for curves of many steps that are shown at many moments.

A piece is looked at in a few places; what a polynomial makes of them is the curve itself but for rounding, where the
piece bends little. Within each piece s runs from -1 to 1. Source: Trefethen, "Approximation Theory and Approximation
Practice", 2013, chapters 3 and 8.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.chebyshev import cheb2poly

N_TERMS = 14
"""Of a series."""

_NODE_ANGLES_RAD = np.pi * (np.arange(N_TERMS) + 0.5) / N_TERMS

NODE_PLACES = np.cos(_NODE_ANGLES_RAD)
"""Where a piece is looked at: the zeros of Chebyshev's polynomial, shape (N_TERMS,)."""

_CHEBYSHEV = (
    np.cos(np.outer(np.arange(N_TERMS), _NODE_ANGLES_RAD))
    * np.where(np.arange(N_TERMS) > 0, 2.0, 1.0)[:, None]
    / N_TERMS
)
"""From the values at the nodes to the coefficients of Chebyshev's polynomials: the discrete cosine transform."""

_POWERS = np.stack([np.pad(cheb2poly(np.eye(N_TERMS)[n, : n + 1]), (0, N_TERMS - 1 - n)) for n in range(N_TERMS)])
"""Chebyshev's polynomials in powers of s, a row each."""


def moments(pieces: int) -> np.ndarray:
    """Return the nodes of so many equal pieces of -1 to 1, one piece after the other, shape (pieces * N_TERMS,)."""
    return ((2.0 * np.arange(pieces)[:, None] + 1.0 + NODE_PLACES) / pieces - 1.0).ravel()


def fit(values: np.ndarray) -> np.ndarray:
    """Return the coefficients (pieces, k, N_TERMS) of k functions with these values (k, pieces * N_TERMS) at the
    nodes.
    """
    # In two steps, not by one matrix: large powers have large coefficients of nearly opposite size, and only between
    # the two steps are those of the high polynomials small.
    # A product for each function, so that BLAS does not share it among threads: on a busy machine it waits for them far
    # longer than all of this takes.
    series = values.reshape(len(values), -1, N_TERMS) @ _CHEBYSHEV.T @ _POWERS
    return np.ascontiguousarray(series.transpose(1, 0, 2))


def powers(s: np.ndarray) -> np.ndarray:
    """Return what `fit`'s coefficients are to be multiplied by at s (n,), shape (N_TERMS, n)."""
    rows = np.empty((N_TERMS, s.size))
    rows[0], rows[1] = 1.0, s
    for power in range(2, N_TERMS):
        np.multiply(rows[power // 2], rows[power - power // 2], out=rows[power])
    return rows
