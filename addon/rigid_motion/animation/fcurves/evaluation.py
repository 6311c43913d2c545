"""Evaluation of F-curves: their values on frames, in double precision."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .easings import ease, elastic
from .keys import BEZIER, CONSTANT, EASINGS, ELASTIC, INTERPOLATIONS, KEY_TOLERANCE, LINEAR, Keys, fold
from .solvers import solve_cubics


@np.errstate(all="ignore")
def evaluate(
    curves: Sequence[Keys],
    times: Sequence[np.ndarray],
    out: Sequence[np.ndarray] | None = None,
) -> Sequence[np.ndarray]:
    """Return the values of curves at their times.

    Parameters
    ----------
    curves : sequence of Keys
        Curves without keys are 0 everywhere, as in Blender.
    times : sequence of array, shape (m,)
        Frames for each of the curves. They are not rounded to single precision as in Blender: values are smooth in
        time between keys.
    out : sequence of array, shape (c, m), optional
        Arrays to write the values to.

    Returns
    -------
    sequence of array, shape (c, m)
        NaN where keys or handles are not finite. Values are not rounded as Blender does for channels of whole
        numbers and enumerations.
    """
    if out is None:
        out = [np.empty((len(keys.points), len(frames))) for keys, frames in zip(curves, times, strict=True)]
    for keys, frames, values in zip(curves, times, out, strict=True):
        values[:] = 0.0
        if len(keys.times):
            _evaluate(keys, np.asarray(frames, dtype=np.float64), values)
    return out


def _evaluate(keys: Keys, frames: np.ndarray, out: np.ndarray) -> None:
    """Write the values of curves with keys on these frames (m,) to `out`, which is 0, shape (c, m)."""
    rounds = None
    if keys.cycles is not None:
        frames, _, rounds = fold(keys, frames)
    at = np.searchsorted(keys.times[1:] - KEY_TOLERANCE, frames, side="right")
    elapsed = frames - keys.times[at]
    u = np.where(elapsed > KEY_TOLERANCE, elapsed, 0.0) * keys.rates[at]
    polynomials, cubics = keys.cubics
    t = u
    if cubics is not None:
        cubics = cubics[..., at]
        t = solve_cubics(np.tile(u, cubics.shape[1]), cubics.reshape(3, -1)).reshape(cubics.shape[1:])
    for coefficients in polynomials[::-1]:
        out *= t
        out += coefficients[:, at]
    _ease(keys, at, u, out)
    if keys.linear:
        _extrapolate(keys, frames, out)
    if rounds is not None and rounds.any():
        out += np.multiply.outer(keys.values[:, -1] - keys.values[:, 0], rounds)


def _ease(keys: Keys, at: np.ndarray, u: np.ndarray, out: np.ndarray) -> None:
    """Replace the values (c, m) in segments (m,) with easing, at times u (m,) from 0 to 1."""
    if keys.easing is None or keys.easing_settings is None:
        return
    kinds = (keys.interpolation * len(EASINGS) + keys.easing)[:, at]
    for kind in np.unique(kinds).tolist():
        code, easing = divmod(kind, len(EASINGS))
        if code in (CONSTANT, LINEAR, BEZIER):
            continue
        chosen = kinds == kind
        curve, sample = np.nonzero(chosen)
        segment, time = at[sample], u[sample]
        start, change = keys.cubics[0][:2, curve, segment]
        back, amplitude, period = keys.easing_settings[:, curve, segment].astype(np.float64)
        if code == ELASTIC:
            moved = elastic(EASINGS[easing], time, change, amplitude, period * keys.rates[segment])
        else:
            moved = change * ease(INTERPOLATIONS[code], EASINGS[easing], time, back)
        out[chosen] = start + moved


def _extrapolate(keys: Keys, frames: np.ndarray, out: np.ndarray) -> None:
    """Extend values (c, m) with the slope of their curves before the first key and after the last."""
    last = len(keys.times) - 1
    for side, end, beside, handles in ((-1, 0, min(1, last), keys.left), (1, last, max(last - 1, 0), keys.right)):
        beyond = np.flatnonzero(side * (frames - keys.times[end]) > 0.0)
        codes, point, towards = keys.interpolation[:, end], keys.points[:, end], keys.points[:, beside]
        if handles is not None:
            towards = np.where(codes[:, None] == LINEAR, towards, handles[:, end])
        run, rise = (towards - point).astype(np.float64).T
        slopes = np.where((run == 0.0) | (codes == CONSTANT), 0.0, rise / run)
        out[:, beyond] += slopes[:, None] * (frames[beyond] - keys.times[end])
