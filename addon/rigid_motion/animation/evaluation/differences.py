"""Differences: the values to add to the channels of sources so that they follow their modes between keys.

Works on arrays alone, many sources at once: the ten components of location, rotation and scale are rows, and the
samples (or segments, or keys) of all sources follow each other along the last axis. A segment runs from one frame with
a key in any channel that modes change to the next such frame. Progress in a segment is that of Blender's own
in-betweens: their fraction of the chord over all these channels. So a segment follows the easing, the handles and the
overshoot of its keys in any mode. A smooth mode has a timing of its own, even from key to key, which is used if keys
are not eased: it takes the place of handles, which shape single channels.

The added values repeat with the channels: they are computed for the first round of cycles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ...motion import Poses
from ...motion.piecewise import combine
from .bodies import body_poses, channels_at_ends, idle_progress, location_axes, progress_weights
from .breakdowns import Passages, moved_by
from .channel_values import channel_values, steps_of
from .components import MODE_NAMES, MODE_NUMBERS, ROWS, SCALE, SMOOTH_MODES
from .ends import SLOPE_MOMENTS, Ends, corrected, packed
from .sources import KeyedTransform, each, sampled, values_of

MOST_PREPARED = 4
"""The number of groups of sources with prepared motion: each planning round asks for other frames of the same ones."""


class InBetweens(NamedTuple):
    """The motion of one source as a body, including the object's delta transforms; poses are (m,).

    Poses are in the space of the channels; along the axes of location if these differ from the body's axes at
    rest.
    """

    native: Poses
    """The poses of Blender's own in-betweens."""

    desired: Poses
    """The poses of the modes."""


def in_betweens(
    source: KeyedTransform, frames: np.ndarray, mode: str | None = None, progress: np.ndarray | None = None
) -> InBetweens:
    """Return the motion of a source at any rising frames, sub-frames included.

    Parameters
    ----------
    source : Source
    frames : array, shape (m,)
    mode : str, optional
        One of `MODE_IDS`, used for all segments instead of their own modes.
    progress : array, shape (m,), optional
        Progress in the segment on these frames, 0 to 1 and beyond, instead of that of the channels.
    """
    frames = np.asarray(frames, dtype=np.float64)
    chosen = source if mode is None else replace(source, mode=MODE_NUMBERS[mode])
    native, difference = _native_and_difference(chosen, frames, progress)
    axes = None if source.location_axes is None else source.location_axes[None]

    def moved(rows: np.ndarray) -> Poses:
        poses, scales = body_poses(rows[:, None], source.original[:, None, None], axes, source)[0], None
        if source.uniform_scale:
            scales = source.original[ROWS[SCALE]] @ rows[ROWS[SCALE]] / 3.0
        return replace(poses, scales=scales)

    return InBetweens(moved(native), moved(native + difference))


def seen_values(source: KeyedTransform, frames: np.ndarray) -> np.ndarray:
    """Return the values that the modes give channels on any rising frames (m,), shape (10, m)."""
    return np.add(*_native_and_difference(source, np.asarray(frames, dtype=np.float64)))


def _native_and_difference(
    source: KeyedTransform, frames: np.ndarray, progress: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the channels' own values and the values to add, (10, m) each, also outside of spans."""
    (native,) = values_of([source], [frames])
    folded, order = frames, np.arange(len(frames))
    if source.cyclic is not None:
        folded = source.folded(frames)
        order = np.argsort(folded, kind="stable")
    difference = np.empty((10, len(frames)))
    given = None if progress is None else progress[order]
    ((difference[:, order], _),) = channel_differences([source], [folded[order]], given)
    return native, difference


def progress_at(sources: Sequence[KeyedTransform], frames: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the progress of each source along its path segment, 0 to 1, on its own rising frames, (m,) each."""
    result: dict[int, np.ndarray] = {}
    for numbers in _groups_of_similar(sources):
        motion = _Motion.of([sources[number] for number in numbers])
        _, counts, along, _ = motion.moments([frames[number] for number in numbers], None)
        if motion.passages is not None:
            along, _ = motion.passages.along(counts, along)
        ends = np.cumsum([len(frames[number]) for number in numbers])[:-1]
        result.update(zip(numbers, np.split(along, ends), strict=True))
    return [result[number] for number in range(len(sources))]


def channel_differences(
    sources: Sequence[KeyedTransform], frames: Sequence[np.ndarray], given: np.ndarray | None = None
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the values to add to the channels of each source, and the channels' own values.

    Parameters
    ----------
    sources : sequence of Source
    frames : sequence of array, shape (m,)
        Rising float64 frames for each source. Frames outside of `spans` have no difference.
    given : array, shape (m,), optional
        Progress in the segment, if there is only one source.

    Returns
    -------
    list of pairs of array, shape (10, m)
        Their sum is the desired channel values. Quaternions have lengths that change evenly between those of the keys,
        are continuous in each span, and start with the sign of the first key. Angles are continuous, and nearest to
        those of the key at the start. Rows that are not filled have no difference.
    """
    if any(source.switches for source in sources):
        return _differences_of_runs(sources, frames, given)
    differences = [np.zeros((10, len(times))) for times in frames]
    natives: dict[int, np.ndarray] = {}
    acting = [number for number, source in enumerate(sources) if source.is_live and source.is_repeatable]
    for portion in _groups_of_similar([sources[number] for number in acting]):
        numbers = [acting[place] for place in portion]
        some, times = [sources[number] for number in numbers], [frames[number] for number in numbers]
        values, native, live = _prepared(*some).values(times, given)
        for number, (source, span) in zip(numbers, each(some, map(len, times)), strict=True):
            rows = source.filled_rows
            differences[number][rows] = np.where(live[span], values[rows, span] - native[rows, span], 0.0)
            natives[number] = native[:, span]
    rest = [number for number in range(len(sources)) if number not in natives]
    others = values_of([sources[number] for number in rest], [frames[number] for number in rest])
    natives.update(zip(rest, others, strict=True))
    return [(difference, natives[number]) for number, difference in enumerate(differences)]


def _differences_of_runs(
    sources: Sequence[KeyedTransform], frames: Sequence[np.ndarray], given: np.ndarray | None
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return `channel_differences` of sources that may switch holders: each run is evaluated by itself."""
    runs = [(number, run) for number, source in enumerate(sources) for run in source.runs]
    bounds = [frames[number].searchsorted((run.stretch.first, run.stretch.until)) for number, run in runs]
    parts = [
        slice(0 if run is sources[number].runs[0] else begin, end)
        for (number, run), (begin, end) in zip(runs, bounds, strict=True)
    ]
    moments = [
        run.moments(frames[number][part]) if sources[number].switches else frames[number]
        for (number, run), part in zip(runs, parts, strict=True)
    ]
    asked = [run.source if sources[number].switches else sources[number] for number, run in runs]
    if given is None:
        of_runs = channel_differences(asked, moments)
    else:
        of_runs = [
            channel_differences([source], [times], given[part])[0]
            for source, times, part in zip(asked, moments, parts, strict=True)
        ]
    natives = values_of(sources, frames)
    differences = [np.zeros(native.shape) for native in natives]
    for (number, _), part, (difference, native) in zip(runs, parts, of_runs, strict=True):
        differences[number][:, part] = native + difference - natives[number][:, part]
    return list(zip(differences, natives, strict=True))


def _groups_of_similar(sources: Sequence[KeyedTransform]) -> list[list[int]]:
    """Return groups of source numbers that are evaluated together: same rotation order, same treatment of scale, and
    with or without passed keys.
    """
    alike: dict[tuple, list[int]] = {}
    for number, source in enumerate(sources):
        alike.setdefault((source.order, source.uniform_scale, bool(source.on_path.any())), []).append(number)
    return [*alike.values()]


@dataclass(frozen=True, eq=False)
class _Motion:
    """The motion of similar sources in S segments from key to key, on P path segments, which may pass keys."""

    sources: list[KeyedTransform]
    modes: np.ndarray
    """The numbers of the segments' modes, shape (S,)."""

    ends: Ends
    """The ends of the path segments."""

    channels: np.ndarray
    """The channels' own values at both ends of segments, shape (2, 10, S)."""

    weights: np.ndarray
    """See `progress_weights`, shape (10, S)."""

    offsets: np.ndarray
    """The offsets to subtract from progress, shape (S,)."""

    lacks: np.ndarray | None
    """The slopes that progress lacks at both ends, shape (2, S); None if it lacks none."""

    idle: np.ndarray
    """True for segments that turn although no channel changes, shape (S,)."""

    passages: Passages | None

    @classmethod
    def of(cls, sources: Sequence[KeyedTransform]) -> _Motion:
        """Prepare the motion of sources with the same rotation order and treatment of scale."""
        sources = [source.looped for source in sources]
        paths = [source.path for source in sources]
        segments = _segments(paths)
        bounds = channels_at_ends(segments)
        modes = np.concatenate([source.modes for source in paths])
        smooth = np.isin(modes, SMOOTH_MODES)
        ends, lacks = Ends.of(*bounds, segments, smooth), None
        weights, offsets = progress_weights(*bounds, sources[0])
        idle = np.zeros(len(modes), dtype=bool)
        if ends.turning is not None:
            idle = (ends.turning.spins.turns != 0.0) & ~weights.any(axis=0)
        has_handles = smooth & np.concatenate([source.has_handles for source in paths]) if smooth.any() else smooth
        if has_handles.any():
            at = (ends.times[:, :1] + np.diff(ends.times) * SLOPE_MOMENTS).ravel()
            of_each = [at[span.start * len(SLOPE_MOMENTS) : span.stop * len(SLOPE_MOMENTS)] for _, span in segments]
            measured = sampled(each(paths, map(len, of_each)), of_each).reshape(10, -1, len(SLOPE_MOMENTS))
            progress = np.einsum("rs,rsk->sk", weights, measured) - offsets[:, None]
            if idle.any():
                uniform = np.concatenate([idle_progress(*one) for one in zip(paths, of_each, strict=True)])
                progress[idle] = uniform.reshape(progress.shape)[idle]
            tangents, lacks = ends.at_keys(progress, measured, paths[0])
            ends = replace(ends, tangents=np.where(has_handles, tangents, 1.0))
            lacks = np.where(has_handles, lacks, 0.0)
        if all(path is source for path, source in zip(paths, sources, strict=True)):
            return cls(sources, modes, ends, np.stack(bounds), weights, offsets, lacks, idle, None)
        return cls._passing(sources, modes, ends, lacks)

    @classmethod
    def _passing(
        cls, sources: list[KeyedTransform], modes: np.ndarray, ends: Ends, lacks: np.ndarray | None
    ) -> _Motion:
        """Return the motion of sources whose paths, with these modes and ends of segments, pass some of their keys."""
        segments = _segments(sources)
        bounds = channels_at_ends(segments)
        passed = np.concatenate([source.on_path[:-1] for source in sources])
        keys = Ends.of(*bounds, segments, np.zeros(len(passed), dtype=bool)).keys
        many = np.diff(np.append(np.flatnonzero(~passed), len(passed)))
        passages = Passages.of(passed, keys, lambda *at: _poses(ends, modes, *at), np.isin(modes, SMOOTH_MODES))
        if lacks is not None:
            lacks = np.where(many > 1, 0.0, lacks).repeat(many, axis=1)
        idle = np.zeros(len(passed), dtype=bool)
        channels, weights = np.stack(bounds), progress_weights(*bounds, sources[0])
        return cls(sources, modes.repeat(many), ends, channels, *weights, lacks, idle, passages)

    @property
    def owners(self) -> np.ndarray:
        """The index of the source of each segment, shape (S,)."""
        return self.ends.owners if self.passages is None else self.ends.owners.repeat(np.diff(self.passages.first))

    def moments(
        self, frames: Sequence[np.ndarray], given: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the channels' own values on rising frames of each source, (10, m), the number of frames per segment,
        (S,), the progress, (m,), and whether a mode acts, (m,): not on keys, in holds, or where channels stand still.
        """
        sources, samples = self.sources, each(self.sources, map(len, frames))
        every_frame = np.concatenate(frames)
        native = sampled(samples, frames)
        counts, live = _counts(sources, frames)
        live &= (self.modes != 0).repeat(counts)
        if given is not None:
            return native, counts, given, live
        progress = np.empty((1, len(every_frame)))
        combine(self.weights[None], native, counts, progress)
        progress = progress[0] - self.offsets.repeat(counts)
        if self.idle.any():
            uniform = np.concatenate([idle_progress(*one) for one in zip(sources, frames, strict=True)])
            progress = np.where(self.idle.repeat(counts), uniform, progress)
        if self.lacks is not None:
            times = (
                self.ends.times
                if self.passages is None
                else self.ends.times.repeat(np.diff(self.passages.first), axis=0)
            )
            first, last = times.T.repeat(counts, axis=1)
            elapsed = (every_frame - first) / np.where(last > first, last - first, np.inf)
            progress = corrected(progress, elapsed, self.lacks.repeat(counts, axis=1))
        return native, counts, progress, live

    def values(
        self, frames: Sequence[np.ndarray], given: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the desired and the channels' own values on rising frames of each source, (10, m) each.

        Also returns whether a mode acts, (m,).
        """
        native, every, progress, acts = self.moments(frames, given)
        order, live, values = self.sources[0].order, np.flatnonzero(acts), np.zeros((10, len(acts)))
        if not len(live):
            return values, native, acts
        segment = np.arange(len(every)).repeat(every)[live]
        counts, progress = np.bincount(segment, minlength=len(every)), progress[live]
        turns = np.zeros(len(counts))
        if self.ends.turning is not None and self.passages is None:
            turns = self.ends.turning.spins.turns
        steps, at_steps = steps_of(counts, progress, turns, order)
        segment = np.concatenate((np.arange(len(steps)).repeat(steps), segment))
        progress = np.concatenate((at_steps, progress))
        rising = np.lexsort((progress, segment)) if order is not None else np.argsort(segment, kind="stable")
        poses, progress = self._poses(counts + steps, progress[rising]), progress[rising]
        owners, originals = self.owners, np.stack([source.original for source in self.sources], axis=1)
        axes = location_axes(self.sources, owners.repeat(counts + steps))
        if axes is not None:
            poses = replace(poses, positions=np.einsum("mji,mj->mi", axes, poses.positions))
        is_step = rising < len(at_steps)
        rows = channel_values(poses, counts + steps, progress, self.channels, originals[:, owners], order, is_step)
        places = np.empty(len(rising), dtype=int)
        places[rising] = np.arange(len(rising))
        values[:, live] = rows[:, places[len(at_steps) :]]
        return values, native, acts

    def _poses(self, counts: np.ndarray, progress: np.ndarray) -> Poses:
        """Return the poses (m,) at this progress (m,), of which counts[i] are in segment i."""
        if self.passages is None:
            return _poses(self.ends, self.modes, counts, progress)
        along, off = self.passages.along(counts, progress)
        first = self.passages.first[:-1]
        return moved_by(_poses(self.ends, self.modes[first], np.add.reduceat(counts, first), along), off)


def _poses(ends: Ends, modes: np.ndarray, counts: np.ndarray, progress: np.ndarray) -> Poses:
    """Return the poses (m,) that the modes (P,) of path segments give at progress (m,), counts[i] in segment i."""
    used = np.unique(modes[counts > 0])
    if len(used) == 1:
        return ends.poses(counts, progress, MODE_NAMES[used[0]])
    rows = np.empty((len(progress), 7 if ends.keys.scales is None else 8))
    for mode in used:
        some = (modes == mode).repeat(counts)
        rows[some] = packed(ends.poses(np.where(modes == mode, counts, 0), progress[some], MODE_NAMES[mode]))
    return Poses(rows[:, :3], rows[:, 3:7], None if ends.keys.scales is None else rows[:, 7])


@lru_cache(maxsize=MOST_PREPARED)
def _prepared(*sources: KeyedTransform) -> _Motion:
    return _Motion.of(sources)


def _segments(sources: Sequence[KeyedTransform]) -> list[tuple[KeyedTransform, slice]]:
    return each(sources, (len(source.key_frames) - 1 for source in sources))


def _counts(sources: Sequence[KeyedTransform], frames: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of samples per segment, (segments,), and which lie inside one or where channels go on, (m,).

    Samples outside of all keys belong to the outermost segments.
    """
    counts, inside = [], []
    for source, times in zip(sources, frames, strict=True):
        keys = source.key_frames
        at = times.searchsorted(keys)
        bounds = np.array((0, *at[1:-1], len(times)))
        live = ~source.holds.repeat(np.diff(bounds))
        live[: at[0]] = live[at[-1] :] = source.is_linear
        within = at < len(times)
        live[at[within][times[at[within]] == keys[within]]] = False
        if source.shaping is not None and source.cyclic is not None:
            live[: at[1]] = live[at[-2] :] = False
        counts.append(np.diff(bounds))
        inside.append(live)
    return np.concatenate(counts), np.concatenate(inside)
