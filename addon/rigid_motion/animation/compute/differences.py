"""From what was keyed to what is to happen between the keys, and to the delta transforms that make Blender do it.

Arrays alone, many sources at once: the ten components of location, rotation and scale are rows, and the samples (or
segments, or keys) of all sources stand one behind the other along the last axis. A segment runs from one frame that has
a key in any channel to the next. How far the object has come in it is what Blender's own in-betweens say: their share
of the chord over all channels, a radian counting as much as a unit of length. So a segment follows the easing, the
handles and the overshoot of its keys, whatever its mode. A smooth mode has a timing of its own, even from key to key,
and that is kept where keys are not eased: handles shape single channels, and it is in their place.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ...motion import KEYFRAME_MODES, Poses, prepare, twists
from ...motion.eulers import extrinsic_eulers_from_quaternions
from ...motion.piecewise import blocks, combine
from ...motion.quaternions import multiply
from ...motion.segments import prepare_within
from ..curves import Keys, evaluate
from .between_samples import Samples, largest_errors
from .bodies import align, body_poses, differ, location_axes, take_off, turn_into_quaternions
from .components import LOCATION, PART_OF, REST, ROTATION, ROWS, SCALE
from .key_speeds import MEASURED, corrected, native_twists, progress_slopes, tangents_and_lacks
from .neighbours import meeting, with_neighbours
from .sources import MODE_NAMES, MODE_NUMBERS, SAME_FRAME, Source

AT_ONCE = 131072
"""Samples that are prepared for at once."""

BLOCK = 24576
"""Samples worked on at once: few enough for the processor's caches."""

NOTHING = 1e-9
"""What a component varies by that is always the same but for rounding errors."""


SMOOTH = [mode.number for mode in KEYFRAME_MODES.values() if mode.is_smooth]
"""The numbers of modes for which the keys around a segment count."""

if any(mode.behind > 1 or mode.ahead > 1 for mode in KEYFRAME_MODES.values()):
    raise NotImplementedError(
        "a mode for keyframes can look one key behind and ahead of a segment: see with_neighbours"
    )


@dataclass(frozen=True, eq=False)
class InBetweens:
    """The motion of one source as a body, with the delta transforms that the object has anyway.

    It is in the space of the channels; but where location runs along other axes than the body's at rest, in those.
    """

    frames: np.ndarray
    """Shape (m,)."""

    native: Poses
    """What Blender's own in-betweens make of the keys, shape (m,)."""

    wanted: Poses
    """What the modes make of them, shape (m,)."""


def in_betweens(source: Source, frames: np.ndarray, mode: str | None = None) -> InBetweens:
    """The motion of a source at any rising frames, sub-frames included.

    Parameters
    ----------
    source : Source
    frames : array, shape (m,)
    mode : str, optional
        One of `MODE_IDS` for all segments, instead of the modes that they have.
    """
    frames = np.asarray(frames, dtype=np.float64)
    native, delta = np.empty((2, _height([source]), len(frames)))
    delta = delta[: _filled_height([source])]
    if len(source.key_frames) > 1:
        _move([source], [frames], native, delta, None if mode is None else MODE_NUMBERS[mode])
    else:
        # Without a segment there is nothing to fill in.
        _sampled([(source, slice(len(frames)))], [frames], out=native)
        turn_into_quaternions(native, source.order)
        delta[:] = source.original[: len(delta), None]

    def moved_by(deltas: np.ndarray) -> Poses:
        positions = (native[ROWS[LOCATION]] + deltas[ROWS[LOCATION]]).T
        return Poses(
            positions if source.location_axes is None else positions @ source.location_axes.T,
            multiply(deltas[ROWS[ROTATION]].T, native[ROWS[ROTATION]].T),
            (native[ROWS[SCALE]] * deltas[ROWS[SCALE]]).mean(axis=0) if source.uniform_scale else None,
        )

    return InBetweens(frames, moved_by(source.original[:, None]), moved_by(delta))


def differences(
    sources: Sequence[Source],
    ranges: Sequence[tuple[int, int]] | None = None,
    rates: Sequence[int] | None = None,
    reaches: Sequence[float] | None = None,
) -> list[Samples]:
    """What turns Blender's in-betweens into the wanted ones, on the whole frames of each source and between them.

    The rotation is a quaternion or, for a source that turns by Euler angles, as these, and applied on the left;
    location is added, scale multiplied. Components that are the source's original ones throughout are left out.

    Parameters
    ----------
    sources
    ranges : sequence of pairs, optional
        The first and last samples of each, counted from frame 0, in place of those of the source. Then no component
        is left out that may differ elsewhere.
    rates : sequence of int, optional
        How many samples a frame each has; one where there are none.
    reaches : sequence of float, optional
        How far the body of each reaches from its origin: then the errors between samples are estimated.
    """
    found = {}
    rates = rates or [1] * len(sources)
    rate_of = {id(source): rate for source, rate in zip(sources, rates, strict=True)}
    reach_of = {id(source): reach for source, reach in zip(sources, reaches or rates, strict=True)}
    range_of = {id(source): source.sample_range(rate) for source, rate in zip(sources, rates, strict=True)}
    if ranges is not None:
        range_of = {id(source): span for source, span in zip(sources, ranges, strict=True)}
    for portion in _portions(sources, range_of):
        spans = [(*range_of[id(source)], rate_of[id(source)]) for source in portion]
        of_range = {span: np.arange(span[0], span[1] + 1.0) / span[2] for span in set(spans)}
        frames = [of_range[span] for span in spans]
        samples = _each(portion, map(len, frames))
        # Both in one array: of smaller ones the C library gives the memory back at once, and asks for it the next time.
        rows, points = np.empty((2, _height(portion), samples[-1][1].stop))
        delta = rows[: _filled_height(portion)]
        _move(portion, frames, rows, delta)
        for source, place in samples:
            if source.is_on_top and not np.array_equal(source.original, REST):
                take_off(delta[:, place], source.original)
        order = portion[0].order
        if order is not None:
            for some, place in blocks(np.array((0, *(own.stop for _, own in samples))), BLOCK):
                starts = [own.start - place.start for _, own in samples[some]]
                delta[3:6, place] = extrinsic_eulers_from_quaternions(delta[ROWS[ROTATION], place].T, order, starts).T
        else:
            align(delta[ROWS[ROTATION]], [place.start for _, place in samples])
        starts = [place.start for _, place in samples]
        errors = itertools.repeat(0.0)
        if reaches is not None:
            errors = largest_errors(delta, samples, spans, [reach_of[id(source)] for source in portion])
        first, differs = delta[:, starts], _range_of_each(delta, starts) > NOTHING
        points = points.view(np.float32).reshape(*rows.shape, 2)[: len(delta)]
        points[..., 0] = np.concatenate(frames)
        points[..., 1] = delta
        for number, ((source, place), error) in enumerate(zip(samples, errors, strict=False)):
            changing = {row for row in source.filled_rows if differs[row, number] or ranges is not None}
            held = _held_rows(source, changing, first[:, number])
            own = Samples({row: points[row, place].ravel() for row in sorted(changing | held)})
            own.rate, own.error = rate_of[id(source)], float(error)
            found[id(source)] = own
    return [found[id(source)] for source in sources]


def _held_rows(source: Source, changing: set[int], constant: np.ndarray) -> set[int]:
    """The rows that never change, and have to be held all the same, of what is constant (.,) in them.

    The components of a quaternion are one by one only where they are zero. In the NLA Blender puts what a strip has no
    channel of to its default.
    """
    turning = source.order is None and any(PART_OF[row] == ROTATION for row in changing)
    default = REST if source.order is None else np.where((REST == 1.0) & (np.arange(10) == 3), 0.0, REST)
    return {
        row
        for row in source.filled_rows
        if row not in changing
        and (
            (turning and PART_OF[row] == ROTATION and abs(constant[row]) > NOTHING)
            or (source.in_nla and abs(constant[row] - default[row]) > NOTHING)
        )
    }


def _range_of_each(rows: np.ndarray, starts: Sequence[int]) -> np.ndarray:
    """By how much rows (r, m) vary within each of the parts that start there, shape (r, parts)."""
    return np.maximum.reduceat(rows, starts, axis=1) - np.minimum.reduceat(rows, starts, axis=1)


def _portions(sources: Sequence[Source], range_of: dict[int, tuple[int, int]]) -> Iterator[list[Source]]:
    """The sources in lists of about `AT_ONCE` samples, those apart that scale evenly or turn otherwise."""
    alike: dict[tuple, list[Source]] = {}
    for source in sources:
        alike.setdefault((source.order, source.uniform_scale), []).append(source)
    for kin in alike.values():
        portion, samples = [], 0
        for source in kin:
            portion.append(source)
            first, last = range_of[id(source)]
            samples += last - first + 1
            if samples >= AT_ONCE:
                yield portion
                portion, samples = [], 0
        if portion:
            yield portion


def _each(sources: Sequence[Source], counts: Iterator[int]) -> list[tuple[Source, slice]]:
    """Each source with the place of what it has this many of."""
    bounds = [0, *itertools.accumulate(counts)]
    return [(source, slice(*place)) for source, place in zip(sources, itertools.pairwise(bounds), strict=True)]


def _move(
    sources: Sequence[Source],
    frames: Sequence[np.ndarray],
    native: np.ndarray,
    delta: np.ndarray,
    mode: int | None = None,
) -> None:
    """Fill in Blender's own in-betweens, rotations as unit quaternions, and the deltas to the wanted ones.

    The sources are alike: all turn by quaternions or by Euler angles of one order, all scale evenly or none does.
    `native` is of `_height`, `delta` of `_filled_height`. They may be in the same place: then the deltas are there.
    """
    order = sources[0].order
    samples = _each(sources, map(len, frames))
    segments = _each(sources, (len(source.key_frames) - 1 for source in sources))
    timing = _sampled(samples, frames, out=native)
    start, end = bounds = _ends(segments)
    if any(source.is_elastic for source in sources):
        timing = _sampled(samples, frames, unit_elastic=True)
        bounds = _ends(segments, unit_elastic=True)
    weights, offsets = _weights(*bounds, order)
    counts, on_keys, owners = _counts(sources, frames)
    modes = np.concatenate([source.modes for source in sources]) if mode is None else np.full(counts.shape, mode)
    original = np.stack([source.original[: len(delta)] for source in sources], axis=1)
    smooth = np.isin(modes, SMOOTH)
    ends, lacks = _Ends.of(start, end, segments, smooth), None
    has_handles = smooth & np.concatenate([source.has_handles for source in sources])
    if has_handles.any():
        measured = _measured(ends.times, segments)
        progress = np.einsum("rs,rsk->sk", weights, measured) - offsets[:, None]
        tangents, lacks = ends.at_keys(progress, measured, sources[0])
        ends = replace(ends, tangents=np.where(has_handles, tangents, 1.0))
        lacks = np.where(has_handles, lacks, 0.0)

    every_frame = np.concatenate(frames)
    for some, place in blocks(np.concatenate(((0,), np.cumsum(counts))), BLOCK):
        progress = np.empty((1, place.stop - place.start))
        combine(weights[None, :, some], timing[:, place], counts[some], progress)
        progress = progress[0] - offsets[some].repeat(counts[some])
        turn_into_quaternions(native[:, place], order)
        default = original[:, ends.owners[some]]
        if lacks is not None:
            first, last = (rows.repeat(counts[some]) for rows in ends.times[some].T)
            elapsed = (every_frame[place] - first) / np.where(last > first, last - first, np.inf)
            progress = corrected(progress, elapsed, lacks[:, some].repeat(counts[some], axis=1))
        _fill(delta[:, place], native[:, place], default, modes[some], ends, some, counts[some], progress)
    # A key is the animator's: nothing is added to it, not even a rounding error.
    delta[:, on_keys] = original[:, owners]
    for number, (source, place) in enumerate(samples):
        if source.cyclic is not None:
            before, after = source.used_up
            outside = (frames[number] < before) | (frames[number] > after)
            delta[:, place][:, outside] = original[:, number, None]


def _fill(
    delta: np.ndarray,
    native: np.ndarray,
    own: np.ndarray,
    modes: np.ndarray,
    ends: _Ends,
    segment: slice,
    counts: np.ndarray,
    progress: np.ndarray,
) -> None:
    """Fill in the deltas (., m) of some segments, each with its own modes and deltas, (s,) and (., s)."""
    for mode in np.unique(modes[counts > 0]):
        chosen = modes == mode
        every = bool(chosen.all())
        some = slice(None) if every else np.repeat(chosen, counts)
        here = counts if every else np.where(chosen, counts, 0)
        if not mode:
            delta[:, some] = own.repeat(here, axis=1)
            continue
        wanted = ends.poses(segment, here, progress[some], MODE_NAMES[mode])
        part = delta if every else np.empty((len(delta), int(here.sum())))
        differ(wanted, native[:, some], part)
        if wanted.scales is not None:
            part[ROWS[SCALE]] *= own[ROWS[SCALE]].repeat(here, axis=1)
        if not every:
            delta[:, some] = part


@dataclass(frozen=True, eq=False)
class _Ends:
    """What S segments of several sources run between, with the objects' own delta transforms."""

    owners: np.ndarray
    """The number of the source of each, shape (S,)."""

    times: np.ndarray
    """The frames of both keys, shape (S, 2)."""

    keys: Poses
    """The poses at both, shape (S, 2)."""

    axes: np.ndarray | None
    """The axes that location runs along, as columns in those of the poses, shape (S, 3, 3); None where they are one."""

    own: np.ndarray
    """The objects' own delta transforms, shape (10, S)."""

    pairs: tuple[np.ndarray, np.ndarray] | None = None
    """For smooth modes the segments that meet at a key, before it and after it."""

    around: tuple[np.ndarray, Poses] | None = None
    """For smooth modes frames and poses of the keys before and behind as well, shape (S, 4)."""

    tangents: np.ndarray | None = None
    """How long the tangents of smooth modes are at both keys, shape (2, S); None where all are 1."""

    prepared: dict[str, Callable[..., Poses]] = field(default_factory=dict)
    """What each mode makes of all segments, once it has been asked for."""

    @classmethod
    def of(cls, start: np.ndarray, end: np.ndarray, segments: list[tuple[Source, slice]], smooth: np.ndarray) -> _Ends:
        """From the channels (10, S) at both ends, and which of the segments have a smooth mode."""
        sources = [source for source, _ in segments]
        owners = np.repeat(np.arange(len(sources)), [place.stop - place.start for _, place in segments])
        firsts, lasts = ([source.key_frames[part] for source in sources] for part in (slice(-1), slice(1, None)))
        times = np.stack((np.concatenate(firsts), np.concatenate(lasts)), axis=1)
        own = np.stack([source.original for source in sources], axis=1)[:, owners]
        axes = location_axes(sources, owners)
        keys = body_poses(np.stack((start, end), axis=2), own[..., None], axes, sources[0])
        if not smooth.any():
            return cls(owners, times, keys, axes, own)
        holds, pairs = np.concatenate([source.holds for source in sources]), meeting(owners, times, keys)
        return cls(owners, times, keys, axes, own, pairs, with_neighbours(times, keys, holds, pairs))

    def at_keys(self, progress: np.ndarray, measured: np.ndarray, source: Source) -> tuple[np.ndarray, np.ndarray]:
        """Return `tangents_and_lacks`, from progress (S, 6) and the channels (., S, 6) at the moments `MEASURED`."""
        first, second = self.keys[:, 0], self.keys[:, 1]
        screws = twists.between(first.positions, first.quaternions, second.positions, second.quaternions)
        native = native_twists(self.keys, body_poses(measured, self.own[..., None], self.axes, source))
        return tangents_and_lacks(progress_slopes(progress), native, screws, self.times, self.pairs)

    def poses(self, some: slice, counts: np.ndarray, progress: np.ndarray, mode: str) -> Poses:
        """What a mode makes of some of the segments, each with so many samples (s,) of this progress (m,).

        Positions run along the axes that location does.
        """
        axes = None if self.axes is None else self.axes[some].repeat(counts, axis=0)
        if mode not in self.prepared:
            self.prepared[mode] = self._prepare(mode)
        if KEYFRAME_MODES[mode].is_smooth:
            # Of the three segments between four keys the one in the middle.
            some = slice(3 * some.start, 3 * some.stop)
            counts = np.multiply.outer(counts, (0, 1, 0)).ravel()
        poses = self.prepared[mode](counts, progress, some)
        return poses if axes is None else replace(poses, positions=np.einsum("mji,mj->mi", axes, poses.positions))

    def _prepare(self, mode: str) -> Callable[..., Poses]:
        if not KEYFRAME_MODES[mode].is_smooth:
            return prepare(np.broadcast_to((0.0, 1.0), self.times.shape), self.keys, mode)
        if self.tangents is None:
            return prepare(*self.around, mode)
        return prepare_within(partial(KEYFRAME_MODES[mode].curves, tangents=self.tangents[..., None]), *self.around)


def _measured(times: np.ndarray, segments: list[tuple[Source, slice]]) -> np.ndarray:
    """The channels' own values in each of S segments at the moments `MEASURED`, shape (., S, 6)."""
    sources = [source for source, _ in segments]
    moments = times[:, :1] + (times[:, 1:] - times[:, :1]) * MEASURED
    frames = [moments[place].ravel() for _, place in segments]
    return _sampled(_each(sources, map(len, frames)), frames).reshape(_height(sources), -1, len(MEASURED))


def _sampled(
    samples: list[tuple[Source, slice]],
    frames: Sequence[np.ndarray],
    *,
    unit_elastic: bool = False,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """The channels' own values at the frames of each source, m in all, with a row for each of the `_height`."""
    rows = np.empty((_height([source for source, _ in samples]), samples[-1][1].stop)) if out is None else out
    curves, times, out, apart = [], [], [], []
    for (source, place), at in zip(samples, frames, strict=True):
        _rest(rows[:, place], source)
        for own, keys in source.channels:
            if at is source.key_frames and source.is_together:
                rows[own, place] = keys.values
                continue
            curves.append(keys)
            times.append(at)
            if own[-1] - own[0] < len(own):
                out.append(rows[own[0] : own[-1] + 1, place])
            else:
                out.append(np.empty((len(own), len(at))))
                apart.append((own, place, out[-1]))
    evaluate(curves, times, unit_elastic=unit_elastic, out=out)
    for own, place, values in apart:
        rows[own, place] = values
    return rows


def _ends(segments: list[tuple[Source, slice]], *, unit_elastic: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """The channels' own values where each segment starts and where it ends, rows as `_sampled` has them."""
    sources = [source for source, _ in segments]
    keys = _each(sources, (len(source.key_frames) for source in sources))
    rows = _sampled(keys, [source.key_frames for source in sources], unit_elastic=unit_elastic)
    begins = np.delete(np.arange(rows.shape[1]), [place.stop - 1 for _, place in keys])
    start, end = rows[:, begins], rows[:, begins + 1]
    for source, place in segments:
        for own, channels in source.channels:
            if channels.cycles is None:
                continue
            # A cycle whose ends differ jumps: one round ends on its last value, the next starts on its first.
            jumps = _jumps(channels, source.key_frames)
            for row, values in zip(own, channels.values, strict=True):
                start[row, place][jumps[:-1]], end[row, place][jumps[1:]] = values[0], values[-1]
    return start, end


def _height(sources: Sequence[Source]) -> int:
    """How many of the components are needed for what the sources key."""
    return ROWS[SCALE].stop if any(SCALE in source.keyed for source in sources) else ROWS[ROTATION].stop


def _filled_height(sources: Sequence[Source]) -> int:
    """How many of them for what is filled in."""
    return ROWS[SCALE].stop if sources[0].uniform_scale else ROWS[ROTATION].stop


def _rest(rows: np.ndarray, source: Source) -> None:
    """Fill in what a source does not key."""
    for name, own in ROWS.items():
        if name not in source.keyed and own.start < len(rows):
            rows[own] = REST[own, None]
    for row, value in source.rest.items():
        rows[row] = value
    if source.order is not None:
        rows[6] = 0.0


def _jumps(keys: Keys, times: np.ndarray) -> np.ndarray:
    """At which of these times a cyclic channel goes from its last value to its first, shape (n,)."""
    cycles = keys.cycles
    first, last = keys.times[[0, -1]]
    if cycles is None or first == last:
        return np.zeros(times.shape, dtype=bool)
    rounds = (times - first) / (last - first)
    whole = np.rint(rounds)
    after = (whole >= 1) & (cycles.after == "REPEAT") & ((whole <= cycles.after_count) | (cycles.after_count == 0))
    before = (whole <= 0) & (cycles.before == "REPEAT") & ((whole > -cycles.before_count) | (cycles.before_count == 0))
    return (np.abs(rounds - whole) * (last - first) < SAME_FRAME) & (after | before)


def _counts(sources: Sequence[Source], frames: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How many samples each segment has, shape (segments,); which samples of all are on a key; and of which source."""
    keys = np.concatenate([source.key_frames for source in sources])
    owners = np.repeat(np.arange(len(sources)), [len(source.key_frames) for source in sources])
    ends = np.cumsum([len(own) for own in frames])
    begins = ends - [len(own) for own in frames]
    at = begins[owners] + np.concatenate(
        [own.searchsorted(source.key_frames) for source, own in zip(sources, frames, strict=True)]
    )
    hits = np.flatnonzero(np.concatenate(frames)[np.minimum(at, ends[owners] - 1)] == keys)
    # A segment begins with the sample on its first key; what is outside of the keys belongs to the outermost ones.
    bounds = at.copy()
    last = np.flatnonzero(np.diff(owners, append=len(sources)))
    bounds[np.concatenate(((0,), last[:-1] + 1))], bounds[last] = begins, ends
    return np.delete(np.diff(bounds), last[:-1]), at[hits], owners[hits]


def _weights(start: np.ndarray, end: np.ndarray, order: str | None) -> tuple[np.ndarray, np.ndarray]:
    """What a segment's progress is made of: weights (10, S) for the channels, and what to take off their sum, (S,)."""
    chord = end - start
    weights = chord.copy()
    if order is None:
        # A unit quaternion moves by half of the angle that the object turns.
        weights[ROWS[ROTATION]] *= 4.0
    total = np.einsum("rs,rs->s", weights, chord)
    weights /= np.where(total > 0.0, total, np.inf)
    return weights, np.einsum("rs,rs->s", weights, start)
