"""Meshopt filters: storing numbers as integers of few bits and restoring them, element by element.

Elements are arrays of bytes, shape (count, stride).
Source: the specification of KHR_meshopt_compression, Khronos 2026, appendix B.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

QUATERNION, EXPONENTIAL = "QUATERNION", "EXPONENTIAL"

MAX_SMALL_COMPONENT = np.sqrt(0.5)
"""Largest magnitude of any component of a unit quaternion except its largest one."""

MOST_BITS, FEWEST_BITS = 15, 4
"""Bits of a quaternion component, limited so that the restored numbers determine the stored bits."""

MAX_INT16 = np.iinfo(np.int16).max

MAX_MANTISSA = 2**23 - 1
"""Largest magnitude of a mantissa."""


def quaternions_of(elements: np.ndarray) -> np.ndarray:
    """Return quaternions as normalised integers (count, 4), x, y, z, w, from three components and an index."""
    given = _typed(elements, "<i2").reshape(-1, 4).astype(np.int64)
    parts = given[:, :3] / (given[:, 3:] | 3) * MAX_SMALL_COMPONENT
    fourth = np.sqrt(np.maximum(1.0 - np.sum(parts**2, axis=1), 0.0))
    places = (given[:, 3:] + np.arange(4)) & 3
    result = np.empty((len(given), 4))
    np.put_along_axis(result, places, np.column_stack((fourth, parts)), axis=1)
    return np.rint(result * MAX_INT16).astype("<i2")


def with_quaternions(values: np.ndarray, bits: int, rank: int = 0) -> np.ndarray:
    """Return elements (count, 8) for unit quaternions (count, 4), x, y, z, w, with components of `bits` bits.

    The largest component is left out; with a rank of 1 the second largest, for quaternions in which both are as large.
    """
    largest = np.argsort(-np.abs(values), axis=1, kind="stable")[:, rank, None]
    turned = np.take_along_axis(values, (largest + np.arange(4)) % 4, axis=1)
    one = 2 ** (bits - 1) - 1
    parts = np.rint(turned[:, 1:] * np.where(turned[:, :1] < 0.0, -1.0, 1.0) / MAX_SMALL_COMPONENT * one)
    fourth = one & ~3 | largest
    return np.hstack((np.clip(parts, -one, one), fourth)).astype("<i2").view(np.uint8)


def floats_of(elements: np.ndarray) -> np.ndarray:
    """Return floats (count, stride / 4) from 24-bit mantissas and their exponents."""
    given = _typed(elements, "<i4")
    return np.ldexp((given << 8 >> 8).astype(np.float64), given >> 24).astype("<f4")


def with_floats(values: np.ndarray, exponents: np.ndarray | int) -> np.ndarray:
    """Return elements (count, 4 * width) for numbers (count, width) as multiples of 2**exponents (broadcast)."""
    mantissas = np.clip(np.rint(np.ldexp(values, -np.asarray(exponents))), -MAX_MANTISSA, MAX_MANTISSA).astype(np.int64)
    parts = mantissas & 0xFFFFFF | (np.asarray(exponents, dtype=np.int64) & 0xFF) << 24
    return parts.astype("<u4").view(np.uint8)


def _octahedral(elements: np.ndarray) -> np.ndarray:
    """Return unit vectors, with the fourth number unchanged."""
    integers = _typed(elements, f"<i{elements.shape[1] // 4}")
    given, largest = integers.astype(np.float64), np.iinfo(integers.dtype).max
    xy = given[:, :2] / np.where(given[:, 2:3] == 0.0, 1.0, given[:, 2:3])
    z = 1.0 - np.abs(xy).sum(axis=1, keepdims=True)
    vectors = np.hstack((xy - np.copysign(np.minimum(z, 0.0), xy), z))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    whole = np.copysign(np.floor(np.abs(vectors) * largest + 0.5), vectors)
    return np.hstack((whole, given[:, 3:])).astype(integers.dtype)


def _colours(elements: np.ndarray) -> np.ndarray:
    """Return red, green, blue and alpha from luma, two chroma components and alpha."""
    kind = f"{elements.shape[1] // 4}"
    luma, _, _, alpha = _typed(elements, f"<u{kind}").astype(np.int64).T
    _, orange, green, _ = _typed(elements, f"<i{kind}").astype(np.int64).T
    widest = 2 ** np.frexp(alpha.astype(np.float64))[1].astype(np.int64) - 1
    alpha = alpha & widest >> 1
    parts = np.stack((luma + orange - green, luma + green, luma - orange - green, alpha << 1 | alpha & 1), axis=1)
    largest = np.iinfo(f"<u{kind}").max
    scaled = parts * (largest / np.maximum(widest, 1))[:, None]
    return np.clip(np.floor(scaled + 0.5), 0, largest).astype(f"<u{kind}")


def _typed(elements: np.ndarray, kind: str) -> np.ndarray:
    return np.ascontiguousarray(elements).view(kind)


UNDO_BY_FILTER: dict[str, tuple[tuple[int, ...], Callable[[np.ndarray], np.ndarray]]]
UNDO_BY_FILTER = {
    "NONE": ((), lambda elements: elements),
    "OCTAHEDRAL": ((4, 8), _octahedral),
    QUATERNION: ((8,), quaternions_of),
    EXPONENTIAL: ((), floats_of),
    "COLOR": ((4, 8), _colours),
}
"""For each filter: the strides it allows (empty for any), and the function that undoes it."""
