"""Spans: the stretches of time in which the values added to channels are smooth."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..fcurves.keys import BEZIER, EASINGS, ELASTIC, INTERPOLATIONS, KEY_TOLERANCE, Keys
from .components import PART_OF, ROWS
from .sources import SAME_FRAME, KeyedTransform, distinct

BOUNCE_CODE = {name: code for code, name in INTERPOLATIONS.items()}["BOUNCE"]
EASE_IN_CODE, EASE_IN_OUT_CODE = (code for code, name in EASINGS.items() if name in ("EASE_IN", "EASE_IN_OUT"))

BOUNCE_LANDING_TIMES = np.array((1.0 / 2.75, 2.0 / 2.75, 2.5 / 2.75))
"""The times, 0 to 1, at which the ball of an easing-out bounce lands."""

ELASTIC_PERIOD_RATIOS = 0.3, 0.45
"""The default period of ELASTIC as a fraction of the segment, and the one for easing in and out."""


@dataclass(frozen=True)
class Span:
    """A stretch of time in which the difference in some rows is smooth."""

    rows: tuple[int, ...]
    """The rows among the components."""

    first: float
    last: float
    first_is_key: bool
    last_is_key: bool

    breaks: tuple[float, ...]
    """Frames inside the span at which the timing has a kink."""


def spans(source: KeyedTransform) -> list[Span]:
    """Return the stretches in which the modes act, in order of time.

    For cycles, only those between the first and the last key: the added values repeat with the channels.
    """
    if source.switches:
        return _spans_of_runs(source)
    rows = tuple(source.filled_rows)
    if not (source.is_live and source.is_repeatable and rows):
        return []
    keys, breaks = source.key_frames, np.unique(np.concatenate([np.empty(0), *map(_breaks, source.filled_curves)]))
    acts = source.modes != 0
    inside = acts & ~source.holds
    ends = [(first, last, True, True) for first, last in zip(keys[:-1][inside], keys[1:][inside], strict=True)]
    if source.is_linear and source.seen is not None:
        before, behind = source.goes_on_to
        if acts[0] and before < keys[0]:
            ends.insert(0, (before, keys[0], False, True))
        if acts[-1] and behind > keys[-1]:
            ends.append((keys[-1], behind, True, False))
    return [
        Span(rows, float(first), float(last), at_first, at_last, tuple(breaks[(breaks > first) & (breaks < last)]))
        for first, last, at_first, at_last in ends
    ]


def _spans_of_runs(source: KeyedTransform) -> list[Span]:
    """Return the stretches of time from key to key for an object that switches holders.

    In no mode do the channels keep their own values between the last key in one holder and the first in the next.
    """
    # An object that turns about an axis may have no rotation keys.
    times = dict.fromkeys(source.filled_rows, np.full(1, np.inf))
    times |= {row: keys.times for rows, keys in source.channels for row in rows}
    # Angles stay together: near gimbal lock each of them depends on the others.
    parts = [tuple(row for row in sorted(times) if PART_OF[row] == part) for part in ROWS]
    breaks = np.unique(np.concatenate([distinct(source.keyed_frames), *map(_breaks, source.curves)]))
    result: list[Span] = []
    for run in source.runs:
        ends = [*distinct(run.source.keyed_frames).tolist(), *({run.stretch.until} - {np.inf})]
        for rows in filter(None, parts):
            # The frame of a switch belongs to the next run, and a channel has its own value only on its own keys.
            is_key = [all(np.abs(times[row] - frame).min() < SAME_FRAME for row in rows) for frame in ends]
            # Strips reach a key slightly early, when curves already have its value.
            shown = [
                *ends[:-1],
                _frame_before_key(ends[-1]) if is_key[-1] and ends[-1] == run.stretch.until else ends[-1],
            ]
            is_key[-1] |= ends[-1] == run.stretch.until
            result += [
                Span(rows, first, last, *are_keys, tuple(breaks[(breaks > first) & (breaks < last)]))
                for (first, last), are_keys in zip(pairwise(shown), pairwise(is_key), strict=True)
            ]
    if source.is_linear and source.seen is not None:
        (first, last), (before, behind) = source.keyed_range, source.goes_on_to
        for rows in filter(None, parts):
            result += [Span(rows, before, first, False, True, ())] if before < first else []
            result += [Span(rows, last, behind, True, False, ())] if behind > last else []
    return result


def _frame_before_key(frame: float) -> float:
    """Return the last single-precision frame before a key on which curves do not yet have its value."""
    return float(np.nextafter(np.float32(frame - KEY_TOLERANCE), np.float32(-np.inf)))


def _breaks(keys: Keys) -> np.ndarray:
    """Return the frames (b,) at which the easings of these keys have a kink between two keys."""
    if keys.easing is None or keys.easing_settings is None:
        return np.empty(0)
    codes, easings, periods = (rows[:, :-1] for rows in (keys.interpolation, keys.easing, keys.easing_settings[2]))
    starts, durations = keys.times[:-1], np.diff(keys.times)
    with np.errstate(divide="ignore", invalid="ignore"):
        periods = np.where(
            periods == 0.0, np.where(easings == EASE_IN_OUT_CODE, *ELASTIC_PERIOD_RATIOS[::-1]), periods / durations
        )
    # The distance of each kink from the steep end of its segment, as a fraction of the segment.
    away = np.full((len(BOUNCE_LANDING_TIMES), *codes.shape), np.nan)
    away[:, codes == BOUNCE_CODE] = BOUNCE_LANDING_TIMES[:, None]
    away[:, codes == ELASTIC] = 0.25 * periods[codes == ELASTIC]
    moments = np.where(easings == EASE_IN_CODE, 1.0 - away, away)
    both = (easings == EASE_IN_OUT_CODE) & (codes > BEZIER)
    halves = np.concatenate((0.5 - 0.5 * away, 0.5 + 0.5 * away, np.full((1, *codes.shape), 0.5)))[:, both]
    at = np.broadcast_to(starts, codes.shape)[both] + halves * np.broadcast_to(durations, codes.shape)[both]
    frames = np.concatenate((at.ravel(), (starts + moments * durations)[:, ~both].ravel()))
    return frames[np.isfinite(frames)]
