"""The path of something that is held: in the world, run by run in the space of what holds it, and over what it passes.

Holders that move by keys alone are worked out from these; others are where they were seen, see `records`.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import bpy
import numpy as np

from ...animation.baking.motions import shown
from ...animation.evaluation.components import MODE_NUMBERS
from ...animation.evaluation.sources import HoldRun, KeyedTransform
from ...animation.holds.holders import Holder, holders_of
from ...animation.transforms import Transform, transform_of
from ...motion.affine import AffineMaps
from .blends import blended, smoothstep
from .ghosts import Ghosts, ghost_frames, in_space_of_path, matrices_of
from .kinds import space_of
from .parents import CarriedTargets, Parents, followed_parents, identity, maps_of
from .points import PASSING_HOLDER, DrawnPath, Piece, axis_frames, sample_frames, tick_frames
from .records import PlaceRecord, record_of


class HolderMotion:
    """What holds something, and where that carries it.

    Parameters
    ----------
    target : Transform
    source : Source
    carried : Carried
        That of all targets that are looked at together.
    """

    def __init__(self, target: Transform, source: KeyedTransform, carried: CarriedTargets) -> None:
        self.target, self.source = target, source
        context: Any = bpy.context
        self._scene, self._depsgraph = context.scene, context.view_layer.depsgraph
        self._parents = Parents(target, carried)
        self._space, self._turn = space_of(target, self._depsgraph)
        self._holders = {
            holder.number: (self._read(holder, carried), maps_of(holder.offset))
            for holder in holders_of(target)
            if holder.target is not None
        }
        ids = set(self._parents.ids)
        for holder, _ in self._holders.values():
            ids |= holder.ids if isinstance(holder, Parents) else set()
        self.ids = frozenset(ids)
        """Session ids of the data-blocks that decide on it."""

    def _read(self, holder: Holder, carried: CarriedTargets) -> Parents | PlaceRecord:
        target: Any = holder.target
        transform = transform_of((target.pose.bones.get(holder.bone) if holder.bone else None) or target)
        parents = Parents(transform, carried, itself=True)
        if parents.known:
            return parents
        return record_of(transform, self._scene.frame_current_final, self._depsgraph)

    @property
    def carriers(self) -> frozenset[Transform]:
        """All that carries it at any time, as far as that moves by keys."""
        holders = (holder.carriers for holder, _ in self._holders.values() if isinstance(holder, Parents))
        return self._parents.carriers.union(*holders)

    @property
    def records(self) -> tuple[tuple[PlaceRecord, int], ...]:
        """What is known as it was seen alone, and how often that has changed."""
        return tuple((one, one.version) for one, _ in self._holders.values() if isinstance(one, PlaceRecord))

    @property
    def range(self) -> tuple[int, int]:
        """The first and last whole frame of its path: where it is held there, those of the scene."""
        (first, last), ends = self.source.seen_range, self.source.keyed_range
        if self.source.hold_at(ends[0])[0]:
            first = min(first, self._scene.frame_start)
        if self.source.hold_at(ends[1])[0]:
            last = max(last, self._scene.frame_end)
        return first, last

    @property
    def digest(self) -> tuple:
        """Differs wherever anything differs that decides where it is carried."""
        space = b"" if self._parents.known else np.array(self._space).tobytes()
        return (
            self._parents.digest,
            space,
            tuple(self.target.motion.lead),
            *(
                (number, getattr(one, "digest", None), offset.axes.tobytes(), offset.origins.tobytes())
                for number, (one, offset) in sorted(self._holders.items())
            ),
            *((record.transform.identity if record.transform else (), version) for record, version in self.records),
        )

    def maps(self, frames: np.ndarray, mode: str | None) -> AffineMaps:
        """Return where it is in the world on rising frames (n,), with a mode in place of those of its segments."""
        result = identity(len(frames))
        source = self.source
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
        """Put where a run has it on the chosen ones of frames (n,) into a result (n,)."""
        if not chosen.any():
            return
        at, source = frames[chosen], run.source
        if mode is not None:
            source = replace(source, mode=MODE_NUMBERS[mode])
        maps = shown(self.target, source, run.moments(at))[1]
        spaces, turn = self._space_of(self.source.hold_at(run.stretch.first)[0], at)
        result[chosen] = spaces @ in_space_of_path(self.target, maps, turn)

    def _space_of(self, number: int, frames: np.ndarray) -> tuple[AffineMaps, np.ndarray | None]:
        """Return what `Parents.spaces` does for frames (n,) of keys in the holder of a number."""
        held = self._holders.get(number)
        if held is not None:
            holder, offset = held
            return (holder.places(frames) if isinstance(holder, Parents) else holder.maps(frames)) @ offset, None
        if self._parents.known:
            return self._parents.spaces(frames)
        return identity(len(frames)) @ maps_of(self._space), self._turn

    def spaces(self, frames: np.ndarray) -> tuple[AffineMaps, np.ndarray]:
        """Return the maps (n,) into the world, and the turns (n, 3, 3), of the spaces that keys on frames (n,) are in,
        see `Parents.spaces`.
        """
        maps, numbers = identity(len(frames)), np.array([self.source.hold_at(frame)[0] for frame in frames.tolist()])
        turns = maps.axes.copy()
        for number in np.unique(numbers).tolist():
            chosen = numbers == number
            maps[chosen], turn = self._space_of(number, frames[chosen])
            turns[chosen] = np.eye(3) if turn is None else turn
        return maps, turns

    def holders_at(self, frames: np.ndarray) -> np.ndarray:
        """Return the numbers of what holds it on frames (n,), PASSING where it passes."""
        numbers = np.zeros(len(frames), dtype=int)
        for run in self.source.runs:
            at = frames >= run.stretch.first if run is not self.source.runs[0] else np.ones(len(frames), dtype=bool)
            numbers[at] = self.source.hold_at(run.stretch.first)[0]
        for switch in self.source.switches:
            numbers[(frames >= switch.begin) & (frames < switch.frame)] = PASSING_HOLDER
        return numbers

    def trace(self, mode: str | None, tick_step: int, axis_length: float, selected: np.ndarray) -> DrawnPath | None:
        """Return its path in the world, see `points.trace`; None where it is one point."""
        keys = self.source.keyed_frames
        first, last = self.range
        if first == last:
            return None
        ticks = tick_frames(first, last, tick_step)
        # A thing that passes at once is in both places next to each other.
        jumps = [moment for switch in self.source.switches for moment in (switch.begin, switch.frame - 1e-3)]
        samples = np.unique(np.concatenate((sample_frames(first, last), keys, jumps)))
        frames = np.union1d(samples, ticks)
        on_samples, on_keys, on_ticks = (np.searchsorted(frames, some) for some in (samples, keys, ticks))
        native = self.maps(frames, "BLENDER")
        desired = native if mode == "BLENDER" else self.maps(frames, mode)
        lead = np.array(self.target.motion.lead)
        native, desired = (AffineMaps(maps.axes, maps.at(lead)) for maps in (native, desired))
        with_axes = axis_frames(ticks)
        axes = desired[np.searchsorted(frames, with_axes)]
        ends = axes.origins[:, None] + axis_length * np.moveaxis(axes.axes, -1, 1)
        return DrawnPath(
            frames=samples,
            native=native.origins[on_samples],
            desired=None if mode == "BLENDER" else desired.origins[on_samples],
            key_frames=keys,
            keys=desired.origins[on_keys],
            selected=np.isin(keys, selected),
            tick_frames=ticks,
            native_ticks=native.origins[on_ticks],
            desired_ticks=None if mode == "BLENDER" else desired.origins[on_ticks],
            axis_frames=with_axes,
            axes=np.stack((np.broadcast_to(axes.origins[:, None], ends.shape), ends), axis=2),
            in_world=True,
            pieces=pieces_of(self.holders_at(samples)),
        )

    def ghosts(self, step: int, mode: str | None) -> Ghosts:
        """Return where it is every few frames."""
        frames = ghost_frames(*self.range, step, self.source.keyed_frames)
        return Ghosts(frames, matrices_of(self.maps(frames, mode)), self.holders_at(frames))


def is_held(source: KeyedTransform) -> bool:
    """Return whether anything holds what has these keys at any time."""
    return source.held is not None and any(source.hold_at(run.stretch.first)[0] for run in source.runs)


def carrier_of(target: Transform, source: KeyedTransform, carried: CarriedTargets) -> HolderMotion | Parents | None:
    """Return what holds something with keys, or the parents that carry it if these move by keys; None for neither."""
    return HolderMotion(target, source, carried) if is_held(source) else followed_parents(target, carried)


def pieces_of(holders: np.ndarray) -> tuple[Piece, ...]:
    """Return the pieces of a path whose points (n,) have these holders; each goes on to the beginning of the next."""
    bounds = [0, *(np.flatnonzero(np.diff(holders)) + 1).tolist(), len(holders) - 1]
    return tuple(Piece(first, last, int(holders[first])) for first, last in pairwise(bounds) if last > first)
