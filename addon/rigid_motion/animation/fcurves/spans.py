"""Spans: what the value of a curve is from each key to the next, and before and behind all of them.

A curve of n keys has n + 1 *spans*: before its first key, from each key to the next, and from its last key on. In every
span the value is a cubic polynomial of a parameter, and the parameter depends on the frames of keys and handles alone.
Channels keyed together have these in common, so that their parameters are worked out once, which is most of the work.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .easings import ease, elastic
from .keys import BEZIER, CODE, CONSTANT, EASINGS, ELASTIC, INTERPOLATIONS, KEY_TOLERANCE, LINEAR, Keys
from .solvers import bezier_cubics, solve_cubics

TIMING_SIZE = 4 * np.dtype(np.float32).itemsize
"""Bytes of `Spans.timing` for each span: frames of its key and of that key's handles, and the code."""


@dataclass(frozen=True, eq=False)
class Spans:
    """The spans of C curves, one curve after the other: N in all."""

    first_curve: list[int]
    """The number of curves before those of each `Keys`."""

    first_span: np.ndarray
    """The first span of each curve, and the end, shape (C + 1,)."""

    start: np.ndarray
    """Frame of the key that begins the span; of the first key for the time before it; shape (N,)."""

    earliest: np.ndarray
    """First frame in the span, shape (N,)."""

    rate: np.ndarray
    """One over the duration in frames; 0 where the value stays or there is no end; shape (N,)."""

    side: np.ndarray
    """-1 before the first key, 1 after the last, 0 between, shape (N,)."""

    interpolation: np.ndarray
    """Codes, CONSTANT where the rate is 0, shape (N,)."""

    easing: np.ndarray | None
    """Codes, shape (N,). None where nothing eases."""

    settings: np.ndarray | None
    """BACK's overshoot, ELASTIC's change, amplitude and period (in durations), shape (4, N)."""

    bezier: np.ndarray
    """Time as a cubic of the parameter, both from 0 to 1: coefficients of t, t^2, t^3, shape (3, N)."""

    polynomials: np.ndarray
    """Value as a cubic of the parameter: coefficients of 1, t, t^2, t^3, shape (4, N)."""

    timing: bytes
    """All that the parameters of BEZIER depend on, `TIMING_SIZE` bytes for each span."""

    crowded: frozenset[int]
    """Curves that have keys so close together that a frame may be near to two, or out of order."""

    linear: bool
    """True if any curve goes on at its slope outside of its keys."""

    unit_elastic: bool
    """True if ELASTIC is worked out for a change of 1, see `evaluate`."""

    @classmethod
    @np.errstate(all="ignore")
    def of(cls, curves: Sequence[Keys], unit_elastic: bool) -> Spans:
        """Return the spans of all curves of these keys, in their order."""
        curves = [keys if len(keys.times) else _without_keys(len(keys.points)) for keys in curves]
        channels = [len(keys.points) for keys in curves]
        first_span = np.concatenate(((0,), np.cumsum(np.repeat([len(keys.times) + 1 for keys in curves], channels))))
        before, after = first_span[:-1], first_span[1:] - 1
        # The span before the first key is that of a second key in the same place.
        key = np.arange(first_span[-1]) - np.repeat(np.arange(1, len(first_span)), np.diff(first_span))
        key[before] += 1

        points, left, right, codes = (array.take(key, axis=0) for array in _concatenated(curves))
        next_points, next_left = np.roll(points, -1, axis=0), np.roll(left, -1, axis=0)
        duration = next_points[:, 0] - points[:, 0]
        crowded = ~(duration > 2.1 * KEY_TOLERANCE)
        crowded[before] = crowded[after] = False
        duration[after] = 0.0
        moving = (duration != 0.0) & (codes != CONSTANT)
        duration = duration.astype(np.float64)
        change = np.where(moving, next_points[:, 1] - points[:, 1], 0.0).astype(np.float64)

        polynomials, bezier = np.zeros((4, len(key))), np.zeros((3, len(key)))
        polynomials[0], polynomials[1], bezier[0] = points[:, 1], change, 1.0
        curved = np.flatnonzero(moving & (codes == BEZIER))
        if len(curved):
            cubics = bezier_cubics(*(ends.take(curved, axis=0) for ends in (points, right, next_left, next_points)))
            bezier[:, curved] = cubics[..., 0] / duration[curved]
            polynomials[1:, curved] = cubics[..., 1]
        linear = np.flatnonzero(np.repeat([keys.linear for keys in curves], channels))
        if len(linear):
            first, last = before[linear], after[linear]
            # The neighbour of an only key is that key itself.
            second, last_but_one = np.minimum(first + 2, last), np.maximum(last - 1, first + 1)
            for outside, neighbours, handles in ((first, second, left), (last, last_but_one, right)):
                slopes = _slopes(points[outside], points[neighbours], handles[outside], codes[outside])
                polynomials[1, outside] = slopes

        easing = settings = None
        if any(keys.easing is not None for keys in curves):
            easing, (back, amplitude, period) = (rows[..., key] for rows in _easings(curves))
            changes = np.ones_like(change) if unit_elastic else change
            settings = np.stack((back, changes, amplitude, period / duration))
        if not unit_elastic:
            # The parameter is then how far the value has moved, and no longer what share of its change is done.
            polynomials[1, moving & (codes == ELASTIC)] = 1.0

        start = points[:, 0].astype(np.float64)
        earliest = start - KEY_TOLERANCE
        earliest[before + 1] = start[before]
        side = np.zeros(len(key))
        side[before], side[after] = -1.0, 1.0
        timing = np.column_stack((points[:, 0], left[:, 0], right[:, 0], codes.astype(np.float32)))
        return cls(
            first_curve=list(itertools.accumulate(channels[:-1], initial=0)),
            first_span=first_span,
            start=start,
            earliest=earliest,
            rate=np.where(moving, 1.0 / duration, 0.0),
            side=side,
            interpolation=np.where(moving, codes, CONSTANT),
            easing=easing,
            settings=settings,
            bezier=bezier,
            polynomials=polynomials,
            timing=timing.tobytes(),
            crowded=frozenset((np.searchsorted(first_span, np.flatnonzero(crowded), side="right") - 1).tolist()),
            linear=bool(len(linear)),
            unit_elastic=unit_elastic,
        )

    def timings(self, curves: Sequence[Keys]) -> Iterator[list[tuple[slice, tuple]]]:
        """Yield for each of the keys the channels that have their timing in common, and all that this depends on."""
        for first, keys in zip(self.first_curve, curves, strict=True):
            channels = len(keys.points)
            begin, end = (TIMING_SIZE * self.first_span[curve] for curve in (first, first + channels))
            timing, size = self.timing[begin:end], (end - begin) // channels
            if keys.easing is None and timing == timing[:size] * channels:
                yield [(slice(0, channels), (timing[:size], None, keys.cycles))]
                continue
            result = []
            for channel in range(channels):
                eased: tuple | int | None = None
                if keys.easing is not None and keys.easing_settings is not None:
                    eased = keys.easing[channel].tobytes(), keys.easing_settings[:, channel].tobytes()
                    if not self.unit_elastic and ELASTIC in keys.interpolation[channel]:
                        eased = first + channel
                of_channel = timing[channel * size : (channel + 1) * size]
                result.append((slice(channel, channel + 1), (of_channel, eased, keys.cycles)))
            yield result

    def at(self, curve: int, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the spans of one curve that rising frames fall into one after the other, and how many into each."""
        begin, end = self.first_span[curve : curve + 2]
        if curve in self.crowded:
            result = _search(self.start[begin + 1 : end], frames)
            runs = np.flatnonzero(np.diff(result, prepend=-1))
            return begin + result[runs], np.diff(runs, append=len(frames))
        bounds = np.empty(end - begin + 1, dtype=np.int64)
        bounds[0], bounds[-1] = 0, len(frames)
        bounds[1:-1] = np.searchsorted(frames, self.earliest[begin + 1 : end])
        return np.arange(begin, end), bounds[1:] - bounds[:-1]

    def parameters(self, spans: np.ndarray, counts: np.ndarray, frames: np.ndarray) -> np.ndarray:
        """Return the parameters of the cubics on frames (m,), of which each of the spans (s,) has `counts` (s,)."""

        def spread(of_spans: np.ndarray) -> np.ndarray:
            return of_spans[..., spans].repeat(counts, axis=-1)

        elapsed = frames - spread(self.start)
        parameters = np.where(np.abs(elapsed) <= KEY_TOLERANCE, 0.0, elapsed) * spread(self.rate)
        codes = set(self.interpolation[spans].tolist())
        if BEZIER in codes:
            parameters = solve_cubics(parameters, spread(self.bezier))
        if not codes <= {CONSTANT, LINEAR, BEZIER}:
            self._ease(parameters, np.repeat(spans, counts))
        if self.linear:
            side = spread(self.side)
            parameters = np.where(side != 0.0, side * np.maximum(side * elapsed, 0.0), parameters)
        return parameters

    def _ease(self, parameters: np.ndarray, spans: np.ndarray) -> None:
        """Replace the times in these spans, each of shape (m,), by what easings make of them."""
        assert self.easing is not None
        assert self.settings is not None
        kinds = (self.interpolation * len(EASINGS) + self.easing)[spans]
        for kind in np.unique(kinds).tolist():
            code, easing = divmod(kind, len(EASINGS))
            if code in (CONSTANT, LINEAR, BEZIER):
                continue
            selected = np.flatnonzero(kinds == kind)
            back, *swing = self.settings[:, spans[selected]]
            u, easing = parameters[selected], EASINGS[easing]
            if code == ELASTIC:
                parameters[selected] = elastic(easing, u, *swing)
            else:
                parameters[selected] = ease(INTERPOLATIONS[code], easing, u, back)


def _without_keys(channels: int) -> Keys:
    """Return keys that stand for curves without any, which are 0 everywhere in Blender."""
    return Keys(np.zeros((channels, 1, 2), np.float32), np.full((channels, 1), CONSTANT, CODE))


def _concatenated(curves: Sequence[Keys]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return points and handles (n, 2), points where there are no handles, and codes (n,) of the keys of all curves."""
    points = [keys.points.reshape(-1, 2) for keys in curves]
    left, right = (
        [on_key if handles is None else handles.reshape(-1, 2) for on_key, handles in zip(points, side, strict=True)]
        for side in ([keys.left for keys in curves], [keys.right for keys in curves])
    )
    codes = [keys.interpolation.ravel() for keys in curves]
    return np.concatenate(points), np.concatenate(left), np.concatenate(right), np.concatenate(codes)


def _easings(curves: Sequence[Keys]) -> tuple[np.ndarray, np.ndarray]:
    """Return easings (n,) and their settings (3, n) of the keys of all curves, zeros where none were read."""
    counts = [keys.interpolation.size for keys in curves]
    easing, settings = np.zeros(sum(counts), dtype=CODE), np.zeros((3, sum(counts)))
    for keys, end, count in zip(curves, itertools.accumulate(counts), counts, strict=True):
        if keys.easing is not None and keys.easing_settings is not None:
            easing[end - count : end] = keys.easing.ravel()
            settings[:, end - count : end] = keys.easing_settings.reshape(3, -1)
    return easing, settings


def _slopes(ends: np.ndarray, neighbours: np.ndarray, handles: np.ndarray, codes: np.ndarray) -> np.ndarray:
    """Return slopes beyond keys at the end of a curve, from points of shape (k, 2)."""
    run, rise = (np.where(codes[:, None] == LINEAR, neighbours, handles) - ends).astype(np.float64).T
    return np.where((run == 0.0) | (codes == CONSTANT), 0.0, rise / run)


def _search(keys: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Return the spans, counted from 0 for the time before the first key, that frames fall into by Blender's bisection.

    Where several keys are near to a frame it decides for the one that it comes across first.
    """
    low, high = np.zeros(len(frames), dtype=np.int64), np.full(len(frames), len(keys))
    spans = np.zeros(len(frames), dtype=np.int64)
    searching = np.ones(len(frames), dtype=bool)
    for outermost in (0, len(keys) - 1):
        result = searching & (np.abs(frames - keys[outermost]) <= KEY_TOLERANCE)
        spans[result] = outermost + 1
        searching &= ~result
    for _ in range(len(keys).bit_length() + 1):
        middle = np.minimum((low + high) // 2, len(keys) - 1)
        elapsed = frames - keys[middle]
        result = searching & (np.abs(elapsed) <= KEY_TOLERANCE)
        spans[result] = middle[result] + 1
        searching &= ~result
        low = np.where(searching & (elapsed > 0.0), middle + 1, low)
        high = np.where(searching & (elapsed < 0.0), middle - 1, high)
        going = searching & (low <= high)
        spans[searching & ~going] = low[searching & ~going]
        searching = going
    spans[frames >= keys[-1]] = len(keys)
    spans[frames <= keys[0]] = 0
    return spans
