"""Why a screw wins on one motion and loses on another: how much of its bow the recorded path has.

Between two keys the origin runs straight under `lerp_slerp` and on a bow under a screw. With a the way from the
straight line to the recorded position, and b to the screw's, the sums of squared errors differ as `FORMULA` says. So
the screw has the smaller RMS position error where the share k of its bow is above a half, exactly; and by how much
depends on the stake, sum |b|^2 / sum |a|^2. A hand that pivots about a wrist or an elbow has a k near 1, a body in free
flight near 0. Lengths in metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import interpolate
from rigid_motion_batch.analysis.metrics import NOTHING
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.recordings.clips import Clip

from . import claims
from .table import senders

FORMULA = (
    "k = sum a.b / sum |b|^2",
    "sum |a - b|^2 = sum |a|^2 - (2 k - 1) sum |b|^2",
)
"""What k is, and what it decides; a and b as above."""

SCREW = "dq_sclerp"

RATES = (5, 8, *sorted(row.state_of_the_art for row in claims.TABLE))
"""Updates a second."""


@dataclass(frozen=True)
class Bow:
    """What the recorded path has of the screw's bow. The fields are the columns of `bows.csv`."""

    clip: str
    updates: int

    share: float
    """k."""

    stake: float
    """The sum of squares of the bow, over that of the straight line's errors."""

    error: float
    """The RMS position error of the screw, as a multiple of that of `lerp_slerp`."""


def bows_of(clip: Clip) -> list[Bow]:
    """The bows of a clip at each of `RATES` that has in-betweens, over the senders of `table`."""
    found = []
    for rate in RATES:
        pairs = [_from_the_straight(clip, keys) for keys in senders(clip, rate)]
        if not pairs:
            continue
        a, b = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
        across, bow, missed, left = (float(np.sum(product)) for product in (a * b, b * b, a * a, (a - b) ** 2))
        if min(bow, missed) > len(a) * NOTHING**2:
            found.append(Bow(clip.name, rate, across / bow, bow / missed, float(np.sqrt(left / missed))))
    return found


def _from_the_straight(clip: Clip, keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The ways from the straight line to what was recorded, and to the screw, at all samples between keys: (n, 3)."""
    samples = slice(int(keys[0]), int(keys[-1]) + 1)
    straight, screw = (
        clip.in_metres(interpolate(clip.times[keys], clip.poses[keys], clip.times[samples], mode)).positions
        for mode in (REFERENCE, SCREW)
    )
    return clip.in_metres(clip.poses[samples]).positions - straight, screw - straight
