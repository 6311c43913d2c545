"""The paper's table: how many updates a second each mode needs to be as good as the state of the art is with its own.

As good means, by one of three `YARDSTICKS` set beforehand, an error no larger than that of `lerp_slerp` at 30, 20, 15
or 12 updates a second. Errors are taken over a whole range of updates a second, and where a sender happens to begin is
averaged out: `PHASES` of them, each a little later than the one before, are measured together. Then the lowest rate
that is as good is where the curve of a mode first comes down to the error wanted. Errors are in metres and m/s.

`analysis.needed` asks the same of one sender and one yardstick, key by key; over several senders the curves are smooth
enough for the other two.

Why a screw wins on one motion and loses on another, `bows_of` tells: between two keys the origin runs straight under
`lerp_slerp` and on a bow under a screw. With a the way from the straight line to the recorded position, and b to the
screw's,

    k = sum a.b / sum |b|^2
    sum |a - b|^2 = sum |a|^2 - (2 k - 1) sum |b|^2

So the screw has the smaller RMS position error where the share k of its bow is above a half, exactly. A hand that
pivots about a wrist or an elbow has a k near 1, a body in free flight near 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from rigid_motion.motion import Errors, decimate, interpolate, measure, reduce_keys, rms
from rigid_motion.motion.decimation import nearest
from rigid_motion_batch.analysis.metrics import NOTHING, geometric_mean
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.recordings.clips import Clip

PAPER = {30: 20, 20: 10, 15: 7, 12: 5}
"""The paper's table: updates under its state of the art, and those that it found to look the same with multivectors."""

UPDATES = tuple(PAPER)  # a second of the state of the art, from the most to the fewest
TIME_SAVED = 0.165  # what the paper saves of the running time for a generated frame, as a share

RADIUS = 0.1  # of the shell, in metres

YARDSTICKS = {
    "rms_shell": "RMS shell error",
    "p95_shell": "95th percentile of the shell error",
    "rms_velocity": "RMS velocity error",
}
"""What is compared, and what it is called."""

SCREW = "dq_sclerp"

MODES = (REFERENCE, SCREW, "pga_lerp", "motor_spline", "motor_spline_causal")
"""Those that get evenly spaced keys. `pga_slerp` and `cga_slerp` are the motion of `dq_sclerp`, `cga_lerp` that of
`pga_lerp`."""

CHOSEN = ", keys where needed"
"""What is added to the name of a mode that has its keys where it needs them: of these two."""

ADAPTIVE = (REFERENCE, "motor_spline")

LOWEST, HIGHEST, STEP = 1.5, 60.0, 1.05
"""The rates that are tried: updates a second, and the factor from one rate to the next."""

PHASES = 6  # senders of the same rate that begin one after the other within an interval

SAMPLES_AN_UPDATE = 2.0
"""A recording tells nothing of in-betweens at a rate that leaves it fewer samples than this."""

TOLERANCES = 0.5, 2.0, 8
"""Of adaptive keys: from this multiple of the smallest error wanted to this multiple of the largest, so many."""

BOW_RATES = (5, 8, *sorted(UPDATES))

Curve = np.ndarray
"""A row for each rate or tolerance: keys a second, and the errors by `YARDSTICKS`; shape (n, 4)."""


def rates_for(clip: Clip) -> np.ndarray:
    """Return the rates to try on a clip, rising: those of the table among them."""
    steps = int(np.log(HIGHEST / LOWEST) / np.log(STEP))
    rates = np.union1d(LOWEST * STEP ** np.arange(steps + 1), UPDATES)
    return rates[rates <= clip.samples_a_second / SAMPLES_AN_UPDATE * (1.0 + 1e-9)]


def senders(clip: Clip, rate: float) -> list[np.ndarray]:
    """Return the samples that each of `PHASES` senders sends."""
    begins = clip.times[0] + np.arange(PHASES) / (PHASES * rate)
    sent = [int(first) + decimate(clip.times[first:], rate) for first in np.unique(nearest(clip.times, begins))]
    return [keys for keys in sent if len(keys) > 1]


def point(clip: Clip, mode: str, senders_keys: Sequence[np.ndarray]) -> tuple[float, float, float, float]:
    """Return keys a second, and the errors of a mode over all of these keys, pooled: a row of a `Curve`."""
    result = [errors_of(clip, mode, keys) for keys in senders_keys]
    shell = np.concatenate([errors.shell for errors in result])
    velocity = np.concatenate([errors.velocity for errors in result])
    segments = sum(len(keys) - 1 for keys in senders_keys)
    seconds = sum(float(clip.times[keys[-1]] - clip.times[keys[0]]) for keys in senders_keys)
    return segments / seconds, rms(shell), float(np.percentile(shell, 95.0)), rms(velocity)


def errors_of(clip: Clip, mode: str, keys: np.ndarray) -> Errors:
    """Return the errors of a mode at all samples from the first of its keys to the last."""
    samples = slice(int(keys[0]), int(keys[-1]) + 1)
    times, truth = clip.times[samples], clip.in_metres(clip.poses[samples])
    filled = interpolate(clip.times[keys], clip.poses[keys], times, mode)
    return measure(times, clip.in_metres(filled), truth, RADIUS)


def even_points(clip: Clip) -> dict[int, tuple[float, float, float, float]]:
    """Return, for each of the paper's rates that the clip has samples for, the point of the state of the art."""
    known = rates_for(clip)
    return {rate: point(clip, REFERENCE, senders(clip, rate)) for rate in UPDATES if rate in known}


def curves_of(clip: Clip) -> dict[str, Curve]:
    """Return the curves of all modes on a clip, with evenly spaced keys and with keys where needed."""
    curves: dict[str, list[tuple[float, ...]]] = {mode: [] for mode in MODES}
    for rate in rates_for(clip):
        if keys := senders(clip, rate):
            for mode in MODES:
                curves[mode].append(point(clip, mode, keys))
    requested = [row[1] for row in even_points(clip).values()]
    low, high, count = TOLERANCES
    for tolerance in np.geomspace(low * min(requested), high * max(requested), count) if requested else ():
        for mode in ADAPTIVE:
            lengths = float(tolerance / clip.metres_per_unit), RADIUS / clip.metres_per_unit
            keys = reduce_keys(clip.times, clip.poses, mode, *lengths, rms=True)
            curves.setdefault(mode + CHOSEN, []).append(point(clip, mode, [keys]))
    return {name: np.array(rows) for name, rows in curves.items()}


def needed(clip: Clip, curves: Mapping[str, Curve]) -> dict[str, dict[str, dict[int, float]]]:
    """Return by yardstick, name and rate of the state of the art what is needed of its updates, as a share.

    Infinite where none of the rates tried was as good; there is none where the recording has too few samples for the
    rate, or nothing moves.
    """
    points = even_points(clip)
    return {
        yardstick: {
            name: {
                rate: lowest(curve[:, 0], curve[:, column], reference[column]) / reference[0]
                for rate, reference in points.items()
                if reference[column] > NOTHING
            }
            for name, curve in curves.items()
        }
        for column, yardstick in enumerate(YARDSTICKS, start=1)
    }


def lowest(cost: np.ndarray, errors: np.ndarray, requested: float) -> float:
    """Return the lowest cost (n,) at which a curve is down to the error wanted; infinite where it never is.

    Between two points, error and cost are taken to be lines on a double logarithmic scale.
    """
    order = np.argsort(cost, kind="stable")
    cost, errors = cost[order], errors[order]
    good = np.flatnonzero(errors <= requested)
    if not len(good):
        return float("inf")
    first = int(good[0])
    if first == 0 or errors[first] == requested:
        return float(cost[first])
    before, after = np.log(np.maximum(errors[[first - 1, first]], NOTHING))
    part = (before - np.log(requested)) / (before - after)
    return float(cost[first - 1] * (cost[first] / cost[first - 1]) ** part)


def mean_over(shares: Iterable[Mapping[int, float]]) -> dict[str, np.ndarray]:
    """Return the means over clips of shares by rate, and the "updates" that they are, for each of the paper's rates."""
    result = means([[share.get(rate, np.nan) for rate in UPDATES] for share in shares])
    return {"updates": (1.0 - result["saved"]) * UPDATES, **result}


def means(shares: Sequence[Sequence[float]]) -> dict[str, np.ndarray]:
    """Return geometric means over clips of shares (clips, rates), NaN where a clip was not asked.

    What is "saved" as a share, NaN where it is on no clip; on how many clips the error was "reached", of how many
    "asked".
    """
    table = np.array(shares)
    reached, asked = np.isfinite(table).sum(axis=0), (~np.isnan(table)).sum(axis=0)
    return {"saved": 1.0 - geometric_mean(table), "reached": reached, "asked": asked}


def bows_of(clip: Clip) -> dict[int, tuple[float, float]]:
    """Return by rate k, and the RMS position error of the screw as a multiple of that of `lerp_slerp`.

    Of `BOW_RATES` those that have in-betweens.
    """
    result = {}
    for rate in BOW_RATES:
        pairs = []
        for keys in senders(clip, rate):
            samples = slice(int(keys[0]), int(keys[-1]) + 1)
            straight, screw = (
                clip.in_metres(interpolate(clip.times[keys], clip.poses[keys], clip.times[samples], mode)).positions
                for mode in (REFERENCE, SCREW)
            )
            pairs.append((clip.in_metres(clip.poses[samples]).positions - straight, screw - straight))
        if pairs:
            a, b = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
            across, bow, missed, left = (float(np.sum(product)) for product in (a * b, b * b, a * a, (a - b) ** 2))
            if min(bow, missed) > len(a) * NOTHING**2:
                result[rate] = across / bow, float(np.sqrt(left / missed))
    return result
