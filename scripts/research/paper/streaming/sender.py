"""The sender: a trajectory as packets, so many a second.

Poses are taken at the exact ticks, along the screw from one recorded sample to the next, and not at the nearest sample:
tracking systems say where a device is at the moment they are asked about (OpenXR's `xrLocateSpace`), and a stream whose
poses were up to half a sample away from their tick would measure the recording's clock and not the link.
"""

from __future__ import annotations

import numpy as np

from rigid_motion.motion import Poses, interpolate

from .packets import Packets
from .packing import PACKINGS, Packing


def send(times: np.ndarray, poses: Poses, rate: float, packing: Packing = PACKINGS["double"]) -> Packets:
    """The packets of a sender of `rate` poses a second.

    Parameters
    ----------
    times : array, shape (n,)
        Seconds, strictly rising. The first tick is at the first sample, the last no later than the last sample.
    poses : Poses, shape (n,)
    rate : float
        Packets a second.
    packing : Packing

    Returns
    -------
    Packets
        Stamped with their ticks. None where the trajectory has no samples.

    Raises
    ------
    ValueError
        For a rate that is not a positive number, times that do not rise, and poses that the packing cannot say.
    """
    if not (np.isfinite(rate) and rate > 0.0):
        raise ValueError(f"a rate of {rate} packets a second is not a positive number")
    times = np.asarray(times, dtype=np.float64)
    if len(times) == 0:
        return Packets.of(times, poses, 1.0 / rate, packing)
    # The allowance is for rounding, as in 2.0 * 0.5: the last tick may be the last sample.
    ticks = times[0] + np.arange(np.floor((times[-1] - times[0]) * rate + 1e-6) + 1.0) / rate
    return Packets.of(ticks, interpolate(times, poses, ticks, "dq_sclerp"), 1.0 / rate, packing)
