"""Why a screw wins on one motion and loses on another: how much of its bow the recorded path has.

Between two keys the origin runs straight under `lerp_slerp` and on a bow under a screw. With a the way from the
straight line to the recorded position, and b to the screw's,

    k = sum a.b / sum |b|^2
    sum |a - b|^2 = sum |a|^2 - (2 k - 1) sum |b|^2

So the screw has the smaller RMS position error where the share k of its bow is above a half, exactly. A hand that
pivots about a wrist or an elbow has a k near 1, a body in free flight near 0. Lengths in metres.
"""

from __future__ import annotations

import numpy as np

from rigid_motion.motion import interpolate
from rigid_motion_batch.analysis.metrics import NOTHING
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.recordings.clips import Clip

from .claims import UPDATES
from .table import senders

SCREW = "dq_sclerp"

RATES = (5, 8, *sorted(UPDATES))
"""Updates a second."""


def bows_of(clip: Clip) -> dict[int, tuple[float, float]]:
    """Return by rate k, and the RMS position error of the screw as a multiple of that of `lerp_slerp`.

    Of `RATES` those that have in-betweens, over the senders of `table`.
    """
    result = {}
    for rate in RATES:
        pairs = [_from_the_straight(clip, keys) for keys in senders(clip, rate)]
        if pairs:
            a, b = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
            across, bow, missed, left = (float(np.sum(product)) for product in (a * b, b * b, a * a, (a - b) ** 2))
            if min(bow, missed) > len(a) * NOTHING**2:
                result[rate] = across / bow, float(np.sqrt(left / missed))
    return result


def _from_the_straight(clip: Clip, keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the ways from the straight line to what was recorded, and to the screw, between keys: (n, 3) each."""
    samples = slice(int(keys[0]), int(keys[-1]) + 1)
    straight, screw = (
        clip.in_metres(interpolate(clip.times[keys], clip.poses[keys], clip.times[samples], mode)).positions
        for mode in (REFERENCE, SCREW)
    )
    return clip.in_metres(clip.poses[samples]).positions - straight, screw - straight
