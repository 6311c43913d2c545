"""Cost of streams that send only when needed, compared with equally accurate streams at even rates.

The even streams are the paper's state of the art, `lerp_slerp` at its rates; the other is the codec of
`rigid_motion.streams`, over loopback to another process (`streaming.measuring`). The codec's tolerance is searched for:
its RMS shell error must equal that of the even stream. Bytes are per second, with the UDP and IPv4 headers of each
datagram, without the description that a receiver gets when it joins. Only the first `SENT_S` are sent. Seconds, metres.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from research.live_streams.packings import STAMP_BYTES
from rigid_motion.motion import decimate
from rigid_motion_batch.analysis.metrics import geometric_mean
from rigid_motion_batch.analysis.modes import STATE_OF_THE_ART as REFERENCE
from rigid_motion_batch.analysis.needed import Ways, part_of
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.streaming.measuring import HEADER_BYTES, measure
from rigid_motion_batch.streaming.sending import body_of, samples_of

from .table import SHELL_RADIUS_M, UPDATES, has_samples_for

DELAYS_S = (0.1, 0.2)  # the delay of the shown motion
SENT_S = 10.0

TOLERANCE_RANGE = 1.0, 5.0, 4
"""Tried tolerances: from this multiple of the smallest requested error, to this multiple of the largest, and the
number of tolerances."""

PACKINGS = {"7 doubles": 56, "7 singles": 28}
"""Bytes per pose."""


def sent(clip: Clip, tolerance: float, delay: float) -> tuple[float, float, float]:
    """Send a clip over loopback, and return datagrams and bytes per second, and the RMS shell error of the result."""
    times, poses = samples_of(clip)
    cost, _ = measure([body_of(clip, poses, SHELL_RADIUS_M)], times, poses, tolerance, delay)
    size = cost["bytes_a_second_with_headers"]
    return (size - cost["bytes_a_second"]) / HEADER_BYTES, size, 1e-3 * cost["rms_mm"]


def costs_of(clip: Clip) -> dict[float, dict[int, tuple[float, float]]]:
    """Return datagrams and bytes per second, by delay and by the rate of the equally accurate even stream."""
    clip = part_of(clip, 0, int(np.searchsorted(clip.times, clip.times[0] + SENT_S, side="right")) - 1)
    ways = Ways(clip, SHELL_RADIUS_M)
    requested = {
        rate: ways.error(decimate(clip.times, rate), REFERENCE) for rate in UPDATES if has_samples_for(clip, rate)
    }
    low, high, count = TOLERANCE_RANGE
    tolerances = np.geomspace(low * min(requested.values()), high * max(requested.values()), count)
    result: dict[float, dict[int, tuple[float, float]]] = {}
    for delay in DELAYS_S:
        datagrams, size, errors = np.array([sent(clip, float(tolerance), delay) for tolerance in tolerances]).T
        result[delay] = {
            rate: (lowest(datagrams, errors, error), lowest(size, errors, error)) for rate, error in requested.items()
        }
    return result


def lowest(cost: np.ndarray, errors: np.ndarray, requested: float) -> float:
    """Return the cost at which a curve (n,) reaches the requested error; infinite if it never does.

    Between two points, the curve is a straight line on a double logarithmic scale.
    """
    order = np.argsort(errors)
    return float(np.exp(np.interp(np.log(requested), np.log(errors[order]), np.log(cost[order]), left=np.inf)))


def costs(clips: list[Clip]) -> dict[str, Any]:
    """Return geometric means over clips, and the bytes of even streams, for each of the paper's rates."""
    of_clips = {clip.name: costs_of(clip) for clip in clips}
    even = {name: [rate * (size + STAMP_BYTES + HEADER_BYTES) for rate in UPDATES] for name, size in PACKINGS.items()}
    needed = {}
    for delay in DELAYS_S:
        table = np.array([[clip[delay].get(rate, (np.nan,) * 2) for rate in UPDATES] for clip in of_clips.values()])
        datagrams, size = geometric_mean(table).T
        needed[f"{1e3 * delay:.0f}"] = {
            "datagrams": datagrams,
            "bytes": size,
            "saved_datagrams": 1.0 - datagrams / UPDATES,
            "saved_bytes": {name: 1.0 - size / of_even for name, of_even in even.items()},
        }
    return {"seconds": SENT_S, "clips": list(of_clips), "even": even, "needed": needed}
