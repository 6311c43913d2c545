"""Packed poses: all joints of a body at an even rate, as floats or as the smallest three quaternion components.

The receiver interpolates linearly between poses.
"""

from __future__ import annotations

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.streams import StreamBody
from rigid_motion.streams.bodies import Forest
from rigid_motion.streams.paths import KnotPath
from rigid_motion_batch.streaming.measuring import HEADER_BYTES, cost

WAYS: dict[str, tuple[float, int | None]] = {
    "float32 at 30 Hz": (30.0, None),
    "smallest three (32 bits) at 20 Hz": (20.0, 10),
    "29 bits at 30 Hz": (30.0, 9),
    "29 bits at 12 Hz": (12.0, 9),
}
"""The sending rate of all joints, and the bits per quaternion component; None for floats."""

STAMP_BYTES = 5
"""Bytes of a datagram for the sender and the time: as few as suffice."""

PLACE_BITS, CUBE_M = 16, 8.0
"""The bits per packed position coordinate, and the side of the cube that they cover, in metres."""


def packed(body: StreamBody, times: np.ndarray, poses: Poses) -> dict[str, dict[str, float]]:
    """Return the cost and the errors of each way to pack samples (n,) of poses (joints, n)."""
    result, sliding, step = {}, np.asarray(body.sliding), CUBE_M / (2**PLACE_BITS - 1)
    for label, (rate, bits) in WAYS.items():
        moments = np.arange(times[0], times[-1] + 1.0 / rate, 1.0 / rate)
        # Floats count as exact.
        sent, turn, place = KnotPath(times, poses).at(np.minimum(moments, times[-1])), 4 * 32, 3 * 32
        if bits:
            turn, place = 2 + 3 * bits, 3 * PLACE_BITS
            rounded = np.where(sliding[:, None, None], np.rint(sent.positions / step) * step, sent.positions)
            sent = Poses(rounded, smallest_three(sent.quaternions, bits))
        size = -(-(len(body.joints) * turn + np.count_nonzero(sliding) * place) // 8)
        off = Forest([body]).errors(KnotPath(moments, sent).at(times), poses).max(axis=0)
        result[label] = cost(rate * size, rate * (STAMP_BYTES + HEADER_BYTES), off)
    return result


def smallest_three(quaternions: np.ndarray, bits: int) -> np.ndarray:
    """Return unit quaternions (..., 4) as decoded from three components of this many bits each."""
    largest = np.argmax(np.abs(quaternions), axis=-1)[..., None]
    step = np.sqrt(2.0) / (2**bits - 2)
    rounded = np.rint(quaternions / step) * step
    np.put_along_axis(rounded, largest, 0.0, axis=-1)
    rest = np.sqrt(np.maximum(1.0 - np.sum(rounded**2, axis=-1, keepdims=True), 0.0))
    rest = np.copysign(rest, np.take_along_axis(quaternions, largest, axis=-1))
    np.put_along_axis(rounded, largest, rest, axis=-1)
    return rounded
