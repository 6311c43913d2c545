"""What else one would send of a body: every joint, at an even rate, as floats or as the smallest three components.

A receiver goes straight from one to the next. Bytes are those of the poses and of headers; errors are the largest
displacement of any point of the joints' balls, at every sample.
"""

from __future__ import annotations

import numpy as np

from rigid_motion.motion import Poses, rms
from rigid_motion.motion.quaternions import align_signs, normalise
from rigid_motion.streams import Body
from rigid_motion.streams.paths import Path

from .measuring import HEADERS

WAYS: dict[str, tuple[float, int | None]] = {
    "float32 at 30 Hz": (30.0, None),
    "smallest three (32 bits) at 20 Hz": (20.0, 10),
    "29 bits at 30 Hz": (30.0, 9),
    "29 bits at 12 Hz": (12.0, 9),
}
"""How often all joints are sent, and the bits of each component of a quaternion; None for floats."""

STAMP = 5
"""Bytes of a datagram that say whose it is, and when: as few as will do."""

PLACE_BITS, CUBE = 16, 8.0
"""The bits of each coordinate of a place that is packed, over a cube of so many metres."""


def packed(body: Body, times: np.ndarray, poses: Poses) -> dict[str, dict[str, float]]:
    """Return what each way costs of samples (n,) of poses (joints, n), and how far off they are."""
    result, sliding, step = {}, np.asarray(body.sliding), CUBE / (2**PLACE_BITS - 1)
    samples = Path(times, Poses(poses.positions, align_signs(poses.quaternions)))
    for label, (rate, bits) in WAYS.items():
        moments = np.arange(times[0], times[-1] + 1.0 / rate, 1.0 / rate)
        sent = samples.at(np.minimum(moments, times[-1]))
        if bits is None:
            turn, place = 128, 96
            positions, quaternions = sent.positions.astype(np.float32), sent.quaternions.astype(np.float32)
        else:
            turn, place = 2 + 3 * bits, 3 * PLACE_BITS
            rounded = np.rint(sent.positions / step) * step
            positions = np.where(sliding[:, None, None], rounded, sent.positions)
            quaternions = smallest_three(normalise(sent.quaternions), bits)
        shown = Path(moments, Poses(positions, normalise(quaternions.astype(np.float64)))).at(times)
        worst = body.errors(shown, samples.at(times)).max(axis=0)
        size = -(-(len(body.joints) * turn + np.count_nonzero(sliding) * place) // 8)
        result[label] = {
            "bytes_a_second": rate * size,
            "bytes_a_second_with_headers": rate * (size + STAMP + HEADERS),
            "rms_mm": 1000.0 * rms(worst),
            "largest_mm": 1000.0 * float(worst.max()),
        }
    return result


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
