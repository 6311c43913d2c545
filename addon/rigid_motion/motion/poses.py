"""Poses: where a rigid body is and how it is turned, for many moments at once.

Positions are in the units of their source, quaternions are unit, scalar first (w, x, y, z) as in `mathutils`, and
scales are uniform and positive. All arrays are float64 and share their leading axes; the last of those is time, so
one object has arrays of shape (n, 3) and (n, 4), and many objects have (objects, n, 3) and (objects, n, 4).
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
"""A number beyond this is damage, not a measurement, and more than Blender can hold. Powers of it are still floats."""

MAX_AXES_ERROR_RATIO = 1e-3
"""By what part of the scale the axes of a matrix may differ from three of one length at right angles to one another."""

MAX_UNIT_SCALE_ERROR = 1e-6
"""A scale that differs less from 1 is 1: single precision has no better."""

MIN_TIME_GAP = 1e-30
"""Between two moments, for the same reason: what happens in less has a speed that is no float."""


def numbers(values: ArrayLike, name: str) -> np.ndarray:
    """Return an argument of this name as an array of float64, kept where it is one.

    Raises TypeError where it is made of strings, complex numbers or anything else, ValueError for rows of different
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
    """Positions, rotations and, where the body grows or shrinks, scales.

    Parameters
    ----------
    positions : array-like, shape (..., n, 3)
        In any unit of length. The last of the leading axes is time: one object has (n, 3), many have (objects, n, 3).
    quaternions : array-like, shape (..., n, 4)
        w, x, y, z (Hamilton's, as in `mathutils`). Kept as given: neither normalised nor checked for signs, which
        `repair` does.
    scales : array-like, shape (..., n), optional
        Uniform scales. None means 1 everywhere, and is what every mode runs fastest with.

    Raises
    ------
    ValueError
        Where the shapes do not fit one another.
    TypeError
        Where positions, quaternions or scales are no numbers.
        Also where NumPy is to make one array of poses, or work on them as if they were one: a mean or a sum of
        quaternions is no rotation. Take `positions` and `quaternions`.

    See Also
    --------
    interpolate : Poses between keys.
    repair : Unit quaternions from recorded ones.

    Notes
    -----
    Arrays of float64 are kept, not copied; all others become float64. Whatever indexes the leading axes by NumPy's
    rules indexes poses, a slice is a view, and a number picks a single pose, of shape (). The length of poses is that
    of their first axis, which is also what a loop runs over; a single pose has neither. To `==`, poses are the same
    only where they are the same object.

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
        """Poses whose quaternions are x, y, z, w, as ROS, Unity, Unreal, glTF and SciPy have them.

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
        """Poses of matrices (..., 4, 4) that multiply columns, as NumPy, Blender and OpenCV have them.

        Raises
        ------
        ValueError
            Where a matrix mirrors, shears or scales unevenly: no pose does. The message names the first.

        Notes
        -----
        Quaternions have successive signs only after `repair`. Scales are None where all are 1. A matrix with NaN is a
        pose of NaN.

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
        """Return the poses along the first axis: single ones of one object, or those of each of many objects."""
        if not self.shape:
            raise TypeError("a single pose, of shape (), has nothing to go through")
        return (self[index] for index in range(len(self)))

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> np.ndarray:
        """Refuse to be one array: NumPy would take means and sums of quaternions, and leave out scales."""
        raise TypeError(
            "poses are no single array: take poses.positions and poses.quaternions, or rows of x, y, z, w, x, y, z by "
            "np.concatenate((poses.positions, poses.quaternions), axis=-1)"
        )

    def __array_function__(self, function: Callable, types: tuple, args: tuple, kwargs: dict) -> np.ndarray:
        """Refuse in words too where NumPy would keep quiet: to `np.array_equal`, what is no array is just not equal."""
        raise TypeError(f"np.{function.__name__} takes arrays: poses.positions and poses.quaternions are some")

    def __getitem__(self, index: Any) -> Poses:
        """Return the poses at `index` of the leading axes, as in NumPy: `poses[3]`, `poses[mask]`, `poses[..., 1:]`."""
        whole = (*(index if isinstance(index, tuple) else (index,)), slice(None))
        return of_each(self, lambda rows: rows[whole])

    def __setitem__(self, index: Any, poses: Poses) -> None:
        """Put others in the place of those at `index`, in the same arrays. Scales only where both have some."""
        whole = (*(index if isinstance(index, tuple) else (index,)), slice(None))
        self.positions[whole], self.quaternions[whole] = poses.positions, poses.quaternions
        if self.scales is not None and poses.scales is not None:
            self.scales[index] = poses.scales

    def copy(self) -> Poses:
        """Return the same in arrays of their own."""
        return of_each(self, np.ndarray.copy)


@dataclass(frozen=True, eq=False)
class PackedPoses:
    """Poses (..., n) whose components are apart in memory, as what is picked from them is: quicker to work on."""

    rows: np.ndarray
    """Positions, quaternions and, where there are some, scales, shape (7 or 8, ..., n)."""

    def __getitem__(self, samples: np.ndarray) -> Poses:
        """Those at some numbers (m,) or (k, m) of the last axis, shape (..., m) or (..., k, m)."""
        return of_rows(self.rows.take(samples, axis=-1))

    def of(self, objects: np.ndarray | slice) -> Poses:
        """Those at some numbers (k,) of the first axis, shape (k, ..., n)."""
        return of_rows(self.rows[:, objects])

    def blocks(self, most: int) -> Iterator[PackedPoses]:
        """Yield the same poses (k, ..., n) by ranges of their last axis, so many in each. Views: `put` is seen here."""
        count = self.rows.shape[-1] if self.rows.ndim > 2 else 0
        step = max(1, most // max(1, math.prod(self.rows.shape[1:-1])))
        for first in range(0, count, step) if count > step else ():
            yield PackedPoses(self.rows[..., first : first + step])
        if count <= step:
            yield self

    def put(self, objects: np.ndarray, poses: Poses) -> None:
        """Others (k, ..., n) in the place of those."""
        self.rows[:3, objects], self.rows[3:7, objects] = components(poses.positions), components(poses.quaternions)
        if poses.scales is not None:
            self.rows[7, objects] = poses.scales


def packed(poses: Poses) -> PackedPoses:
    """Return the same poses, components apart."""
    scales = [] if poses.scales is None else [poses.scales[None]]
    rows = np.concatenate([components(poses.positions), components(poses.quaternions), *scales])
    # NumPy keeps components that are side by side as they are, and `take` would copy them all every time.
    return PackedPoses(np.ascontiguousarray(rows))


def of_rows(rows: np.ndarray) -> Poses:
    """Return poses (...) of the rows of `PackedPoses`. Views."""
    return Poses(vectors(rows[:3]), vectors(rows[3:7]), rows[7] if len(rows) > 7 else None)


def of_each(poses: Poses, change: Callable[[np.ndarray], np.ndarray]) -> Poses:
    """Return poses of arrays that are changed alike: positions (..., 3), quaternions (..., 4) and scales (..., 1)."""
    scales = None if poses.scales is None else change(poses.scales[..., None])[..., 0]
    return Poses(change(poses.positions), change(poses.quaternions), scales)


def reshaped(poses: Poses, *shape: int) -> Poses:
    """Return the same in arrays of these leading axes."""
    return of_each(poses, lambda rows: rows.reshape(*shape, rows.shape[-1]))


def aligned(poses: Poses) -> Poses:
    """Return poses (..., n) whose quaternions have successive signs."""
    return Poses(poses.positions, align_signs(poses.quaternions), poses.scales)


def joined(parts: Sequence[Poses], axis: int = 0) -> Poses:
    """Poses one after another along an axis; all of them have scales, or none."""
    scales = None if parts[0].scales is None else np.concatenate([part.scales for part in parts], axis=axis)
    positions = np.concatenate([part.positions for part in parts], axis=axis)
    return Poses(positions, np.concatenate([part.quaternions for part in parts], axis=axis), scales)


def in_other_axes(poses: Poses, change: np.ndarray) -> Poses:
    """Return poses (...) in the axes that a matrix (3, 3) takes points to, a rotation or a mirror.

    Conjugation by C turns a rotation's axis v into det(C) C v and keeps its angle: a mirror image of a rotation turns
    the other way. So w stays and the vector part is mapped.
    """
    quaternions = poses.quaternions.copy()
    quaternions[..., 1:] = np.sign(np.linalg.det(change)) * poses.quaternions[..., 1:] @ change.T
    return Poses(poses.positions @ change.T, quaternions, poses.scales)


def placed(above: Poses, poses: Poses) -> Poses:
    """Where poses (...) are that are given in the space of others (...), with a scale where either has one.

    What has fewer leading axes is the same along the others.
    """
    arms = rotate(above.quaternions, poses.positions)
    scales = poses.scales if above.scales is None else above.scales
    if above.scales is not None:
        arms *= above.scales[..., None]
        scales = above.scales if poses.scales is None else above.scales * poses.scales
        scales = np.broadcast_to(scales, arms.shape[:-1])
    return Poses(above.positions + arms, multiply(above.quaternions, poses.quaternions), scales)


def inverse(poses: Poses) -> Poses:
    """Return what takes poses (...) back to where they came from."""
    back = conjugate(poses.quaternions)
    arms = -rotate(back, poses.positions)
    if poses.scales is None:
        return Poses(arms, back)
    return Poses(arms / poses.scales[..., None], back, 1.0 / poses.scales)


def beyond(last: Poses, before: Poses) -> Poses:
    """Where a motion gets that goes on from `last` (...) as it went there from `before` (...): last before^-1 last."""
    turn = multiply(last.quaternions, conjugate(before.quaternions))
    return Poses(
        last.positions + rotate(turn, last.positions - before.positions),
        multiply(turn, last.quaternions),
        None if last.scales is None else last.scales * last.scales / before.scales,
    )
