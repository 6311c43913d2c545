"""Spans: the stretches of time in which what is added to channels is smooth."""

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
"""When a ball lands that bounces out, 0 to 1."""

ELASTIC_PERIOD_RATIOS = 0.3, 0.45
"""ELASTIC's own period, in durations of a segment: and where it eases in and out."""


@dataclass(frozen=True)
class Span:
    """A stretch of time in which the difference of some rows is smooth."""

    rows: tuple[int, ...]
    """The rows among the components."""

    first: float
    last: float
    first_is_key: bool
    last_is_key: bool

    breaks: tuple[float, ...]
    """Frames inside of it at which the timing has a kink."""


def spans(source: KeyedTransform) -> list[Span]:
    """Return the stretches in which the modes act, in order of time.

    Of cycles those between the first key and the last: what is added repeats with the channels.
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
    """Return the stretches of time from key to key of something that passes from one holder to another.

    What its channels have between the last key in one and the first in the next is the same for none of the modes.
    """
    # What turns about an axis need have no keys of its rotation.
    times = dict.fromkeys(source.filled_rows, np.full(1, np.inf))
    times |= {row: keys.times for rows, keys in source.channels for row in rows}
    # Angles stay together: near gimbal lock what one of them has depends on the others.
    parts = [tuple(row for row in sorted(times) if PART_OF[row] == part) for part in ROWS]
    breaks = np.unique(np.concatenate([distinct(source.keyed_frames), *map(_breaks, source.curves)]))
    result: list[Span] = []
    for run in source.runs:
        ends = [*distinct(run.source.keyed_frames).tolist(), *({run.stretch.until} - {np.inf})]
        for rows in filter(None, parts):
            # The frame of a switch is the next run's, and a channel has its own value where it has a key alone.
            is_key = [all(np.abs(times[row] - frame).min() < SAME_FRAME for row in rows) for frame in ends]
            # Strips come to a key by a hair too early, where curves have its value already.
            shown = [*ends[:-1], _before(ends[-1]) if is_key[-1] and ends[-1] == run.stretch.until else ends[-1]]
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


def _before(frame: float) -> float:
    """Return the last frame in single precision before a key on which curves do not have its value yet."""
    return float(np.nextafter(np.float32(frame - KEY_TOLERANCE), np.float32(-np.inf)))


def _breaks(keys: Keys) -> np.ndarray:
    """Return frames (b,) at which the easings of these keys have a kink between two of them."""
    if keys.easing is None or keys.easing_settings is None:
        return np.empty(0)
    codes, easings, periods = (rows[:, :-1] for rows in (keys.interpolation, keys.easing, keys.easing_settings[2]))
    starts, durations = keys.times[:-1], np.diff(keys.times)
    with np.errstate(divide="ignore", invalid="ignore"):
        periods = np.where(
            periods == 0.0, np.where(easings == EASE_IN_OUT_CODE, *ELASTIC_PERIOD_RATIOS[::-1]), periods / durations
        )
    # By how much of the segment a kink is away from its steep end.
    away = np.full((len(BOUNCE_LANDING_TIMES), *codes.shape), np.nan)
    away[:, codes == BOUNCE_CODE] = BOUNCE_LANDING_TIMES[:, None]
    away[:, codes == ELASTIC] = 0.25 * periods[codes == ELASTIC]
    moments = np.where(easings == EASE_IN_CODE, 1.0 - away, away)
    both = (easings == EASE_IN_OUT_CODE) & (codes > BEZIER)
    halves = np.concatenate((0.5 - 0.5 * away, 0.5 + 0.5 * away, np.full((1, *codes.shape), 0.5)))[:, both]
    at = np.broadcast_to(starts, codes.shape)[both] + halves * np.broadcast_to(durations, codes.shape)[both]
    frames = np.concatenate((at.ravel(), (starts + moments * durations)[:, ~both].ravel()))
    return frames[np.isfinite(frames)]
