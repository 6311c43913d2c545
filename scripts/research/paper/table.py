"""The paper's table: how many updates a second each mode needs to be as good as the state of the art is with its own.

As good means an RMS shell error no larger than that of `lerp_slerp` at 30, 20, 15 or 12 updates a second. How many that
takes is what comparisons find (`analysis.needed`, keys_needed.csv), of a single sender. Errors are in metres.

Why a screw wins on one motion and loses on another, `bows_of` tells: between two keys the origin runs straight under
`lerp_slerp` and on a bow under a screw. With a the way from the straight line to the recorded position, and b to the
screw's,

    k = sum a.b / sum |b|^2
    sum |a - b|^2 = sum |a|^2 - (2 k - 1) sum |b|^2

So the screw has the smaller RMS position error where the share k of its bow is above a half, exactly. A hand that
pivots about a wrist or an elbow has a k near 1, a body in free flight near 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigid_motion.motion import decimate, interpolate
from rigid_motion_batch.analysis.metrics import MAX_ROUNDING_M, geometric_mean
from rigid_motion_batch.analysis.modes import REFERENCE as BLENDERS
from rigid_motion_batch.analysis.modes import STATE_OF_THE_ART as REFERENCE
from rigid_motion_batch.analysis.needed import DECIMATIONS, KeysNeeded, Ways, keys_needed
from rigid_motion_batch.recordings.clips import Clip

PAPER_RATES_PER_S = {30: 20, 20: 10, 15: 7, 12: 5}
"""The paper's table: updates under its state of the art, and those that it found to look the same with multivectors."""

UPDATES = tuple(PAPER_RATES_PER_S)  # a second of the state of the art, from the most to the fewest
TIME_SAVED = 0.165  # what the paper saves of the running time for a generated frame, as a share

SHELL_RADIUS_M = 0.1  # of the shell, in metres

SCREW = "dq_sclerp"

MODES = (REFERENCE, BLENDERS, SCREW, "pga_lerp", "motor_spline", "motor_spline_causal")
"""`pga_slerp` and `cga_slerp` are the motion of `dq_sclerp`, `cga_lerp` that of `pga_lerp`."""

ADAPTIVE, CHOSEN = (REFERENCE, BLENDERS, "motor_spline"), ", keys where needed"
"""Modes that have their keys where they need them too, and what is added to their names then."""

ROW_CHOICES = {mode: (mode, DECIMATIONS[0]) for mode in MODES} | {
    mode + CHOSEN: (mode, DECIMATIONS[1]) for mode in ADAPTIVE
}
"""Names of the rows, each with its mode and its decimation."""

SAMPLES_AN_UPDATE, NEVER_EXACT = 2.0, 1e-3
"""A recording tells nothing of in-betweens at a rate that leaves it fewer samples than this. Files round the time of a
frame: so much, as a share, may be missing."""

BOW_RATES = (5, 8, *sorted(UPDATES))


def has_samples_for(clip: Clip, rate: float) -> bool:
    """Return whether a clip has two samples to an update."""
    return rate <= clip.samples_a_second * (1.0 + NEVER_EXACT) / SAMPLES_AN_UPDATE


def shares_of(clip: Clip, result: KeysNeeded) -> dict[str, dict[str, list[float]]]:
    """Return by mode and decimation, of each rate, the keys needed as a share of the reference's.

    NaN where the clip has no two samples to a key or nothing moves, infinite where it takes all samples.
    """
    counted = [has_samples_for(clip, float(rate)) for rate in result.rates]
    shares = np.where(counted, result.shares, np.nan).tolist()
    groups = zip(result.groups, shares, strict=True)
    return {mode: dict(zip(DECIMATIONS, row, strict=False)) for group, row in groups for mode in group}


def needed(clip: Clip) -> dict[str, list[float]]:
    """Return by name, of `ROW_CHOICES`, what is needed of the updates of the state of the art at `UPDATES`, as
    shares.
    """
    shares = shares_of(clip, keys_needed(Ways(clip, SHELL_RADIUS_M), MODES, REFERENCE))
    return {name: shares[mode][way][: len(UPDATES)] for name, (mode, way) in ROW_CHOICES.items()}


def means(shares: Sequence[Sequence[float]], rates: Sequence[float] = UPDATES) -> dict[str, np.ndarray]:
    """Return geometric means over clips of shares of rates (clips, rates), NaN where a clip was not asked.

    What is "saved" as a share, and the "updates" that are left, NaN where there is none on any clip; on how many clips
    the error was "reached", of how many "asked".
    """
    table = np.array(shares)
    reached, asked = np.isfinite(table).sum(axis=0), (~np.isnan(table)).sum(axis=0)
    mean = geometric_mean(table)
    return {"updates": mean * rates, "saved": 1.0 - mean, "reached": reached, "asked": asked}


def bows_of(clip: Clip) -> dict[int, tuple[float, float]]:
    """Return by rate k, and the RMS position error of the screw as a multiple of that of `lerp_slerp`.

    Of `BOW_RATES` those that have in-betweens.
    """
    result = {}
    for rate in BOW_RATES:
        keys = decimate(clip.times, rate)
        samples = slice(int(keys[0]), int(keys[-1]) + 1)
        if len(keys) < 2:
            continue
        straight, screw = (
            clip.in_metres(interpolate(clip.times[keys], clip.poses[keys], clip.times[samples], mode)).positions
            for mode in (REFERENCE, SCREW)
        )
        a, b = clip.in_metres(clip.poses[samples]).positions - straight, screw - straight
        across, bow, missed, left = (float(np.sum(product)) for product in (a * b, b * b, a * a, (a - b) ** 2))
        if min(bow, missed) > len(a) * MAX_ROUNDING_M**2:
            result[rate] = across / bow, float(np.sqrt(left / missed))
    return result
