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
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...motion import KEYFRAME_MODES, Poses
from ...motion.eulers import extrinsic_eulers_from_quaternions
from ...motion.piecewise import blocks, combine
from ...motion.quaternions import multiply
from .bodies import (
    align,
    are_idle,
    blended,
    channels_at_ends,
    differ,
    filled_height,
    progress_weights,
    take_off,
    turn_into_quaternions,
    undo_blending,
)
from .breakdowns import Passages
from .components import LOCATION, MODE_NAMES, MODE_NUMBERS, REST, ROTATION, ROWS, SCALE, SMOOTH
from .ends import MEASURED, Ends, corrected, measured_in, packed
from .samples import MOST_CORNERS, Samples, kept_rows, largest_errors
from .sources import SAME_FRAME, Source, each, height, sampled

AT_ONCE = 131072
"""Samples that are prepared for at once."""

BLOCK = 24576
"""Samples worked on at once: few enough for the processor's caches."""


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
    """Poses that Blender's own in-betweens make of the keys, shape (m,)."""

    desired: Poses
    """Poses that the modes make of them, shape (m,)."""


def in_betweens(
    source: Source,
    frames: np.ndarray,
    mode: str | None = None,
    progress: np.ndarray | None = None,
    rate: int | None = None,
) -> InBetweens:
    """Return the motion of a source at any rising frames, sub-frames included.

    Parameters
    ----------
    source : Source
    frames : array, shape (m,)
    mode : str, optional
        One of `MODE_IDS` for all segments, instead of the modes that they have.
    progress : array, shape (m,), optional
        How far the body has come in its segment on these frames, 0 to 1 and beyond, instead of what the channels say.
    rate : int, optional
        As Blender shows the modes with so many samples of the differences a frame, and straight lines between them.
    """
    frames = np.asarray(frames, dtype=np.float64)
    moments, indices = np.unique(source.held(frames), return_inverse=True) if source.steps else (frames, slice(None))
    native, delta = np.empty((2, height([source]), len(moments)))
    delta = delta[: filled_height([source])]
    if len(source.key_frames) > 1:
        chosen = source if mode is None else replace(source, mode=MODE_NUMBERS[mode])
        _move([chosen], [moments], native, delta, progress)
    else:
        # Without a segment there is nothing to fill in.
        sampled([(source, slice(len(moments)))], [moments], out=native)
        turn_into_quaternions(native, source.order)
        delta[:] = source.original[: len(delta), None]
    if rate is not None and source.is_live:
        delta = _between_samples(source, moments, rate)
    native, delta = native[:, indices], delta[:, indices]

    def moved_by(deltas: np.ndarray) -> Poses:
        positions = (native[ROWS[LOCATION]] + deltas[ROWS[LOCATION]]).T
        return Poses(
            positions if source.location_axes is None else positions @ source.location_axes.T,
            multiply(deltas[ROWS[ROTATION]].T, native[ROWS[ROTATION]].T),
            (native[ROWS[SCALE]] * deltas[ROWS[SCALE]]).mean(axis=0) if source.uniform_scale else None,
        )

    return InBetweens(frames, moved_by(source.original[:, None]), moved_by(delta))


def _between_samples(source: Source, frames: np.ndarray, rate: int) -> np.ndarray:
    """Return differences (., m), rotations as quaternions, with straight lines between so many samples a frame.

    Keys between samples are hit, unless there are too many: see `writers.corners`.
    """
    samples = np.concatenate((np.floor(frames * rate), np.ceil(frames * rate))) / rate
    keys = source.key_frames[np.abs(np.rint(source.key_frames * rate) - source.key_frames * rate) > SAME_FRAME]
    if source.cyclic is None and len(keys) <= MOST_CORNERS:
        samples = np.concatenate((samples, keys))
    samples = np.unique(samples)
    rows = np.empty((2, height([source]), len(samples)))
    delta = rows[1, : filled_height([source])]
    _move([source], [samples], rows[0], delta)
    if source.order is None:
        align(delta[ROWS[ROTATION]], [0])
    else:
        delta[3:6] = extrinsic_eulers_from_quaternions(delta[ROWS[ROTATION]].T, source.order, [0]).T
    between = np.stack([np.interp(frames, samples, row) for row in delta])
    turn_into_quaternions(between, source.order)
    return between


def progress_at(sources: Sequence[Source], frames: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return how far along its segment of the path, 0 to 1, each source is on rising frames of its own, (m,)."""
    result, of_source = {}, dict(zip(sources, frames, strict=True))
    for portion in _portions(sources, {source: (0, len(times)) for source, times in of_source.items()}):
        times = [of_source[source] for source in portion]
        samples = each(portion, map(len, times))
        native, delta = np.empty((2, height(portion), samples[-1][1].stop))
        along = _move(portion, times, native, delta[: filled_height(portion)])
        result.update((source, along[span]) for source, span in samples)
    return [result[source] for source in sources]


def differences(
    sources: Sequence[Source],
    rates: Sequence[int] | None = None,
    reaches: Sequence[float] | None = None,
) -> list[Samples]:
    """Return what turns Blender's in-betweens into the desired ones,
    on the whole frames of each source and between them.

    The rotation is a quaternion or, for a source that turns by Euler angles, as these, and applied on the left;
    location is added, scale multiplied. Components that are the source's original ones throughout are left out. Holds
    are left to the F-curves that the differences go into.

    Parameters
    ----------
    sources
    rates : sequence of int, optional
        How many samples a frame each has; one where there are none.
    reaches : sequence of float, optional
        How far the body of each reaches from its origin: then the errors between samples are estimated.
    """
    result = {}
    rates = rates or [1] * len(sources)
    rate_of = dict(zip(sources, rates, strict=True))
    reach_of = dict(zip(sources, reaches or rates, strict=True))
    range_of = {source: source.sample_range(rate) for source, rate in rate_of.items()}
    for portion in _portions(sources, range_of):
        spans = [(*range_of[source], rate_of[source]) for source in portion]
        of_range = {span: np.arange(span[0], span[1] + 1.0) / span[2] for span in set(spans)}
        frames = [of_range[span] for span in spans]
        frames_of = dict(zip(portion, frames, strict=True))
        samples = each(portion, map(len, frames))
        # Both in one array: of smaller ones the C library gives the memory back at once, and asks for it the next time.
        rows, points = np.empty((2, height(portion), samples[-1][1].stop))
        delta = rows[: filled_height(portion)]
        _move(portion, frames, rows, delta)
        for source, span in samples:
            if source.is_on_top and (source.original != REST).any():
                take_off(delta[:, span], source.original)
        order = portion[0].order
        partial = [(source, span) for source, span in samples if source.influence is not None]
        for source, span in partial:
            times = frames_of[source]
            blended(source, times, sampled([(source, slice(len(times)))], [times]), delta[:, span])
        if order is not None:
            for some, span in blocks(np.array((0, *(part.stop for _, part in samples))), BLOCK):
                starts = [part.start - span.start for _, part in samples[some]]
                delta[3:6, span] = extrinsic_eulers_from_quaternions(delta[ROWS[ROTATION], span].T, order, starts).T
            for source, span in partial:
                undo_blending(source, frames_of[source], delta[3:6, span])
        else:
            align(delta[ROWS[ROTATION]], [span.start for _, span in samples])
        starts = [span.start for _, span in samples]
        errors = itertools.repeat(0.0)
        if reaches is not None:
            errors = largest_errors(delta, samples, spans, [reach_of[source] for source in portion])
        kept = kept_rows(portion, delta, starts)
        points = points.view(np.float32).reshape(*rows.shape, 2)[: len(delta)]
        points[..., 0] = np.concatenate(frames)
        points[..., 1] = delta
        for (source, span), rows_of_source, error in zip(samples, kept, errors, strict=False):
            filled = Samples({row: points[row, span].ravel() for row in rows_of_source})
            filled.rate, filled.error = rate_of[source], float(error)
            result[source] = filled
    return [result[source] for source in sources]


def _portions(sources: Sequence[Source], range_of: dict[Source, tuple[int, int]]) -> Iterator[list[Source]]:
    """Yield the sources in lists of about `AT_ONCE` samples, those apart that scale evenly or turn otherwise."""
    alike: dict[tuple, list[Source]] = {}
    for source in sources:
        alike.setdefault((source.order, source.uniform_scale), []).append(source)
    for group in alike.values():
        portion, samples = [], 0
        for source in group:
            portion.append(source)
            first, last = range_of[source]
            samples += last - first + 1
            if samples >= AT_ONCE:
                yield portion
                portion, samples = [], 0
        if portion:
            yield portion


def _move(
    sources: Sequence[Source],
    frames: Sequence[np.ndarray],
    native: np.ndarray,
    delta: np.ndarray,
    given: np.ndarray | None = None,
) -> np.ndarray:
    """Fill in Blender's own in-betweens, rotations as unit quaternions, and the deltas to the desired ones.

    The sources are alike: all turn by quaternions or by Euler angles of one order, all scale evenly or none does.
    `native` is of `height`, `delta` of `filled_height`. They may be in the same place: then the deltas are there.
    `given` is the progress on all frames, in place of that of the channels. Returns how far along its segment of the
    path each of the samples has come.
    """
    order = sources[0].order
    samples = each(sources, map(len, frames))
    timing = sampled(samples, frames, out=native)
    if any(source.is_elastic for source in sources):
        timing = sampled(samples, frames, unit_elastic=True)
    counts, on_keys, owners = _counts(sources, frames)
    original = np.stack([source.original[: len(delta)] for source in sources], axis=1)
    modes, ends, lacks, (weights, offsets), idle = _prepared([source.path for source in sources])
    on_paths, passages, along = counts, None, np.empty(timing.shape[1])
    if any(source.passed.any() for source in sources):
        passages, (weights, offsets) = _passages(sources, modes, ends)
        on_paths = np.add.reduceat(counts, passages.first[:-1])
        if lacks is not None:
            lacks[:, np.diff(passages.first) > 1] = 0.0

    every_frame = np.concatenate(frames)
    for some, span in blocks(np.concatenate(((0,), np.cumsum(on_paths))), BLOCK):
        parts = some if passages is None else slice(*passages.first[[some.start, some.stop]])
        progress = np.empty((1, span.stop - span.start))
        combine(weights[None, :, parts], timing[:, span], counts[parts], progress)
        progress = progress[0] - offsets[parts].repeat(counts[parts])
        bounds = np.concatenate(((0,), np.cumsum(on_paths[some])))
        for number in np.flatnonzero(idle[some] & (on_paths[some] > 0)):
            idle_span = slice(*bounds[number : number + 2])
            progress[idle_span] = ends.idle_progress(some.start + number, every_frame[span][idle_span], sources)
        turn_into_quaternions(native[:, span], order)
        default = original[:, ends.owners[some]]
        if lacks is not None:
            first, last = (rows.repeat(on_paths[some]) for rows in ends.times[some].T)
            elapsed = (every_frame[span] - first) / np.where(last > first, last - first, np.inf)
            progress = corrected(progress, elapsed, lacks[:, some].repeat(on_paths[some], axis=1))
        if given is not None:
            progress = given[span]
        off = None
        if passages is not None:
            progress, off = passages.along(parts, counts[parts], progress)
        along[span] = progress
        _fill(delta[:, span], native[:, span], default, modes[some], ends, some, on_paths[some], progress, off)
    # A key is the animator's: nothing is added to it, not even a rounding error.
    delta[:, on_keys] = original[:, owners]
    for number, (source, span) in enumerate(samples):
        if source.cyclic is not None:
            delta[:, span][:, _are_used_up(source, frames[number])] = original[:, number, None]
    return along


def _are_used_up(source: Source, frames: np.ndarray) -> np.ndarray:
    """Return at which frames cycles with a count are through: Blender goes back to the outermost keys."""
    cycles = [keys.cycles for keys in source.curves if keys.cycles is not None]
    before = any(cycle.before != "NONE" and cycle.before_count > 0 for cycle in cycles)
    after = any(cycle.after != "NONE" and cycle.after_count > 0 for cycle in cycles)
    first, last = source.key_frames[[0, -1]]
    return (before & (frames < first)) | (after & (frames > last))


Weights = tuple[np.ndarray, np.ndarray]
"""The result of `progress_weights`."""


def _segments(sources: Sequence[Source]) -> list[tuple[Source, slice]]:
    return each(sources, (len(source.key_frames) - 1 for source in sources))


def _prepared(sources: Sequence[Source]) -> tuple[np.ndarray, Ends, np.ndarray | None, Weights, np.ndarray]:
    """Return modes and ends of all segments, what their progress lacks at both ends, its weights, and which are idle.

    Idle are those that turn although no channel changes in them.
    """
    segments = _segments(sources)
    start, end = bounds = channels_at_ends(segments)
    if any(source.is_elastic for source in sources):
        bounds = channels_at_ends(segments, unit_elastic=True)
    weights, offsets = progress_weights(*bounds, sources[0].order)
    modes = np.concatenate([source.modes for source in sources])
    smooth = np.isin(modes, SMOOTH)
    ends, lacks = Ends.of(start, end, segments, smooth), None
    idle = np.zeros(len(modes), dtype=bool)
    if ends.turning is not None:
        idle = are_idle(weights, ends.turning.spins.turns)
    has_handles = smooth
    if smooth.any():
        has_handles = smooth & np.concatenate([source.has_handles for source in sources])
    if has_handles.any():
        measured = measured_in(ends.times, segments)
        progress = np.einsum("rs,rsk->sk", weights, measured) - offsets[:, None]
        for segment in np.flatnonzero(idle & has_handles):
            moments = ends.times[segment, 0] + np.ptp(ends.times[segment]) * MEASURED
            progress[segment] = ends.idle_progress(segment, moments, sources)
        tangents, lacks = ends.at_keys(progress, measured, sources[0])
        ends = replace(ends, tangents=np.where(has_handles, tangents, 1.0))
        lacks = np.where(has_handles, lacks, 0.0)
    return modes, ends, lacks, (weights, offsets), idle


def _passages(sources: Sequence[Source], modes: np.ndarray, ends: Ends) -> tuple[Passages, Weights]:
    """Return how keys lie on paths, whose segments have these modes and ends, and the weights from key to key."""
    segments = _segments(sources)
    bounds = channels_at_ends(segments)
    passed = np.concatenate([source.passed[:-1] for source in sources])
    keys = Ends.of(*bounds, segments, np.zeros(len(passed), dtype=bool)).keys

    def poses_at(counts: np.ndarray, progress: np.ndarray) -> Poses:
        rows = np.empty((len(progress), 7 if keys.scales is None else 8))
        for mode in np.unique(modes[counts > 0]):
            chosen = modes == mode
            some = np.repeat(chosen, counts)
            poses = ends.on_paths(slice(0, len(modes)), np.where(chosen, counts, 0), progress[some], MODE_NAMES[mode])
            rows[some] = packed(poses)
        return Poses(rows[:, :3], rows[:, 3:7], None if keys.scales is None else rows[:, 7])

    if any(source.is_elastic for source in sources):
        bounds = channels_at_ends(segments, unit_elastic=True)
    return Passages.of(passed, keys, poses_at, np.isin(modes, SMOOTH)), progress_weights(*bounds, sources[0].order)


def _fill(
    delta: np.ndarray,
    native: np.ndarray,
    original: np.ndarray,
    modes: np.ndarray,
    ends: Ends,
    segment: slice,
    counts: np.ndarray,
    progress: np.ndarray,
    off: Poses | None,
) -> None:
    """Fill in the deltas (., m) of some segments, each with its own modes and deltas, (s,) and (., s).

    `off` is how far off their paths samples (m,) are.
    """
    for mode in np.unique(modes[counts > 0]):
        chosen = modes == mode
        every = bool(chosen.all())
        some = slice(None) if every else np.repeat(chosen, counts)
        here = counts if every else np.where(chosen, counts, 0)
        if not mode:
            delta[:, some] = original.repeat(here, axis=1)
            continue
        desired = ends.poses(segment, here, progress[some], MODE_NAMES[mode], None if off is None else off[some])
        part = delta if every else np.empty((len(delta), int(here.sum())))
        differ(desired, native[:, some], part)
        if desired.scales is not None:
            part[ROWS[SCALE]] *= original[ROWS[SCALE]].repeat(here, axis=1)
        if not every:
            delta[:, some] = part


def _counts(sources: Sequence[Source], frames: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return how many samples segments have, (segments,); which samples are on a key; and the sources of these."""
    keys = np.concatenate([source.key_frames for source in sources])
    owners = np.repeat(np.arange(len(sources)), [len(source.key_frames) for source in sources])
    ends = np.cumsum([len(times) for times in frames])
    begins = ends - [len(times) for times in frames]
    at = begins[owners] + np.concatenate(
        [times.searchsorted(source.key_frames) for source, times in zip(sources, frames, strict=True)]
    )
    hits = np.flatnonzero(np.concatenate(frames)[np.minimum(at, ends[owners] - 1)] == keys)
    # A segment begins with the sample on its first key; what is outside of the keys belongs to the outermost ones.
    bounds = at.copy()
    last = np.flatnonzero(np.diff(owners, append=len(sources)))
    bounds[np.concatenate(((0,), last[:-1] + 1))], bounds[last] = begins, ends
    return np.delete(np.diff(bounds), last[:-1]), at[hits], owners[hits]
