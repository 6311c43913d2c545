"""Largest displacement of visible geometry in world space between two sets of tracks, proven between keys as well.

Each node has a ball that encloses all that the node carries, with a least radius, its shell. No point of the ball is
displaced by more than the error. The ball is in the node's own space, so it scales with the node. Morph targets are
bounded by their largest displacement. Long clips are checked one stretch at a time.
Joints that stand on the ground are feet: this module also measures how far they slide there, and when it is too far.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..motion import Skeleton
from ..motion.affine import AffineMaps, ball_displacement, displacement_bound
from ..motion.contacts import MAX_STANDING_HEIGHT_RATIO, MAX_STANDING_HEIGHTS_PER_S, contacts, spans
from ..motion.skeleton_stretches import stretches
from .nodes import Nodes
from .seen import Seen
from .tracks import SCALE, WEIGHTS, Tracks

PARTS_PER_GAP = 8
"""Parts into which every gap between moments is divided for the check."""

STRETCH_SAMPLES, MIN_STRETCHES = 1500, 2
"""Samples of a clip that are checked and searched at once, if there are more than MIN_STRETCHES times as many."""

AT_ONCE = 2**15
"""Poses evaluated in one go."""

EXACT_BATCH_POSES = 64
"""Poses whose exact displacement is computed at once, largest bounds first."""

MAX_EVEN_SCALE_RATIO = 1e-4
"""Largest relative difference between the axes of an even scale. Some programs write scales with rounding errors."""

NO_SAMPLES = np.empty(0, dtype=np.int64)

UP_AXIS = 1
"""The up axis of glTF."""


@dataclass(frozen=True, order=True)
class Worst:
    """The largest displacement, with its node and time."""

    error: float = 0.0
    node: int = -1
    time: float = 0.0


@dataclass(frozen=True, eq=False)
class SeenBlock:
    """The nodes at consecutive moments."""

    first: int
    """Number of the first moment."""

    times: np.ndarray
    """Shape (m,)."""

    maps: tuple[AffineMaps, ...]
    """World transforms of the nodes for each of several sets of tracks, shape (n, m)."""

    @property
    def samples(self) -> slice:
        """The numbers of the moments."""
        return slice(self.first, self.first + len(self.times))


@dataclass(frozen=True, eq=False)
class World:
    """The moving nodes and how their displacement is measured. Lengths are in the unit of the document."""

    nodes: Nodes
    seen: Seen
    moving: np.ndarray
    """Numbers of the moving nodes, parents before children, shape (n,)."""

    shells: np.ndarray
    """Least radii of the balls, in world space where a node is largest, shape (n,)."""

    truth: Tracks
    times: np.ndarray
    """Moments between which all tracks run evenly, shape (m,)."""

    @cached_property
    def rows(self) -> dict[int, int]:
        """The row of each moving node."""
        return {node: row for row, node in enumerate(self.moving.tolist())}

    @cached_property
    def parents(self) -> np.ndarray:
        """The row of each node's parent, -1 if the parent does not move, shape (n,)."""
        above = self.nodes.parents[self.moving].tolist()
        return np.array([self.rows.get(parent, -1) for parent in above], dtype=np.int64)

    @cached_property
    def stretches(self) -> list[slice]:
        """Ranges of moments checked in one go, each from the end of the last; one range for short clips."""
        count = len(self.times)
        return stretches(count, STRETCH_SAMPLES) if count > MIN_STRETCHES * STRETCH_SAMPLES else [slice(0, count)]

    def blocks(self, *tracks: Tracks, parts: int = 1, among: Collection[int] | None = None) -> Iterator[SeenBlock]:
        """Yield the nodes as moved by each of these sets of tracks, with all gaps between moments divided into `parts`.

        `among` limits the stretches, given by their numbers.
        """
        step = max(1, AT_ONCE // (parts * max(1, len(self.moving))))
        last = len(self.times) - 1
        for number, stretch in enumerate(self.stretches):
            if among is not None and number not in among:
                continue
            end = stretch.stop if stretch.stop > last else stretch.stop - 1
            near = [self._tracks_near(some, stretch) for some in tracks]
            for first in range(stretch.start, end, step):
                times = self.parted(first, min(first + step, end), parts)
                yield SeenBlock(parts * first, times, tuple(self.worlds(some, times) for some in near))

    def digests(self, tracks: Tracks) -> list[int]:
        """Return a digest of the keys of tracks in each stretch, to detect changes."""
        near = (self._tracks_near(tracks, stretch) for stretch in self.stretches)
        return [
            hash(tuple(part.tobytes() for track in some.values() for part in (track.times, track.values)))
            for some in near
        ]

    def _tracks_near(self, tracks: Tracks, stretch: slice) -> Tracks:
        """Return the keys of tracks that affect a stretch."""
        ends = self.times[[stretch.start, stretch.stop - 1]].tolist()
        return {target: track.near(*ends) for target, track in tracks.items()}

    def parted(self, first: int, end: int, parts: int) -> np.ndarray:
        """Return some of the moments, with the gaps after them divided into `parts`."""
        times = parted(self.times[first : end + 1], parts)
        return times if end >= len(self.times) else times[:-1]

    def worlds(self, tracks: Tracks, times: np.ndarray) -> AffineMaps:
        """Return the world transforms of the nodes at times (m,), shape (n, m)."""
        return self.nodes.worlds(self.moving, tracks, times)

    def lengths_above(self, times: np.ndarray) -> np.ndarray:
        """Return the world lengths of the axes of each node's parent at times (m,), shape (n, m, 3) or (n, 1, 3)."""
        if any(path == SCALE and len(track.times) > 1 for (_, path), track in self.truth.items()):
            return self._of_parents(np.linalg.norm(self.worlds(self.truth, times).axes, axis=-2))
        return self._of_parents(self._extremes[0][:, None])

    def _of_parents(self, lengths: np.ndarray) -> np.ndarray:
        """Return the axis lengths of each node's parent, given the axis lengths of all nodes, shape (n, ..., 3)."""
        result = lengths[self.parents]
        for row in np.flatnonzero(self.parents < 0).tolist():
            parent = self.nodes.parents[self.moving[row]]
            result[row] = np.linalg.norm(self.nodes.resting.axes[parent], axis=-2) if parent >= 0 else 1.0
        return result

    @property
    def _shapes_change(self) -> bool:
        """Whether nodes may grow or shear between moments, because scales change or are uneven."""
        scales = [track.points for (_, path), track in self.truth.items() if path == SCALE]
        every = [*scales, *self.nodes.rest[SCALE][:, None]]
        return bool(self.nodes.matrices) or any(
            len(some) > 1 or np.ptp(some) > MAX_EVEN_SCALE_RATIO * np.max(some) for some in every
        )

    @cached_property
    def _extremes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The longest axes of each node in world space (n, 3), the largest scaling of any length, and the largest
        distance from the parent, shapes (n,).
        """
        count = len(self.moving)
        lengths, largest, away = np.zeros((count, 3)), np.zeros(count), np.zeros(count)
        hangs = self.parents >= 0
        for block in self.blocks(self.truth, parts=PARTS_PER_GAP if self._shapes_change else 1):
            (maps,) = block.maps
            lengths = np.maximum(lengths, np.linalg.norm(maps.axes, axis=-2).max(axis=1))
            largest = np.maximum(largest, _largest_scaling(maps.axes).max(axis=1))
            from_parents = maps.origins[hangs] - maps.origins[self.parents[hangs]]
            away[hangs] = np.maximum(away[hangs], np.linalg.norm(from_parents, axis=-1).max(axis=1))
        return lengths, largest, away

    @property
    def largest(self) -> np.ndarray:
        """Largest world length of a vector of length 1 in each node's space, shape (n,)."""
        return self._extremes[1]

    @property
    def distances(self) -> np.ndarray:
        """Largest distance of each node from its parent in world space, shape (n,); 0 if the parent does not move."""
        return self._extremes[2]

    @cached_property
    def balls(self) -> np.ndarray:
        """Radii of the balls in the spaces of the nodes, shape (n,)."""
        shells = np.divide(self.shells, self.largest, out=np.zeros(len(self.moving)), where=self.largest > 0.0)
        return np.maximum(self.seen.reaches[self.moving], shells)

    @cached_property
    def radii(self) -> np.ndarray:
        """Radii of the balls in world space, where the nodes are largest, shape (n,)."""
        return self.balls * self.largest

    @cached_property
    def longest_above(self) -> np.ndarray:
        """Longest axis of each node's parent in world space, shape (n,)."""
        return self._of_parents(self._extremes[0]).max(axis=-1)

    @cached_property
    def reaches(self) -> np.ndarray:
        """Upper bound on the distance from each node to its descendants including their balls, shape (n,)."""
        result, away = self.radii.copy(), self._extremes[2]
        for row in range(len(result) - 1, -1, -1):
            if (parent := self.parents[row]) >= 0:
                result[parent] = max(result[parent], away[row] + result[row])
        return result

    def morph_scale(self, node: int) -> float:
        """Return how much larger the morph targets of a node's mesh are in world space than in the mesh, at most."""
        morph = self.seen.morphs[node]
        largest = _largest_scaling(self.nodes.resting.axes[morph.carriers])
        moves = np.isin(morph.carriers, self.moving)
        largest[moves] = self.largest[[self.rows[carrier] for carrier in morph.carriers[moves].tolist()]]
        return float((largest * morph.factors).max())

    def morphed(self, shown: Tracks) -> tuple[Worst, np.ndarray]:
        """Return the largest displacement by morph targets, and the largest on each of the nodes, shape (n,)."""
        worst, besides = Worst(), np.zeros(len(self.moving))
        for (node, path), track in self.truth.items():
            if path != WEIGHTS or node not in self.seen.morphs:
                continue
            given = shown.get((node, path))
            keys = track.times if given is None else np.union1d(track.times, given.times)
            times = parted(keys, PARTS_PER_GAP)
            there = self.nodes.rest_of(node, path) if given is None else given.at(times)
            morph = self.seen.morphs[node]
            errors = np.abs(there - track.at(times)) @ morph.deltas * self.morph_scale(node)
            worst = max(worst, Worst(float(errors.max()), node, float(times[np.argmax(errors)])))
            rows = [self.rows[carrier] for carrier in morph.carriers.tolist() if carrier in self.rows]
            besides[rows] = np.maximum(besides[rows], errors.max())
        return worst, besides

    def worst(
        self,
        shown: Tracks,
        morphed: tuple[Worst, np.ndarray],
        tolerance: float = np.inf,
        *,
        parts: int = PARTS_PER_GAP,
        among: Collection[int] | None = None,
    ) -> tuple[Worst, np.ndarray, np.ndarray]:
        """Return the largest displacement of visible geometry, at the moments and at parts of the gaps between them.

        Parameters
        ----------
        shown : Tracks
        morphed : tuple
            Errors of morph targets for these tracks: see `morphed`.
        tolerance : float, optional
        parts : int, optional
        among : collection of int, optional
            Numbers of the stretches to check.

        Returns
        -------
        largest : Worst
        rows, numbers : array, shape (k,)
            Rows of nodes and numbers of times at which the displacement is above the tolerance and a peak.
        """
        largest, besides = morphed
        rows, numbers = [NO_SAMPLES], [NO_SAMPLES]
        for block in self.blocks(shown, self.truth, parts=parts, among=among):
            there, truth = block.maps
            bounds = displacement_bound(there, truth, self.balls[:, None]) + besides[:, None]
            errors = np.zeros(bounds.shape)
            waiting = np.flatnonzero(bounds > min(largest.error, tolerance))
            waiting = waiting[np.argsort(-bounds.flat[waiting])]
            for begin in range(0, len(waiting), EXACT_BATCH_POSES):
                some = waiting[begin : begin + EXACT_BATCH_POSES]
                if bounds.flat[some[0]] <= min(largest.error, tolerance):
                    break
                where = row, number = np.unravel_index(some, errors.shape)
                errors[where] = ball_displacement(there[where], truth[where], self.balls[row]) + besides[row]
                most = int(np.argmax(errors[where]))
                found = Worst(float(errors[where][most]), int(self.moving[row[most]]), float(block.times[number[most]]))
                largest = max(largest, found)
            padded = np.pad(errors, ((0, 0), (1, 1)))
            peaks = (errors > tolerance) & (errors >= padded[:, :-2]) & (errors >= padded[:, 2:])
            row, number = np.nonzero(peaks)
            rows.append(row)
            numbers.append(number + block.first)
        return largest, np.concatenate(rows), np.concatenate(numbers)


def _largest_scaling(axes: np.ndarray) -> np.ndarray:
    """Return an upper bound on the length that vectors of length 1 get from axes (..., 3, 3), shape (...).

    Uses Gershgorin's bound of the largest singular value, exact for perpendicular axes.
    """
    return np.sqrt(np.abs(np.swapaxes(axes, -1, -2) @ axes).sum(axis=-1).max(axis=-1))


def parted(times: np.ndarray, parts: int) -> np.ndarray:
    """Return moments with the gaps between them divided into `parts`."""
    gaps = times[:-1, None] + np.diff(times)[:, None] * np.arange(parts) / parts
    return np.append(gaps.ravel(), times[-1])


class Feet:
    """The joints of a world that stand on the ground for a while.

    Parameters
    ----------
    world : World
    joints : iterable of int
        Nodes that may stand.
    """

    def __init__(self, world: World, joints: Iterable[int]) -> None:
        self.world = world
        self.rows = np.flatnonzero(np.isin(world.moving, list(joints)))

    @cached_property
    def stands(self) -> np.ndarray:
        """Whether each joint stands at each moment, shape (rows, m)."""
        world, times, shape = self.world, self.world.times, (len(self.rows), len(self.world.times))
        if not len(self.rows) or len(times) < 2:
            return np.zeros(shape, dtype=bool)
        heights, lowest = np.empty(len(times)), np.inf
        for block in world.blocks(world.truth):
            upwards = block.maps[0].origins[self.rows, :, UP_AXIS]
            heights[block.samples], lowest = np.ptp(upwards, axis=0), min(lowest, float(upwards.min()))
        height, low, slow = float(np.median(heights)), np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
        before = None
        for block in world.blocks(world.truth):
            positions = block.maps[0].origins[self.rows]
            low[:, block.samples] = positions[..., UP_AXIS] - lowest <= MAX_STANDING_HEIGHT_RATIO * height
            before = positions[:, :1] if before is None else before
            ways = np.linalg.norm(np.diff(np.concatenate((before, positions), axis=1), axis=1), axis=-1)
            slow[:, block.samples] = (
                ways <= MAX_STANDING_HEIGHTS_PER_S * height * np.diff(times, prepend=times[0])[block.samples]
            )
            before = positions[:, -1:]
        return contacts(times, low, slow[:, 1:])

    @cached_property
    def spans(self) -> np.ndarray:
        """Spans in which a joint stands: row of the joint, first and last sample, shape (s, 3)."""
        result = np.array(spans(self.stands), dtype=np.int64).reshape(-1, 3)
        result[:, 0] = self.rows[result[:, 0]]
        return result

    @cached_property
    def _before(self) -> list[np.ndarray]:
        return self._slide_distances(self.world.truth)

    def slides(self, tracks: Tracks) -> tuple[float, float]:
        """Return the largest distance of any foot from where it first stood in a span, before and after."""
        before, after = (max(map(np.max, ways), default=0.0) for ways in (self._before, self._slide_distances(tracks)))
        return float(before), float(after)

    def farther(self, tracks: Tracks) -> float:
        """Return by how much more than before any foot slides, at most."""
        return float(self.extra_slides(tracks).max(initial=0.0))

    def extra_slides(self, tracks: Tracks) -> np.ndarray:
        """Return by how much more than before the joint of each span slides, shape (s,)."""
        ways = zip(self._before, self._slide_distances(tracks), strict=True)
        return np.array([after.max() - before.max() for before, after in ways])

    def slips(self, tracks: Tracks, more: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rows and samples where joints slide `more` farther than before, and where these spans begin."""
        rows, samples = [NO_SAMPLES], [NO_SAMPLES]
        for (row, first, _), before, after in zip(self.spans, self._before, self._slide_distances(tracks), strict=True):
            padded = np.pad(after, 1)
            peaks = (after > before.max() + more) & (after >= padded[:-2]) & (after >= padded[2:])
            if peaks.any():
                samples.append(first + np.append(0, np.flatnonzero(peaks)))
                rows.append(np.full(len(samples[-1]), row))
        return np.concatenate(rows), np.concatenate(samples)

    @cached_property
    def _chains(self) -> tuple[World, np.ndarray]:
        """The joints that stand at any time with their ancestors, and the rows of the spans' joints in it, (s,)."""
        world, wanted = self.world, np.zeros(len(self.world.moving), dtype=bool)
        wanted[self.spans[:, 0]] = True
        wanted = Skeleton(world.parents).most_below(wanted)
        chains = replace(world, moving=world.moving[wanted], shells=world.shells[wanted])
        return chains, (np.cumsum(wanted) - 1)[self.spans[:, 0]]

    def _slide_distances(self, tracks: Tracks) -> list[np.ndarray]:
        """Return distances from where the joint first stood, one array for each span."""
        if not len(self.spans):
            return []
        (world, rows), (_, firsts, lasts) = self._chains, self.spans.T
        result, starts = [np.empty(length) for length in lasts - firsts + 1], np.empty((len(rows), 3))
        for block in world.blocks(tracks):
            origins, samples = block.maps[0].origins, block.samples
            for number in np.flatnonzero((firsts < samples.stop) & (lasts >= samples.start)).tolist():
                begin, end = max(firsts[number], samples.start), min(lasts[number] + 1, samples.stop)
                positions = origins[rows[number], begin - samples.start : end - samples.start]
                if begin == firsts[number]:
                    starts[number] = positions[0]
                ways = np.linalg.norm(positions - starts[number], axis=1)
                result[number][begin - firsts[number] : end - firsts[number]] = ways
        return result
