"""Piecewise functions: each piece combines the same basis functions with different coefficients.

Pieces (segments of a motion, spans of an F-curve) follow one another, and so do their samples. Piece i has counts[i]
samples, possibly none.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

BLOCK_SAMPLES = 32768
"""Samples processed at once: few enough for the processor's caches, enough that NumPy's call overhead is small."""

DENSE_RUN_SAMPLES = 128
"""Samples in a run of pieces with equal counts, from which on matrix products beat repeated coefficients."""

DENSE_PIECE = 8
"""Mean samples for each piece, from which on matrix products beat repeated coefficients."""


def blocks(bounds: np.ndarray, size: int = BLOCK_SAMPLES) -> Iterator[tuple[slice, slice]]:
    """Yield slices of pieces and of their samples, each with about `size` samples.

    `bounds` (S + 1,) are the first samples of the pieces, and the number of all samples.
    """
    if bounds[-1] <= size:
        yield slice(0, len(bounds) - 1), slice(0, int(bounds[-1]))
        return
    cuts = np.unique(np.append(np.searchsorted(bounds, np.arange(0, bounds[-1], size)), len(bounds) - 1))
    for first, last in itertools.pairwise(cuts.tolist()):
        yield slice(first, last), slice(int(bounds[first]), int(bounds[last]))


def is_dense(counts: np.ndarray) -> bool:
    """Whether `multiply_matrices` is the faster method for these counts (S,) of samples."""
    runs = 1 + np.count_nonzero(counts[1:] != counts[:-1])
    return bool(counts.sum() >= max(DENSE_RUN_SAMPLES * runs, DENSE_PIECE * len(counts)))


def multiply_matrices(matrices: np.ndarray, functions: np.ndarray, counts: np.ndarray, out: np.ndarray) -> None:
    """Fill `out` with the matrix of each of S pieces times the functions at its samples.

    Parameters
    ----------
    matrices : array, shape (S, k, b)
    functions : array, shape (b, n)
    counts : array of int, shape (S,)
        The number of samples of each piece, n in all.
    out : array, shape (k, n)
    """
    piece = sample = 0
    for rounds, runs in _repeated_runs(counts):
        pieces, samples = sum(length for length, _ in runs), sum(length * count for length, count in runs)
        last_piece, last_sample = piece + rounds * pieces, sample + rounds * samples
        of_pieces = matrices[piece:last_piece].reshape(rounds, pieces, *matrices.shape[1:])
        of_samples = [rows[:, sample:last_sample].reshape(len(rows), rounds, samples) for rows in (functions, out)]
        at_piece = at_sample = 0
        for length, count in runs:
            if count:
                run = slice(at_sample, at_sample + length * count)
                shape = (-1, rounds, length, count)
                inputs, products = (rows[..., run].reshape(shape).transpose(1, 2, 0, 3) for rows in of_samples)
                np.matmul(of_pieces[:, at_piece : at_piece + length], inputs, out=products)
            at_piece += length
            at_sample += length * count
        piece, sample = last_piece, last_sample


def _repeated_runs(counts: np.ndarray) -> Iterator[tuple[int, list[tuple[int, int]]]]:
    """Yield how often a pattern of runs repeats, and the pattern: runs (length, count) of equal numbers in counts (S,).

    Objects with keys at the same times repeat their counts, so that a few large products replace many small ones.
    """
    bounds = [0, *(np.flatnonzero(counts[1:] != counts[:-1]) + 1).tolist(), len(counts)]
    runs = [(last - first, int(counts[first])) for first, last in itertools.pairwise(bounds) if last > first]
    # The outermost runs may have been cut.
    inner = runs[1:-1]
    period = inner.index(inner[0], 1) if inner[:1] and inner[0] in inner[1:] else 0
    rounds = len(inner) // period if period else 0
    if rounds < 2 or inner[period : rounds * period] != inner[: (rounds - 1) * period]:
        yield 1, runs
        return
    yield 1, runs[:1]
    yield rounds, inner[:period]
    yield 1, runs[1 + rounds * period :]


def combine(coefficients: np.ndarray, functions: np.ndarray, counts: np.ndarray, out: np.ndarray) -> None:
    """Do the same as `multiply_matrices` from coefficients (k, b, S), by the faster method for these counts."""
    nonempty = np.flatnonzero(counts)
    if len(nonempty) < len(counts):
        coefficients, counts = coefficients[..., nonempty], counts[nonempty]
    if not len(counts):
        return
    if is_dense(counts):
        multiply_matrices(np.ascontiguousarray(coefficients.transpose(2, 0, 1)), functions, counts, out)
        return
    # Few rows at a time, as repeated coefficients take much memory.
    batch_size = max(1, BLOCK_SAMPLES // max(1, functions.shape[1]))
    for row in range(0, len(out), batch_size):
        rows = slice(row, row + batch_size)
        np.einsum("kbn,bn->kn", coefficients[rows].repeat(counts, axis=2), functions, out=out[rows])
