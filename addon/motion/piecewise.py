"""Functions that are put together piece by piece: each piece its own coefficients, over functions that all share.

Pieces (segments of a motion, spans of an F-curve) stand one behind the other, and so do the samples in them: of piece i
there are counts[i], none where it has none.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

BLOCK = 32768
"""Samples worked on at once: few enough for the processor's caches, enough to make light of the calls to NumPy."""

DENSE = 128
"""Samples in a row of pieces with equally many each, from which on matrix products beat repeating coefficients."""

ENOUGH = 8
"""Samples of a piece from which on they do."""


def blocks(bounds: np.ndarray, size: int = BLOCK) -> Iterator[tuple[slice, slice]]:
    """Slices of pieces and of their samples, of about `size` samples each.

    `bounds` (S + 1,) is where the samples of each piece begin, and the end.
    """
    cuts = np.unique(np.append(np.searchsorted(bounds, np.arange(0, bounds[-1], size)), len(bounds) - 1))
    for first, last in itertools.pairwise(cuts.tolist()):
        yield slice(first, last), slice(int(bounds[first]), int(bounds[last]))


def is_dense(counts: np.ndarray) -> bool:
    """Whether `multiply` is the quicker way for these counts (S,) of samples."""
    runs = 1 + np.count_nonzero(counts[1:] != counts[:-1])
    return bool(counts.sum() >= max(DENSE * runs, ENOUGH * len(counts)))


def multiply(matrices: np.ndarray, functions: np.ndarray, counts: np.ndarray, out: np.ndarray) -> None:
    """Fill out (k, n) with the matrix (k, b) of each of S pieces times the functions (b, n) at its samples.

    Parameters
    ----------
    matrices : array, shape (S, k, b)
    functions : array, shape (b, n)
    counts : array of int, shape (S,)
        Samples of each piece, n in all.
    out : array, shape (k, n)
    """
    changes = np.flatnonzero(counts[1:] != counts[:-1]) + 1
    begin = 0
    for first, last in itertools.pairwise((0, *changes.tolist(), len(counts))):
        if counts[first] == 0:
            continue
        shape = (-1, last - first, int(counts[first]))
        end = begin + shape[1] * shape[2]
        np.matmul(
            matrices[first:last],
            functions[:, begin:end].reshape(shape).transpose(1, 0, 2),
            out=out[:, begin:end].reshape(shape).transpose(1, 0, 2),
        )
        begin = end


def combine(coefficients: np.ndarray, functions: np.ndarray, counts: np.ndarray, out: np.ndarray) -> None:
    """The same as `multiply`, from coefficients (k, b, S), the quicker way for these counts."""
    some = np.flatnonzero(counts)
    if len(some) < len(counts):
        coefficients, counts = coefficients[..., some], counts[some]
    if not len(counts):
        return
    if is_dense(counts):
        multiply(np.ascontiguousarray(coefficients.transpose(2, 0, 1)), functions, counts, out)
        return
    # Few rows at a time, for repeating multiplies what there is.
    at_once = max(1, BLOCK // max(1, functions.shape[1]))
    for row in range(0, len(out), at_once):
        rows = slice(row, row + at_once)
        np.einsum("kbn,bn->kn", coefficients[rows].repeat(counts, axis=2), functions, out=out[rows])
