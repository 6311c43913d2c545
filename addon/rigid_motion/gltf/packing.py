"""The search for the tracks of a clip that meshopt packs into the fewest bytes within a tolerance in the world.

Each track has samples at an even rate, or sparse keys, in as few bits as do. Parents come first, and what hangs on them
knows how they are stored: a joint turns so that what it carries gets to where it should be, as far as a turn does that.
So errors do not add up, and each joint may use up much of the tolerance: those with many below them less.
Times are whole numbers of 2**-15 s, many of them a multiple of 2**-7 s apart, which leaves a byte that never changes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cached_property, partial

import numpy as np

from ..motion.quaternions import align_signs, conjugate, from_matrices, multiply, normalise, rotate
from .errors import MAX_EVEN_SCALE_RATIO, PARTS_PER_GAP, Feet, World, parted
from .meshopt import TIME_EXPONENT, packed_size
from .packed_keys import MAX_MENDED_RATIO, OWN_TIMES, SHARED_TIMES, SINGLE_KEY, Aim, PackedKeys
from .settling import on_lines
from .tracks import ROTATION, SCALE, TRANSLATION, Target, Tracks

KEY_TIME_STEP_S = 2.0**-7
"""Seconds between most times of keys."""

SAMPLE_STEPS_S = [steps * 2.0**-exponent for exponent in range(7, -3, -1) for steps in (4, 5, 6, 7)]
"""Seconds between samples at even rates, rising."""

MAX_SEARCH_SAMPLES = 2 * 10**5
"""Of all nodes together: about so many are looked at in a search."""

JUMP_FRAME_STRIDE, MIN_JUMP_ERROR_RATIO, FRAMES_PER_JUMP = 4, 2.0, 60
"""A jump is where a track with every fourth frame is so many times as far off as it is nearly everywhere, and among the
worst of so many frames."""

MIN_USUAL_ERROR = 1e-9

OF_TIME = {True: 1.5, False: 0.95}
"""About how many bytes the time of a key of its own takes, on a frame or on a multiple of KEY_TIME_STEP_S."""

OF_RATE = 0.8
"""The same of one that tracks share."""

MAX_MENDINGS, MENDING_ERROR_RATIO = 3, 0.9
"""How often keys are put in where too few are, and the share of what is allowed from which it is needed."""

MAX_FAR_SAMPLES_RATIO = 0.01
"""The share of samples at which keys of a grid may be too far off before these are rounded."""

MAX_SPARSE_BYTES_RATIO = 1.2
"""How many times as many bytes sparse keys may take, and are tried again."""

SPARSE_LINE_FACTORS = (1.6, 1.15, 0.8)
"""How much farther off than it may be a line is through sparse keys before these are fitted, in turn."""

CARRIED_TOLERANCE_RATIOS = ((0.4, 0.85), (0.6, 0.92))
"""The shares of the tolerance that what the root of a body carries may use up, and at most what others carry that turns
itself, in turn."""

OF_PLACE = 0.5
"""Of that, what a translation may."""

AIMED_TOLERANCE_RATIO, STRICTER_TOLERANCE_RATIO, MIN_TOLERANCE_RATIO = 0.985, 0.93, 0.3
"""The share of the tolerance that is aimed at, and how much smaller it gets, down to what, where the proof fails."""

OF_SLIDE = 0.5
"""The share of what a foot may slide that it may be off while it stands."""

TURN_WEIGHT = 4.0
"""How much what turns with a node counts beside where the nodes are that it carries."""


class Packing:
    """The search of one clip.

    Parameters
    ----------
    world : World
    tracks : mapping
        Those that are to be packed.
    fixed : mapping
        All others, as they are shown.
    tolerance : float
    feet : Feet
    slide : float
        How much farther these may slide than before.
    """

    def __init__(self, world: World, tracks: Tracks, fixed: Tracks, tolerance: float, feet: Feet, slide: float) -> None:
        self.world, self.tolerance, self.feet, self.slide = world, tolerance, feet, slide
        # Parents first.
        self.tracks = dict(sorted(tracks.items(), key=lambda item: world.rows[item[0][0]]))
        self.fixed, count = fixed, len(world.times) * len(world.moving)
        # With all times that keys may have.
        self.samples = np.union1d(
            parted(world.times, max(min(PARTS_PER_GAP, MAX_SEARCH_SAMPLES // count), 1)), self.bases[0][0]
        )
        self.truth = world.worlds(world.truth, self.samples)
        self.users: Counter[bytes] = Counter()
        """How many tracks have keys at the same times, by these."""
        self.sparse: dict[Target, bool] = {}
        """Whether sparse keys are worth a trial."""

    @cached_property
    def frames(self) -> np.ndarray:
        """The moments as they may be stored."""
        times = self.world.times
        exponent = max(TIME_EXPONENT, int(np.frexp(np.abs(times).max())[1]) - 23)
        return np.unique(np.ldexp(np.rint(np.ldexp(times, -exponent)), exponent))

    @cached_property
    def grids(self) -> list[np.ndarray]:
        """Times of samples at even rates, the highest first: frames, every second of them..., and SAMPLE_STEPS_S."""
        first, last, frames = self.frames[0], self.frames[-1], self.frames
        gap = float(np.median(np.diff(frames)))
        even = [frames, *(np.append(frames[:-1:every], last) for every in (2, 3, 4, 5, 6, 8))]
        rates = [rate for rate in SAMPLE_STEPS_S if 1.05 * gap < rate < (last - first) / 2]
        even += [np.append(np.arange(first, last - rate / 8, rate), last) for rate in rates]
        return sorted((np.union1d(times, self.cuts) for times in even), key=lambda times: -len(times))

    @cached_property
    def of_frames(self) -> list[np.ndarray]:
        """Those of the grids that have keys on frames alone."""
        return [times for times in self.grids if np.isin(times, self.frames).all()]

    @cached_property
    def cuts(self) -> np.ndarray:
        """The frames around sudden jumps, which keys at even rates would smooth away."""
        frames, sudden = self.frames, np.zeros(len(self.frames))
        for target, track in self.tracks.items() if len(frames) > 2 * JUMP_FRAME_STRIDE else ():
            values = track.at(frames)
            values = align_signs(values) if target[1] == ROTATION else values
            aim = Aim(frames, values, 1.0, partial(_differ, values), target[1] == ROTATION)
            off = aim.fit(np.append(frames[:-1:JUMP_FRAME_STRIDE], frames[-1]))[1]
            sudden = np.maximum(sudden, off / max(np.quantile(off, 0.98), MIN_USUAL_ERROR))
        most = np.sort(sudden)[-max(len(frames) // FRAMES_PER_JUMP, 1)]
        (jumps,) = np.nonzero((sudden > MIN_JUMP_ERROR_RATIO) & (sudden >= most))
        return frames[np.unique(np.clip(jumps[:, None] + (-1, 0, 1), 0, len(frames) - 1))]

    @cached_property
    def bases(self) -> list[tuple[np.ndarray, float]]:
        """Times of which sparse keys have some, and about how many bytes each of them takes."""
        first, last, frames = self.frames[0], self.frames[-1], self.frames
        steps = np.union1d(np.append(np.arange(first, last - KEY_TIME_STEP_S / 8, KEY_TIME_STEP_S), last), self.cuts)
        return [(steps, OF_TIME[False]), (frames, OF_TIME[True])]

    @cached_property
    def turned(self) -> list[np.ndarray]:
        """What each node's own rotation is, shapes (m, 4)."""
        return [self._own(row, self.world.truth) for row in range(len(self.world.moving))]

    @cached_property
    def aimed(self) -> list[np.ndarray]:
        """Its rotation in the world."""
        result: list[np.ndarray] = []
        for row, parent in enumerate(self.world.parents.tolist()):
            result.append(multiply(self._resting(row) if parent < 0 else result[parent], self.turned[row]))
        return result

    def _resting(self, row: int) -> np.ndarray:
        """Return how the parent of a node is turned in the world that does not move, shape (m, 4)."""
        parent = int(self.world.nodes.parents[self.world.moving[row]])
        own = np.array((1.0, 0.0, 0.0, 0.0))
        if parent >= 0:
            axes = self.world.nodes.resting.axes[parent]
            own = from_matrices((axes / np.linalg.norm(axes, axis=0))[None])[0]
        return np.broadcast_to(own, (len(self.samples), 4))

    def _own(self, row: int, tracks: Tracks) -> np.ndarray:
        own = self.world.nodes.channel(int(self.world.moving[row]), ROTATION, tracks, self.samples)
        return np.broadcast_to(normalise(own), (len(self.samples), 4))

    @cached_property
    def turns(self) -> list[bool]:
        """Whether each node turns by a track that is packed."""
        return [(node, ROTATION) in self.tracks for node in self.world.moving.tolist()]

    @cached_property
    def carried(self) -> list[list[int]]:
        """The nodes that each of them carries, without what these carry where they turn themselves."""
        parents = self.world.parents.tolist()
        result: list[list[int]] = [[] for _ in self.turns]
        for row, parent in enumerate(parents):
            while parent >= 0:
                result[parent].append(row)
                parent = -1 if self.turns[parent] else parents[parent]
        return result

    @cached_property
    def allowed(self) -> list[np.ndarray]:
        """How far off each node may be, of what others may, shapes (m,): less while feet stand."""
        result = [np.broadcast_to(1.0, self.samples.shape)] * len(self.turns)
        for row, first, last in self.feet.spans.tolist() if np.isfinite(self.slide) else ():
            stands = (self.samples >= self.world.times[first]) & (self.samples <= self.world.times[last])
            result[row] = np.where(stands, min(OF_SLIDE * self.slide / self.tolerance, 1.0), result[row])
        return result

    @cached_property
    def depths(self) -> np.ndarray:
        """How far down each node is on the longest way through it, from 0 for roots to 1, shape (n,)."""
        count, parents = len(self.world.moving), self.world.parents.tolist()
        above, below = np.zeros(count), np.zeros(count)
        for row, parent in enumerate(parents):
            above[row] = above[parent] + 1 if parent >= 0 else 0
        for row in range(count - 1, -1, -1):
            if (parent := parents[row]) >= 0:
                below[parent] = max(below[parent], below[row] + 1)
        return above / np.maximum(above + below, 1)

    @property
    def may_aim(self) -> bool:
        """Whether rotations alone say how nodes are turned in the world."""
        rest = self.world.nodes.rest[SCALE][self.world.moving]
        scales = [rest, *(track.points for (_, path), track in self.world.truth.items() if path == SCALE)]
        even = all(bool((np.ptp(some, axis=1) <= MAX_EVEN_SCALE_RATIO * some.min(axis=1)).all()) for some in scales)
        return even and not self.world.nodes.matrices

    def trials(self) -> Iterator[dict[Target, PackedKeys]]:
        """Yield keys of all tracks that may keep to the tolerance, the smallest first; then ever more exact ones.

        None where no turn makes up for another.
        """
        if not self.may_aim:
            return
        found = [
            (self._size(keys := self._trial(shares, AIMED_TOLERANCE_RATIO)), number, keys)
            for number, shares in enumerate(CARRIED_TOLERANCE_RATIOS)
        ]
        for _, _, keys in sorted(found, key=lambda trial: trial[:2]):
            yield keys
        strict, shares = AIMED_TOLERANCE_RATIO * STRICTER_TOLERANCE_RATIO, CARRIED_TOLERANCE_RATIOS[min(found)[1]]
        while strict > MIN_TOLERANCE_RATIO:
            yield self._trial(shares, strict)
            strict *= STRICTER_TOLERANCE_RATIO

    def _size(self, keys: Mapping[Target, PackedKeys]) -> int:
        arrays = [own.times.astype(np.float32)[:, None] for own in keys.values()]
        return packed_size([*arrays, *(own.stored for own in keys.values())], range(len(arrays)))

    def _trial(self, shares: tuple[float, float], strict: float) -> dict[Target, PackedKeys]:
        """Return keys of all tracks, where no node may be farther off than a strict share of the tolerance."""
        world, keys, most = self.world, {}, strict * self.tolerance
        rotations: list[np.ndarray] = []
        off: list[np.ndarray] = []
        origins, nowhere = self.truth.origins, np.zeros((len(self.samples), 3))
        allowed = most * (shares[0] + (shares[1] - shares[0]) * self.depths)
        for row, (node, parent) in enumerate(zip(world.moving.tolist(), world.parents.tolist(), strict=True)):
            above, here = (rotations[parent], nowhere) if parent >= 0 else (self._resting(row), nowhere)
            if parent >= 0:
                bone = origins[row] - origins[parent]
                here = off[parent] + rotate(multiply(above, conjugate(self.aimed[parent])), bone) - bone
            if (target := (node, TRANSLATION)) in self.tracks:
                length, values = world.longest_above[row], self.tracks[target].at(self.samples)
                within = OF_PLACE * float(allowed[row])
                measure = partial(self._place_off, row, above, values, here, within)
                aim = Aim(
                    self.samples, values - rotate(conjugate(above), here) / length, length / within, measure, False
                )
                keys[target] = own = self._best(target, aim)
                here = here + rotate(above, own.shown - values) * length
            off.append(here)
            turned = self._own(row, self.fixed)
            if (target := (node, ROTATION)) in self.tracks:
                within = float(allowed[row])
                measure = partial(self._turn_off, row, above, here, within, most)
                goal = align_signs(multiply(conjugate(above), self._turned_to(row, here)))
                keys[target] = own = self._best(
                    target, Aim(self.samples, goal, 2.0 * self.lengths[row] / within, measure, True)
                )
                turned = own.shown
            rotations.append(multiply(above, turned))
        self.users = Counter(own.times.tobytes() for own in keys.values())
        return keys

    @cached_property
    def lengths(self) -> np.ndarray:
        """How long the longest bone of each node is, or the radius of its ball, shape (n,)."""
        origins = self.truth.origins
        return np.array(
            [
                max([self.world.radii[row], *(np.linalg.norm(origins[it] - origins[row], axis=1).max() for it in some)])
                for row, some in enumerate(self.carried)
            ]
        )

    def _place_off(
        self,
        row: int,
        above: np.ndarray,
        values: np.ndarray,
        off: np.ndarray,
        within: float,
        shown: np.ndarray,
        some: np.ndarray | slice,
    ) -> np.ndarray:
        """Return how far off a node is whose translations these are, shape (k,); it is off by that besides (m, 3)."""
        there = off[some] + rotate(above[some], shown - values[some]) * self.world.longest_above[row]
        return np.linalg.norm(there, axis=1) / (within * self.allowed[row][some])

    def _turn_off(
        self,
        row: int,
        above: np.ndarray,
        off: np.ndarray,
        within: float,
        most: float,
        shown: np.ndarray,
        some: np.ndarray | slice,
    ) -> np.ndarray:
        """Return how far off a node is whose rotations these are, and what it carries, shape (k,)."""
        off, origins, radii = off[some], self.truth.origins, self.world.radii
        turn = multiply(multiply(above[some], shown), conjugate(self.aimed[row][some]))
        chord = 2.0 * np.linalg.norm(turn[:, 1:], axis=1)
        result = (np.linalg.norm(off, axis=1) + radii[row] * chord) / most
        for child in self.carried[row]:
            bone = origins[child][some] - origins[row][some]
            there = np.linalg.norm(off + rotate(turn, bone) - bone, axis=1)
            if self.turns[child]:
                allowed = within
            else:
                there, allowed = there + radii[child] * chord, most
            result = np.maximum(result, there / (allowed * self.allowed[child][some]))
        return result

    def _turned_to(self, row: int, off: np.ndarray) -> np.ndarray:
        """Return how a node is to turn so that what it carries is where it should, if it is off by that (m, 3)."""
        origins, radii = self.truth.origins, self.world.radii
        carried = self.carried[row]
        if not carried or not off.any():
            return self.aimed[row]
        own = TURN_WEIGHT * (radii[row] ** 2 + sum(radii[child] ** 2 for child in carried if not self.turns[child]))
        matrix, right = own * np.eye(3)[None], np.zeros_like(off)
        for child in carried:
            bone = origins[child] - origins[row]
            square = np.einsum("ij,ij->i", bone, bone)
            matrix = matrix + square[:, None, None] * np.eye(3) - bone[:, :, None] * bone[:, None]
            right -= np.cross(bone, off)
        turn = np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
        return normalise(multiply(np.column_stack((np.ones(len(off)), turn / 2.0)), self.aimed[row]))

    def _best(self, target: Target, aim: Aim) -> PackedKeys:
        """Return the keys that take the fewest bytes, of those that are tried.

        What carries others that turn has keys on frames alone: those have to make up for it on frames.
        """
        one, row = self.frames[:1], self.world.rows[target[0]]
        if not aim.failing(one) and (own := aim.keys(one, SINGLE_KEY)) is not None:
            return own
        is_free = not any(self.turns[child] for child in self.carried[row])
        found, low, grids = [], 0, self.grids if is_free else self.of_frames
        high = len(grids)
        while low < high:  # How many of the grids are fine enough.
            middle = (low + high) // 2
            low, high = (middle + 1, high) if aim.failing(grids[middle]) < MAX_FAR_SAMPLES_RATIO else (low, middle)
        found += [(aim.keys(times, SHARED_TIMES), self._dear(times)) for times in grids[max(low - 4, 0) : low]]
        found += self._mended(aim, grids, low)
        if self.sparse.setdefault(target, True):
            found += self._sparse(aim, self.bases if is_free else self.bases[1:])
        good = [(own.size + dear, own) for own, dear in found if own is not None]
        if not good:
            return aim.keys(self.samples[::2], OWN_TIMES) or aim.finest(self.frames)
        least, best = min(good, key=lambda one: one[0])
        self.sparse[target] = (
            min((size for size, own in good if own.kind == OWN_TIMES), default=np.inf) <= MAX_SPARSE_BYTES_RATIO * least
        )
        return best

    def _mended(self, aim: Aim, grids: list[np.ndarray], low: int) -> Iterator[tuple[PackedKeys | None, float]]:
        """Yield keys of grids that are too coarse in few places, with all frames there, as `_sparse` does."""
        high = len(grids)
        while low < high:
            middle = (low + high) // 2
            low, high = (middle + 1, high) if aim.failing(grids[middle]) < MAX_MENDED_RATIO else (low, middle)
        for times in grids[max(low - 2, 0) : low]:
            for _ in range(MAX_MENDINGS):
                places = np.searchsorted(self.frames, self.samples[aim.fit(times)[1] > MENDING_ERROR_RATIO])
                near = np.unique(np.clip(places[:, None] + (-2, -1, 0, 1), 0, len(self.frames) - 1))
                times = np.union1d(times, self.frames[near])
                if (own := aim.keys(times, OWN_TIMES)) is not None:
                    yield own, OF_TIME[False] * len(times)
                    break

    def _sparse(self, aim: Aim, bases: list[tuple[np.ndarray, float]]) -> Iterator[tuple[PackedKeys | None, float]]:
        """Yield sparse keys, and about how many bytes their times take."""
        for base, each in bases:
            values = aim.at(base)
            values = align_signs(values) if aim.turns else values
            for looser in SPARSE_LINE_FACTORS:
                times = base[on_lines(base, values, lambda off: aim.reach * np.linalg.norm(off, axis=1), looser)]
                if (own := aim.keys(times, OWN_TIMES)) is not None:
                    yield own, each * len(times)
                    break

    def _dear(self, times: np.ndarray) -> float:
        """About how many bytes of times a track takes that shares these."""
        return OF_RATE * len(times) / max(self.users[times.tobytes()], 1 + len(self.tracks) / 6)


def _differ(values: np.ndarray, shown: np.ndarray, some: np.ndarray | slice) -> np.ndarray:
    return np.minimum(*(np.linalg.norm(shown - sign * values[some], axis=1) for sign in (1, -1)))
