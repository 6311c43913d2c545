"""Power series that approximate curves piece by piece, for curves with costly formulas that are evaluated often.

Each piece is evaluated at a few nodes. If the piece bends little, the polynomial through these values equals the curve
except for rounding. Within each piece s runs from -1 to 1. Source: Trefethen, "Approximation Theory and Approximation
Practice", 2013, chapters 3 and 8.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.chebyshev import cheb2poly

N_TERMS = 14
"""Terms of a series."""

_NODE_ANGLES_RAD = np.pi * (np.arange(N_TERMS) + 0.5) / N_TERMS

NODE_PLACES = np.cos(_NODE_ANGLES_RAD)
"""The nodes where a piece is evaluated: the zeros of Chebyshev's polynomial, shape (N_TERMS,)."""

_CHEBYSHEV = (
    np.cos(np.outer(np.arange(N_TERMS), _NODE_ANGLES_RAD))
    * np.where(np.arange(N_TERMS) > 0, 2.0, 1.0)[:, None]
    / N_TERMS
)
"""Maps values at the nodes to coefficients of Chebyshev's polynomials: the discrete cosine transform."""

_POWERS = np.stack([np.pad(cheb2poly(np.eye(N_TERMS)[n, : n + 1]), (0, N_TERMS - 1 - n)) for n in range(N_TERMS)])
"""Chebyshev's polynomials as powers of s, one row each."""


def moments(pieces: int) -> np.ndarray:
    """Return the nodes of equal pieces of the interval -1 to 1, piece by piece, shape (pieces * N_TERMS,)."""
    return ((2.0 * np.arange(pieces)[:, None] + 1.0 + NODE_PLACES) / pieces - 1.0).ravel()


def fit(values: np.ndarray) -> np.ndarray:
    """Return the coefficients (pieces, k, N_TERMS) of k functions from their values (k, pieces * N_TERMS) at nodes."""
    # In two steps, not by one matrix: large powers have large coefficients that nearly cancel, while the coefficients
    # of high polynomials between the two steps are small.
    # One product for each function keeps BLAS from using threads: on a busy machine it would wait for them far longer
    # than this whole computation takes.
    series = values.reshape(len(values), -1, N_TERMS) @ _CHEBYSHEV.T @ _POWERS
    return np.ascontiguousarray(series.transpose(1, 0, 2))


def powers(s: np.ndarray) -> np.ndarray:
    """Return the powers of s (n,) to multiply by the coefficients from `fit`, shape (N_TERMS, n)."""
    rows = np.empty((N_TERMS, s.size))
    rows[0], rows[1] = 1.0, s
    for power in range(2, N_TERMS):
        np.multiply(rows[power // 2], rows[power - power // 2], out=rows[power])
    return rows
