"""Search for the tracks of a clip that take the fewest meshopt bytes within a tolerance in world space.

Each track gets samples at an even rate or sparse keys, in as few bits as possible. Parents come first, and children
take the stored keys into account: a joint turns so that the nodes it carries get to their places, as far as a
rotation can do that. So errors do not add up, and each joint may use much of the tolerance: less for joints with many
joints below them.
Times are multiples of 2**-15 s, many of them multiples of 2**-7 s, which leaves a byte that never changes.
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
"""About how many samples of all nodes together are checked in a search."""

JUMP_FRAME_STRIDE, MIN_JUMP_ERROR_RATIO, FRAMES_PER_JUMP = 4, 2.0, 60
"""A jump: with every JUMP_FRAME_STRIDE-th frame as a key, the error is MIN_JUMP_ERROR_RATIO times its 98th percentile,
and among the worst, at most one in FRAMES_PER_JUMP frames."""

MIN_USUAL_ERROR = 1e-9

OF_TIME = {True: 1.5, False: 0.95}
"""About how many bytes a separate key time takes: True for a frame, False for a multiple of KEY_TIME_STEP_S."""

OF_RATE = 0.8
"""The same for key times that tracks share."""

MAX_MENDINGS, MENDING_ERROR_RATIO = 3, 0.9
"""Most rounds of inserting keys into too coarse a grid, and the error ratio at which one is needed."""

MAX_FAR_SAMPLES_RATIO = 0.01
"""Largest fraction of samples that may be too far off with keys on a grid, before rounding."""

MAX_SPARSE_BYTES_RATIO = 1.2
"""Largest bytes of sparse keys, as a ratio to the best keys, at which sparse keys are tried again for a track."""

SPARSE_LINE_FACTORS = (1.6, 1.15, 0.8)
"""Factors on the allowed error for lines through sparse keys before the keys are fitted, tried in turn."""

CARRIED_TOLERANCE_RATIOS = ((0.4, 0.85), (0.6, 0.92))
"""Fractions of the tolerance allowed for turning nodes that a joint carries: at the root of a body, and at the end of
its chains; tried in turn."""

OF_PLACE = 0.5
"""Fraction of this that a translation may use."""

AIMED_TOLERANCE_RATIO, STRICTER_TOLERANCE_RATIO, MIN_TOLERANCE_RATIO = 0.985, 0.93, 0.3
"""Fraction of the tolerance to aim at, its factor after a failed proof, and its lower limit."""

OF_SLIDE = 0.5
"""Largest error of a standing foot, as a fraction of the slide it is allowed."""

TURN_WEIGHT = 4.0
"""Weight of a node's rotation, compared with the positions of the nodes that it carries."""


class Packing:
    """The search for one clip.

    Parameters
    ----------
    world : World
    tracks : mapping
        Tracks to pack.
    fixed : mapping
        All other tracks, as shown.
    tolerance : float
    feet : Feet
    slide : float
        How much farther feet may slide than before.
    """

    def __init__(self, world: World, tracks: Tracks, fixed: Tracks, tolerance: float, feet: Feet, slide: float) -> None:
        self.world, self.tolerance, self.feet, self.slide = world, tolerance, feet, slide
        # Parents first.
        self.tracks = dict(sorted(tracks.items(), key=lambda item: world.rows[item[0][0]]))
        self.fixed, count = fixed, len(world.times) * len(world.moving)
        # Includes all possible key times.
        self.samples = np.union1d(
            parted(world.times, max(min(PARTS_PER_GAP, MAX_SEARCH_SAMPLES // count), 1)), self.bases[0][0]
        )
        self.truth = world.worlds(world.truth, self.samples)
        self.users: Counter[bytes] = Counter()
        """Number of tracks by their key times."""
        self.sparse: dict[Target, bool] = {}
        """Whether sparse keys are worth trying."""

    @cached_property
    def frames(self) -> np.ndarray:
        """The moments, as times that can be stored."""
        times = self.world.times
        exponent = max(TIME_EXPONENT, int(np.frexp(np.abs(times).max())[1]) - 23)
        return np.unique(np.ldexp(np.rint(np.ldexp(times, -exponent)), exponent))

    @cached_property
    def grids(self) -> list[np.ndarray]:
        """Times of samples at even rates, finest first: all frames, every second and so on, and SAMPLE_STEPS_S."""
        first, last, frames = self.frames[0], self.frames[-1], self.frames
        gap = float(np.median(np.diff(frames)))
        even = [frames, *(np.append(frames[:-1:every], last) for every in (2, 3, 4, 5, 6, 8))]
        rates = [rate for rate in SAMPLE_STEPS_S if 1.05 * gap < rate < (last - first) / 2]
        even += [np.append(np.arange(first, last - rate / 8, rate), last) for rate in rates]
        return sorted((np.union1d(times, self.cuts) for times in even), key=lambda times: -len(times))

    @cached_property
    def of_frames(self) -> list[np.ndarray]:
        """The grids with keys on frames only."""
        return [times for times in self.grids if np.isin(times, self.frames).all()]

    @cached_property
    def cuts(self) -> np.ndarray:
        """Frames around sudden jumps, which keys at even rates would smooth away."""
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
        """Possible times of sparse keys, each with the approximate bytes per key time."""
        first, last, frames = self.frames[0], self.frames[-1], self.frames
        steps = np.union1d(np.append(np.arange(first, last - KEY_TIME_STEP_S / 8, KEY_TIME_STEP_S), last), self.cuts)
        return [(steps, OF_TIME[False]), (frames, OF_TIME[True])]

    @cached_property
    def turned(self) -> list[np.ndarray]:
        """Each node's own rotation, shapes (m, 4)."""
        return [self._own_rotations(row, self.world.truth) for row in range(len(self.world.moving))]

    @cached_property
    def aimed(self) -> list[np.ndarray]:
        """Each node's rotation in world space."""
        result: list[np.ndarray] = []
        for row, parent in enumerate(self.world.parents.tolist()):
            result.append(multiply(self._resting(row) if parent < 0 else result[parent], self.turned[row]))
        return result

    def _resting(self, row: int) -> np.ndarray:
        """Return the world rotation of a node's parent that does not move, shape (m, 4)."""
        parent = int(self.world.nodes.parents[self.world.moving[row]])
        own = np.array((1.0, 0.0, 0.0, 0.0))
        if parent >= 0:
            axes = self.world.nodes.resting.axes[parent]
            own = from_matrices((axes / np.linalg.norm(axes, axis=0))[None])[0]
        return np.broadcast_to(own, (len(self.samples), 4))

    def _own_rotations(self, row: int, tracks: Tracks) -> np.ndarray:
        own = self.world.nodes.channel(int(self.world.moving[row]), ROTATION, tracks, self.samples)
        return np.broadcast_to(normalise(own), (len(self.samples), 4))

    @cached_property
    def turns(self) -> list[bool]:
        """Whether each node has a rotation track to pack."""
        return [(node, ROTATION) in self.tracks for node in self.world.moving.tolist()]

    @cached_property
    def carried(self) -> list[list[int]]:
        """The nodes that each node carries, down to and including the next nodes with a rotation track."""
        parents = self.world.parents.tolist()
        result: list[list[int]] = [[] for _ in self.turns]
        for row, parent in enumerate(parents):
            while parent >= 0:
                result[parent].append(row)
                parent = -1 if self.turns[parent] else parents[parent]
        return result

    @cached_property
    def allowed(self) -> list[np.ndarray]:
        """Factors on the allowed error of each node, shapes (m,): smaller while feet stand."""
        result = [np.broadcast_to(1.0, self.samples.shape)] * len(self.turns)
        for row, first, last in self.feet.spans.tolist() if np.isfinite(self.slide) else ():
            stands = (self.samples >= self.world.times[first]) & (self.samples <= self.world.times[last])
            result[row] = np.where(stands, min(OF_SLIDE * self.slide / self.tolerance, 1.0), result[row])
        return result

    @cached_property
    def depths(self) -> np.ndarray:
        """Relative depth of each node in the longest chain through it, from 0 at roots to 1 at ends, shape (n,)."""
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
        """Whether the rotations alone determine how nodes are turned in world space."""
        rest = self.world.nodes.rest[SCALE][self.world.moving]
        scales = [rest, *(track.points for (_, path), track in self.world.truth.items() if path == SCALE)]
        even = all(bool((np.ptp(some, axis=1) <= MAX_EVEN_SCALE_RATIO * some.min(axis=1)).all()) for some in scales)
        return even and not self.world.nodes.matrices

    def trials(self) -> Iterator[dict[Target, PackedKeys]]:
        """Yield keys of all tracks that may stay within the tolerance, smallest first, then more exact ones.

        Yields nothing if scales are uneven or nodes have matrices: then no rotation compensates for another.
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
        """Return keys of all tracks, where the allowed error is the fraction `strict` of the tolerance."""
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
                keys[target] = own = self._smallest_keys(target, aim)
                here = here + rotate(above, own.shown - values) * length
            off.append(here)
            turned = self._own_rotations(row, self.fixed)
            if (target := (node, ROTATION)) in self.tracks:
                within = float(allowed[row])
                measure = partial(self._turn_off, row, above, here, within, most)
                goal = align_signs(multiply(conjugate(above), self._turned_to(row, here)))
                keys[target] = own = self._smallest_keys(
                    target, Aim(self.samples, goal, 2.0 * self.lengths[row] / within, measure, True)
                )
                turned = own.shown
            rotations.append(multiply(above, turned))
        self.users = Counter(own.times.tobytes() for own in keys.values())
        return keys

    @cached_property
    def lengths(self) -> np.ndarray:
        """The length of each node's longest bone, or the radius of its ball if larger, shape (n,)."""
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
        """Return the relative error of a node with these translations, shape (k,); `off` (m, 3) is the error so far."""
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
        """Return the relative error of a node with these rotations, and of the nodes that it carries, shape (k,)."""
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
        """Return the rotation of a node that puts the nodes it carries in place, if it is off by `off` (m, 3)."""
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

    def _smallest_keys(self, target: Target, aim: Aim) -> PackedKeys:
        """Return the keys with the fewest bytes among those tried.

        Nodes that carry turning nodes have keys on frames only: the children compensate for them on frames.
        """
        one, row = self.frames[:1], self.world.rows[target[0]]
        if not aim.failing(one) and (own := aim.keys(one, SINGLE_KEY)) is not None:
            return own
        is_free = not any(self.turns[child] for child in self.carried[row])
        found, low, grids = [], 0, self.grids if is_free else self.of_frames
        high = len(grids)
        while low < high:  # Find how many of the grids are fine enough.
            middle = (low + high) // 2
            low, high = (middle + 1, high) if aim.failing(grids[middle]) < MAX_FAR_SAMPLES_RATIO else (low, middle)
        found += [
            (aim.keys(times, SHARED_TIMES), self._shared_time_bytes(times)) for times in grids[max(low - 4, 0) : low]
        ]
        found += self._with_inserted_keys(aim, grids, low)
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

    def _with_inserted_keys(
        self, aim: Aim, grids: list[np.ndarray], low: int
    ) -> Iterator[tuple[PackedKeys | None, float]]:
        """Yield keys of grids that are too coarse in few places, with the frames there added; see `_sparse`."""
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

    def _shared_time_bytes(self, times: np.ndarray) -> float:
        """Return about how many bytes the key times take for one track, if it shares them with others."""
        return OF_RATE * len(times) / max(self.users[times.tobytes()], 1 + len(self.tracks) / 6)


def _differ(values: np.ndarray, shown: np.ndarray, some: np.ndarray | slice) -> np.ndarray:
    return np.minimum(*(np.linalg.norm(shown - sign * values[some], axis=1) for sign in (1, -1)))
