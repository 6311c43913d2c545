"""The paper's table: the updates per second that each mode needs to be as good as the state of the art.

As good means an RMS shell error no larger than that of `lerp_slerp` at 30, 20, 15 or 12 updates per second. The number
needed is what comparisons find (`analysis.needed`, keys_needed.csv), for a single sender. Errors are in metres.

`bows_of` explains why a screw wins on one motion and loses on another: between two keys the origin moves straight
under `lerp_slerp` and on a bow under a screw. Let a be the vector from the straight line to the recorded position, and
b the vector to the screw's position:

    k = sum a.b / sum |b|^2
    sum |a - b|^2 = sum |a|^2 - (2 k - 1) sum |b|^2

So the screw has the smaller RMS position error exactly if the fraction k of its bow is above a half. A hand that pivots
about a wrist or an elbow has k near 1, a body in free flight near 0.
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
"""The paper's table: updates of its state of the art, and those found to look the same with multivectors."""

UPDATES = tuple(PAPER_RATES_PER_S)  # per second, of the state of the art, in descending order
TIME_SAVED = 0.165  # the fraction that the paper saves of the running time per generated frame

SHELL_RADIUS_M = 0.1  # of the shell, in metres

SCREW = "dq_sclerp"

MODES = (REFERENCE, BLENDERS, SCREW, "pga_lerp", "motor_spline", "motor_spline_causal")
"""`pga_slerp` and `cga_slerp` are the motion of `dq_sclerp`, `cga_lerp` that of `pga_lerp`."""

ADAPTIVE, CHOSEN = (REFERENCE, BLENDERS, "motor_spline"), ", keys where needed"
"""Modes that are also tried with keys where needed, and the suffix of their names then."""

ROW_CHOICES = {mode: (mode, DECIMATIONS[0]) for mode in MODES} | {
    mode + CHOSEN: (mode, DECIMATIONS[1]) for mode in ADAPTIVE
}
"""Row names, with their mode and decimation."""

SAMPLES_AN_UPDATE, NEVER_EXACT = 2.0, 1e-3
"""The minimum samples per update for in-betweens to be measurable, and the fraction by which rates may fall short:
files round the time of a frame."""

BOW_RATES = (5, 8, *sorted(UPDATES))


def has_samples_for(clip: Clip, rate: float) -> bool:
    """Return whether a clip has at least two samples per update."""
    return rate <= clip.samples_a_second * (1.0 + NEVER_EXACT) / SAMPLES_AN_UPDATE


def shares_of(clip: Clip, result: KeysNeeded) -> dict[str, dict[str, list[float]]]:
    """Return the keys needed at each rate, as ratios to the reference's, by mode and decimation.

    NaN if the clip has fewer than two samples per key or nothing moves, infinite if all samples would be needed.
    """
    counted = [has_samples_for(clip, float(rate)) for rate in result.rates]
    shares = np.where(counted, result.shares, np.nan).tolist()
    groups = zip(result.groups, shares, strict=True)
    return {mode: dict(zip(DECIMATIONS, row, strict=False)) for group, row in groups for mode in group}


def needed(clip: Clip) -> dict[str, list[float]]:
    """Return the updates needed by each of `ROW_CHOICES`, as ratios to the state of the art's at `UPDATES`."""
    shares = shares_of(clip, keys_needed(Ways(clip, SHELL_RADIUS_M), MODES, REFERENCE))
    return {name: shares[mode][way][: len(UPDATES)] for name, (mode, way) in ROW_CHOICES.items()}


def means(shares: Sequence[Sequence[float]], rates: Sequence[float] = UPDATES) -> dict[str, np.ndarray]:
    """Return geometric means over clips of ratios (clips, rates), NaN where a clip was not asked.

    "saved" is the saved fraction, "updates" what remains of the rates, NaN if no clip has a ratio; "reached" is the
    number of clips that reached the error, "asked" the number that were asked.
    """
    table = np.array(shares)
    reached, asked = np.isfinite(table).sum(axis=0), (~np.isnan(table)).sum(axis=0)
    mean = geometric_mean(table)
    return {"updates": mean * rates, "saved": 1.0 - mean, "reached": reached, "asked": asked}


def bows_of(clip: Clip) -> dict[int, tuple[float, float]]:
    """Return k, and the ratio of the screw's RMS position error to that of `lerp_slerp`, by rate.

    Only for those of `BOW_RATES` that have in-betweens.
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
