"""How far off nodes are in the world, where other tracks move them: proven between keys, too.

What counts is a ball around each node: no point of it is off by more. Its radius is that in the world, where the node
is largest; a node that shrinks takes its ball along. Of a long clip no more is looked at at once than a stretch of it.
Joints that stand on the ground are feet: how far they slide there counts, and when too far.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..motion.affine import AffineMaps, ball_displacement, displacement_bound
from ..motion.contacts import LOW, SLOW, contacts, spans
from ..motion.skeleton_stretches import stretches
from .nodes import Nodes
from .tracks import SCALE, Tracks

PARTS = 8
"""Of every gap between keys: that is how closely it is looked at."""

STRETCH, LONG = 1500, 2
"""Samples of a clip that are looked at and searched at once, where there are more than so many times as many."""

AT_ONCE = 2**15
"""Poses that are looked at in one go."""

EXACTLY = 64
"""Poses whose displacement is worked out at once, those with the largest bounds first."""

AS_LARGE = 1.0 - 1e-9
"""What is larger than this share of something else is no smaller but for rounding."""

EVEN = 1e-4
"""Of a scale: its axes differ by no more where it is even. Programs write some with rounding."""

NOWHERE = np.empty(0, dtype=np.int64)

UPWARDS = 1
"""The axis of glTF that is."""


@dataclass(frozen=True, eq=False)
class Block:
    """What is seen of nodes at some moments that follow one another."""

    first: int
    """The number of the first of them."""

    times: np.ndarray
    """Shape (m,)."""

    maps: tuple[AffineMaps, ...]
    """Where the nodes are, as each of several tracks move them, shape (n, m)."""

    @property
    def samples(self) -> slice:
        """The numbers of the moments."""
        return slice(self.first, self.first + len(self.times))


@dataclass(frozen=True, eq=False)
class World:
    """Nodes that move, and what they are measured by. Lengths are in the unit of the document."""

    nodes: Nodes
    moving: np.ndarray
    """The numbers of those that move, parents before their children, shape (n,)."""

    radii: np.ndarray
    """Of the balls, shape (n,)."""

    truth: Tracks
    times: np.ndarray
    """The moments between which all tracks run evenly, shape (m,)."""

    @cached_property
    def rows(self) -> dict[int, int]:
        """The row of each node among those that move."""
        return {node: row for row, node in enumerate(self.moving.tolist())}

    @cached_property
    def parents(self) -> np.ndarray:
        """The row of each node's parent, -1 where that does not move, shape (n,)."""
        above = self.nodes.parents[self.moving].tolist()
        return np.array([self.rows.get(parent, -1) for parent in above], dtype=np.int64)

    @cached_property
    def stretches(self) -> list[slice]:
        """Moments that are looked at in one go, each from the last of those before on; all, if they are few."""
        count = len(self.times)
        return stretches(count, STRETCH) if count > LONG * STRETCH else [slice(0, count)]

    def seen(self, *tracks: Tracks, parts: int = 1, among: Collection[int] | None = None) -> Iterator[Block]:
        """Yield what moments look like as each of these tracks move the nodes, and so many parts of gaps between.

        Where that is asked for, among some of the stretches alone, by their numbers.
        """
        step = max(1, AT_ONCE // (parts * max(1, len(self.moving))))
        last = len(self.times) - 1
        for number, stretch in enumerate(self.stretches):
            if among is not None and number not in among:
                continue
            end = stretch.stop if stretch.stop > last else stretch.stop - 1
            near = [self._near(some, stretch) for some in tracks]
            for first in range(stretch.start, end, step):
                times = self.parted(first, min(first + step, end), parts)
                yield Block(parts * first, times, tuple(self.worlds(some, times) for some in near))

    def digests(self, tracks: Tracks) -> list[int]:
        """Return what tells apart, of each stretch, whether tracks have the same keys there."""
        near = (self._near(tracks, stretch) for stretch in self.stretches)
        return [
            hash(tuple(part.tobytes() for track in some.values() for part in (track.times, track.values)))
            for some in near
        ]

    def _near(self, tracks: Tracks, stretch: slice) -> Tracks:
        """Return the keys of tracks that say what is shown in a stretch."""
        ends = self.times[[stretch.start, stretch.stop - 1]].tolist()
        return {target: track.near(*ends) for target, track in tracks.items()}

    def parted(self, first: int, end: int, parts: int) -> np.ndarray:
        """Return some of the moments, and so many parts of the gaps behind them."""
        times = self.times[first : end + 1]
        gaps = (times[:-1, None] + np.diff(times)[:, None] * np.arange(parts) / parts).ravel()
        return gaps if len(times) > end - first else np.append(gaps, times[-1])

    def worlds(self, tracks: Tracks, times: np.ndarray) -> AffineMaps:
        """Where the nodes are at times (m,) as tracks move them, shape (n, m)."""
        return self.nodes.worlds(self.moving, tracks, times)

    def lengths_above(self, times: np.ndarray) -> np.ndarray:
        """How long the axes of each node's parent are in the world at times (m,), shape (n, m, 3), or (n, 1, 3)."""
        if any(path == SCALE and len(track.times) > 1 for (_, path), track in self.truth.items()):
            return self._above(np.linalg.norm(self.worlds(self.truth, times).axes, axis=-2))
        return self._above(self._extremes[1][:, None])

    def _above(self, lengths: np.ndarray) -> np.ndarray:
        """Those of nodes' parents, where these are of the nodes, shape (n, ..., 3)."""
        result = lengths[self.parents]
        for row in np.flatnonzero(self.parents < 0).tolist():
            parent = self.nodes.parents[self.moving[row]]
            result[row] = np.linalg.norm(self.nodes.resting.axes[parent], axis=-2) if parent >= 0 else 1.0
        return result

    @property
    def _is_uneven(self) -> bool:
        """Whether any scale is uneven by more than rounding, or may be: what turns below has another shape then."""
        scales = [track.points for (_, path), track in self.truth.items() if path == SCALE]
        return bool(self.nodes.matrices) or any(
            (np.ptp(some, axis=1) > EVEN * np.abs(some).max(axis=1)).any() for some in (self.nodes.rest[SCALE], *scales)
        )

    @cached_property
    def _extremes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of each node: its axes where they are first largest (n, 3, 3), their lengths at most (n, 3), and how far it
        gets from its parent (n,).

        Axes that are as large again, but for rounding, are not taken: under a parent whose scale is uneven, nodes that
        turn keep their size and change the shape of what was a ball.
        """
        count = len(self.moving)
        axes, sizes = np.zeros((count, 3, 3)), np.full(count, -1.0)
        lengths, away = np.zeros((count, 3)), np.zeros(count)
        hangs, every = self.parents >= 0, np.arange(count)
        # Nodes that change their shape are largest for a moment, perhaps between two.
        for block in self.seen(self.truth, parts=PARTS if self._is_uneven else 1):
            (maps,) = block.maps
            squares = np.einsum("nmij,nmij->nm", maps.axes, maps.axes)
            largest = np.argmax(squares >= AS_LARGE * squares.max(axis=1, keepdims=True), axis=1)
            larger = AS_LARGE * squares[every, largest] > sizes
            sizes[larger], axes[larger] = squares[every, largest][larger], maps.axes[every, largest][larger]
            lengths = np.maximum(lengths, np.linalg.norm(maps.axes, axis=-2).max(axis=1))
            from_parents = maps.origins[hangs] - maps.origins[self.parents[hangs]]
            away[hangs] = np.maximum(away[hangs], np.linalg.norm(from_parents, axis=-1).max(axis=1))
        return axes, lengths, away

    @cached_property
    def longest_above(self) -> np.ndarray:
        """How long any axis of each node's parent gets in the world, shape (n,)."""
        return self._above(self._extremes[1]).max(axis=-1)

    @cached_property
    def reaches(self) -> np.ndarray:
        """How far what hangs on each node is from it at most, with the balls around it, shape (n,); an upper bound."""
        result, away = self.radii.copy(), self._extremes[2]
        for row in range(len(result) - 1, -1, -1):
            if (parent := self.parents[row]) >= 0:
                result[parent] = max(result[parent], away[row] + result[row])
        return result

    def largest_error(self, shown: Tracks, *, parts: int = PARTS) -> float:
        """Return the largest displacement of any point of any ball at the moments, and at parts of the gaps between."""
        return self.worst(shown, np.inf, parts=parts)[0]

    def worst(
        self, shown: Tracks, tolerance: float, *, parts: int = PARTS, among: Collection[int] | None = None
    ) -> tuple[float, np.ndarray, np.ndarray]:
        """Errors at the moments and parts of the gaps: the largest, and where it is over a tolerance and a peak.

        Returns
        -------
        largest : float
        rows, numbers : array, shape (k,)
            Of nodes, and of the times.
        """
        largest, rows, numbers = 0.0, [NOWHERE], [NOWHERE]
        for block in self.seen(shown, self.truth, parts=parts, among=among):
            there, truth = (AffineMaps(some.axes @ self._to_balls, some.origins) for some in block.maps)
            bounds = displacement_bound(there, truth, self.radii[:, None])
            errors = np.zeros(bounds.shape)
            waiting = np.flatnonzero(bounds > min(largest, tolerance))
            waiting = waiting[np.argsort(-bounds.flat[waiting])]
            for begin in range(0, len(waiting), EXACTLY):
                some = waiting[begin : begin + EXACTLY]
                if bounds.flat[some[0]] <= min(largest, tolerance):
                    break
                where = np.unravel_index(some, errors.shape)
                errors[where] = ball_displacement(there[where], truth[where], self.radii[where[0]])
                largest = max(largest, float(np.max(errors[where])))
            padded = np.pad(errors, ((0, 0), (1, 1)))
            peaks = (errors > tolerance) & (errors >= padded[:, :-2]) & (errors >= padded[:, 2:])
            row, number = np.nonzero(peaks)
            rows.append(row)
            numbers.append(number + block.first)
        return largest, np.concatenate(rows), np.concatenate(numbers)

    @cached_property
    def _to_balls(self) -> np.ndarray:
        """From axes of nodes to those of their balls, which are even where the node is largest, (n, 1, 3, 3)."""
        return np.linalg.pinv(self._extremes[0])[:, None]


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
    def stand(self) -> np.ndarray:
        """Which joints stand, and when, shape (rows, m)."""
        world, times, shape = self.world, self.world.times, (len(self.rows), len(self.world.times))
        if not len(self.rows) or len(times) < 2:
            return np.zeros(shape, dtype=bool)
        heights, lowest = np.empty(len(times)), np.inf
        for block in world.seen(world.truth):
            upwards = block.maps[0].origins[self.rows, :, UPWARDS]
            heights[block.samples], lowest = np.ptp(upwards, axis=0), min(lowest, float(upwards.min()))
        height, low, slow = float(np.median(heights)), np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
        before = None
        for block in world.seen(world.truth):
            positions = block.maps[0].origins[self.rows]
            low[:, block.samples] = positions[..., UPWARDS] - lowest <= LOW * height
            before = positions[:, :1] if before is None else before
            ways = np.linalg.norm(np.diff(np.concatenate((before, positions), axis=1), axis=1), axis=-1)
            slow[:, block.samples] = ways <= SLOW * height * np.diff(times, prepend=times[0])[block.samples]
            before = positions[:, -1:]
        return contacts(times, low, slow[:, 1:])

    @cached_property
    def spans(self) -> np.ndarray:
        """The row of a joint, and the first and the last sample of a time in which it stands, shape (s, 3)."""
        result = np.array(spans(self.stand), dtype=np.int64).reshape(-1, 3)
        result[:, 0] = self.rows[result[:, 0]]
        return result

    @cached_property
    def _before(self) -> list[np.ndarray]:
        return self._ways(self.world.truth)

    def slides(self, tracks: Tracks) -> tuple[float, float]:
        """Return the farthest that any of them gets from where it stood at first, before and after."""
        before, after = (max(map(np.max, ways), default=0.0) for ways in (self._before, self._ways(tracks)))
        return float(before), float(after)

    def farther(self, tracks: Tracks) -> float:
        """How much farther than before any of them slides, at most."""
        ways = zip(self._before, self._ways(tracks), strict=True)
        return max((float(after.max() - before.max()) for before, after in ways), default=0.0)

    def slips(self, tracks: Tracks, more: float) -> tuple[np.ndarray, np.ndarray]:
        """Rows of joints and samples at which one slides by more than this farther than before, and began to."""
        rows, samples = [NOWHERE], [NOWHERE]
        for (row, first, _), before, after in zip(self.spans, self._before, self._ways(tracks), strict=True):
            padded = np.pad(after, 1)
            peaks = (after > before.max() + more) & (after >= padded[:-2]) & (after >= padded[2:])
            if peaks.any():
                samples.append(first + np.append(0, np.flatnonzero(peaks)))
                rows.append(np.full(len(samples[-1]), row))
        return np.concatenate(rows), np.concatenate(samples)

    def _ways(self, tracks: Tracks) -> list[np.ndarray]:
        """How far each gets from where it stood at first, an array for each span."""
        if not len(self.spans):
            return []
        rows, firsts, lasts = self.spans.T
        result, starts = [np.empty(length) for length in lasts - firsts + 1], np.empty((len(rows), 3))
        for block in self.world.seen(tracks):
            origins, samples = block.maps[0].origins, block.samples
            for number in np.flatnonzero((firsts < samples.stop) & (lasts >= samples.start)).tolist():
                begin, end = max(firsts[number], samples.start), min(lasts[number] + 1, samples.stop)
                positions = origins[rows[number], begin - samples.start : end - samples.start]
                if begin == firsts[number]:
                    starts[number] = positions[0]
                ways = np.linalg.norm(positions - starts[number], axis=1)
                result[number][begin - firsts[number] : end - firsts[number]] = ways
        return result
