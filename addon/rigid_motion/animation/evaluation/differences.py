"""From what was keyed to what is to happen between the keys, and to the values that make channels do it.

Arrays alone, many sources at once: the ten components of location, rotation and scale are rows, and the samples (or
segments, or keys) of all sources stand one behind the other along the last axis. A segment runs from one frame that has
a key in any channel to the next. How far the object has come in it is what Blender's own in-betweens say: their share
of the chord over all channels, a radian counting as much as a unit of length. So a segment follows the easing, the
handles and the overshoot of its keys, whatever its mode. A smooth mode has a timing of its own, even from key to key,
and that is kept where keys are not eased: handles shape single channels, and it is in their place.

Where location, rotation and scale have keys on different frames, each of them runs between its own, and follows what
its own channels say in all segments that are not joint. The poses at the keys of the location then have the rotation
and the scale that are seen there.

What is added to channels repeats with them: it is worked out for the first round of cycles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...motion import KEYFRAME_MODES, Poses
from ...motion.piecewise import combine
from .bodies import LEAST_SCALE, are_idle, body_poses, channels_at_ends, location_axes, measured_in, progress_weights
from .breakdowns import Passages, moved_by
from .channel_values import channel_values, steps_of
from .components import LOCATION, MODE_NAMES, MODE_NUMBERS, ROTATION, ROWS, SCALE, SMOOTH
from .ends import MEASURED, Ends, corrected, packed, twists_counting
from .sources import Source, each, sampled, values_of

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
    source: Source, frames: np.ndarray, mode: str | None = None, progress: np.ndarray | None = None
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
    """
    frames = np.asarray(frames, dtype=np.float64)
    chosen = source if mode is None else replace(source, mode=MODE_NUMBERS[mode])
    native, difference = _both(chosen, frames, progress)
    axes = None if source.location_axes is None else source.location_axes[None]

    def moved(rows: np.ndarray) -> Poses:
        poses, scales = body_poses(rows[:, None], source.original[:, None, None], axes, source)[0], None
        if source.uniform_scale:
            scales = source.original[ROWS[SCALE]] @ rows[ROWS[SCALE]] / 3.0
        return replace(poses, scales=scales)

    return InBetweens(frames, moved(native), moved(native + difference))


def seen_values(source: Source, frames: np.ndarray) -> np.ndarray:
    """Return the values that channels are to have on any rising frames (m,), shape (10, m)."""
    return np.add(*_both(source, np.asarray(frames, dtype=np.float64)))


def _both(source: Source, frames: np.ndarray, progress: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return the channels' own values and what is to be added, (10, m) each, also outside of spans."""
    (native,) = values_of([source], [frames])
    folded, order = frames, np.arange(len(frames))
    if source.cyclic is not None:
        folded = source.folded(frames)
        order = np.argsort(folded, kind="stable")
    difference = np.empty((10, len(frames)))
    given = None if progress is None else progress[order]
    ((difference[:, order], _),) = _differences([source], [folded[order]], given)
    return native, difference


def progress_at(sources: Sequence[Source], frames: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return how far along its segment of the path, 0 to 1, each source is on rising frames of its own, (m,).

    Where parts have keys of their own, the location; or else the rotation.
    """
    parts = []
    for source in sources:
        of_source = _parts(source) if source.is_uneven else {}
        parts.append(of_source.get(LOCATION) or of_source.get(ROTATION) or source)
    result: dict[int, np.ndarray] = {}
    for numbers in _alike(parts):
        motion = _Motion.of([parts[number] for number in numbers])
        moments = motion.moments([np.asarray(frames[number], dtype=np.float64) for number in numbers], None)
        along = moments.progress
        if motion.passages is not None:
            along, _ = motion.passages.along(moments.counts, along)
        ends = np.cumsum([len(frames[number]) for number in numbers])[:-1]
        result.update(zip(numbers, np.split(along, ends), strict=True))
    return [result[number] for number in range(len(sources))]


def channel_differences(sources: Sequence[Source], frames: Sequence[np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return what is to be added to the channels of each source, and the values that they have by themselves.

    Parameters
    ----------
    sources : sequence of Source
    frames : sequence of array, shape (m,)
        Rising ones for each, taken as they are and not in single precision. Those that are not inside of `spans` have
        no difference.

    Returns
    -------
    list of pairs of array, shape (10, m)
        Both together are the values that channels are to have: quaternions as long as those of the keys, evenly from
        one to the other, continuous in each span and in the sign that the key at its beginning has; angles
        continuous, and nearest to those of the key at the beginning. Rows that are not filled have no difference.
    """
    return _differences(sources, [np.asarray(times, dtype=np.float64) for times in frames], None)


def _differences(
    sources: Sequence[Source], frames: Sequence[np.ndarray], given: np.ndarray | None
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return what `channel_differences` does, with the `given` progress (m,) of the only source."""
    differences = [np.zeros((10, len(times))) for times in frames]
    natives: dict[int, np.ndarray] = {}
    jobs: list[tuple[Source, int, list[int]]] = []
    for number, source in enumerate(sources):
        if source.is_live and source.is_repeatable:
            jobs.extend((part, number, rows) for rows, part in filled_parts(source))
    for portion in _alike([part for part, _, _ in jobs]):
        some = [jobs[job] for job in portion]
        times = [frames[number] for _, number, _ in some]
        values, native, live = _Motion.of([part for part, _, _ in some]).values(times, given)
        for (part, number, rows), (_, span) in zip(
            some, each([part for part, _, _ in some], map(len, times)), strict=True
        ):
            differences[number][rows] = np.where(live[span], values[rows, span] - native[rows, span], 0.0)
            if part.cyclic is None:
                natives[number] = native[:, span]
    rest = [number for number in range(len(sources)) if number not in natives]
    others = values_of([sources[number] for number in rest], [frames[number] for number in rest], exact=True)
    natives.update(zip(rest, others, strict=True))
    return [(difference, natives[number]) for number, difference in enumerate(differences)]


def filled_parts(source: Source) -> list[tuple[list[int], Source]]:
    """Return the rows that the modes change, with the source that each of them is worked out from."""
    parts = _parts(source).values() if source.is_uneven else [source]
    return [(part.filled_rows, part) for part in parts if part.filled_rows]


def _parts(source: Source) -> dict[str, Source]:
    """Return the parts of a source that is uneven, and of its location what is beside it."""
    parts, endless = dict(source.parts), source.endless
    others = [part for name, part in parts.items() if name != LOCATION and part.is_live and part.filled_rows]

    def beside(frames: np.ndarray) -> np.ndarray:
        moments, places = np.unique(frames, return_inverse=True)
        folded = endless.folded(moments)
        order = np.argsort(folded, kind="stable")
        rows = endless.values_at(moments)
        several = _differences(others, [folded[order]] * len(others), None)
        for part, (difference, _) in zip(others, several, strict=True):
            rows[np.ix_(part.filled_rows, order)] += difference[part.filled_rows]
        # A body grows by factors; what overshoots has none.
        np.maximum(rows[ROWS[SCALE]], LEAST_SCALE, out=rows[ROWS[SCALE]])
        return rows[3:, places]

    if LOCATION in parts:
        parts[LOCATION] = replace(parts[LOCATION], beside=beside)
    return parts


def _alike(sources: Sequence[Source]) -> list[list[int]]:
    """Return the numbers of the sources that are worked on together: those that turn and scale alike,
    and have keys that are passed or not.
    """
    alike: dict[tuple, list[int]] = {}
    for number, source in enumerate(sources):
        alike.setdefault((source.order, source.uniform_scale, bool(source.passed.any())), []).append(number)
    return [*alike.values()]


@dataclass(frozen=True, eq=False)
class _Moments:
    """Frames of sources as moments in their segments."""

    native: np.ndarray
    """What the channels have there, shape (10, m)."""

    counts: np.ndarray
    """The number of them in each segment, shape (S,)."""

    progress: np.ndarray
    """Progress in the segment, shape (m,)."""

    live: np.ndarray
    """Whether a mode acts there, shape (m,): not on keys, in holds, or where channels stand still outside of keys."""


@dataclass(frozen=True, eq=False)
class _Motion:
    """The motion of alike sources in S segments from key to key, on P segments of paths: those that pass keys."""

    sources: list[Source]
    modes: np.ndarray
    """Of the segments, shape (S,)."""

    ends: Ends
    """Of the paths' segments."""

    channels: np.ndarray
    """The channels' own values at both ends of segments, shape (2, 10, S)."""

    weights: np.ndarray
    """See `progress_weights`, shape (10, S)."""

    offsets: np.ndarray
    """Shape (S,)."""

    lacks: np.ndarray | None
    """The slopes that progress lacks at both ends, shape (2, S); None where it lacks nothing."""

    idle: np.ndarray
    """Which segments turn although no channel changes, shape (S,)."""

    passages: Passages | None

    @classmethod
    def of(cls, sources: Sequence[Source]) -> _Motion:
        """Prepare for the motion of sources that turn and scale alike."""
        sources = [source.looped for source in sources]
        paths = [source.path for source in sources]
        segments = _segments(paths)
        bounds = channels_at_ends(segments)
        modes = np.concatenate([source.modes for source in paths])
        smooth = np.isin(modes, SMOOTH)
        ends, lacks = Ends.of(*bounds, segments, smooth), None
        weights, offsets = _weights(segments, bounds)
        idle = np.zeros(len(modes), dtype=bool)
        if ends.turning is not None:
            idle = are_idle(weights, ends.turning.spins.turns)
        has_handles = smooth & np.concatenate([source.has_handles for source in paths]) if smooth.any() else smooth
        if has_handles.any():
            measured = measured_in(ends.times, segments, MEASURED)
            progress = np.einsum("rs,rsk->sk", weights, measured) - offsets[:, None]
            for segment in np.flatnonzero(idle & has_handles).tolist():
                moments = ends.times[segment, 0] + np.ptp(ends.times[segment]) * MEASURED
                progress[segment] = ends.idle_progress(segment, moments, paths)
            plain = 1.0 if ends.tangents is None else ends.tangents
            tangents, lacks = ends.at_keys(progress, measured, paths[0])
            ends = replace(ends, tangents=np.where(has_handles, tangents, plain))
            lacks = np.where(has_handles, lacks, 0.0)
        if all(path is source for path, source in zip(paths, sources, strict=True)):
            return cls(sources, modes, ends, np.stack(bounds), weights, offsets, lacks, idle, None)
        return cls._passing(sources, paths, modes, ends, lacks)

    @classmethod
    def _passing(
        cls, sources: list[Source], paths: list[Source], modes: np.ndarray, ends: Ends, lacks: np.ndarray | None
    ) -> _Motion:
        """Return the motion of sources with keys that their paths, whose segments have these modes and ends, pass."""
        segments = _segments(sources)
        bounds = channels_at_ends(segments)
        passed = np.concatenate([source.passed[:-1] for source in sources])
        keys = Ends.of(*bounds, segments, np.zeros(len(passed), dtype=bool)).keys
        many = np.diff(np.append(np.flatnonzero(~passed), len(passed)))
        # A smooth path depends on the segments beside it.
        joint, beside = (
            np.concatenate(both) for both in zip(*((p.joint, p.is_joint_beside) for p in paths), strict=True)
        )
        joint = np.where(np.isin(modes, SMOOTH), joint & beside, joint).repeat(many)
        joint &= np.concatenate([source.is_common[:-1] for source in sources])
        counting = twists_counting([sources[owner] for owner in ends.owners.repeat(many)], joint)
        passages = Passages.of(passed, keys, lambda *at: _poses(ends, modes, *at), np.isin(modes, SMOOTH), counting)
        if lacks is not None:
            lacks = np.where(many > 1, 0.0, lacks).repeat(many, axis=1)
        idle = np.zeros(len(passed), dtype=bool)
        channels, weights = np.stack(bounds), _weights(segments, bounds)
        return cls(sources, modes.repeat(many), ends, channels, *weights, lacks, idle, passages)

    @property
    def owners(self) -> np.ndarray:
        """The number of the source of each segment, shape (S,)."""
        return self.ends.owners if self.passages is None else self.ends.owners.repeat(np.diff(self.passages.first))

    def moments(self, frames: Sequence[np.ndarray], given: np.ndarray | None) -> _Moments:
        """Return where the segments are on rising frames of each source, with `given` progress (m,) instead."""
        sources, samples = self.sources, each(self.sources, map(len, frames))
        every_frame = np.concatenate(frames)
        native = timing = sampled(samples, frames)
        if any(source.is_elastic for source in sources):
            timing = sampled(samples, frames, unit_elastic=True)
        counts, live = _counts(sources, frames)
        live &= (self.modes != 0).repeat(counts)
        if given is not None:
            return _Moments(native, counts, given, live)
        progress = np.empty((1, len(every_frame)))
        combine(self.weights[None], timing, counts, progress)
        progress = progress[0] - self.offsets.repeat(counts)
        begins = np.cumsum(counts) - counts
        for number in np.flatnonzero(self.idle & (counts > 0)).tolist():
            span = slice(begins[number], begins[number] + counts[number])
            progress[span] = self.ends.idle_progress(number, every_frame[span], sources)
        if self.lacks is not None:
            times = (
                self.ends.times
                if self.passages is None
                else self.ends.times.repeat(np.diff(self.passages.first), axis=0)
            )
            first, last = times.T.repeat(counts, axis=1)
            elapsed = (every_frame - first) / np.where(last > first, last - first, np.inf)
            progress = corrected(progress, elapsed, self.lacks.repeat(counts, axis=1))
        return _Moments(native, counts, progress, live)

    def values(
        self, frames: Sequence[np.ndarray], given: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what channels are to have on rising frames of each source, and have by themselves, (10, m) each.

        And where a mode acts, (m,).
        """
        moments, order = self.moments(frames, given), self.sources[0].order
        live = np.flatnonzero(moments.live)
        values = np.zeros((10, len(moments.live)))
        if not len(live):
            return values, moments.native, moments.live
        segment = np.arange(len(moments.counts)).repeat(moments.counts)[live]
        counts, progress = np.bincount(segment, minlength=len(moments.counts)), moments.progress[live]
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
        return values, moments.native, moments.live

    def _poses(self, counts: np.ndarray, progress: np.ndarray) -> Poses:
        """Return the poses (m,) in segments, counts[i] in the i-th, at this progress (m,)."""
        if self.passages is None:
            return _poses(self.ends, self.modes, counts, progress)
        along, off = self.passages.along(counts, progress)
        first = self.passages.first[:-1]
        return moved_by(_poses(self.ends, self.modes[first], np.add.reduceat(counts, first), along), off)


def _poses(ends: Ends, modes: np.ndarray, counts: np.ndarray, progress: np.ndarray) -> Poses:
    """Return the poses (m,) that the modes (P,) of paths' segments make, counts[i] in the i-th, at progress (m,)."""
    used = np.unique(modes[counts > 0])
    if len(used) == 1:
        return ends.poses(counts, progress, MODE_NAMES[used[0]])
    rows = np.empty((len(progress), 7 if ends.keys.scales is None else 8))
    for mode in used:
        some = (modes == mode).repeat(counts)
        rows[some] = packed(ends.poses(np.where(modes == mode, counts, 0), progress[some], MODE_NAMES[mode]))
    return Poses(rows[:, :3], rows[:, 3:7], None if ends.keys.scales is None else rows[:, 7])


def _segments(sources: Sequence[Source]) -> list[tuple[Source, slice]]:
    return each(sources, (len(source.key_frames) - 1 for source in sources))


def _weights(
    segments: list[tuple[Source, slice]], bounds: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return `progress_weights` of segments whose channels have these values at both ends, (10, S) each."""
    if any(source.is_elastic for source, _ in segments):
        bounds = channels_at_ends(segments, unit_elastic=True)
    counting = np.concatenate([source.counting for source, _ in segments], axis=1)
    return progress_weights(*bounds, segments[0][0].order, counting)


def _counts(sources: Sequence[Source], frames: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return how many samples segments have, (segments,), and which are inside of them, or where channels go on, (m,).

    What is outside of the keys belongs to the outermost ones.
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
