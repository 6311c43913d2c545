"""What the animator keyed: the location, rotation and scale channels of one slot and their modes, as arrays.

A source is read, never written. Its digest tells whether anything changed that its motion depends on. Frames are those
of the Action; values are in the channels' own units.

Location, rotation and scale may have keys on frames of their own: then each of them runs between its own keys. A
segment that has its ends in common with all of them is *joint*: how far it has come is what all channels say together.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..fcurves.evaluation import evaluate
from ..fcurves.keys import BEZIER, CONSTANT, LINEAR, cycled
from .components import (
    AXIS_ANGLE,
    DEPENDS_ON_KEYS,
    LOCATION,
    PART_OF,
    REST,
    ROTATION,
    ROWS,
    SCALE,
)
from .keyed import Keyed
from .marks import HALF_TURN, SAME_FRAME, SCREW_AXIS, TURN_AXES, WHOLE_TURN, Marks, distinct, sweeps, turns_at
from .rounds import endless, repeat

__all__ = ["SAME_FRAME", "SCREW_AXIS", "TURN_AXES", "WHOLE_TURN", "Marks", "Source", "distinct"]


@dataclass(frozen=True, eq=False)
class Source(Keyed):
    """The keys of one slot, and the segments that run between them."""

    shaping: np.ndarray | None = None
    """The frames of the keys that segments run between, where they are not those of the channels."""

    part: str | None = None
    """The part whose keys segments run between, where the others have keys on frames of their own."""

    whole: Source | None = None
    """The source that it is a part of."""

    beside: Callable[[np.ndarray], np.ndarray] | None = None
    """From frames (m,) to how a body turns and grows of which this is the location: what its channels are to have."""

    @cached_property
    def is_together(self) -> bool:
        """Return whether all channels have their keys on the same frames, and go through them once."""
        return len(self.channels) == 1 and self.cyclic is None and self.shaping is None and self.part is None

    @cached_property
    def frames_of(self) -> dict[str, np.ndarray]:
        """The frames of the keys of each part that changes and has two at least, without keys that are one."""
        if self.is_together:
            return dict.fromkeys(self.changing, self.curves[0].times)
        times: dict[str, list[np.ndarray]] = {}
        for rows, keys in self.channels:
            for part in {PART_OF[row] for row in rows} & self.changing:
                times.setdefault(part, []).append(keys.times)
        frames = {part: distinct(np.unique(np.concatenate(several))) for part, several in times.items()}
        frames = {part: of_part for part, of_part in frames.items() if len(of_part) > 1}
        if frames and ROTATION in self.changing:
            # What only turns of the channel move goes along with the others.
            frames.setdefault(ROTATION, next(frames[part] for part in (LOCATION, SCALE, ROTATION) if part in frames))
        return frames

    @cached_property
    def is_uneven(self) -> bool:
        """Return whether the parts that change have keys on different frames: each then runs between its own."""
        first, *others = self.frames_of.values() or [np.empty(0)]
        differs = (len(first) != len(other) or np.abs(first - other).max() > SAME_FRAME for other in others)
        return self.part is None and any(differs)

    @cached_property
    def parts(self) -> dict[str, Source]:
        """The source between the keys of each of the parts that change, of one that is uneven."""
        return {part: replace(self, part=part, whole=self) for part in self.frames_of}

    @cached_property
    def joint(self) -> np.ndarray:
        """Return which segments all parts that change have, shape (n - 1,): on a `path` those of all paths."""
        moments = self._starts[0]
        result = np.ones(len(moments), dtype=bool)
        if self.whole is not None:
            parts = self.whole.parts.values()
            frames = [part.key_frames if self.shaping is None else part.path.key_frames for part in parts]
            ends = [(keys, np.clip(np.searchsorted(keys, moments), 1, len(keys) - 1)) for keys in frames]
            bounds = np.array([(keys[at - 1], keys[at]) for keys, at in ends])
            result = np.all(np.ptp(bounds, axis=0) <= SAME_FRAME, axis=0)
            if self.is_linear:
                # It goes on outside of its keys, where others may have keys of theirs.
                result[[0, -1]] &= [np.ptp([keys[end] for keys in frames]) <= SAME_FRAME for end in (0, -1)]
        return result

    @property
    def is_joint_beside(self) -> np.ndarray:
        """Return whether the segments before and behind each are joint, as far as there are any, shape (n - 1,)."""
        around = np.concatenate(((True,), self.joint, (True,)))
        return around[:-2] & around[2:]

    @cached_property
    def counting(self) -> np.ndarray:
        """Which components say how far a segment has come, shape (10, n - 1)."""
        own = np.array([self.part in (None, part) for part in PART_OF])
        return own[:, None] | self.joint

    @cached_property
    def key_frames(self) -> np.ndarray:
        """Frames of the keys of the parts that change, or else of all, without keys that are one to Blender, (n,).

        Segments run between them; on a `path` only between those that shape it.
        """
        if self.shaping is not None:
            return self.shaping
        if self.is_together:
            return self.curves[0].times
        if self.part is not None:
            return self.frames_of[self.part]
        return distinct(np.unique(np.concatenate([*self.frames_of.values()] or [self.keyed_frames])))

    @cached_property
    def is_repeatable(self) -> bool:
        """Return whether the motion in every round of its cycles is that in the first."""
        return self.cyclic is None or repeat(self.channels, self.cyclic, self.order)

    @cached_property
    def endless(self) -> Source:
        """Source with cycles that have no end."""
        return self if self.cyclic is None else replace(self, channels=endless(self.channels))

    @cached_property
    def looped(self) -> Source:
        """Source with a segment more on either side, where a mode looks over the seam of endless rounds."""
        if self.cyclic is None or self.cyclic.cycles is None or not self.is_smooth or len(self.key_frames) < 2:
            return self
        keys, cycles = self.key_frames, self.cyclic.cycles.endless
        first, last = keys[1] - keys[0], keys[-1] - keys[-2]
        before, after = first if cycles.before == "MIRROR" else last, last if cycles.after == "MIRROR" else first
        return replace(self.endless, shaping=np.array((keys[0] - before, *keys, keys[-1] + after)))

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The frames on which the channels have the values of the first and second keys of segments, (n - 1,) each.

        They are other ones than those of the segments where a cycle jumps.
        """
        starts, ends = self.key_frames[:-1].copy(), self.key_frames[1:].copy()
        if self.shaping is not None and self.cyclic is not None and self.cyclic.cycles is not None:
            if self.cyclic.cycles.after == "REPEAT":
                starts[-1] = starts[1]
            if self.cyclic.cycles.before == "REPEAT":
                ends[0] = ends[-2]
        return starts, ends

    def folded(self, frames: np.ndarray) -> np.ndarray:
        """Return frames (m,) folded back into the first round of its cycles, as they are where there are none."""
        return frames if self.cyclic is None else cycled(self.cyclic, frames)[0]

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
        """Return the numbers of the modes at these frames, (m,)."""
        return self.mode.at(frames) if isinstance(self.mode, Marks) else np.full(len(frames), self.mode)

    def mode_at(self, frame: float) -> int:
        """Return the number of the mode of the segment that a frame is in: of the first or the last one outside of all.

        A mode that begins within a segment does not act there.
        """
        segment = int(np.searchsorted(self.key_frames, self.folded(np.array((frame,)))[0], side="right")) - 1
        return int(self.modes[min(max(segment, 0), len(self.modes) - 1)])

    @cached_property
    def axes_of_turns(self) -> np.ndarray:
        """The axis that turns of each segment are about, of `TURN_AXES`, shape (n - 1,)."""
        if isinstance(self.turns_axis, Marks):
            return np.array(TURN_AXES)[self.turns_axis.at(self._starts[0])]
        return np.full(len(self._starts[0]), self.turns_axis)

    @cached_property
    def turns_with_keys(self) -> np.ndarray:
        """Return whether both ends of a segment are neighbouring keys of the rotation, shape (n - 1,)."""
        if self.part in (None, ROTATION) or ROTATION not in self.frames_of:
            return np.full(len(self._starts[0]), self.part in (None, ROTATION))
        keys = self.frames_of[ROTATION]
        at = np.searchsorted(keys, self.key_frames - SAME_FRAME)
        hits = np.abs(keys[np.minimum(at, len(keys) - 1)] - self.key_frames) <= SAME_FRAME
        return hits[:-1] & hits[1:] & (np.diff(at) == 1)

    @cached_property
    def segment_turns(self) -> np.ndarray:
        """The turns more of each segment that is not Blender's own, whole ones but for inserted keys, (n - 1,)."""
        if self.turns is None:
            return np.zeros(len(self._starts[0]))
        turns = turns_at(self.turns, self._starts[0])
        return np.where((self.modes == 0) | ~self.turns_with_keys, 0.0, turns)

    @property
    def run_backwards(self) -> np.ndarray:
        """Return whether cycles run through a segment backwards, shape (n - 1,)."""
        return self._starts[1]

    @cached_property
    def has_half_turns(self) -> bool:
        """Return whether an angle goes by half a turn or more from one of its keys to the next."""
        if self.order is None:
            return False
        if self.order == AXIS_ANGLE:
            angles = self.values_at(self.frames_of.get(ROTATION, self.key_frames))[ROWS[ROTATION]]
            return bool(np.abs(sweeps(angles[:, :-1], angles[:, 1:])).max(initial=0.0) >= HALF_TURN)
        return any(
            3 <= row < 6 and np.abs(np.diff(values)).max(initial=0.0) >= HALF_TURN
            for rows, keys in self.channels
            for row, values in zip(rows, keys.values, strict=True)
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
    def is_common(self) -> np.ndarray:
        """Return which keys all parts that change have, shape (n,)."""
        result, parts = np.ones(len(self.key_frames), dtype=bool), {} if self.whole is None else self.whole.frames_of
        for frames in parts.values():
            near = np.clip(np.searchsorted(frames, self.key_frames - SAME_FRAME), 0, len(frames) - 1)
            result &= np.abs(frames[near] - self.key_frames) <= SAME_FRAME
        return result

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
        return bool(np.any(self.modes))

    @cached_property
    def seen_range(self) -> tuple[int, int]:
        """The first and last whole frame that anything is seen on, also where it goes on outside of its keys."""
        first, last = self.keyed_range
        if self.seen is not None and self.goes_on:
            first, last = min(first, self.seen[0]), max(last, self.seen[1])
        return math.floor(first), math.ceil(last)

    @cached_property
    def filled_rows(self) -> list[int]:
        """The rows of the components that the modes change."""
        parts = (self.keyed & self.changing) - (frozenset() if self.uniform_scale else {SCALE})
        parts = parts if self.part is None else parts & {self.part}
        has_six = self.order in (None, AXIS_ANGLE)
        rows = (row for row in range(10) if PART_OF[row] in parts and (row != 6 or has_six))
        return [row for row in rows if row not in self.driven]

    @cached_property
    def uniform_scale(self) -> bool:
        """Return whether the scale is animated, at every key the same along all axes and positive: else it is left."""
        if SCALE not in self.keyed or SCALE not in self.frames_of:
            return False
        x, y, z = self.values_at(self.frames_of[SCALE])[ROWS[SCALE]]
        return bool(np.allclose(x, y) and np.allclose(x, z) and np.all(x > 0.0) and np.ptp(x) > 0.0)

    def values_at(self, frames: np.ndarray) -> np.ndarray:
        """Return what the channels alone have on these frames, shape (10, m)."""
        return values_of([self], [frames])[0]

    @cached_property
    def holds(self) -> np.ndarray:
        """Return whether all channels hold their value throughout a segment, shape (n - 1,)."""
        codes, counts = self._interpolations
        return np.all((codes == CONSTANT) | ~counts, axis=0)

    @cached_property
    def has_handles(self) -> np.ndarray:
        """Return whether handles shape a segment, and no easing does nor a hold, shape (n - 1,)."""
        codes, counts = self._interpolations
        is_bezier = counts & (codes == BEZIER)
        return np.all((codes == LINEAR) | is_bezier | ~counts, axis=0) & np.any(is_bezier, axis=0)

    @cached_property
    def _interpolations(self) -> tuple[np.ndarray, np.ndarray]:
        """The codes of keys that segments run on from, and which of them have a say, (channels, n - 1) each."""
        starts, codes = self.key_frames[:-1] + SAME_FRAME, []
        for keys in self.curves:
            at = starts if keys.cycles is None else cycled(keys, starts)[0]
            codes.append(keys.interpolation[:, np.clip(np.searchsorted(keys.times, at, side="right") - 1, 0, None)])
        return np.concatenate(codes), self.counting[[row for rows, _ in self.channels for row in rows]]


def each(sources: Sequence[Source], counts: Iterable[int]) -> list[tuple[Source, slice]]:
    """Return each source with the span of what it has this many of."""
    bounds = [0, *itertools.accumulate(counts)]
    return [(source, slice(*span)) for source, span in zip(sources, itertools.pairwise(bounds), strict=True)]


def sampled(
    samples: list[tuple[Source, slice]],
    frames: Sequence[np.ndarray],
    *,
    unit_elastic: bool = False,
    exact: bool = True,
) -> np.ndarray:
    """Return the channels' own values at the frames of each source, m in all, (10, m). What it does not key rests.

    Frames are taken as they are where `exact`, otherwise as Blender does.
    """
    rows = np.empty((10, samples[-1][1].stop if samples else 0))
    curves, times, out, apart = [], [], [], []
    for (source, span), at in zip(samples, frames, strict=True):
        rows[:, span] = REST[:, None]
        if source.order is not None:
            rows[3, span] = 0.0
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
    evaluate(curves, times, unit_elastic=unit_elastic, exact=exact, out=out)
    for keyed_rows, span, values in apart:
        rows[keyed_rows, span] = values
    return rows


def values_of(sources: Sequence[Source], frames: Sequence[np.ndarray], *, exact: bool = False) -> list[np.ndarray]:
    """Return what the channels of each source alone have on frames of its own, shape (10, m)."""
    samples = each(sources, map(len, frames))
    rows = sampled(samples, frames, exact=exact)
    return [rows[:, span] for _, span in samples]
