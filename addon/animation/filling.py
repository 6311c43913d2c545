"""Writing in-betweens: delta transforms as sampled F-curves, in the slot that has the keys.

A sampled F-curve has a value on every whole frame and no keys: Blender alone evaluates it, and the Dope Sheet shows
nothing of it. The delta transforms that an object has of its own are remembered while in-betweens are in their place.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cache

import bpy
import numpy as np

from .inbetweens import Deltas, deltas
from .slots import GROUP, WIDTHS, Curves, Slot, curves_in, is_filled_in, is_replacing, slots_of
from .sources import LOCATION, ROTATION, SCALE, Source

FARTHEST = 1_000_000
"""Frames from 0 up to which Blender can show any."""

OWN = {
    "delta_location": ("own_location", 0),
    "delta_rotation_quaternion": ("own_quaternion", 1),
    "delta_rotation_euler": ("own_euler", 2),
    "delta_scale": ("own_scale", 3),
}
"""Each delta transform: where an object's own is remembered, and its place in `filled`."""


def fill_in(readings: Sequence[tuple[Slot, Curves, Source]]) -> None:
    """Compute and write the in-betweens of these slots."""
    for (slot, curves, source), delta in zip(readings, deltas([source for *_, source in readings]), strict=True):
        _write(slot, curves, _values(source, delta), source.frame_range)
        _record(slot, source.digest)


def is_complete(curves: Curves, source: Source) -> bool:
    """Whether all F-curves are there that the in-betweens of a source go into, from its first frame to its last."""
    first, last = source.frame_range
    wanted = [(path, index) for path in _paths(source) for index in range(WIDTHS[path.removeprefix("delta_")])]
    return all(name in curves and _covers(curves[name], first, last - first + 1) for name in wanted)


def clear(slot: Slot, curves: Curves) -> None:
    """Take the in-betweens out of a slot, and give its objects their own delta transforms back."""
    _write(slot, curves, {}, (0, 0))
    _record(slot, "")


def recorded(slot: Slot) -> str:
    """The digest of the source that a slot was filled in from, "" where it was not."""
    return next((record.digest for record in slot.action.rigid_motion.slots if record.handle == slot.handle), "")


def _record(slot: Slot, digest: str) -> None:
    records = slot.action.rigid_motion.slots
    for place, record in enumerate(records):
        if record.handle == slot.handle:
            if digest:
                record.digest = digest
            else:
                records.remove(place)
            return
    if digest:
        record = records.add()
        record.handle, record.digest = slot.handle, digest


def _paths(source: Source) -> dict[str, str]:
    """The delta transforms that a source needs, and which of its properties each is for."""
    rotation = "delta_rotation_quaternion" if source.order is None else "delta_rotation_euler"
    paths = {"delta_location": LOCATION, rotation: ROTATION}
    needed = {path: name for path, name in paths.items() if name in source.keyed}
    return {**needed, "delta_scale": SCALE} if source.uniform_scale else needed


def _values(source: Source, delta: Deltas) -> dict[str, np.ndarray]:
    return {path: getattr(delta, name) for path, name in _paths(source).items()}


def _write(slot: Slot, curves: Curves, values: dict[str, np.ndarray], frames: tuple[int, int]) -> None:
    """Replace the in-betweens of a slot by these samples of delta transforms, from the first of the frames to the last.

    A row (2 m,) for each channel has frame and value of every sample. Delta transforms that have no samples, or another
    number of them, are taken out.
    """
    first, last = frames
    for obj in slot.users:
        _remember(obj, values)
    for path, rows in values.items():
        for index, samples in enumerate(rows):
            fcurve = curves.get((path, index))
            points = () if fcurve is None else fcurve.sampled_points
            if len(points) != last - first + 1:
                if fcurve is not None:
                    _remove(slot, curves, path, index)
                points = _new(slot.channelbag, curves, path, index, first, last).sampled_points
            points.foreach_set("co", samples)
    others = OWN.keys() - values.keys()
    gone = [key for key, fcurve in curves.items() if key[0] in others and is_filled_in(fcurve)]
    for key in gone:
        _remove(slot, curves, *key)
    if gone:
        _tidy(slot)
        for obj in slot.users:
            give_back(obj)
    for obj in slot.users:
        obj.update_tag(refresh={"TIME"})


def _remove(slot: Slot, curves: Curves, path: str, index: int) -> None:
    slot.channelbag.fcurves.remove(curves.pop((path, index)))


def _tidy(slot: Slot) -> None:
    """Take out the group of the in-betweens where nothing is left in it."""
    groups = slot.channelbag.groups
    group = groups.get(GROUP)
    if group is not None and not group.channels:
        groups.remove(group)


def _covers(fcurve: bpy.types.FCurve, first: int, count: int) -> bool:
    points = fcurve.sampled_points
    return len(points) == count and points[0].co[0] == first


def _new(
    channelbag: bpy.types.ActionChannelbag, curves: Curves, path: str, index: int, first: int, last: int
) -> bpy.types.FCurve:
    """A sampled F-curve out of the animator's way: locked, and hidden in the Graph Editor."""
    fcurve = curves[path, index] = channelbag.fcurves.new(path, index=index)
    fcurve.group = channelbag.groups.get(GROUP) or channelbag.groups.new(GROUP)
    fcurve.keyframe_points.insert(first, 0.0)
    fcurve.convert_to_samples(first, last + 1)
    fcurve.lock = fcurve.hide = True
    fcurve.select = False
    return fcurve


def adopt(slot: Slot, curves: Curves) -> None:
    """Remember the own delta transforms of objects that move by a slot which is filled in already."""
    paths = {path for path, _ in _filled(curves)}
    for obj in slot.users:
        _remember(obj, paths)


def _filled(curves: Curves) -> Curves:
    """Those of a slot's F-curves that in-betweens are in."""
    return {key: fcurve for key, fcurve in curves.items() if key[0] in OWN and is_filled_in(fcurve)}


def _remember(obj: bpy.types.Object, paths: Iterable[str]) -> None:
    """Keep the object's own delta transforms, which in-betweens take the place of."""
    motion = obj.rigid_motion
    filled = tuple(motion.filled)
    for path in paths:
        own, place = OWN[path]
        if not filled[place]:
            setattr(motion, own, getattr(obj, path))
            motion.filled[place] = True


def hold_own(slot: Slot, curves: Curves) -> None:
    """Let a slot that is not filled in hold its objects' own delta transforms where another slot of theirs is.

    While a strip plays whose Action lacks a channel that another strip's has, Blender puts that channel to its default.
    """
    held = _held(slot, curves)
    there = {
        key: next((point.co[1] for point in fcurve.sampled_points), None) for key, fcurve in _filled(curves).items()
    }
    if held != there:
        # Where its own keys begin, for the Action to be no longer than it was. A damaged file may have them anywhere.
        starts = [start for fcurve in curves.values() if abs(start := fcurve.range()[0]) < FARTHEST]
        first = math.floor(min(starts, default=0.0))
        values: dict[str, list[np.ndarray]] = {}
        for (path, _), value in held.items():
            values.setdefault(path, []).append(np.array((first, value, first + 1, value), dtype=np.float32))
        _write(slot, curves, values, (first, first + 1))


def _held(slot: Slot, curves: Curves) -> dict[tuple[str, int], float]:
    """The channels that a slot which is not filled in has to have, and what they hold."""
    first, *others = (_held_for(obj, slot) for obj in slot.users)
    if any(held != first for held in others):
        return {}
    # What it does not key may be another strip's to move, below it, and then so are the delta transforms of that.
    animated = {path for (path, _), fcurve in curves.items() if not is_filled_in(fcurve)}
    return {
        (path, index): value
        for (path, index), value in first.items()
        if path not in animated and path.removeprefix("delta_") in animated
    }


def _held_for(obj: bpy.types.Object, slot: Slot) -> dict[tuple[str, int], float]:
    if not len(obj.animation_data.nla_tracks):
        return {}
    owns = {path: getattr(obj.rigid_motion, own)[:] for path, (own, _) in OWN.items()}
    owns = {path: own for path, own in owns.items() if all(map(math.isfinite, own)) and own != _default(path)}
    # All objects of the file are gone through for the rest: only for the few that have delta transforms of their own.
    if not (owns and is_replacing(obj, slot)):
        return {}
    filled = {path for other in slots_of([obj]) if recorded(other) for path, _ in curves_in(other.channelbag)}
    return {(path, index): value for path, own in owns.items() if path in filled for index, value in enumerate(own)}


@cache
def _default(path: str) -> tuple[float, ...]:
    """What a delta transform is where an object has none of its own."""
    return tuple(bpy.types.Object.bl_rna.properties[path].default_array)


def give_back(obj: bpy.types.Object) -> None:
    """Give an object its own delta transforms back where no in-betweens are in their place any more."""
    motion = obj.rigid_motion
    if not any(motion.filled):
        return
    curves = {path for slot in slots_of([obj]) for path, _ in curves_in(slot.channelbag)}
    for path, (own, place) in OWN.items():
        if motion.filled[place] and path not in curves:
            setattr(obj, path, getattr(motion, own))
            motion.filled[place] = False
