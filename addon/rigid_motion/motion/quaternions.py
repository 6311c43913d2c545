"""Quaternion arithmetic on arrays with w, x, y, z along the last axis and Hamilton's product, as in `mathutils`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

ZERO_SINE = 1e-12
"""Replaces the sine of a zero turn in divisions."""

ZERO_ANGLE_RAD = 1e-9
"""Replaces an angle of zero, in radians: its sine equals the angle itself."""

MAX_COPIED_NUMBERS = 6000
"""Vectors with at most this many numbers: fewer NumPy calls outweigh the copying of components."""

NEXT_AXES, LAST_AXES = np.array((1, 2, 0)), np.array((2, 0, 1))
"""The next axis after each axis, and the one after that."""


def components(vectors: np.ndarray) -> np.ndarray:
    """Return vectors (..., k) as components (k, ...), a view."""
    return vectors.transpose(-1, *range(vectors.ndim - 1))


def vectors(components: np.ndarray) -> np.ndarray:
    """Return components (k, ...) as vectors (..., k), a view."""
    return components.transpose(*range(1, components.ndim), 0)


def multiply(a: np.ndarray, b: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
    """Return Hamilton's product a b, shapes (..., 4): the rotation b first, then a.

    The result is a view with each component contiguous in memory. `out`, an array for the product, must not share
    memory with a and b.
    """
    aw, ax, ay, az = (a[..., row] for row in range(4))
    bw, bx, by, bz = (b[..., row] for row in range(4))
    if out is None:
        out = vectors(np.empty((4, *np.broadcast(aw, bw).shape)))
    w, x, y, z = (out[..., row] for row in range(4))
    np.subtract(aw * bw, ax * bx, out=w)
    w -= ay * by
    w -= az * bz
    np.add(aw * bx, ax * bw, out=x)
    x += ay * bz
    x -= az * by
    np.add(aw * by, ay * bw, out=y)
    y -= ax * bz
    y += az * bx
    np.add(aw * bz, az * bw, out=z)
    z += ax * by
    z -= ay * bx
    return out


def conjugate(q: np.ndarray) -> np.ndarray:
    """Return w, -x, -y, -z: the inverse of a unit quaternion."""
    return q * np.array((1.0, -1.0, -1.0, -1.0))


def rotate(q: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points (..., 3) rotated by unit quaternions (..., 4), a view with each component contiguous in memory."""
    w, *xyz = (q[..., row] for row in range(4))
    across = cross(xyz, [points[..., row] for row in range(3)])
    across *= 2.0
    turned = cross(xyz, across)
    across *= w
    turned += across
    for axis in range(3):
        turned[axis] += points[..., axis]
    return vectors(turned)


def matrices(q: np.ndarray) -> np.ndarray:
    """Return the rotation matrices (3, 3, ...) of unit quaternions (..., 4), components first."""
    w, x, y, z = components(q)
    xx, yy, zz, xy, yz, xz = x * x, y * y, z * z, x * y, y * z, x * z
    wx, wy, wz = w * x, w * y, w * z
    halves = ((0.5 - yy - zz, xy - wz, xz + wy), (xy + wz, 0.5 - xx - zz, yz - wx), (xz - wy, yz + wx, 0.5 - xx - yy))
    return 2.0 * np.array(halves)


def from_matrices(rotations: np.ndarray) -> np.ndarray:
    """Return unit quaternions (..., 4) of rotation matrices (..., 3, 3), with arbitrary signs.

    Each of four formulas divides by one component of the quaternion. The one with the largest component is used.
    """
    (a, b, c), (d, e, f), (g, h, i) = (np.moveaxis(rotations[..., row, :], -1, 0) for row in range(3))
    candidates = np.stack(
        [
            np.stack([1.0 + a + e + i, h - f, c - g, d - b], axis=-1),
            np.stack([h - f, 1.0 + a - e - i, b + d, c + g], axis=-1),
            np.stack([c - g, b + d, 1.0 - a + e - i, f + h], axis=-1),
            np.stack([d - b, c + g, f + h, 1.0 - a - e + i], axis=-1),
        ],
        axis=-2,
    )
    largest = np.argmax(np.einsum("...ii->...i", candidates), axis=-1)
    return normalise(np.take_along_axis(candidates, largest[..., None, None], axis=-2)[..., 0, :])


def cross(a: np.ndarray | Sequence[np.ndarray], b: np.ndarray | Sequence[np.ndarray]) -> np.ndarray:
    """Return the cross product of vectors (3, ...), components first."""
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray) and a.size <= MAX_COPIED_NUMBERS:
        product = a.take(NEXT_AXES, axis=0) * b.take(LAST_AXES, axis=0)
        product -= a.take(LAST_AXES, axis=0) * b.take(NEXT_AXES, axis=0)
        return product
    product = np.empty((3, *np.broadcast(a[0], b[0]).shape))
    for axis in range(3):
        after, last = (axis + 1) % 3, (axis + 2) % 3
        np.subtract(a[after] * b[last], a[last] * b[after], out=product[axis, ...])
    return product


def normalise(q: np.ndarray) -> np.ndarray:
    """Return normalised quaternions. Every quaternion needs a length above zero."""
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def align_signs(q: np.ndarray) -> np.ndarray:
    """Return the same rotations with each quaternion in the hemisphere of the one before.

    q and -q are one rotation, but an in-between of q and -r runs the long way round. Shape (..., n, 4); the first
    quaternion of each list keeps its sign, and so does one at exactly 180 degrees from its predecessor.
    """
    flips = np.einsum("...i,...i->...", q[..., 1:, :], q[..., :-1, :]) < 0.0
    if not flips.any():
        return q
    aligned = q.copy()
    aligned[..., 1:, :] *= 1.0 - 2.0 * (np.cumsum(flips, axis=-1) % 2)[..., None]
    return aligned


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the angle in radians, 0 to pi, of the rotation from a to b. Accurate for tiny angles too."""
    difference = multiply(conjugate(a), b)
    return 2.0 * np.arctan2(np.linalg.norm(difference[..., 1:], axis=-1), np.abs(difference[..., 0]))


def turned(quaternions: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return unit quaternions (..., 4) rotated by rotation vectors (..., 3), in radians along their own axes."""
    half = 0.5 * np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
    share = 0.5 * np.sinc(half / np.pi)
    return multiply(quaternions, np.concatenate((np.cos(half)[..., None], share[..., None] * vectors), axis=-1))


def turns_between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the shortest rotation vectors (..., 3) from `first` to `second`, along the axes of `first`, in radians.

    Both are unit quaternions (..., 4).
    """
    turns = multiply(conjugate(first), second)
    w = turns[..., 0]
    sine = np.sqrt(np.einsum("...i,...i->...", turns[..., 1:], turns[..., 1:]))
    angle = 2.0 * np.arctan2(sine, np.abs(w))
    return turns[..., 1:] * (np.where(w < 0.0, -1.0, 1.0) * angle / np.maximum(sine, ZERO_SINE))[..., None]


def turned_at(key_times: np.ndarray, keys: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return unit quaternions (m, 4) at times between keys (n, 4): slerp on the shorter way."""
    keys = normalise(keys)
    first, second = keys[:-1], keys[1:]
    second = np.where(np.einsum("ij,ij->i", first, second)[:, None] < 0.0, -second, second)
    angles = 2.0 * np.arctan2(np.linalg.norm(second - first, axis=1), np.linalg.norm(second + first, axis=1))
    angles = np.maximum(angles, ZERO_ANGLE_RAD)
    segments = np.clip(np.searchsorted(key_times, times, side="right") - 1, 0, len(first) - 1)
    share = (times - key_times[segments]) / np.diff(key_times)[segments]
    angles, sines = angles[segments], np.sin(angles)[segments]
    begin, end = np.sin((1.0 - share) * angles) / sines, np.sin(share * angles) / sines
    return begin[:, None] * first[segments] + end[:, None] * second[segments]
