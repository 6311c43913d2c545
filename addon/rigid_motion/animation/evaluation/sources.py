"""Sources: the keyed location, rotation and scale channels of one slot and their modes, as arrays.

A source is read, never written. Its digest changes whenever anything changes that its motion depends on. Frames are
those of the Action. Values are in the channels' own units.

A key of any part that modes fill is a key of the whole body: channels without a key there use the values of their
curves.
"""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..fcurves.evaluation import evaluate
from ..fcurves.keys import BEZIER, CONSTANT, LINEAR, Keys, cycled
from .components import AXIS_ANGLE, DEPENDS_ON_KEYS, PART_OF, REST_COMPONENTS, ROTATION, ROWS, SCALE, SMOOTH_MODES
from .marks import (
    FULL_TURN,
    HALF_TURN,
    SAME_FRAME,
    SCREW_AXIS,
    TURN_AXES,
    WHOLE_TURN,
    Marks,
    distinct,
    sweeps,
    turns_at,
    which_vary,
)
from .runs import MOST_FRAMES, Stretch, Switch, keys_in, resting_in, stretches_of, switches_of

__all__ = ["SAME_FRAME", "SCREW_AXIS", "TURN_AXES", "WHOLE_TURN", "KeyedTransform", "Marks", "distinct"]

OUTSIDE_REACH_FRAMES = 12.0
"""Frames sampled outside of the visible range. A Stepped modifier with no more frames can be added without replanning.
"""


@dataclass(frozen=True, eq=False)
class KeyedTransform:
    """The keys of one slot, the rest values of its unkeyed components, and the segments between keys."""

    order: str | None
    """The order of Euler angles, AXIS_ANGLE, or None for quaternions."""

    keyed: frozenset[str]
    """The parts (location, rotation, scale) that are keyed in at least one component, or turned."""

    channels: tuple[tuple[list[int], Keys], ...]
    """The channels with keys, grouped if keyed together: their rows among the components, and their keys."""

    rest: dict[int, float]
    """The values of components without keys, in parts that are keyed, by row."""

    original: np.ndarray
    """An object's own delta transforms as components, shape (10,): modes act on the motion including them."""

    mode: int | Marks
    """The number of the mode of all segments, or the numbers from given frames on. 0 is Blender's own."""

    turns: Keys | None = None
    """The Turns channel: extra whole turns of segments from the frames of its keys on; None if it has no effect."""

    turns_axis: str | Marks = SCREW_AXIS
    """One of `TURN_AXES`, or indices into it."""

    location_axes: np.ndarray | None = None
    """The axes that location runs along, as columns (3, 3) in the body's axes at rest; None if both are the same."""

    seen: tuple[int, int] | None = None
    """The first and last frame that scenes and strips show."""

    reach: float = OUTSIDE_REACH_FRAMES
    """The largest number of frames outside of `seen` that motion blur and Stepped modifiers sample."""

    driven: frozenset[int] = frozenset()
    """The rows of components that drivers move, or whose channels are muted: to the other rows they are at rest."""

    held: Marks | None = None
    """The holders of keys from given frames on, see `actions.marks.hold`; None if all keys are in the space of
    the channels."""

    shaping: np.ndarray | None = None
    """The frames of the keys that segments run between, if these are not the frames of the channels' keys."""

    carried: tuple[int, int] | None = None
    """The first and last frame on which its base moves, if it is the offset of a layer."""

    @cached_property
    def digest(self) -> str:
        """Differs whenever something differs that the motion depends on."""
        summary = hashlib.blake2b(digest_size=16)
        for rows, keys in self.channels:
            summary.update(bytes(rows))
            summary.update(keys.raw)
        # The rest location does not affect the motion.
        rest = {row: value for row, value in self.rest.items() if row >= ROWS[ROTATION].start}
        seen = (self.seen, self.reach) if self.goes_on and self.cyclic is None else None
        summary.update(repr((self.order, sorted(self.keyed), rest, self.mode, sorted(self.driven), seen)).encode())
        summary.update(self.original[ROWS[ROTATION]].tobytes())
        if self.location_axes is not None:
            summary.update(self.location_axes.tobytes())
        if self.turns is not None:
            summary.update(self.turns.raw + repr(self.turns_axis).encode())
        if self.held is not None:
            summary.update(repr(self.held).encode())
        return summary.hexdigest()

    @property
    def digest24(self) -> int:
        """The first 24 bits of the digest."""
        return int(self.digest[:6], 16)

    @cached_property
    def curves(self) -> list[Keys]:
        """The keys of all channels that have any."""
        return [keys for _, keys in self.channels]

    @cached_property
    def key_count(self) -> int:
        """The number of keys in all channels."""
        return sum(keys.interpolation.size for keys in self.curves)

    @cached_property
    def changing(self) -> frozenset[str]:
        """The parts changed by turns, or by channels with more than one value."""
        parts = {
            PART_OF[row]
            for rows, keys in self.channels
            for row, varies in zip(rows, which_vary(keys).tolist(), strict=True)
            if varies
        }
        if ROTATION in self.keyed and self.turns is not None and self.turns.values.any():
            parts.add(ROTATION)
        return frozenset(parts)

    @cached_property
    def keyed_frames(self) -> np.ndarray:
        """Frames on which any channel has one of the animator's keys, shape (k,)."""
        return np.unique(np.concatenate([np.empty(0), *(keys.times for keys in self.curves)]))

    @cached_property
    def keyed_range(self) -> tuple[float, float]:
        """The first and the last frame with a key."""
        return min(float(keys.times[0]) for keys in self.curves), max(float(keys.times[-1]) for keys in self.curves)

    @cached_property
    def goes_on(self) -> bool:
        """Return whether any channel continues outside of its keys, by cycles or with its slope."""
        return any(keys.linear or keys.cycles is not None for keys in self.curves)

    @cached_property
    def is_linear(self) -> bool:
        """Return whether the motion continues with its slope outside of its keys."""
        return self.cyclic is None and any(keys.linear for keys in self.curves)

    @cached_property
    def is_smooth(self) -> bool:
        """Return whether any of its modes looks at the keys next to a segment."""
        return bool(np.isin(self.mode.numbers if isinstance(self.mode, Marks) else self.mode, SMOOTH_MODES).any())

    @cached_property
    def cyclic(self) -> Keys | None:
        """The keys of the first channel that changes and repeats."""
        return next((keys for keys in self.curves if keys.cycles is not None and which_vary(keys).any()), None)

    @cached_property
    def key_frames(self) -> np.ndarray:
        """Frames of the keys that segments run between, merging keys that are one to Blender, (n,).

        These are the frames of channels that the modes change, or else of all; on a `path`, only those that shape it.
        """
        if self.shaping is not None:
            return self.shaping
        frames = distinct(np.unique(np.concatenate([np.empty(0), *(keys.times for keys in self.filled_curves)])))
        return frames if len(frames) > 1 else distinct(self.keyed_frames)

    @cached_property
    def filled_curves(self) -> list[Keys]:
        """The keys of the channels that the modes change, and of any channels keyed together with them."""
        filled = set(self.filled_rows)
        return [keys for rows, keys in self.channels if not filled.isdisjoint(rows)]

    @cached_property
    def is_repeatable(self) -> bool:
        """Return whether every round of its cycles has the same motion as the first."""
        return self.cyclic is None or repeat(self.channels, self.cyclic, self.order)

    @cached_property
    def looped(self) -> KeyedTransform:
        """Source with one more segment on either side, if a mode looks across the seam of endless cycles."""
        if self.cyclic is None or self.cyclic.cycles is None or not self.is_smooth or len(self.key_frames) < 2:
            return self
        endless = tuple(
            (rows, keys if keys.cycles is None else replace(keys, cycles=keys.cycles.endless))
            for rows, keys in self.channels
        )
        keys, cycles = self.key_frames, self.cyclic.cycles.endless
        first, last = keys[1] - keys[0], keys[-1] - keys[-2]
        before, after = first if cycles.before == "MIRROR" else last, last if cycles.after == "MIRROR" else first
        return replace(self, channels=endless, shaping=np.array((keys[0] - before, *keys, keys[-1] + after)))

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The frames at which the channels have the values of the first and second key of each segment, (n - 1,) each.

        Where a cycle jumps, these are not the frames of the segment itself.
        """
        starts, ends = self.key_frames[:-1].copy(), self.key_frames[1:].copy()
        if self.shaping is not None and self.cyclic is not None and self.cyclic.cycles is not None:
            if self.cyclic.cycles.after == "REPEAT":
                starts[-1] = starts[1]
            if self.cyclic.cycles.before == "REPEAT":
                ends[0] = ends[-2]
        return starts, ends

    def folded(self, frames: np.ndarray) -> np.ndarray:
        """Return frames (m,) folded back into the first round of cycles; unchanged if there are no cycles."""
        return frames if self.cyclic is None else cycled(self.cyclic, frames)[0]

    @cached_property
    def modes(self) -> np.ndarray:
        """The number of the mode of each segment, shape (n - 1,)."""
        return self.modes_at(self._starts[0])

    @cached_property
    def _starts(self) -> tuple[np.ndarray, np.ndarray]:
        """A moment just inside each segment, folded by cycles, and whether they run backwards there, (n - 1,) each."""
        # In a copy that runs backwards, this moment is just before the end of the original segment.
        starts = self.key_frames[:-1] + SAME_FRAME
        return (starts, np.zeros(len(starts), dtype=bool)) if self.cyclic is None else cycled(self.cyclic, starts)

    def modes_at(self, frames: np.ndarray) -> np.ndarray:
        """Return the numbers of the modes at these frames, (m,)."""
        return self.mode.at(frames) if isinstance(self.mode, Marks) else np.full(len(frames), self.mode)

    def mode_at(self, frame: float) -> int:
        """Return the number of the mode of the segment at a frame; outside of all keys, of the outermost segment.

        A mode that begins within a segment does not act there.
        """
        segment = int(np.searchsorted(self.key_frames, self.folded(np.array((frame,)))[0], side="right")) - 1
        return int(self.modes[min(max(segment, 0), len(self.modes) - 1)])

    @cached_property
    def axes_of_turns(self) -> np.ndarray:
        """The axis of each segment's turns, one of `TURN_AXES`, shape (n - 1,)."""
        if isinstance(self.turns_axis, Marks):
            return np.array(TURN_AXES)[self.turns_axis.at(self._starts[0])]
        return np.full(len(self._starts[0]), self.turns_axis)

    @cached_property
    def segment_turns(self) -> np.ndarray:
        """The extra turns of each segment, 0 in Blender's own mode; whole unless keys were inserted, (n - 1,)."""
        if self.turns is None or ROTATION not in self.keyed:
            return np.zeros(len(self._starts[0]))
        turns = turns_at(self.turns, self._starts[0])
        return np.where(self.modes == 0, 0.0, turns)

    @property
    def run_backwards(self) -> np.ndarray:
        """Return whether cycles run through a segment backwards, shape (n - 1,)."""
        return self._starts[1]

    @cached_property
    def has_half_turns(self) -> bool:
        """Return whether an angle changes by half a turn or more from one key to the next."""
        if self.order is None or len(self.key_frames) < 2:
            return False
        angles = self.values_at(self.key_frames)[ROWS[ROTATION]]
        first, second = angles[:, :-1], angles[:, 1:]
        by = sweeps(first, second) if self.order == AXIS_ANGLE else (second - first)[:3]
        return bool(np.abs(by).max() >= HALF_TURN)

    @cached_property
    def on_path(self) -> np.ndarray:
        """Return which keys lie on the path between the neighbouring keys instead of shaping it, shape (n,).

        These are breakdowns in all filled channels with a key there. They lie between keys of one mode, whose path
        depends on its keys and turns the shortest way.
        """
        passed = np.zeros(len(self.key_frames), dtype=bool)
        goes_the_shortest_way = self.turns is None and not self.has_half_turns
        if self.cyclic is None and goes_the_shortest_way and any(keys.breakdowns is not None for keys in self.curves):
            modes = self.modes
            passed[1:-1] = np.isin(modes[1:], DEPENDS_ON_KEYS) & (modes[1:] == modes[:-1])
            for keys in self.filled_curves:
                shaping = keys.times if keys.breakdowns is None else keys.times[~keys.breakdowns]
                passed &= ~np.isin(self.key_frames, shaping)
        return passed

    @cached_property
    def path(self) -> KeyedTransform:
        """Source without the keys that are `passed`, but otherwise the same."""
        if not self.on_path.any():
            return self
        # Channels keep these keys: without them, a channel that has no key on other frames would be elsewhere.
        return replace(self, shaping=self.key_frames[~self.on_path])

    @cached_property
    def is_live(self) -> bool:
        """Return whether any segment is filled differently from Blender's own in-betweens."""
        if not self.curves or len(self.key_frames) < 2:
            return False
        return bool(self.switches) or bool(np.any(self.modes))

    @cached_property
    def switches(self) -> tuple[Switch, ...]:
        """The switches from one holder to another."""
        return switches_of(self.keyed_frames, self.held)

    @cached_property
    def runs(self) -> list[HoldRun]:
        """The stretches of keys with the same holder, in order; a single one if there are no switches."""
        stretches = stretches_of(self.keyed_frames, self.switches, is_linear=self.is_linear)
        return [HoldRun(stretch, self._restricted_to(stretch)) for stretch in stretches]

    def hold_at(self, frame: float) -> tuple[int, int]:
        """Return the number of the holder of a key on a frame, 0 for none, and how many frames the switch takes."""
        if self.held is None:
            return 0, 0
        number, frames = divmod(int(self.held.at(np.array([frame + 0.5 * SAME_FRAME]))[0]), MOST_FRAMES + 1)
        return number, frames

    def run_at(self, frame: float) -> HoldRun:
        """Return the run whose motion is shown on a frame."""
        return next((run for run in self.runs if frame < run.stretch.until), self.runs[-1])

    def _restricted_to(self, stretch: Stretch) -> KeyedTransform:
        """Return the source with the keys of a stretch alone; channels without a key there rest."""
        channels, rest = [], dict(self.rest)
        for rows, keys in self.channels:
            if (part := keys_in(keys, stretch)) is not None:
                channels.append((rows, part))
            else:
                rest.update(zip(rows, resting_in(keys, stretch).tolist(), strict=True))
        # In a holder, location has no axes of its own, unlike under the parent of a bone.
        axes = None if self.hold_at(stretch.first)[0] else self.location_axes
        return replace(self, channels=tuple(channels), rest=rest, held=None, seen=None, location_axes=axes)

    @cached_property
    def seen_range(self) -> tuple[int, int]:
        """The first and last whole frame that is shown, including frames outside of the keys if motion goes on."""
        first, last = self.keyed_range
        if self.seen is not None and self.goes_on:
            first, last = min(first, self.seen[0]), max(last, self.seen[1])
        if self.carried is not None:
            first, last = min(first, self.carried[0]), max(last, self.carried[1])
        return math.floor(first), math.ceil(last)

    @property
    def goes_on_to(self) -> tuple[float, float]:
        """The outermost frames to which terms extend a motion that continues with its slope."""
        assert self.seen is not None
        return self.seen[0] - self.reach, self.seen[1] + self.reach

    @cached_property
    def filled_rows(self) -> list[int]:
        """The rows of the components that the modes change."""
        parts = (self.keyed & self.changing) - (frozenset() if self.uniform_scale else {SCALE})
        has_six = self.order in (None, AXIS_ANGLE)
        rows = (row for row in range(10) if PART_OF[row] in parts and (row != 6 or has_six))
        return [row for row in rows if row not in self.driven]

    @cached_property
    def uniform_scale(self) -> bool:
        """Return whether the scale is animated, and on every key uniform and positive; other scales are left alone."""
        if SCALE not in self.keyed & self.changing:
            return False
        x, y, z = self.values_at(self.keyed_frames)[ROWS[SCALE]]
        return bool(np.allclose(x, y) and np.allclose(x, z) and np.all(x > 0.0) and np.ptp(x) > 0.0)

    def values_at(self, frames: np.ndarray) -> np.ndarray:
        """Return the channels' own values at these frames, shape (10, m)."""
        return values_of([self], [frames])[0]

    @cached_property
    def holds(self) -> np.ndarray:
        """Return whether all channels hold their value throughout a segment, shape (n - 1,)."""
        return np.all(self._interpolations == CONSTANT, axis=0)

    @cached_property
    def has_handles(self) -> np.ndarray:
        """Return whether handles shape a segment without easing or holding keys, shape (n - 1,)."""
        is_bezier = self._interpolations == BEZIER
        return np.all(is_bezier | (self._interpolations == LINEAR), axis=0) & np.any(is_bezier, axis=0)

    @cached_property
    def _interpolations(self) -> np.ndarray:
        """The interpolation codes at the start of segments, for channels that modes change or else all, (., n - 1)."""
        starts, codes = self.key_frames[:-1] + SAME_FRAME, dict[int, np.ndarray]()
        for rows, keys in self.channels:
            at = starts if keys.cycles is None else cycled(keys, starts)[0]
            at = np.clip(np.searchsorted(keys.times, at, side="right") - 1, 0, None)
            codes.update(zip(rows, keys.interpolation[:, at], strict=True))
        return np.stack([codes[row] for row in self.filled_rows if row in codes] or [*codes.values()])


@dataclass(frozen=True, eq=False)
class HoldRun:
    """A stretch of keys with the same holder."""

    stretch: Stretch
    source: KeyedTransform
    """The source with these keys alone."""

    def moments(self, frames: np.ndarray) -> np.ndarray:
        """Return the frames of the run's own motion shown on frames (m,): it may rest outside of its keys."""
        first, last = self.source.keyed_range
        return np.clip(frames, -np.inf if self.stretch.comes else first, np.inf if self.stretch.goes else last)


def repeat(channels: tuple[tuple[list[int], Keys], ...], cyclic: Keys, order: str | None) -> bool:
    """Return whether every round has the same motion as the first; `cyclic` is one of the changing channels.

    This is so if all changing channels have the same cycles and range, and rounds with an offset add no rotation and no
    scale, or only rotation about a single axis.
    """
    cycles, ends = cyclic.cycles, cyclic.times[[0, -1]].tolist()
    assert cycles is not None
    changing = [(rows, keys) for rows, keys in channels if which_vary(keys).any()]
    if any(keys.cycles != cycles or keys.times[[0, -1]].tolist() != ends for _, keys in changing):
        return False
    if "REPEAT_OFFSET" not in (cycles.before, cycles.after):
        return True
    change, turning = np.zeros(10), 0
    for rows, keys in changing:
        change[rows] = keys.values[:, -1] - keys.values[:, 0]
        turning += int(np.count_nonzero(which_vary(keys)[[3 <= row < 7 for row in rows]]))
    if order is not None:
        # The axes of the other angles are fixed if a single one changes.
        angles = slice(3, 4) if order == AXIS_ANGLE else slice(3, 6)
        change[angles] -= FULL_TURN * np.rint(change[angles] / FULL_TURN) if turning > 1 else change[angles]
    return bool(np.abs(change[3:]).max() < 1e-6)


def each(sources: Sequence[KeyedTransform], counts: Iterable[int]) -> list[tuple[KeyedTransform, slice]]:
    """Return each source with the slice of its items, given the number of items of each."""
    bounds = [0, *itertools.accumulate(counts)]
    return [(source, slice(*span)) for source, span in zip(sources, itertools.pairwise(bounds), strict=True)]


def sampled(samples: list[tuple[KeyedTransform, slice]], frames: Sequence[np.ndarray]) -> np.ndarray:
    """Return the channels' own values at the frames of each source, m in all, (10, m). Unkeyed ones are at rest."""
    rows = np.empty((10, samples[-1][1].stop if samples else 0))
    curves, times, out, apart = [], [], [], []
    for (source, span), at in zip(samples, frames, strict=True):
        rows[:, span] = REST_COMPONENTS[:, None]
        if source.order is not None:
            rows[3, span] = 0.0
        for row, value in source.rest.items():
            rows[row, span] = value
        for keyed_rows, keys in source.channels:
            curves.append(keys)
            times.append(at)
            if keyed_rows[-1] - keyed_rows[0] < len(keyed_rows):
                out.append(rows[keyed_rows[0] : keyed_rows[-1] + 1, span])
            else:
                out.append(np.empty((len(keyed_rows), len(at))))
                apart.append((keyed_rows, span, out[-1]))
    evaluate(curves, times, out=out)
    for keyed_rows, span, values in apart:
        rows[keyed_rows, span] = values
    return rows


def values_of(sources: Sequence[KeyedTransform], frames: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the channels' own values of each source at its frames, shape (10, m)."""
    samples = each(sources, map(len, frames))
    rows = sampled(samples, frames)
    return [rows[:, span] for _, span in samples]
