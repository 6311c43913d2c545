"""The paper's table: how many updates a second each mode needs to be as good as the state of the art is with its own.

As good means, by one of three `YARDSTICKS` set beforehand, an error no larger than that of `lerp_slerp` at 30, 20, 15
or 12 updates a second. Errors are taken over a whole range of updates a second, and where a sender happens to begin is
averaged out: `PHASES` of them, each a little later than the one before, are measured together. Then the lowest rate
that is as good is where the curve of a mode first comes down to the error wanted. Errors are in metres and m/s.

`analysis.needed` asks the same of one sender and one yardstick, key by key; over several senders the curves are smooth
enough for the other two.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from rigid_motion.motion import Errors, decimate, interpolate, measure, reduce_keys, rms
from rigid_motion.motion.decimation import nearest
from rigid_motion_batch.analysis.metrics import NOTHING, geometric_mean
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.recordings.clips import Clip

from .claims import UPDATES

RADIUS = 0.1
"""Of the shell, in metres."""

YARDSTICKS = {
    "rms_shell": "RMS shell error",
    "p95_shell": "95th percentile of the shell error",
    "rms_velocity": "RMS velocity error",
}
"""What is compared, and what it is called."""

MODES = (REFERENCE, "dq_sclerp", "pga_lerp", "motor_spline", "motor_spline_causal")
"""Those that get evenly spaced keys. `pga_slerp` and `cga_slerp` are the motion of `dq_sclerp`, `cga_lerp` that of
`pga_lerp`."""

CHOSEN = ", keys where needed"
"""What is added to the name of a mode that has its keys where it needs them: of these two."""

ADAPTIVE = (REFERENCE, "motor_spline")

LOWEST, HIGHEST, STEP = 1.5, 60.0, 1.05
"""The rates that are tried: updates a second, and the factor from one rate to the next."""

PHASES = 6
"""Senders of the same rate that begin one after the other within an interval."""

SAMPLES_AN_UPDATE = 2.0
"""A recording tells nothing of in-betweens at a rate that leaves it fewer samples than this."""

TOLERANCES = 0.5, 2.0, 8
"""Of adaptive keys: from this multiple of the smallest error wanted to this multiple of the largest, so many."""

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
    firsts = np.unique(nearest(clip.times, begins))
    sent = [int(first) + decimate(clip.times[first:], rate) for first in firsts]
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
    result: dict[str, dict[str, dict[int, float]]] = {}
    for column, yardstick in enumerate(YARDSTICKS, start=1):
        own = result[yardstick] = {name: {} for name in curves}
        for rate, reference in even_points(clip).items():
            if reference[column] > NOTHING:
                for name, curve in curves.items():
                    own[name][rate] = lowest(curve[:, 0], curve[:, column], reference[column]) / reference[0]
    return result


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


def mean_over(shares: Iterable[Mapping[int, float]]) -> dict[str, list[Any]]:
    """Return the geometric means over clips of shares by rate, for each of the paper's rates.

    Returns
    -------
    dict
        "updates" needed, what of them is "saved" as a share, and on how many clips of how many asked the error was
        "reached"; NaN where it was on none.
    """
    shares = list(shares)
    result: dict[str, list[Any]] = {"updates": [], "saved": [], "reached": [], "asked": []}
    for rate in UPDATES:
        known = np.array([of_clip[rate] for of_clip in shares if rate in of_clip])
        mean = float(geometric_mean(known)) if len(known) else float("nan")
        result["updates"].append(rate * mean)
        result["saved"].append(1.0 - mean)
        result["reached"].append(int(np.isfinite(known).sum()))
        result["asked"].append(len(known))
    return result
