"""Motion of held objects in the world: in each holder in turn, and blended from one holder to the next.

Holders that move by keys alone are computed from these; for others, places recorded by `records` are used.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import bpy
import numpy as np

from ...animation.evaluation.sources import HoldRun, KeyedTransform
from ...animation.holds.holders import Holder, holders_of
from ...animation.transforms import Transform, transform_of
from ...blender import existing
from ...motion.affine import AffineMaps
from .blends import blended, smoothstep
from .kinds import Space, space_of
from .parents import CarriedTargets, Parents, identity, maps_of
from .points import PASSING_HOLDER, Piece
from .records import PlaceRecord, record_of
from .seen import SeenMotion


class HeldMotion(SeenMotion):
    """The motion of an object or bone that is held at times. Its path is in the world."""

    def __init__(self, target: Transform, source: KeyedTransform, carried: CarriedTargets, space: Space) -> None:
        super().__init__(target, source, carried, space)
        context: Any = bpy.context
        self._scene, self._depsgraph = context.scene, context.view_layer.depsgraph
        self._channel_space, self.in_world, self.space = maps_of(space.matrix), True, identity()
        self._holders = {
            holder.number: (self._read(holder, carried), maps_of(holder.offset))
            for holder in holders_of(target)
            if holder.target is not None
        }
        by_keys = [holder for holder, _ in self._holders.values() if isinstance(holder, Parents)]
        self.carriers = self._parents.carriers.union(*(holder.carriers for holder in by_keys))
        self.ids = frozenset(self._parents.ids).union(*(holder.ids for holder in by_keys))
        seen = [holder for holder, _ in self._holders.values() if isinstance(holder, PlaceRecord)]
        self.records = tuple((record, record.version) for record in seen)
        # Where the holder changes at once, two neighbouring frames show both places.
        self.jumps = tuple(moment for switch in source.switches for moment in (switch.begin, switch.frame - 1e-3))

    def _read(self, holder: Holder, carried: CarriedTargets) -> Parents | PlaceRecord:
        target: Any = holder.target
        transform = transform_of((target.pose.bones.get(holder.bone) if holder.bone else None) or target)
        parents = Parents(transform, carried, itself=True)
        if parents.known:
            return parents
        return record_of(transform, self._scene.frame_current_final, self._depsgraph)

    @property
    def has_path(self) -> bool:
        """Return whether it is seen where its keys put it: in a tweaked NLA strip it has no path."""
        return not existing(self.target.animated.animation_data).use_tweak_mode

    @property
    def range(self) -> tuple[int, int]:
        """The first and last whole frame of its path, extended to the scene's range at an end where it is held."""
        (first, last), ends = self.source.seen_range, self.source.keyed_range
        if self.source.hold_at(ends[0])[0]:
            first = min(first, self._scene.frame_start)
        if self.source.hold_at(ends[1])[0]:
            last = max(last, self._scene.frame_end)
        return first, last

    @property
    def digest(self) -> tuple:
        space = (
            b"" if self._parents.known else self._channel_space.axes.tobytes() + self._channel_space.origins.tobytes()
        )
        return (
            self._parents.digest,
            space,
            *(
                (number, getattr(one, "digest", None), offset.axes.tobytes(), offset.origins.tobytes())
                for number, (one, offset) in sorted(self._holders.items())
            ),
            *((record.transform.identity if record.transform else (), version) for record, version in self.records),
        )

    def places(self, frames: np.ndarray, mode: str | None = None) -> AffineMaps:
        result, source = identity(len(frames)), self.source
        for run in source.runs:
            first = -np.inf if run is source.runs[0] else run.stretch.first
            self._place(result, run, frames, (frames >= first) & (frames < run.stretch.until), mode)
        for switch, run in zip(source.switches, source.runs[1:], strict=True):
            passing = (frames >= switch.begin) & (frames < switch.frame)
            if passing.any():
                there = identity(len(frames))
                self._place(there, run, frames, passing, mode)
                over = (frames[passing] - switch.begin) / (switch.there - switch.begin)
                result[passing] = blended(result[passing], there[passing], smoothstep(np.minimum(over, 1.0)))
        return result

    def _place(
        self, result: AffineMaps, run: HoldRun, frames: np.ndarray, chosen: np.ndarray, mode: str | None
    ) -> None:
        """Write the places of a run on the chosen frames of (n,) into a result (n,)."""
        if chosen.any():
            spaces = self._space_of(self.source.hold_at(run.stretch.first)[0], frames[chosen])
            result[chosen] = self._placed(run.source, run.moments(frames[chosen]), mode, *spaces)

    def _space_of(self, number: int, frames: np.ndarray) -> tuple[AffineMaps, np.ndarray | None]:
        """Return the same as `Parents.spaces` for frames (n,), for keys in the holder of this number."""
        held = self._holders.get(number)
        if held is not None:
            holder, offset = held
            return (holder.places(frames) if isinstance(holder, Parents) else holder.maps(frames)) @ offset, None
        if self._parents.known:
            return self._parents.spaces(frames)
        return identity(len(frames)) @ self._channel_space, self._turn

    def spaces(self, frames: np.ndarray) -> tuple[AffineMaps, np.ndarray]:
        maps, numbers = identity(len(frames)), np.array([self.source.hold_at(frame)[0] for frame in frames.tolist()])
        turns = maps.axes.copy()
        for number in np.unique(numbers).tolist():
            chosen = numbers == number
            maps[chosen], turn = self._space_of(number, frames[chosen])
            turns[chosen] = np.eye(3) if turn is None else turn
        return maps, turns

    def holders_at(self, frames: np.ndarray) -> np.ndarray:
        """Return the numbers of its holders on frames (n,), PASSING_HOLDER between two of them."""
        numbers = np.zeros(len(frames), dtype=int)
        for run in self.source.runs:
            at = frames >= run.stretch.first if run is not self.source.runs[0] else np.ones(len(frames), dtype=bool)
            numbers[at] = self.source.hold_at(run.stretch.first)[0]
        for switch in self.source.switches:
            numbers[(frames >= switch.begin) & (frames < switch.frame)] = PASSING_HOLDER
        return numbers

    def pieces(self, frames: np.ndarray) -> tuple[Piece, ...]:
        """Return the pieces of a path with points on frames (n,); each goes on to the beginning of the next."""
        holders = self.holders_at(frames)
        bounds = [0, *(np.flatnonzero(np.diff(holders)) + 1).tolist(), len(holders) - 1]
        return tuple(Piece(first, last, int(holders[first])) for first, last in pairwise(bounds) if last > first)


def motion_of(target: Transform, source: KeyedTransform, carried: CarriedTargets, space: Space) -> SeenMotion:
    """Return the motion of a target with keys: carried by its parents, or by its holders if it has any."""
    is_held = source.held is not None and any(source.hold_at(run.stretch.first)[0] for run in source.runs)
    return (HeldMotion if is_held else SeenMotion)(target, source, carried, space)


def motion_now(target: Transform, depsgraph: bpy.types.Depsgraph) -> SeenMotion:
    """Return the motion of a target that has a path, read anew."""
    carried = CarriedTargets()
    source = existing(carried.read([target])[target][1])
    return motion_of(target, source, carried, space_of(target, depsgraph))
