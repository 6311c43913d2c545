"""What segments run between: the poses at their ends, how they turn, and what the modes make of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ...motion import KEYFRAME_MODES, Poses, prepare, twists
from ...motion.segments import prepare_within
from .bodies import body_poses, location_axes
from .breakdowns import moved_by
from .channel_rows import each, height, sampled
from .key_speeds import MEASURED, native_twists, progress_slopes, tangents_and_lacks
from .neighbours import meeting, spins_of_neighbours, with_neighbours
from .progress import idle_progress
from .sources import Source
from .turning import Turning, needs_turning, turning_of, without_spins


@dataclass(frozen=True, eq=False)
class Ends:
    """What S segments of several sources run between, with the objects' own delta transforms."""

    owners: np.ndarray
    """The number of the source of each, shape (S,)."""

    times: np.ndarray
    """The frames of both keys, shape (S, 2)."""

    keys: Poses
    """The poses at both, shape (S, 2)."""

    axes: np.ndarray | None
    """The axes that location runs along, as columns in those of the poses, shape (S, 3, 3); None where they are one."""

    original: np.ndarray
    """The objects' own delta transforms, shape (10, S)."""

    pairs: tuple[np.ndarray, np.ndarray] | None = None
    """For smooth modes the segments that meet at a key, before it and after it."""

    around: tuple[np.ndarray, Poses] | None = None
    """For smooth modes frames and poses of the keys before and behind as well, shape (S, 4)."""

    turning: Turning | None = None
    """The turning of the segments, None where all of them go the shortest way."""

    whole: Turning | None = None
    """The turning in whole turns alone, for smooth modes."""

    spins: np.ndarray | None = None
    """For smooth modes what spins add at both ends of the three segments around, shape (3, 2, S, 3)."""

    tangents: np.ndarray | None = None
    """The lengths of the tangents of smooth modes at both keys, shape (2, S); None where all are 1."""

    prepared: dict[str, Callable[..., Poses]] = field(default_factory=dict)
    """The poses that each mode makes of all segments, once it has been asked for."""

    @classmethod
    def of(cls, start: np.ndarray, end: np.ndarray, segments: list[tuple[Source, slice]], smooth: np.ndarray) -> Ends:
        """Return the ends of the channels (10, S) at both ends, and which of the segments have a smooth mode."""
        sources = [source for source, _ in segments]
        owners = np.repeat(np.arange(len(sources)), [span.stop - span.start for _, span in segments])
        firsts, lasts = ([source.key_frames[part] for source in sources] for part in (slice(-1), slice(1, None)))
        times = np.stack((np.concatenate(firsts), np.concatenate(lasts)), axis=1)
        original = np.stack([source.original for source in sources], axis=1)[:, owners]
        axes = location_axes(sources, owners)
        keys = body_poses(np.stack((start, end), axis=2), original[..., None], axes, sources[0])
        turned = whole = None
        if any(map(needs_turning, sources)):
            turned, whole = turning_of(sources, start, end, keys, original)
        ends = cls(owners, times, keys, axes, original, turning=turned, whole=whole)
        if not smooth.any():
            return ends
        holds, pairs = np.concatenate([source.holds for source in sources]), meeting(owners, times, keys)
        (frames, around), spins = with_neighbours(times, keys, holds, pairs), None
        if turned is not None:
            signs = np.where(np.einsum("si,si->s", whole.second, keys.quaternions[:, 1]) < 0.0, -1.0, 1.0)
            around, spins = spins_of_neighbours(signs, whole.twists, around, holds, pairs)
        return replace(ends, pairs=pairs, around=(frames, around), spins=spins)

    def idle_progress(self, segment: int, frames: np.ndarray, sources: Sequence[Source]) -> np.ndarray:
        """Return the progress on frames (m,) of a segment that turns although no channel changes in it."""
        first, last = (np.full(len(frames), end) for end in self.times[segment])
        return idle_progress(sources[self.owners[segment]], frames, first, last)

    def at_keys(self, progress: np.ndarray, measured: np.ndarray, source: Source) -> tuple[np.ndarray, np.ndarray]:
        """Return `tangents_and_lacks`, from progress (S, 6) and the channels (., S, 6) at the moments `MEASURED`."""
        first, second, slopes = self.keys[:, 0], self.keys[:, 1], progress_slopes(progress)
        turned = second.quaternions if self.whole is None else self.whole.second
        screws = twists.between(
            first.positions, first.quaternions, second.positions, turned, shortest=self.whole is None
        )
        screws, poses = np.stack((screws, screws)), body_poses(measured, self.original[..., None], self.axes, source)
        if self.whole is not None:
            # Angles turn by spins, too. These are known, and what is left is less than half a turn.
            poses = without_spins(poses, self.whole.by_angles, progress)
        native = native_twists(self.keys, poses)
        if self.whole is not None:
            added = np.moveaxis(self.whole.twists, 1, 0)
            screws[:, :3] += added
            native[:, :3] += slopes[:, None] * added
        return tangents_and_lacks(slopes, native, screws, self.times, self.pairs)

    def poses(self, some: slice, counts: np.ndarray, progress: np.ndarray, mode: str, off: Poses | None) -> Poses:
        """Return what a mode makes of some of the segments, each with so many samples (s,) of this progress (m,).

        They are so far off the path. Positions run along the axes that location does.
        """
        axes = None if self.axes is None else self.axes[some].repeat(counts, axis=0)
        poses = self.on_paths(some, counts, progress, mode)
        poses = poses if off is None else moved_by(poses, off)
        return poses if axes is None else replace(poses, positions=np.einsum("mji,mj->mi", axes, poses.positions))

    def on_paths(self, some: slice, counts: np.ndarray, progress: np.ndarray, mode: str) -> Poses:
        """Return the poses of `poses` along the body's own axes at rest, and on the path."""
        if mode not in self.prepared:
            self.prepared[mode] = self._prepare(mode)
        within, of_each = some, counts
        if KEYFRAME_MODES[mode].is_smooth:
            # Of the three segments between four keys the one in the middle.
            within = slice(3 * some.start, 3 * some.stop)
            of_each = np.multiply.outer(counts, (0, 1, 0)).ravel()
        poses = self.prepared[mode](of_each, progress, within)
        if self.turning is not None:
            turned = self.whole if KEYFRAME_MODES[mode].is_smooth else self.turning
            poses = turned.spins.add_to(poses, counts, progress, some)
        return poses

    def _prepare(self, mode: str) -> Callable[..., Poses]:
        curves, turned = KEYFRAME_MODES[mode].curves, self.turning
        if not KEYFRAME_MODES[mode].is_smooth:
            times, keys = np.broadcast_to((0.0, 1.0), self.times.shape), self.keys
            if turned is None:
                return prepare(times, keys, mode)
            quaternions = np.stack((turned.first, turned.second), axis=1)
            return prepare_within(curves, times, replace(keys, quaternions=quaternions), is_aligned=True)
        if self.tangents is None and turned is None:
            return prepare(*self.around, mode)
        tangents = None if self.tangents is None else self.tangents[..., None]
        curves = partial(curves, tangents=tangents, spins=self.spins)
        return prepare_within(curves, *self.around, is_aligned=turned is not None)


def measured_in(times: np.ndarray, segments: list[tuple[Source, slice]]) -> np.ndarray:
    """Return the channels' own values in each of S segments at the moments `MEASURED`, shape (., S, 6)."""
    sources = [source for source, _ in segments]
    moments = times[:, :1] + (times[:, 1:] - times[:, :1]) * MEASURED
    frames = [moments[span].ravel() for _, span in segments]
    return sampled(each(sources, map(len, frames)), frames).reshape(height(sources), -1, len(MEASURED))
