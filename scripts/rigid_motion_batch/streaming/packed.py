"""What else one would send of a body: every joint, at an even rate, as floats or as the smallest three components.

A receiver goes straight from one to the next. Bytes are those of the poses and of headers; errors are the largest
displacement of any point of the joints' balls, at every sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import shell_error
from rigid_motion.motion.quaternions import normalise
from rigid_motion.streams.bodies import Forest
from rigid_motion.streams.paths import Path

from .transports import HEADERS

STAMP = 5
"""Bytes of a datagram that say whose it is, and when: as few as will do."""

PLACE_BITS = 16
"""The bits of each coordinate of a place that is packed, over a cube of 8 metres."""

CUBE = 8.0


@dataclass(frozen=True)
class Packed:
    """A way of sending all joints, so often."""

    label: str

    rate: float

    bits: int | None
    """The bits of each of three components of a quaternion; None for floats."""

    @property
    def bits_a_turn(self) -> int:
        return 128 if self.bits is None else 2 + 3 * self.bits

    @property
    def bits_a_place(self) -> int:
        return 96 if self.bits is None else 3 * PLACE_BITS


WAYS = (
    Packed("float32 at 30 Hz", 30.0, None),
    Packed("smallest three (32 bits) at 20 Hz", 20.0, 10),
    Packed("29 bits at 30 Hz", 30.0, 9),
    Packed("29 bits at 12 Hz", 12.0, 9),
)


def errors(way: Packed, forest: Forest, samples: Path) -> np.ndarray:
    """Return how far off joints are shown at every sample, shape (joints, n)."""
    moments = np.arange(samples.moments[0], samples.moments[-1] + 1.0 / way.rate, 1.0 / way.rate)
    sent = samples.at(np.minimum(moments, samples.moments[-1]))
    positions, quaternions = sent.positions.swapaxes(0, 1), normalise(sent.quaternions.swapaxes(0, 1))
    if way.bits is None:
        positions, quaternions = (part.astype(np.float32).astype(np.float64) for part in (positions, quaternions))
    else:
        step = CUBE / (2**PLACE_BITS - 1)
        positions = np.where(forest.sliding[:, None], np.rint(positions / step) * step, positions)
        quaternions = smallest_three(quaternions, way.bits)
    still = np.zeros(positions.shape[1:])
    shown = Path(moments, positions, normalise(quaternions), still, still).at(samples.moments)
    skeleton = forest.skeleton
    truth = skeleton.in_root_space(samples.at(samples.moments))
    return shell_error(skeleton.in_root_space(shown), truth, forest.radii[:, None])


def bytes_a_second(way: Packed, forest: Forest) -> tuple[float, float]:
    """Return bytes without headers and with them."""
    size = -(-(len(forest) * way.bits_a_turn + int(forest.sliding.sum()) * way.bits_a_place) // 8)
    return way.rate * size, way.rate * (size + STAMP + HEADERS)


def smallest_three(quaternions: np.ndarray, bits: int) -> np.ndarray:
    """Return unit quaternions (..., 4) as they come back from three components of so many bits each."""
    largest = np.argmax(np.abs(quaternions), axis=-1)[..., None]
    sign = np.where(np.take_along_axis(quaternions, largest, axis=-1) < 0.0, -1.0, 1.0)
    step = np.sqrt(2.0) / (2**bits - 2)
    rounded = np.rint(sign * quaternions / step) * step
    np.put_along_axis(rounded, largest, 0.0, axis=-1)
    rest = np.sqrt(np.maximum(1.0 - np.sum(rounded**2, axis=-1, keepdims=True), 0.0))
    np.put_along_axis(rounded, largest, rest, axis=-1)
    return rounded
