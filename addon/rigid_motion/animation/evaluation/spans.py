"""Spans: the stretches of time in which what is added to channels is smooth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..fcurves.keys import BEZIER, EASINGS, ELASTIC, INTERPOLATIONS, Keys
from .sources import Source

BOUNCE = {name: code for code, name in INTERPOLATIONS.items()}["BOUNCE"]
IN, IN_OUT = (code for code, name in EASINGS.items() if name in ("EASE_IN", "EASE_IN_OUT"))

LANDINGS = np.array((1.0 / 2.75, 2.0 / 2.75, 2.5 / 2.75))
"""When a ball lands that bounces out, 0 to 1."""

SWINGS = 0.3, 0.45
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


def spans(source: Source) -> list[Span]:
    """Return the stretches in which the modes act, in order of time.

    Of cycles those between the first key and the last: what is added repeats with the channels.
    """
    rows = tuple(source.filled_rows)
    if not (source.is_live and source.is_repeatable and rows):
        return []
    keys, breaks = source.key_frames, np.unique(np.concatenate([np.empty(0), *map(_breaks, source.filled_curves)]))
    acts = source.modes != 0
    inside = acts & ~source.holds
    ends = [(first, last, True, True) for first, last in zip(keys[:-1][inside], keys[1:][inside], strict=True)]
    if source.is_linear and source.seen is not None:
        if acts[0] and source.seen[0] < keys[0]:
            ends.insert(0, (float(source.seen[0]), keys[0], False, True))
        if acts[-1] and source.seen[1] > keys[-1]:
            ends.append((keys[-1], float(source.seen[1]), True, False))
    return [
        Span(rows, float(first), float(last), at_first, at_last, tuple(breaks[(breaks > first) & (breaks < last)]))
        for first, last, at_first, at_last in ends
    ]


def _breaks(keys: Keys) -> np.ndarray:
    """Return frames (b,) at which the easings of these keys have a kink between two of them."""
    if keys.easing is None or keys.easing_settings is None:
        return np.empty(0)
    codes, easings, periods = (rows[:, :-1] for rows in (keys.interpolation, keys.easing, keys.easing_settings[2]))
    starts, durations = keys.times[:-1], np.diff(keys.times)
    with np.errstate(divide="ignore", invalid="ignore"):
        periods = np.where(periods == 0.0, np.where(easings == IN_OUT, *SWINGS[::-1]), periods / durations)
    # By how much of the segment a kink is away from its steep end.
    away = np.full((len(LANDINGS), *codes.shape), np.nan)
    away[:, codes == BOUNCE] = LANDINGS[:, None]
    away[:, codes == ELASTIC] = 0.25 * periods[codes == ELASTIC]
    moments = np.where(easings == IN, 1.0 - away, away)
    both = (easings == IN_OUT) & (codes > BEZIER)
    halves = np.concatenate((0.5 - 0.5 * away, 0.5 + 0.5 * away, np.full((1, *codes.shape), 0.5)))[:, both]
    at = np.broadcast_to(starts, codes.shape)[both] + halves * np.broadcast_to(durations, codes.shape)[both]
    frames = np.concatenate((at.ravel(), (starts + moments * durations)[:, ~both].ravel()))
    return frames[np.isfinite(frames)]
