"""What else one would send of a body: every joint, at an even rate, as floats or as the smallest three components.

A receiver goes straight from one to the next. Bytes are those of the poses and of headers; errors are the largest
displacement of any point of the joints' balls, at every sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import normalise
from rigid_motion.streams import Body
from rigid_motion.streams.paths import Path

from .measuring import HEADERS, errors

STAMP = 5
"""Bytes of a datagram that say whose it is, and when: as few as will do."""

PLACE_BITS, CUBE = 16, 8.0
"""The bits of each coordinate of a place that is packed, over a cube of so many metres."""


@dataclass(frozen=True)
class Packed:
    """A way of sending all joints, so often, and the bits of each component of a quaternion; None for floats."""

    label: str
    rate: float
    bits: int | None

    def bytes_a_second(self, body: Body) -> tuple[float, float]:
        """Return bytes without headers and with them."""
        turn, place = (128, 96) if self.bits is None else (2 + 3 * self.bits, 3 * PLACE_BITS)
        size = -(-(len(body.joints) * turn + np.count_nonzero(body.sliding) * place) // 8)
        return self.rate * size, self.rate * (size + STAMP + HEADERS)

    def errors(self, body: Body, samples: Path) -> np.ndarray:
        """Return how far off joints are shown at every sample, shape (joints, n)."""
        moments = np.arange(samples.moments[0], samples.moments[-1] + 1.0 / self.rate, 1.0 / self.rate)
        sent = samples.at(np.minimum(moments, samples.moments[-1]))
        positions, quaternions = sent.positions, normalise(sent.quaternions)
        if self.bits is None:
            positions, quaternions = (part.astype(np.float32).astype(np.float64) for part in (positions, quaternions))
        else:
            step = CUBE / (2**PLACE_BITS - 1)
            sliding = np.asarray(body.sliding)[:, None, None]
            positions = np.where(sliding, np.rint(positions / step) * step, positions)
            quaternions = smallest_three(quaternions, self.bits)
        shown = Path(moments, Poses(positions, normalise(quaternions))).at(samples.moments)
        return errors(body, shown, samples.at(samples.moments))


WAYS = (
    Packed("float32 at 30 Hz", 30.0, None),
    Packed("smallest three (32 bits) at 20 Hz", 20.0, 10),
    Packed("29 bits at 30 Hz", 30.0, 9),
    Packed("29 bits at 12 Hz", 12.0, 9),
)


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
