"""Packing: a pose as bytes, and back.

Positions are in any unit for `double` and `single`, in metres for `smallest_three`; quaternions are w, x, y, z. All
numbers are little-endian, without padding. What each packing loses is stated as a bound: `Packing.bounds`.

Source of the smallest three: Fiedler, "Snapshot Compression", gafferongames.com, 2015.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import normalise

POSITION_BITS = 21
"""For each coordinate of a quantised position: three of them fill 8 bytes but for a bit."""

COMPONENT_BITS = 15
"""For each of the smallest three components of a quaternion: they fill 6 bytes with the 2 bits that name the fourth."""

BOX = 8.0
"""Half the side, in metres, of the cube about the origin that `PACKINGS["smallest_three"]` can say positions in."""

ROUNDING = 1e-15
"""What double precision itself adds to a bound, as a share of the numbers it is about."""


@dataclass(frozen=True)
class Packing:
    """One way of writing a pose as bytes."""

    label: str
    """As reports show it."""

    size: int
    """Bytes a pose."""

    pack: Callable[[Poses], np.ndarray]
    """From poses (n,) to bytes, uint8 of shape (n, size). Raises ValueError for the first pose that cannot be said."""

    unpack: Callable[[np.ndarray], Poses]
    """Back, from bytes (n, size). Bytes that nobody packed may give numbers that are not finite."""

    bounds: Callable[[Poses], tuple[np.ndarray, np.ndarray]]
    """The largest error of each of n poses: of the position, a distance, and of the rotation, radians; (n,) each."""

    twist_kind: str
    """The six numbers of a twist, as NumPy calls them."""

    @property
    def twist_size(self) -> int:
        """Bytes a twist."""
        return 6 * np.dtype(self.twist_kind).itemsize

    def pack_twists(self, twists: np.ndarray) -> np.ndarray:
        """From twists (n, 6) to bytes, uint8 of shape (n, twist_size). Raises ValueError for the first too fast."""
        twists = np.asarray(twists, dtype=np.float64)
        largest = float(np.finfo(self.twist_kind).max)
        _require(np.abs(twists).max(axis=-1, initial=0.0) <= largest, f"has a number beyond {largest:g}", "twist")
        return np.ascontiguousarray(twists.astype(self.twist_kind)).view(np.uint8).reshape(len(twists), self.twist_size)

    def unpack_twists(self, data: np.ndarray) -> np.ndarray:
        """Back, from bytes (n, twist_size) to twists (n, 6)."""
        with np.errstate(invalid="ignore"):
            return np.ascontiguousarray(data).view(self.twist_kind).astype(np.float64).reshape(len(data), 6)


def _floats(label: str, kind: str) -> Packing:
    """Seven floating-point numbers, x, y, z, w, x, y, z, as they are."""
    number = np.dtype(kind)
    # Half a unit in the last place; nothing where the numbers are doubles already.
    lost = 0.0 if number.itemsize == 8 else 0.5 * float(np.finfo(number).eps)
    least = 0.0 if number.itemsize == 8 else float(np.finfo(number).smallest_subnormal)

    def pack(poses: Poses) -> np.ndarray:
        _require_sendable(poses)
        numbers = np.concatenate((poses.positions, poses.quaternions), axis=-1)
        _require(
            np.abs(numbers).max(axis=-1, initial=0.0) <= np.finfo(number).max, "has a number beyond single precision"
        )
        return np.ascontiguousarray(numbers.astype(number)).view(np.uint8)

    def unpack(data: np.ndarray) -> Poses:
        # Bytes that nobody packed may be signalling NaNs.
        with np.errstate(invalid="ignore"):
            numbers = np.ascontiguousarray(data).view(number).astype(np.float64)
        return Poses(numbers[:, :3], numbers[:, 3:])

    def bounds(poses: Poses) -> tuple[np.ndarray, np.ndarray]:
        distances = lost * np.linalg.norm(poses.positions, axis=-1) * (1.0 + ROUNDING) + least
        return distances, np.full(len(poses), 2.0 * np.arcsin(lost) * (1.0 + ROUNDING))

    return Packing(label, 7 * number.itemsize, pack, unpack, bounds, kind)


def smallest_three(low: ArrayLike, high: ArrayLike) -> Packing:
    """A quarter of the paper's bytes: 14 a pose, for positions in a box.

    Parameters
    ----------
    low, high : array-like, shape (3,)
        Corners of the box, in the unit of the positions.

    Returns
    -------
    Packing
        Positions are rounded to a grid of 2^21 - 1 points along each side, and are off by no more than

            sqrt(sum of (step / 2)^2),    step = (high - low) / (2^21 - 2)

        Of the unit quaternion, the component of the largest size is left out, the sign chosen so that it is positive;
        the others are at most 1/sqrt(2) and rounded to within d = 1 / (2 sqrt(2) (2^14 - 1)), which turns by no more
        than

            2 sqrt(3) d / sqrt(1/4 - 3 d - 3 d^2)

        about 4 sqrt(3) d = 1.5e-4 radians, since the component that is left out is at least 1/2. The middle of the box
        and quaternions of ones and zeros come back exact.

    Raises
    ------
    ValueError
        For a box without an inside.

    Notes
    -----
    The layout: 8 bytes x + y 2^21 + z 2^42, each counted from the low side; 6 bytes k + a 2^2 + b 2^17 + c 2^32, where
    k is the component left out and a, b, c are the others in order, counted from -1/sqrt(2).
    """
    low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    if low.shape != (3,) or high.shape != (3,) or not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise ValueError(f"a box needs two corners of three finite numbers, not {low.tolist()} and {high.tolist()}")
    if not np.all(low < high):
        raise ValueError(f"a box from {low.tolist()} to {high.tolist()} has no inside")
    # An even number of steps, so that there is a grid point in the middle.
    steps, component_steps = 2**POSITION_BITS - 2, 2**COMPONENT_BITS - 2
    step, component_step = (high - low) / steps, np.sqrt(2.0) / component_steps
    positions_at = (np.uint64(POSITION_BITS) * np.arange(3)).astype(np.uint64)
    components_at = (2 + np.uint64(COMPONENT_BITS) * np.arange(3)).astype(np.uint64)

    def pack(poses: Poses) -> np.ndarray:
        _require_sendable(poses)
        _require(
            np.all((poses.positions >= low) & (poses.positions <= high), axis=-1),
            f"has a position outside the box from {low.tolist()} to {high.tolist()}; "
            "give a larger box, or poses in metres",
        )
        quaternions = normalise(poses.quaternions)
        left_out = np.argmax(np.abs(quaternions), axis=-1)[:, None]
        signs = np.where(np.take_along_axis(quaternions, left_out, axis=-1) < 0.0, -1.0, 1.0)
        others = np.take_along_axis(signs * quaternions, _others(left_out), axis=-1)
        place = np.rint((poses.positions - low) / step).astype(np.uint64)
        turn = (np.rint(others / component_step) + component_steps // 2).astype(np.uint64)
        words = np.stack(
            (
                np.bitwise_or.reduce(place << positions_at, axis=-1),
                np.bitwise_or.reduce(turn << components_at, axis=-1) | left_out[:, 0].astype(np.uint64),
            ),
            axis=-1,
        )
        return np.ascontiguousarray(words.astype("<u8").view(np.uint8)[:, :14])

    def unpack(data: np.ndarray) -> Poses:
        padded = np.zeros((len(data), 16), dtype=np.uint8)
        padded[:, :14] = data
        place, turn = padded.view("<u8").astype(np.uint64).T[..., None]
        left_out = (turn & np.uint64(3)).astype(np.int64)
        place = (place >> positions_at) & np.uint64(2**POSITION_BITS - 1)
        turn = (turn >> components_at) & np.uint64(2**COMPONENT_BITS - 1)
        others = (turn.astype(np.float64) - component_steps // 2) * component_step
        largest = np.sqrt(np.maximum(0.0, 1.0 - np.einsum("ni,ni->n", others, others)))[:, None]
        quaternions = np.empty((len(data), 4))
        np.put_along_axis(quaternions, left_out, largest, axis=-1)
        np.put_along_axis(quaternions, _others(left_out), others, axis=-1)
        centre = 0.5 * (low + high)
        return Poses(centre + (place.astype(np.float64) - steps // 2) * step, quaternions)

    def bounds(poses: Poses) -> tuple[np.ndarray, np.ndarray]:
        d = 0.5 * component_step
        distance = 0.5 * np.linalg.norm(step) + ROUNDING * np.linalg.norm(np.maximum(np.abs(low), np.abs(high)))
        angle = 2.0 * np.sqrt(3.0) * d / np.sqrt(0.25 - 3.0 * d - 3.0 * d * d) + ROUNDING
        return np.full(len(poses), distance), np.full(len(poses), angle)

    return Packing("Smallest three", 14, pack, unpack, bounds, "<f2")


PACKINGS: dict[str, Packing] = {
    "double": _floats("7 doubles", "<f8"),
    "single": _floats("7 singles", "<f4"),
    "smallest_three": smallest_three((-BOX, -BOX, -BOX), (BOX, BOX, BOX)),
}


def _others(left_out: np.ndarray) -> np.ndarray:
    """The three components besides the one left out (n, 1), rising, shape (n, 3)."""
    rest = np.arange(3)
    return rest + (rest >= left_out)


def _require_sendable(poses: Poses) -> None:
    """Raise a ValueError for the first pose that no packing can say."""
    if len(poses.shape) != 1:
        raise ValueError(f"a stream is of one object: poses need the shape (n,), not {poses.shape}")
    if poses.scales is not None:
        raise ValueError("a stream has no room for scales: it sends a position and a quaternion")
    _require(np.isfinite(poses.positions).all(axis=-1), "has a position that is not finite")
    _require(np.isfinite(poses.quaternions).all(axis=-1), "has a quaternion that is not finite")
    _require(poses.quaternions.any(axis=-1), "has a quaternion of length zero")


def _require(good: np.ndarray, complaint: str, of: str = "pose") -> None:
    if not good.all():
        raise ValueError(f"{of} {np.flatnonzero(~good)[0]} {complaint}")
