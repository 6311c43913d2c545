"""What the animator keyed: the location, rotation, scale and mode channels of one slot, as arrays.

A source is read, never written. Its digest tells whether anything changed that in-betweens depend on. Frames are those
of the Action; values are in the channels' own units.
"""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..curves.evaluation import evaluate
from ..curves.keys import BEZIER, CONSTANT, ELASTIC, LINEAR, Keys, Stepped, cycled, cyclic_times, held
from .components import DEPENDS_ON_KEYS, PART_OF, REST, ROTATION, ROWS, SCALE, SMOOTH

LAYOUT = b"3"
"""The layout of in-betweens in F-curves. With another number, those of older files are made anew."""

FULL_TURN = 2.0 * np.pi

HALF_TURN = np.pi - 1e-4
"""Half a turn between two keys by angles, of which single precision has lost a little."""

WHOLE_TURN = 1e-5
"""Turns of the channel that differ by less from whole ones do so for rounding."""

SCREW_AXIS = "SCREW"
"""Turns are about the axis that a segment turns about anyway, and the local Z axis where it does not turn."""

TURN_AXES = (SCREW_AXIS, "X", "Y", "Z")
"""The axes that turns are about: that of the segment's screw, or always the same local axis."""

SAME_FRAME = 0.01
"""Keys closer than this are one key to Blender, and here."""


def distinct(frames: np.ndarray) -> np.ndarray:
    """Return rising frames of keys, those that are one key to Blender once."""
    return frames[np.diff(frames, prepend=-np.inf) > SAME_FRAME]


@dataclass(frozen=True, eq=False)
class Source:
    """The keys of one slot, and the values that what it does not key rests at."""

    order: str | None
    """The order of Euler angles, or None for quaternions."""

    keyed: frozenset[str]
    """The parts of location, rotation and scale that are keyed, in one of their components at least, or turned."""

    channels: tuple[tuple[list[int], Keys], ...]
    """The channels with keys, those together that are keyed together: their rows among the components, and keys."""

    rest: dict[int, float]
    """The values of components that have no keys, of what is keyed, by their rows."""

    original: np.ndarray
    """The difference without in-betweens, as components, shape (10,): an object's own delta transforms."""

    mode: int | Keys
    """The number of the mode of all segments, or the mode channel."""

    turns: Keys | None = None
    """The channel of whole turns more, of segments from the frames of its keys on; None where it has no say."""

    turns_axis: str = SCREW_AXIS
    """One of `TURN_AXES`."""

    location_axes: np.ndarray | None = None
    """The axes that location runs along, as columns (3, 3) in those of the body at rest; None where they are one."""

    in_nla: bool = False
    """True if there are NLA strips beside it, which Blender blends with the defaults of what it does not key."""

    seen: tuple[int, int] | None = None
    """First and last frame that are seen of it, in scenes and strips."""

    modified: frozenset[int] = frozenset()
    """The rows of channels that modifiers add something to, which stays on top of the modes."""

    driven: frozenset[int] = frozenset()
    """The rows of components that drivers move: to the others they are still."""

    influence: tuple[tuple[float, float], ...] | None = None
    """Frames, and the influence that a strip with nothing below it has on them; None where that is full."""

    is_on_top: bool = False
    """True if differences come on top of the original one, and not in its place."""

    shaping: np.ndarray | None = None
    """The frames of the keys that segments run between, where others are `passed`; None where all are."""

    @cached_property
    def digest(self) -> str:
        """Differs wherever anything differs that the in-betweens depend on."""
        summary = hashlib.blake2b(digest_size=16)
        for rows, keys in self.channels:
            summary.update(bytes(rows))
            summary.update(keys.raw)
        # Where something stands that is not keyed does not change how far off its in-betweens are.
        rest = {row: value for row, value in self.rest.items() if row >= ROWS[ROTATION].start}
        summary.update((repr(rest).encode() if rest else b"") + self.original.tobytes())
        if self.location_axes is not None:
            summary.update(self.location_axes.tobytes())
        summary.update(self.mode.raw if isinstance(self.mode, Keys) else b"%d" % self.mode)
        if self.turns is not None:
            summary.update(self.turns.raw + self.turns_axis.encode())
        if self.has_half_turns:
            summary.update(b"spins")
        span = self.seen if self.goes_on and not self.repeats else None
        if self.influence is not None:
            summary.update(repr(self.influence).encode())
        if self.driven:
            summary.update(repr(sorted(self.driven)).encode())
        summary.update(LAYOUT + repr((self.order, self.in_nla, span)).encode())
        if self.has_modified_scale:
            summary.update(b"modified scale")
        return summary.hexdigest()

    @cached_property
    def curves(self) -> list[Keys]:
        """The keys of all channels that have any."""
        return [keys for _, keys in self.channels]

    @cached_property
    def key_count(self) -> int:
        """The number of keys that its channels have."""
        return sum(keys.interpolation.size for keys in self.curves)

    @cached_property
    def is_together(self) -> bool:
        """Return whether all channels have their keys on the same frames, and go through them once."""
        return len(self.channels) == 1 and self.cyclic is None and self.shaping is None

    @cached_property
    def steps(self) -> tuple[Stepped, ...]:
        """The Stepped modifiers that all channels have in common; those with a single key need not have them."""
        return next((keys.steps for keys in self.curves if keys.steps), ())

    @property
    def unheld(self) -> Source:
        """Source without Stepped modifiers, but otherwise the same."""
        if not self.steps:
            return self
        return replace(self, channels=tuple((rows, replace(keys, steps=())) for rows, keys in self.channels))

    def held(self, frames: np.ndarray) -> np.ndarray:
        """Return the frames (m,) whose poses are shown on these ones (m,)."""
        return held(self.steps, frames)

    @property
    def has_modified_scale(self) -> bool:
        """Return whether modifiers add something to the scale, which the modes leave to Blender then."""
        return any(PART_OF[row] == SCALE for row in self.modified)

    @cached_property
    def keyed_frames(self) -> np.ndarray:
        """Frames on which any of the channels has a key of the animator's, shape (k,)."""
        return np.unique(np.concatenate([keys.times for keys in self.curves]))

    @cached_property
    def key_frames(self) -> np.ndarray:
        """Frames of `keyed_frames` without keys that are one to Blender, and with the copies that cycles make, (n,).

        Copies are there as far as it is seen, and a round on both sides at least. On a `path` only those that shape it.
        """
        return self._all_key_frames if self.shaping is None else self.shaping

    @cached_property
    def _all_key_frames(self) -> np.ndarray:
        if self.is_together:
            return self.curves[0].times
        times = [keys.times for keys in self.curves]
        if self.cyclic is not None:
            first, last = self.keyed_range
            margin = max(channel[-1] - channel[0] for channel in times)
            seen = self.seen or (first, last)
            first, last = min(seen[0], first) - margin, max(seen[1], last) + margin
            times = [cyclic_times(keys, keys.times, first, last) for keys in self.curves]
        return distinct(np.unique(np.concatenate(times)))

    @cached_property
    def keyed_range(self) -> tuple[float, float]:
        """The first and the last frame with a key."""
        return min(float(keys.times[0]) for keys in self.curves), max(float(keys.times[-1]) for keys in self.curves)

    @cached_property
    def goes_on(self) -> bool:
        """Return whether any channel goes on outside of its keys, by cycles or at its slope."""
        return any(keys.linear or keys.cycles is not None for keys in self.curves)

    @cached_property
    def repeats(self) -> bool:
        """Return whether the difference to Blender's in-betweens in every round of its cycles is that in the first.

        So it is where all channels go round together, over whole frames, and in a round turn and grow by nothing, or
        turn about one and the same axis; and where no mode looks at keys that only some of the rounds have.
        """
        cyclic = self.cyclic
        if cyclic is None:
            return False
        cycles, ends = cyclic.cycles, self.keyed_range
        if any(keys.cycles != cycles or tuple(keys.times[[0, -1]]) != ends for keys in self.curves):
            return False
        if not (ends[0] < ends[1] and all(end.is_integer() for end in ends)):
            return False
        is_endless = "NONE" not in (cycles.before, cycles.after)
        if not is_endless and any(keys.linear for keys in self.curves):
            return False
        if not (is_endless and cycles.before_count == cycles.after_count == 0) and self.is_smooth:
            return False
        if "REPEAT_OFFSET" not in (cycles.before, cycles.after):
            return True
        change, turning = np.zeros(10), 0
        for rows, keys in self.channels:
            change[rows] = keys.values[:, -1] - keys.values[:, 0]
            turning += sum(np.ptp(values) > 0.0 for row, values in zip(rows, keys.values, strict=True) if 3 <= row < 7)
        if self.order is not None:
            change[3:6] -= FULL_TURN * np.rint(change[3:6] / FULL_TURN) if turning > 1 else change[3:6]
        return bool(np.abs(change[3:]).max() < 1e-6)

    @cached_property
    def is_smooth(self) -> bool:
        """Return whether a mode in it looks at the keys around a segment."""
        return bool(np.isin(np.rint(self.mode.values) if isinstance(self.mode, Keys) else self.mode, SMOOTH).any())

    @cached_property
    def modes(self) -> np.ndarray:
        """The number of the mode of each segment, shape (n - 1,)."""
        return self.modes_at(self._starts[0])

    @cached_property
    def _starts(self) -> tuple[np.ndarray, np.ndarray]:
        """A moment into each segment, as the cycles have it, and whether they run backwards there, both (n - 1,)."""
        # In a copy that runs backwards that is a moment before its original's end.
        starts = self.key_frames[:-1] + SAME_FRAME
        return (starts, np.zeros(len(starts), dtype=bool)) if self.cyclic is None else cycled(self.cyclic, starts)

    def modes_at(self, frames: np.ndarray) -> np.ndarray:
        """Return the numbers of the modes at these frames: each key of the mode channel holds until the next."""
        if not isinstance(self.mode, Keys):
            return np.full(len(frames), self.mode)
        modes = self.mode.values[0, np.clip(np.searchsorted(self.mode.times, frames, side="right") - 1, 0, None)]
        return np.rint(modes).astype(int)

    def mode_at(self, frame: float) -> int:
        """Return the number of the mode of the segment that a frame is in: of the first or the last one outside of all.

        A mode that begins within a segment does not act there.
        """
        segment = int(np.searchsorted(self.key_frames, frame, side="right")) - 1
        return int(self.modes[min(max(segment, 0), len(self.modes) - 1)])

    @cached_property
    def segment_turns(self) -> np.ndarray:
        """The turns more of each segment that is not Blender's own, whole ones but for inserted keys, (n - 1,)."""
        if self.turns is None:
            return np.zeros(len(self.key_frames) - 1)
        at = np.searchsorted(self.turns.times, self._starts[0], side="right") - 1
        turns = np.where(at < 0, 0.0, self.turns.values[0, np.clip(at, 0, None)])
        whole = np.rint(turns)
        turns = np.where(np.abs(turns - whole) < WHOLE_TURN, whole, turns)
        return np.where(self.modes == 0, 0.0, turns)

    @property
    def run_backwards(self) -> np.ndarray:
        """Return whether cycles run through a segment backwards, shape (n - 1,)."""
        return self._starts[1]

    @cached_property
    def has_half_turns(self) -> bool:
        """Return whether an Euler angle goes by half a turn or more from one of its keys to the next."""
        if self.order is None:
            return False
        angles = (
            (keys.values, [index for index, row in enumerate(rows) if 3 <= row < 6]) for rows, keys in self.channels
        )
        return any(
            indices and np.abs(np.diff(values[indices])).max(initial=0.0) >= HALF_TURN for values, indices in angles
        )

    @cached_property
    def passed(self) -> np.ndarray:
        """Return which keys lie on the path between the keys around them instead of shaping it, shape (n,).

        Breakdowns in all channels that have a key there, that is, between others with the same mode, where a path
        depends on its keys and goes the shortest way round.
        """
        passed = np.zeros(len(self.key_frames), dtype=bool)
        goes_the_shortest_way = self.turns is None and not self.has_half_turns
        if self.cyclic is None and goes_the_shortest_way and any(keys.breakdowns is not None for keys in self.curves):
            modes = self.modes
            passed[1:-1] = np.isin(modes[1:], DEPENDS_ON_KEYS) & (modes[1:] == modes[:-1])
            for keys in self.curves:
                shaping = keys.times if keys.breakdowns is None else keys.times[~keys.breakdowns]
                passed &= ~np.isin(self.key_frames, shaping)
        return passed

    @cached_property
    def path(self) -> Source:
        """Source without the keys that are `passed`, but otherwise the same."""
        if not self.passed.any():
            return self
        # Channels keep these keys: one without a key on the others would be elsewhere there.
        return replace(self, shaping=self.key_frames[~self.passed])

    @cached_property
    def is_live(self) -> bool:
        """Return whether there is a segment that is to be filled in otherwise than Blender does."""
        if not self.curves or len(self.key_frames) < 2:
            return False
        return bool(np.any(self.modes)) if isinstance(self.mode, Keys) else self.mode != 0

    @cached_property
    def frame_range(self) -> tuple[int, int]:
        """The first and last whole frame that in-betweens are for."""
        return self.sample_range(1)

    def sample_range(self, rate: int) -> tuple[int, int]:
        """Return the numbers of the first and last sample that in-betweens are for, from frame 0 on.

        They are those of the segments with a mode. Where it goes on outside of its keys, those of all that is seen,
        unless what is between the keys repeats.
        """
        first, last = self.keyed_range
        if self.goes_on and not self.repeats:
            first, last = self.seen_range
        elif self.cyclic is None and self.is_live:
            live = np.flatnonzero(self.modes)
            first, last = self.key_frames[live[0]], self.key_frames[live[-1] + 1]
        return math.floor(first * rate), math.ceil(last * rate)

    @cached_property
    def seen_range(self) -> tuple[int, int]:
        """The first and last whole frame that anything is seen on, also where it goes on outside of its keys."""
        first, last = self.keyed_range
        if self.seen is not None and self.goes_on:
            # What is held there may be from before, or before an offset from behind.
            longest = sum(step.step for step in self.steps)
            first, last = min(first, self.seen[0] - longest), max(last, self.seen[1] + longest)
        return math.floor(first), math.ceil(last)

    @cached_property
    def filled_rows(self) -> list[int]:
        """The rows of the components that in-betweens may differ in from Blender's."""
        rows = list(range(10) if self.uniform_scale else range(7))
        rows = [row for row in rows if PART_OF[row] in self.keyed and not (row == 6 and self.order is not None)]
        return [row for row in rows if row not in self.driven]

    @cached_property
    def uniform_scale(self) -> bool:
        """Return whether the scale is animated, at every key the same along all axes and positive: else it is left."""
        if SCALE not in self.keyed or self.has_modified_scale:
            return False
        x, y, z = self.values_at(self._all_key_frames)[ROWS[SCALE]]
        return bool(np.allclose(x, y) and np.allclose(x, z) and np.all(x > 0.0) and np.ptp(x) > 0.0)

    def values_at(self, frames: np.ndarray) -> np.ndarray:
        """Return what the channels alone have on these frames, shape (10, m)."""
        return values_of([self], [frames])[0]

    @cached_property
    def holds(self) -> np.ndarray:
        """Return whether all channels hold their value throughout a segment, shape (n - 1,)."""
        return np.all(self._interpolations == CONSTANT, axis=0)

    @cached_property
    def has_handles(self) -> np.ndarray:
        """Return whether handles shape a segment, and no easing does nor a hold, shape (n - 1,)."""
        codes = self._interpolations
        return np.all((codes == LINEAR) | (codes == BEZIER), axis=0) & np.any(codes == BEZIER, axis=0)

    @cached_property
    def _interpolations(self) -> np.ndarray:
        """The codes of each channel's keys that segments run on from, shape (channels, n - 1)."""
        starts, codes = self.key_frames[:-1] + SAME_FRAME, []
        for keys in self.curves:
            at = starts if keys.cycles is None else cycled(keys, starts)[0]
            codes.append(keys.interpolation[:, np.clip(np.searchsorted(keys.times, at, side="right") - 1, 0, None)])
        return np.concatenate(codes)

    @cached_property
    def is_elastic(self) -> bool:
        """Return whether any key eases elastically, which depends on how far a channel goes."""
        return any(keys.easing is not None and np.any(keys.interpolation == ELASTIC) for keys in self.curves)

    @cached_property
    def cyclic(self) -> Keys | None:
        """The first of the channels that repeat."""
        return next((keys for keys in self.curves if keys.cycles is not None), None)


def each(sources: Sequence[Source], counts: Iterator[int]) -> list[tuple[Source, slice]]:
    """Return each source with the span of what it has this many of."""
    bounds = [0, *itertools.accumulate(counts)]
    return [(source, slice(*span)) for source, span in zip(sources, itertools.pairwise(bounds), strict=True)]


def sampled(
    samples: list[tuple[Source, slice]],
    frames: Sequence[np.ndarray],
    *,
    unit_elastic: bool = False,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """Return the channels' own values at the frames of each source, m in all, with a row for each of the `height`.

    What a source does not key rests.
    """
    rows = np.empty((height([source for source, _ in samples]), samples[-1][1].stop)) if out is None else out
    curves, times, out, apart = [], [], [], []
    for (source, span), at in zip(samples, frames, strict=True):
        rows[:, span] = REST[: len(rows), None]
        for row, value in source.rest.items():
            rows[row, span] = value
        for keyed_rows, keys in source.channels:
            if at is source.key_frames and source.is_together:
                rows[keyed_rows, span] = keys.values
                continue
            curves.append(keys)
            times.append(at)
            if keyed_rows[-1] - keyed_rows[0] < len(keyed_rows):
                out.append(rows[keyed_rows[0] : keyed_rows[-1] + 1, span])
            else:
                out.append(np.empty((len(keyed_rows), len(at))))
                apart.append((keyed_rows, span, out[-1]))
    evaluate(curves, times, unit_elastic=unit_elastic, out=out)
    for keyed_rows, span, values in apart:
        rows[keyed_rows, span] = values
    return rows


def height(sources: Sequence[Source]) -> int:
    """Return how many of the components are needed for what the sources key."""
    return ROWS[SCALE].stop if any(SCALE in source.keyed for source in sources) else ROWS[ROTATION].stop


def values_of(sources: Sequence[Source], frames: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return what the channels of each source alone have on frames of its own, shape (10, m)."""
    samples = each(sources, map(len, frames))
    rows = sampled(samples, frames, out=np.empty((10, sum(map(len, frames)))))
    return [rows[:, span] for _, span in samples]
