"""F-curves in NumPy: what `FCurve.evaluate` returns, for many curves and many frames at once.

Frames and values are Blender's, in its single precision; results are doubles. The rules are those of Blender's own
evaluation (source/blender/blenkernel/intern/fcurve.cc, fmodifier.cc).

A curve of n keys has n + 1 *spans*: before its first key, from each key to the next, and from its last key on. In every
span the value is a cubic polynomial of a parameter, and the parameter depends on the frames of keys and handles alone.
Channels keyed together have these in common, so that their parameters are worked out once, which is most of the work.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import bpy
import numpy as np

from ..motion.piecewise import combine
from .easings import ease, elastic

INTERPOLATIONS = {
    item.value: item.identifier for item in bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items
}
"""From the code of `Keyframe.interpolation` to its name."""

EASINGS = {item.value: item.identifier for item in bpy.types.Keyframe.bl_rna.properties["easing"].enum_items}
"""From the code of `Keyframe.easing` to its name."""

CONSTANT, LINEAR, BEZIER, ELASTIC = (
    {name: code for code, name in INTERPOLATIONS.items()}[name] for name in ("CONSTANT", "LINEAR", "BEZIER", "ELASTIC")
)

AUTO = {name: code for code, name in EASINGS.items()}["AUTO"]

CODE = np.uint8
"""The type that Blender keeps codes in: any other takes longer to read."""

NEAR = float(np.float32(1e-4))
"""Frames from a key within which Blender takes its value."""

BLOCK = 16384
"""Values worked on at once: few enough for the processor's caches, enough to make light of the calls to NumPy."""

AT_HAND = 65536
"""Values of curves with the same timing that are worked out at once."""

STEP = 1e-5
"""Last step of Newton's method: the error left is about its square."""

MOST_COPIES = 2**22
"""Of key times that `cyclic_times` returns."""


@dataclass(frozen=True)
class Cycles:
    """A Cycles modifier. Modes are NONE, REPEAT, REPEAT_OFFSET or MIRROR; a count of 0 is without end."""

    before: str
    after: str
    before_count: int
    after_count: int


@dataclass(frozen=True, eq=False)
class Keys:
    """c F-curves that are keyed together: n keys each, on the same frames, and alike in what they do outside of them.

    Frames and values are in single precision, codes are `INTERPOLATIONS` and `EASINGS`. What does not bear on the
    values of the curves is None.
    """

    points: np.ndarray
    """Frame and value, shape (c, n, 2)."""

    interpolation: np.ndarray
    """Codes of the segments that the keys begin, shape (c, n)."""

    left: np.ndarray | None = None
    """The handles before the keys, frame and value, shape (c, n, 2)."""

    right: np.ndarray | None = None
    """The handles behind the keys, frame and value, shape (c, n, 2)."""

    easing: np.ndarray | None = None
    """Codes, shape (c, n)."""

    easing_settings: np.ndarray | None = None
    """BACK's overshoot, ELASTIC's amplitude and ELASTIC's period in frames, shape (3, c, n)."""

    linear: bool = False
    """Whether the curves go on at their slope outside of the keys, instead of holding their value."""

    cycles: Cycles | None = None

    is_sound: bool = True
    """Whether all numbers that were read are finite, and the keys in the order of their frames."""

    @cached_property
    def times(self) -> np.ndarray:
        """Frames of the keys, shape (n,), double precision."""
        return self.points[0, :, 0].astype(np.float64)

    @property
    def values(self) -> np.ndarray:
        """Values of the keys, shape (c, n)."""
        return self.points[..., 1]

    def only(self, channels: Sequence[int]) -> Keys:
        """The same of some of the channels."""
        points, interpolation, left, right, easing = (
            None if array is None else array[channels]
            for array in (self.points, self.interpolation, self.left, self.right, self.easing)
        )
        settings = None if self.easing_settings is None else self.easing_settings[:, channels]
        return Keys(points, interpolation, left, right, easing, settings, self.linear, self.cycles, self.is_sound)

    @property
    def raw(self) -> bytes:
        """All of it as bytes, for a digest that tells whether anything has changed."""
        arrays = (self.points, self.interpolation, self.left, self.right, self.easing, self.easing_settings)
        read = [array for array in arrays if array is not None]
        header = f"{self.points.shape} {len(read)} {self.linear} {self.cycles};"
        return b"".join((header.encode(), *(array.tobytes() for array in read)))


def read_keys(fcurves: Sequence[Sequence[bpy.types.FCurve]]) -> list[list[tuple[list[int], Keys]]]:
    """The keys of F-curves, and the first Cycles modifier of each that is not muted; none of their other modifiers.

    Parameters
    ----------
    fcurves : sequence of sequences of bpy.types.FCurve
        Those of each owner, with keys: of a sampled curve there are none. Many owners are read quicker at once.

    Returns
    -------
    list of lists of (list of int, Keys)
        For each owner those together that are keyed together: their places in its sequence, and their keys.
    """
    alike: dict[tuple, list[tuple]] = {}
    for owner, curves in enumerate(fcurves):
        for place, fcurve in enumerate(curves):
            keys = fcurve.keyframe_points
            cycles = _read_cycles(fcurve.modifiers) if fcurve.modifiers else None
            alike.setdefault((len(keys), fcurve.extrapolation, cycles), []).append((owner, place, keys))
    found: list[list[tuple[list[int], Keys]]] = [[] for _ in fcurves]
    for (_, extrapolation, cycles), some in alike.items():
        owners, places, channels = zip(*some, strict=True)
        for rows, keys in _read(owners, channels, extrapolation == "LINEAR", cycles):
            found[owners[rows[0]]].append(([places[row] for row in rows], keys))
    for together in found:
        together.sort(key=lambda one: one[0])
    return found


def _read(
    owners: Sequence[int], channels: Sequence, linear: bool, cycles: Cycles | None
) -> Iterator[tuple[list[int], Keys]]:
    """The keys of channels, from their `keyframe_points` with equally many each: the numbers of those together."""
    points = _read_each("co", channels, np.float32, 2)
    together = _keyed_together(owners, points[..., 0])
    order = [row for rows in together for row in rows]
    if order != list(range(len(order))):
        channels, points = [channels[row] for row in order], points[order]
    sizes = np.array([len(rows) for rows in together])
    bounds = np.concatenate(((0,), np.cumsum(sizes)))

    def any_of(keys: np.ndarray) -> np.ndarray:
        return np.logical_or.reduceat(keys.any(axis=1), bounds[:-1])

    interpolation = _read_each("interpolation", channels, CODE)
    _mend(interpolation, INTERPOLATIONS, CONSTANT)
    bezier = interpolation == BEZIER
    eased = any_of(~(bezier | (interpolation == LINEAR) | (interpolation == CONSTANT)))
    curved = any_of(bezier) | (eased & linear)
    some = np.flatnonzero(curved.repeat(sizes)).tolist()
    left, right = (_read_each(name, channels, np.float32, 2, some=some) for name in ("handle_left", "handle_right"))
    some = np.flatnonzero(eased.repeat(sizes)).tolist()
    easing = _read_each("easing", channels, CODE, some=some)
    _mend(easing, EASINGS, AUTO)
    settings = [_read_each(name, channels, np.float32, some=some) for name in ("back", "amplitude", "period")]
    every = np.concatenate([array.reshape(len(points), -1) for array in (points, left, right, *settings)], axis=1)
    sound = ~any_of(~np.isfinite(every)) & ~any_of(~(points[:, 1:, 0] >= points[:, :-1, 0]))
    for number, (rows, own) in enumerate(
        zip(together, itertools.starmap(slice, itertools.pairwise(bounds)), strict=True)
    ):
        handles = (left[own], right[own]) if curved[number] else (None, None)
        easings = (easing[own], np.stack([numbers[own] for numbers in settings])) if eased[number] else (None, None)
        yield rows, Keys(points[own], interpolation[own], *handles, *easings, linear, cycles, bool(sound[number]))


def _keyed_together(owners: Sequence[int], frames: np.ndarray) -> list[list[int]]:
    """The numbers of channels with keys on these frames (c, n), those together of one owner and on the same frames."""
    raw, width = frames.tobytes(), frames.shape[1] * frames.itemsize
    together: dict[tuple[int, bytes], list[int]] = {}
    for row, owner in enumerate(owners):
        together.setdefault((owner, raw[row * width : (row + 1) * width]), []).append(row)
    return list(together.values())


def _read_each(
    name: str, channels: Sequence, dtype: type, *width: int, some: Sequence[int] | None = None
) -> np.ndarray:
    """What the n keys of each of c channels have by this name, (c, n) or (c, n, width); zeros for all but `some`."""
    values = np.zeros((len(channels), len(channels[0]) * math.prod(width)), dtype)
    every = some is None or len(some) == len(channels)
    pairs = zip(channels, values, strict=True) if every else ((channels[row], values[row]) for row in some)
    for keys, own in pairs:
        keys.foreach_get(name, own)
    return values.reshape(len(values), -1, *width) if width else values


def _mend(codes: np.ndarray, names: dict[int, str], otherwise: int) -> None:
    """Do Blender's own way with codes that mean nothing, in a damaged file. Those with a meaning have no gaps."""
    codes[(codes < min(names)) | (codes > max(names))] = otherwise


def _read_cycles(modifiers: Iterable[bpy.types.FModifier]) -> Cycles | None:
    for modifier in modifiers:
        if modifier.type == "CYCLES" and not modifier.mute:
            return Cycles(modifier.mode_before, modifier.mode_after, modifier.cycles_before, modifier.cycles_after)
    return None


def evaluate(
    curves: Sequence[Keys],
    times: Sequence[np.ndarray],
    *,
    unit_elastic: bool = False,
    out: Sequence[np.ndarray] | None = None,
) -> Sequence[np.ndarray]:
    """The values of curves at their times.

    Parameters
    ----------
    curves : sequence of Keys
        Without keys curves are 0 everywhere, as in Blender.
    times : sequence of array, shape (m,)
        Frames for each of them, sub-frames allowed, best in rising order. Curves that have their keys and handles on
        the same frames, and that are asked for the same frames, share the work.
    unit_elastic : bool
        Take the amplitude of ELASTIC relative to the change of value in its segment, instead of in units of value:
        then curves keyed together have the same timing there too.
    out : sequence of array, shape (c, m), optional
        What to put the values into.

    Returns
    -------
    sequence of array, shape (c, m)
        NaN where keys or handles are not finite. What Blender does to the channels
        of whole numbers and enumerations, which it rounds, is left out.
    """
    if out is None:
        out = [np.empty((len(keys.points), len(at))) for keys, at in zip(curves, times, strict=True)]
    if curves:
        with np.errstate(all="ignore"):
            spans = _Spans.of(curves, unit_elastic)
            for groups in _blocks(_groups(curves, list(times), spans)):
                _fill(groups, spans, out)
    return out


def cycled(keys: Keys, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times folded back into the range of the keys by the curve's cycles.

    Parameters
    ----------
    keys : Keys
        The curve. Without cycles times stay what they are.
    times : array, shape (m,)
        Frames.

    Returns
    -------
    folded : array, shape (m,)
        In the range of the keys, or as they were where no cycle reaches.
    backwards : array of bool, shape (m,)
        Whether time runs backwards there.
    """
    with np.errstate(all="ignore"):
        folded, backwards, _ = _fold(keys, np.asarray(times))
    return folded, backwards


def cyclic_times(keys: Keys, times: np.ndarray, first: float, last: float) -> np.ndarray:
    """Key times and their copies in the curve's cycles.

    Parameters
    ----------
    keys : Keys
        The curve whose cycles count. Times outside the range of its keys are not copied.
    times : array, shape (k,)
        Key times, of this curve or of several.
    first, last : float
        Frames that the times returned are between, both included.

    Returns
    -------
    array, shape (c,)
        Rising, each time once.

    Raises
    ------
    ValueError
        Where the cycles are so short, and so many, that there would be millions.
    """
    times = np.asarray(times, dtype=np.float64)
    copies = [times]
    if keys.cycles is not None and len(keys.times):
        begin, end = keys.times[[0, -1]].tolist()
        period = end - begin
        inside = times[(times >= begin) & (times <= end)]
        for mode, count, room, side in (
            (keys.cycles.before, keys.cycles.before_count, begin - first, -1.0),
            (keys.cycles.after, keys.cycles.after_count, last - end, 1.0),
        ):
            if mode == "NONE" or not (0.0 < period < np.inf and room > 0.0) or count < 0:
                continue
            rounds = np.ceil(room / period)
            rounds = min(rounds, count) if count else rounds
            if rounds * len(inside) > MOST_COPIES:
                raise ValueError(f"{rounds:.0f} rounds of {period:g} frames are too many: give Cycles a count")
            number = np.arange(1.0, rounds + 1.0)[:, None]
            mirrored = (number % 2 == 1) & (mode == "MIRROR")
            copies.append((np.where(mirrored, begin + end - inside, inside) + side * number * period).ravel())
    found = np.unique(np.concatenate(copies))
    return found[(found >= first) & (found <= last)]


def _fold(keys: Keys, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times folded, whether they run backwards, and how many times the change from first to last key is to be added.

    All in single precision and in Blender's order of steps: it decides on which side of a key a frame falls.
    """
    folded = times.astype(np.float32)
    backwards, rounds = np.zeros(times.shape, dtype=bool), np.zeros(times.shape, np.float32)
    frames = keys.points[0, :, 0]
    if keys.cycles is None or not len(frames) or frames[0] == frames[-1]:
        return folded.astype(np.float64), backwards, rounds
    begin, end = frames[0], frames[-1]
    period = end - begin
    for mode, count, outside, side in (
        (keys.cycles.before, keys.cycles.before_count, folded < begin, -1),
        (keys.cycles.after, keys.cycles.after_count, folded > end, 1),
    ):
        if mode == "NONE":
            continue
        near, far = (begin, end) if side < 0 else (end, begin)
        distance = folded[outside] - near
        cycle = side * distance / period
        reached = (cycle <= count) | (count == 0)
        where = np.flatnonzero(outside)[reached]
        distance, cycle = distance[reached], cycle[reached]
        rest = np.fmod(distance, period)
        odd = (np.trunc(cycle) % 2 == 1) & (mode == "MIRROR")
        reverse = (np.trunc(cycle.astype(np.float64) + 1.0) % 2 == 1) & (mode == "MIRROR")
        time = np.where(reverse, near - rest, begin + rest)
        time = np.where(rest == 0.0, np.where(odd, far, near), time)
        folded[where] = np.where(time < begin, time + period, time)
        backwards[where] = reverse
        if mode == "REPEAT_OFFSET":
            whole = np.floor if side < 0 else np.ceil
            rounds[where] = whole(distance / period)
    return folded.astype(np.float64), backwards, rounds


@dataclass(frozen=True, eq=False)
class _Group:
    """Curves with the same timing, and which spans their moments fall into."""

    members: list[tuple[int, slice]]
    """The curves: which of the keys asked for, and which channels of them."""

    curves: np.ndarray
    """Their numbers among all curves, shape (c,)."""

    moments: np.ndarray
    """Frames, rising, shape (m,)."""

    spans: np.ndarray
    """Spans of the first of the curves, shape (s,)."""

    counts: np.ndarray
    """How many of the moments, one after the other, fall into each, shape (s,)."""

    order: np.ndarray | None
    """Where the moments belong in the result, shape (m,). None: where they are."""

    offsets: np.ndarray | None
    """What cycles add to each curve, in the order of the result, shape (c, m). None: nothing."""

    def handfuls(self, size: int) -> Iterator[tuple[slice, _Group]]:
        """The same with about `size` of the curves at a time, and which these are."""
        begin = first = end = 0
        for place, (_, channels) in enumerate(self.members, start=1):
            end += channels.stop - channels.start
            if end - begin >= size or place == len(self.members):
                some = slice(begin, end)
                offsets = None if self.offsets is None else self.offsets[some]
                yield some, replace(self, members=self.members[first:place], curves=self.curves[some], offsets=offsets)
                begin, first = end, place

    def put(self, values: np.ndarray, out: Sequence[np.ndarray]) -> None:
        """Put values (c, m) at the moments where they belong, see `evaluate`."""
        if self.order is not None:
            rising, values = values, np.empty_like(values)
            values[:, self.order] = rising
        if self.offsets is not None:
            values += self.offsets
        begin = 0
        for number, channels in self.members:
            end = begin + channels.stop - channels.start
            out[number][channels] = values[begin:end]
            begin = end


def _groups(curves: Sequence[Keys], times: Sequence[np.ndarray], spans: _Spans) -> Iterator[_Group]:
    """Curves that share their timing and are asked for the same frames, wherever in the list they are."""
    requests, distinct = _requests(times)
    together: dict[tuple, list[tuple[int, slice]]] = {}
    for number, (request, timings) in enumerate(zip(requests, spans.timings(curves), strict=True)):
        for channels, timing in timings:
            together.setdefault((request, timing), []).append((number, channels))
    rising = [bool(np.all(moments[1:] >= moments[:-1])) for moments in distinct]
    for (request, _), members in together.items():
        leader, moments = curves[members[0][0]], distinct[request]
        offsets = order = None
        if leader.cycles is not None:
            moments, _, rounds = _fold(leader, moments)
            if np.any(rounds):
                ends = [curves[number].values[channels] for number, channels in members]
                offsets = np.multiply.outer(np.concatenate([values[:, -1] - values[:, 0] for values in ends]), rounds)
        if leader.cycles is not None or not rising[request]:
            order = np.argsort(moments, kind="stable")
            moments = moments[order]
        rows = ((spans.number[number], channels) for number, channels in members)
        own = np.array([row for first, some in rows for row in range(first + some.start, first + some.stop)])
        yield _Group(members, own, moments, *spans.place(int(own[0]), moments), order, offsets)


def _requests(times: Sequence[np.ndarray]) -> tuple[list[int], list[np.ndarray]]:
    """Which of the distinct arrays of frames each curve is asked for, and those, in Blender's precision."""
    requests: list[int] = []
    distinct: list[np.ndarray] = []
    of_array: dict[int, int] = {}
    of_content: dict[bytes, int] = {}
    for asked in times:
        if id(asked) not in of_array:
            single = np.asarray(asked).astype(np.float32)
            request = of_array[id(asked)] = of_content.setdefault(single.tobytes(), len(distinct))
            if request == len(distinct):
                distinct.append(single.astype(np.float64))
        requests.append(of_array[id(asked)])
    return requests, distinct


def _blocks(groups: Iterable[_Group]) -> Iterator[list[_Group]]:
    """Groups of equally many curves, in lists of about BLOCK moments."""
    block: list[_Group] = []
    size = 0
    for group in sorted(groups, key=lambda group: len(group.curves)):
        if block and (size >= BLOCK or len(block[0].curves) != len(group.curves)):
            yield block
            block, size = [], 0
        block.append(group)
        size += len(group.moments)
    yield block


def _fill(groups: list[_Group], spans: _Spans, out: Sequence[np.ndarray]) -> None:
    """Put the values of groups with equally many curves each where they belong, see `evaluate`."""
    leading = np.concatenate([group.spans for group in groups])
    counts = np.concatenate([group.counts for group in groups])
    parameters = spans.parameters(leading, counts, np.concatenate([group.moments for group in groups]))
    first = spans.first[np.stack([group.curves for group in groups], axis=1)]
    each = [len(group.spans) for group in groups]
    own = leading + np.repeat(first - first[0], each, axis=1)
    degree = 3 if BEZIER in spans.interpolation[leading] else 1
    powers = np.empty((degree + 1, len(parameters)))
    powers[0] = 1.0
    for power in range(degree):
        np.multiply(powers[power], parameters, out=powers[power + 1])

    def values(of_curves: slice) -> np.ndarray:
        rows = np.empty((len(own[of_curves]), len(parameters)))
        combine(spans.polynomials[: degree + 1, own[of_curves]].transpose(1, 0, 2), powers, counts, rows)
        return rows

    if len(groups) == 1:
        for some, group in groups[0].handfuls(AT_HAND // max(1, len(parameters))):
            group.put(values(some), out)
        return
    begin, rows = 0, values(slice(None))
    for group in groups:
        group.put(rows[:, begin : begin + len(group.moments)], out)
        begin += len(group.moments)


@dataclass(frozen=True, eq=False)
class _Spans:
    """The spans of C curves, one curve after the other: N in all."""

    number: list[int]
    """How many curves there are before those of each `Keys`."""

    first: np.ndarray
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
    """All that the parameters of BEZIER depend on, 16 bytes for each key."""

    crowded: frozenset[int]
    """Curves that have keys so close together that a frame may be near to two, or out of order."""

    linear: bool
    """Whether any curve goes on at its slope outside of its keys."""

    unit_elastic: bool

    @classmethod
    def of(cls, curves: Sequence[Keys], unit_elastic: bool) -> _Spans:
        curves = [keys if len(keys.times) else _without_keys(len(keys.points)) for keys in curves]
        channels = [len(keys.points) for keys in curves]
        first = np.concatenate(((0,), np.cumsum(np.repeat([len(keys.times) + 1 for keys in curves], channels))))
        before, after = first[:-1], first[1:] - 1
        # The span before the first key is that of a second key in the same place.
        key = np.arange(first[-1]) - np.repeat(np.arange(1, len(first)), np.diff(first))
        key[before] += 1

        points = np.concatenate([keys.points.reshape(-1, 2) for keys in curves]).take(key, axis=0)
        left, right = (
            np.concatenate([(keys.points if of_keys is None else of_keys).reshape(-1, 2) for keys, of_keys in handles])
            for handles in ([(keys, keys.left) for keys in curves], [(keys, keys.right) for keys in curves])
        )
        left, right = left.take(key, axis=0), right.take(key, axis=0)
        codes = np.concatenate([keys.interpolation.ravel() for keys in curves]).take(key)
        following, following_left = np.roll(points, -1, axis=0), np.roll(left, -1, axis=0)
        duration = following[:, 0] - points[:, 0]
        crowded = ~(duration > 2.1 * NEAR)
        crowded[before] = crowded[after] = False
        duration[after] = 0.0
        moving = (duration != 0.0) & (codes != CONSTANT)
        duration = duration.astype(np.float64)
        change = np.where(moving, following[:, 1] - points[:, 1], 0.0).astype(np.float64)

        polynomials, bezier = np.zeros((4, len(key))), np.zeros((3, len(key)))
        polynomials[0], polynomials[1], bezier[0] = points[:, 1], change, 1.0
        curved = np.flatnonzero(moving & (codes == BEZIER))
        if len(curved):
            cubics = _cubics(*(ends.take(curved, axis=0) for ends in (points, right, following_left, following)))
            bezier[:, curved] = cubics[..., 0] / duration[curved]
            polynomials[1:, curved] = cubics[..., 1]
        linear = np.flatnonzero(np.repeat([keys.linear for keys in curves], channels))
        if len(linear):
            for outside, inwards, handles in ((before[linear], 2, left), (after[linear], -1, right)):
                # The neighbour of an only key is that key itself.
                neighbours = np.clip(outside + inwards, before[linear] + 1, after[linear])
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
        earliest = start - NEAR
        earliest[before + 1] = start[before]
        side = np.zeros(len(key))
        side[before], side[after] = -1.0, 1.0
        timing = np.column_stack((points[:, 0], left[:, 0], right[:, 0], codes.astype(np.float32)))
        return cls(
            number=list(itertools.accumulate(channels[:-1], initial=0)),
            first=first,
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
            crowded=frozenset((np.searchsorted(first, np.flatnonzero(crowded), side="right") - 1).tolist()),
            linear=bool(len(linear)),
            unit_elastic=unit_elastic,
        )

    def timings(self, curves: Sequence[Keys]) -> Iterator[list[tuple[slice, tuple]]]:
        """For each of the keys which channels have their timing in common, and all that this timing depends on."""
        for number, keys in zip(self.number, curves, strict=True):
            channels = len(keys.points)
            begin, end = 16 * self.first[number], 16 * self.first[number + channels]
            timing, each = self.timing[begin:end], (end - begin) // channels
            if keys.easing is None and timing == timing[:each] * channels:
                yield [(slice(0, channels), (timing[:each], None, keys.cycles))]
                continue
            found = []
            for channel in range(channels):
                eased = None
                if keys.easing is not None:
                    eased = keys.easing[channel].tobytes(), keys.easing_settings[:, channel].tobytes()
                    if not self.unit_elastic and ELASTIC in keys.interpolation[channel]:
                        eased = number + channel
                own = timing[channel * each : (channel + 1) * each]
                found.append((slice(channel, channel + 1), (own, eased, keys.cycles)))
            yield found

    def place(self, number: int, moments: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The spans of one curve that rising moments fall into one after the other, and how many into each."""
        begin, end = self.first[number : number + 2]
        if number in self.crowded:
            found = _search(self.start[begin + 1 : end], moments)
            runs = np.flatnonzero(np.diff(found, prepend=-1))
            return begin + found[runs], np.diff(runs, append=len(moments))
        bounds = np.empty(end - begin + 1, dtype=np.int64)
        bounds[0], bounds[-1] = 0, len(moments)
        bounds[1:-1] = np.searchsorted(moments, self.earliest[begin + 1 : end])
        return np.arange(begin, end), bounds[1:] - bounds[:-1]

    def parameters(self, spans: np.ndarray, counts: np.ndarray, moments: np.ndarray) -> np.ndarray:
        """The parameters of the cubics for moments (m,), of which each of `spans` (s,) has the next `counts` (s,)."""

        def spread(of_spans: np.ndarray) -> np.ndarray:
            return of_spans[..., spans].repeat(counts, axis=-1)

        frames = moments - spread(self.start)
        parameters = np.where(np.abs(frames) <= NEAR, 0.0, frames) * spread(self.rate)
        codes = set(self.interpolation[spans].tolist())
        if BEZIER in codes:
            parameters = _solve(parameters, spread(self.bezier))
        if not codes <= {CONSTANT, LINEAR, BEZIER}:
            self._ease(parameters, np.repeat(spans, counts))
        if self.linear:
            side = spread(self.side)
            parameters = np.where(side != 0.0, side * np.maximum(side * frames, 0.0), parameters)
        return parameters

    def _ease(self, parameters: np.ndarray, spans: np.ndarray) -> None:
        """Replace the times in these spans, each of shape (m,), by what easings make of them."""
        manners = self.interpolation * len(EASINGS) + self.easing
        manner_of = manners[spans]
        for manner in np.unique(manner_of).tolist():
            code, easing = divmod(manner, len(EASINGS))
            if code in (CONSTANT, LINEAR, BEZIER):
                continue
            here = np.flatnonzero(manner_of == manner)
            back, *swing = self.settings[:, spans[here]]
            u, easing = parameters[here], EASINGS[easing]
            if code == ELASTIC:
                parameters[here] = elastic(easing, u, *swing)
            else:
                parameters[here] = ease(INTERPOLATIONS[code], easing, u, back)


def _without_keys(channels: int) -> Keys:
    """Stands for curves without keys, which are 0 everywhere in Blender."""
    return Keys(np.zeros((channels, 1, 2), np.float32), np.full((channels, 1), CONSTANT, CODE))


def _easings(curves: Sequence[Keys]) -> tuple[np.ndarray, np.ndarray]:
    """Easings and their settings for the keys of all curves, shapes (n,) and (3, n); zeros where none were read."""
    counts = [keys.interpolation.size for keys in curves]
    easing, settings = np.zeros(sum(counts), dtype=CODE), np.zeros((3, sum(counts)))
    for keys, end, count in zip(curves, itertools.accumulate(counts), counts, strict=True):
        if keys.easing is not None:
            easing[end - count : end] = keys.easing.ravel()
            settings[:, end - count : end] = keys.easing_settings.reshape(3, -1)
    return easing, settings


def _cubics(start: np.ndarray, right: np.ndarray, left: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Bezier curves as cubics, after the correction that keeps frames from running backwards.

    Parameters
    ----------
    start, right, left, end : array, shape (k, 2)
        Key, its handle, the handle of the next key and that key. Single precision: Blender's rounding matters where
        frames are many and segments short.

    Returns
    -------
    array, shape (3, k, 2)
        Coefficients of t, t^2 and t^3 for frame and value from the first key on.
    """
    duration = end[:, :1] - start[:, :1]
    rises = (one[:, 1] - other[:, 1] for one, other in ((start, end), (right, left), (left, end)))
    flat = np.logical_and.reduce([np.abs(rise) < np.finfo(np.float32).eps for rise in rises])
    right, left = _shortened(start, right, duration), _shortened(end, left, duration)
    cubics = np.stack(
        (3.0 * (right - start), 3.0 * (start - 2.0 * right + left), end - start + 3.0 * (right - left))
    ).astype(np.float64)
    cubics[:, flat, 1] = 0.0
    return cubics


def _shortened(key: np.ndarray, handle: np.ndarray, duration: np.ndarray) -> np.ndarray:
    """The handle, no longer in time than the segment."""
    arm = key - handle
    length = np.abs(arm[:, :1])
    long = length > duration
    return np.where(long, key - duration / length * arm, handle) if long.any() else handle


def _slopes(ends: np.ndarray, neighbours: np.ndarray, handles: np.ndarray, codes: np.ndarray) -> np.ndarray:
    """Slopes beyond keys at the end of a curve, from points of shape (k, 2)."""
    run, rise = (np.where(codes[:, None] == LINEAR, neighbours, handles) - ends).astype(np.float64).T
    return np.where((run == 0.0) | (codes == CONSTANT), 0.0, rise / run)


def _search(keys: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """The spans, counted from 0 for the time before the first key, that moments fall into by Blender's bisection.

    Where several keys are near to a moment it decides for the one that it happens on first.
    """
    low, high = np.zeros(len(moments), dtype=np.int64), np.full(len(moments), len(keys))
    spans = np.zeros(len(moments), dtype=np.int64)
    searching = np.ones(len(moments), dtype=bool)
    for near in (0, len(keys) - 1):
        found = searching & (np.abs(moments - keys[near]) <= NEAR)
        spans[found] = near + 1
        searching &= ~found
    for _ in range(len(keys).bit_length() + 1):
        middle = np.minimum((low + high) // 2, len(keys) - 1)
        frames = moments - keys[middle]
        found = searching & (np.abs(frames) <= NEAR)
        spans[found] = middle[found] + 1
        searching &= ~found
        low = np.where(searching & (frames > 0.0), middle + 1, low)
        high = np.where(searching & (frames < 0.0), middle - 1, high)
        going = searching & (low <= high)
        spans[searching & ~going] = low[searching & ~going]
        searching = going
    spans[moments >= keys[-1]] = len(keys)
    spans[moments <= keys[0]] = 0
    return spans


def _solve(u: np.ndarray, cubic: np.ndarray) -> np.ndarray:
    """The t from 0 to 1 at which the cubic c1 t + c2 t^2 + c3 t^3 is u.

    There is one for every u from 0 to 1: the cubic goes from 0 to 1, and handles no longer than the segment let it turn
    at most before it leaves 0 for good and after it has reached 1.

    Parameters
    ----------
    u : array, shape (m,)
        Time, 0 to 1.
    cubic : array, shape (3, m)
        c1, c2 and c3.
    """
    c1, c2, c3 = cubic
    twice, thrice = 2.0 * c2, 3.0 * c3
    # Newton's method, from the cubic in u that goes through both ends with the slopes that t has there.
    at_start, at_end = (np.clip(1.0 / slope, 0.0, 3.0) for slope in (c1, c1 + twice + thrice))
    t = u * (at_start + u * (3.0 - 2.0 * at_start - at_end + u * (at_start + at_end - 2.0)))
    for _ in range(4):
        step = (((c3 * t + c2) * t + c1) * t - u) / ((thrice * t + twice) * t + c1)
        t -= step
        np.abs(step, out=step)
        if step.max(initial=0.0) < STEP:
            break
    missed = np.flatnonzero(~((step < STEP) & (np.abs(t - 0.5) < 0.5 + STEP)))
    if len(missed):
        t[missed] = _solve_bracketed(u[missed], cubic[:, missed])
    return t


def _solve_bracketed(u: np.ndarray, cubic: np.ndarray) -> np.ndarray:
    """As `_solve`, for the few where the slope vanishes close by: Newton's steps, or bisection where they lead out."""
    c1, c2, c3 = cubic
    low, high = np.zeros_like(u), np.ones_like(u)
    t = np.clip(u, 0.0, 1.0)
    for _ in range(100):
        excess = ((c3 * t + c2) * t + c1) * t - u
        low, high = np.where(excess < 0.0, t, low), np.where(excess > 0.0, t, high)
        following = t - excess / ((3.0 * c3 * t + 2.0 * c2) * t + c1)
        following = np.where((following > low) & (following < high), following, 0.5 * (low + high))
        following = np.where(excess == 0.0, t, following)
        if not np.any(np.abs(following - t) > 1e-12):
            break
        t = following
    return t
