"""Poses: positions, rotations and scales of rigid bodies at many moments.

Positions are in the units of their source. Quaternions are unit, scalar first (w, x, y, z) as in `mathutils`. Scales
are uniform and positive. All arrays are float64 and share their leading axes, the last of which is time: one object has
arrays of shape (n, 3) and (n, 4), and many objects have (objects, n, 3) and (objects, n, 4).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from .quaternions import align_signs, components, conjugate, from_matrices, multiply, rotate, vectors

MAX_ABS = 1e40
"""A larger number is damage, not a measurement, and beyond Blender's range. Powers of this limit are still floats."""

MAX_AXES_ERROR_RATIO = 1e-3
"""How far the axes of a matrix may differ from orthogonal axes of equal length, as a fraction of the scale."""

MAX_UNIT_SCALE_ERROR = 1e-6
"""A scale that differs from 1 by less counts as 1, due to the rounding of single precision."""

MIN_TIME_GAP = 1e-30
"""The least time between two moments: with less, a speed may exceed the range of floats."""


def numbers(values: ArrayLike, name: str) -> np.ndarray:
    """Return an argument of this name as an array of float64; such an array is returned as it is.

    Raises TypeError if it consists of strings, complex numbers or other objects, ValueError for rows of different
    lengths.
    """
    if type(values) is np.ndarray and values.dtype == np.float64:
        return values
    try:
        given = np.asarray(values)
    except ValueError:
        raise ValueError(f"{name}: rows of different lengths make no array") from None
    try:
        if given.dtype.kind in "biufO":
            return given.astype(np.float64)
    except (TypeError, ValueError):
        pass
    kind = type(values).__name__ if given.dtype == object else given.dtype
    raise TypeError(f"{name} need to be numbers, not {kind}: give floats, without quotes or units") from None


@dataclass(frozen=True, eq=False)
class Poses:
    """Positions, rotations and, if the body grows or shrinks, scales.

    Parameters
    ----------
    positions : array-like, shape (..., n, 3)
        In any unit of length. The last of the leading axes is time: one object has (n, 3), many have (objects, n, 3).
    quaternions : array-like, shape (..., n, 4)
        w, x, y, z (Hamilton's, as in `mathutils`). Kept as given: `repair` normalises them and aligns their signs.
    scales : array-like, shape (..., n), optional
        Uniform scales. None means 1 everywhere, and is fastest in every mode.

    Raises
    ------
    ValueError
        If the shapes do not fit each other.
    TypeError
        If positions, quaternions or scales are not numbers.
        Also if NumPy should convert poses to one array, or use them as one: a mean or a sum of quaternions is not a
        rotation. Use `positions` and `quaternions` instead.

    See Also
    --------
    interpolate : Poses between keys.
    repair : Makes recorded poses fit for interpolation.

    Notes
    -----
    Arrays of float64 are kept, not copied; all others are converted to float64. Poses are indexed like their leading
    axes, by NumPy's rules: a slice is a view, and a number picks a single pose of one object, of shape (). The length
    of poses is that of their first axis, and loops iterate over that axis; a single pose supports neither. `==`
    compares identity: two `Poses` are equal only if they are the same object.

    Examples
    --------
    >>> from rigid_motion.motion import Poses
    >>> poses = Poses([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[1, 0, 0, 0]] * 3)
    >>> poses.shape, len(poses[1:])
    ((3,), 2)
    >>> poses[poses.positions[:, 0] > 0.5].positions.tolist()
    [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]
    >>> [pose.positions.tolist() for pose in poses[:2]]
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    """

    positions: np.ndarray
    """Shape (..., n, 3)."""

    quaternions: np.ndarray
    """w, x, y, z, shape (..., n, 4)."""

    scales: np.ndarray | None = None
    """Shape (..., n), or None for 1 everywhere."""

    def __init__(self, positions: ArrayLike, quaternions: ArrayLike, scales: ArrayLike | None = None) -> None:
        positions, quaternions = numbers(positions, "positions"), numbers(quaternions, "quaternions")
        if positions.shape[-1:] != (3,):
            raise ValueError(f"positions need the shape (..., 3), not {positions.shape}")
        if quaternions.shape != (*positions.shape[:-1], 4):
            raise ValueError(f"quaternions need the shape {(*positions.shape[:-1], 4)}, not {quaternions.shape}")
        if scales is not None:
            scales = numbers(scales, "scales")
            if scales.shape != positions.shape[:-1]:
                raise ValueError(f"scales need the shape {positions.shape[:-1]}, not {scales.shape}")
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "quaternions", quaternions)
        object.__setattr__(self, "scales", scales)

    @classmethod
    def from_xyzw(cls, positions: ArrayLike, quaternions: ArrayLike, scales: ArrayLike | None = None) -> Poses:
        """Return poses from quaternions in the order x, y, z, w, as in ROS, Unity, Unreal, glTF and SciPy.

        Examples
        --------
        >>> from rigid_motion.motion import Poses
        >>> Poses.from_xyzw([[0, 0, 0]], [[0, 0, 0, 1]]).quaternions.tolist()
        [[1.0, 0.0, 0.0, 0.0]]
        """
        quaternions = numbers(quaternions, "quaternions")
        if quaternions.shape[-1:] != (4,):
            raise ValueError(f"quaternions need the shape (..., 4), not {quaternions.shape}")
        return cls(positions, quaternions[..., [3, 0, 1, 2]], scales)

    @classmethod
    def from_matrices(cls, matrices: ArrayLike) -> Poses:
        """Return poses from matrices (..., 4, 4) that multiply column vectors, as in NumPy, Blender and OpenCV.

        Raises
        ------
        ValueError
            If a matrix mirrors, shears or scales unevenly, or has a scale of zero. The message names the first one.

        Notes
        -----
        The signs of the quaternions are consistent only after `repair`. Scales are None if all are 1. A matrix with
        NaN becomes a pose of NaN.

        Examples
        --------
        >>> from rigid_motion.motion import Poses
        >>> poses = Poses.from_matrices([[[0, -2, 0, 5], [2, 0, 0, 6], [0, 0, 2, 7], [0, 0, 0, 1]]])
        >>> poses.positions.tolist(), poses.scales.round(3).tolist()
        ([[5.0, 6.0, 7.0]], [2.0])
        >>> poses.quaternions.round(3).tolist()
        [[0.707, 0.0, 0.0, 0.707]]
        """
        matrices = numbers(matrices, "matrices")
        if matrices.shape[-2:] != (4, 4):
            raise ValueError(f"matrices need the shape (..., 4, 4), not {matrices.shape}")
        axes = matrices[..., :3, :3]
        with np.errstate(invalid="ignore", divide="ignore"):
            scales = np.cbrt(np.linalg.det(axes))
            rotations = axes / scales[..., None, None]
            uneven = np.abs(np.einsum("...ij,...ik->...jk", rotations, rotations) - np.eye(3)).max(axis=(-2, -1))
            wrong = (scales <= 0.0) | (uneven > MAX_AXES_ERROR_RATIO)
            if wrong.any():
                index = tuple(map(int, np.argwhere(wrong)[0]))
                if scales[index] < 0.0:
                    fault = "mirrors"
                elif scales[index] == 0.0:
                    fault = "has no scale"
                else:
                    fault = "shears or scales unevenly"
                raise ValueError(f"the matrix at {index[0] if len(index) == 1 else index} {fault}, which no pose does")
            scaled = (np.abs(scales - 1.0) > MAX_UNIT_SCALE_ERROR).any()
            return cls(matrices[..., :3, 3], from_matrices(rotations), scales if scaled else None)

    @property
    def shape(self) -> tuple[int, ...]:
        """The leading axes: (n,) for one object, (objects, n) for many."""
        return self.positions.shape[:-1]

    def __len__(self) -> int:
        if not self.shape:
            raise TypeError("a single pose, of shape (), has no length")
        return self.shape[0]

    def __iter__(self) -> Iterator[Poses]:
        """Iterate over the first axis: the single poses of one object, or the poses of each of many objects."""
        if not self.shape:
            raise TypeError("a single pose, of shape (), has nothing to go through")
        return (self[index] for index in range(len(self)))

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> np.ndarray:
        """Raise a TypeError: as one array, NumPy would compute means and sums of quaternions, and leave out scales."""
        raise TypeError(
            "poses are no single array: take poses.positions and poses.quaternions, or rows of x, y, z, w, x, y, z by "
            "np.concatenate((poses.positions, poses.quaternions), axis=-1)"
        )

    def __array_function__(self, function: Callable, types: tuple, args: tuple, kwargs: dict) -> np.ndarray:
        """Raise a TypeError where NumPy would fail silently: `np.array_equal` just returns False without an array."""
        raise TypeError(f"np.{function.__name__} takes arrays: poses.positions and poses.quaternions are some")

    def __getitem__(self, index: Any) -> Poses:
        """Return the poses at `index` of the leading axes, as in NumPy: `poses[3]`, `poses[mask]`, `poses[..., 1:]`."""
        whole = (*(index if isinstance(index, tuple) else (index,)), slice(None))
        return of_each(self, lambda rows: rows[whole])

    def __setitem__(self, index: Any, poses: Poses) -> None:
        """Replace the poses at `index` in place. Scales are replaced only if both have scales."""
        whole = (*(index if isinstance(index, tuple) else (index,)), slice(None))
        self.positions[whole], self.quaternions[whole] = poses.positions, poses.quaternions
        if self.scales is not None and poses.scales is not None:
            self.scales[index] = poses.scales

    def copy(self) -> Poses:
        """Return a copy with new arrays."""
        return of_each(self, np.ndarray.copy)


@dataclass(frozen=True, eq=False)
class PackedPoses:
    """Poses (..., n) with each component contiguous in memory, also in selections: faster to compute with."""

    rows: np.ndarray
    """Positions, quaternions and, if the poses have them, scales, shape (7 or 8, ..., n)."""

    def __getitem__(self, samples: np.ndarray) -> Poses:
        """Return the poses at indices (m,) or (k, m) of the last axis, shape (..., m) or (..., k, m)."""
        return of_rows(self.rows.take(samples, axis=-1))

    def of(self, objects: np.ndarray | slice) -> Poses:
        """Return the poses at indices (k,) of the first axis, shape (k, ..., n)."""
        return of_rows(self.rows[:, objects])

    def blocks(self, most: int) -> Iterator[PackedPoses]:
        """Yield these poses (k, ..., n) in ranges of the last axis, each with at most `most` poses or one index.

        The ranges are views, so `put` on a range changes these poses.
        """
        count = self.rows.shape[-1] if self.rows.ndim > 2 else 0
        step = max(1, most // max(1, math.prod(self.rows.shape[1:-1])))
        for first in range(0, count, step) if count > step else ():
            yield PackedPoses(self.rows[..., first : first + step])
        if count <= step:
            yield self

    def put(self, objects: np.ndarray, poses: Poses) -> None:
        """Replace the poses at indices (k,) of the first axis by other poses (k, ..., n)."""
        self.rows[:3, objects], self.rows[3:7, objects] = components(poses.positions), components(poses.quaternions)
        if poses.scales is not None:
            self.rows[7, objects] = poses.scales


def packed(poses: Poses) -> PackedPoses:
    """Return the poses with each component contiguous in memory."""
    scales = [] if poses.scales is None else [poses.scales[None]]
    rows = np.concatenate([components(poses.positions), components(poses.quaternions), *scales])
    # NumPy would keep components interleaved, and `take` would copy all of them every time.
    return PackedPoses(np.ascontiguousarray(rows))


def of_rows(rows: np.ndarray) -> Poses:
    """Return poses (...) from the rows of `PackedPoses`, as views."""
    return Poses(vectors(rows[:3]), vectors(rows[3:7]), rows[7] if len(rows) > 7 else None)


def of_each(poses: Poses, change: Callable[[np.ndarray], np.ndarray]) -> Poses:
    """Return poses with `change` applied to positions (..., 3), quaternions (..., 4) and scales (..., 1)."""
    scales = None if poses.scales is None else change(poses.scales[..., None])[..., 0]
    return Poses(change(poses.positions), change(poses.quaternions), scales)


def reshaped(poses: Poses, *shape: int) -> Poses:
    """Return the poses with leading axes of this shape."""
    return of_each(poses, lambda rows: rows.reshape(*shape, rows.shape[-1]))


def aligned(poses: Poses) -> Poses:
    """Return poses (..., n) with the sign of each quaternion aligned with the one before."""
    return Poses(poses.positions, align_signs(poses.quaternions), poses.scales)


def joined(parts: Sequence[Poses], axis: int = 0) -> Poses:
    """Return the concatenation of poses along an axis; either all of them have scales, or none."""
    scales = None if parts[0].scales is None else np.concatenate([part.scales for part in parts], axis=axis)
    positions = np.concatenate([part.positions for part in parts], axis=axis)
    return Poses(positions, np.concatenate([part.quaternions for part in parts], axis=axis), scales)


def in_other_axes(poses: Poses, change: np.ndarray) -> Poses:
    """Return poses (...) in the coordinates to which a matrix (3, 3), a rotation or a mirror, maps points.

    Conjugation by C turns a rotation's axis v into det(C) C v and keeps its angle: a mirror image of a rotation turns
    the other way. So w stays and the vector part is mapped.
    """
    quaternions = poses.quaternions.copy()
    quaternions[..., 1:] = np.sign(np.linalg.det(change)) * poses.quaternions[..., 1:] @ change.T
    return Poses(poses.positions @ change.T, quaternions, poses.scales)


def placed(above: Poses, poses: Poses) -> Poses:
    """Return poses (...), given in the space of the poses `above` (...), in the space in which `above` is given.

    The result has scales if either has them. Leading axes broadcast.
    """
    arms = rotate(above.quaternions, poses.positions)
    scales = poses.scales if above.scales is None else above.scales
    if above.scales is not None:
        arms *= above.scales[..., None]
        scales = above.scales if poses.scales is None else above.scales * poses.scales
        scales = np.broadcast_to(scales, arms.shape[:-1])
    return Poses(above.positions + arms, multiply(above.quaternions, poses.quaternions), scales)


def inverse(poses: Poses) -> Poses:
    """Return the inverse transforms of poses (...)."""
    back = conjugate(poses.quaternions)
    arms = -rotate(back, poses.positions)
    if poses.scales is None:
        return Poses(arms, back)
    return Poses(arms / poses.scales[..., None], back, 1.0 / poses.scales)


def step_repeated(last: Poses, before: Poses) -> Poses:
    """Return the poses that repeat the step from `before` (...) to `last` (...): last before^-1 last."""
    turn = multiply(last.quaternions, conjugate(before.quaternions))
    return Poses(
        last.positions + rotate(turn, last.positions - before.positions),
        multiply(turn, last.quaternions),
        None if last.scales is None else last.scales * last.scales / before.scales,
    )
