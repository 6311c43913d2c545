"""Writing in-betweens: differences as sampled F-curves, in the slot that has the keys.

A sampled F-curve has a value on every whole frame and no keys: Blender alone evaluates it, and the Dope Sheet shows
nothing of it. There are samples only where a mode counts, and only of components that it changes. Where some have to
lie outside of the keys, a manual frame range keeps the Action, its strips and exports from being longer for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import bpy
import numpy as np

from ..actions.records import record_in_betweens, recorded_digest, recorded_rows
from ..actions.slots import GROUP, SlotTransform, is_filled_in, is_replacing, slot_transforms_of
from ..actions.sources import FULL_TURN, Source
from ..transforms import ORIGINALS, PART_OF, ROTATION, Channel, Transform, default_of
from .differences import NOTHING, differences
from .known_sources import changed_range, recall
from .layout import Layout

FARTHEST = 1_000_000
"""Frames from 0 up to which Blender can show any."""

SAME_ROTATION = 1e-4
"""Components of rotations that are one, in single precision, and far from those a turn or a sign apart."""


def fill_in(readings: Sequence[tuple[SlotTransform, Source]]) -> None:
    """Compute and write the in-betweens of these; of those that are there already, what has changed."""
    changed, anew = [], []
    for place, source in readings:
        span = _changed_range(place, source)
        if span is None:
            anew.append((place, source))
        else:
            changed.append((place, source, span))
    anew += _fill_in_changed(changed)
    # However far cycles are seen, one round is all that is written where it repeats.
    rounds = [replace(source, seen=None) if source.repeats else source for _, source in anew]
    longer = set()
    for (place, source), samples in zip(anew, differences(rounds), strict=True):
        layout = Layout.of(source)
        channels = _channels(place, source)
        _write(place, {channels[row]: layout.points(points) for row, points in samples.items()}, layout)
        record_in_betweens(place, source.digest, samples)
        if layout.outermost[0] < source.keyed_range[0] or layout.outermost[1] > source.keyed_range[1]:
            longer.add(place.slot.action)
    _limit_ranges({place.slot.action for place, _ in readings}, longer)


def _changed_range(place: SlotTransform, source: Source) -> tuple[int, int] | None:
    """The frames to fill in anew where the rest is as it has to be, None where all of them are."""
    old = recall(recorded_digest(place))
    if old is None or old is source or Layout.of(source).is_ring or not is_complete(place, source):
        return None
    return changed_range(old, source)


def _fill_in_changed(
    readings: Sequence[tuple[SlotTransform, Source, tuple[int, int]]],
) -> list[tuple[SlotTransform, Source]]:
    """Fill in a range of frames of each. Those for which that will not do are returned, and left as they are."""
    others = []
    found = differences([source for _, source, _ in readings], [span for *_, span in readings])
    for (place, source, (first, last)), samples in zip(readings, found, strict=True):
        channels, rows = _channels(place, source), recorded_rows(place)
        begin = source.frame_range[0]
        part = slice(2 * (first - begin) + 1, 2 * (last - begin) + 2, 2)
        written = {}
        for row in rows:
            points = place.curves[channels[row]].sampled_points
            written[row] = np.empty(2 * len(points), np.float32)
            points.foreach_get("co", written[row])
        values = {row: points[1::2] for row, points in samples.items()}
        before = {row: points[part] for row, points in written.items()}
        if not (_is_covered(values, rows) and _continue(values, before, source)):
            others.append((place, source))
            continue
        for row, points in written.items():
            points[part] = values[row]
            place.curves[channels[row]].sampled_points.foreach_set("co", points)
        record_in_betweens(place, source.digest, rows)
        for user in place.users:
            user.animated.update_tag(refresh={"TIME"})
    return others


def _is_covered(values: dict[int, np.ndarray], rows: Sequence[int]) -> bool:
    """Whether there are F-curves for all components that differ in these frames."""
    return all(row in rows or np.ptp(part) < NOTHING for row, part in values.items()) and all(
        row in values for row in rows
    )


def _continue(values: dict[int, np.ndarray], before: dict[int, np.ndarray], source: Source) -> bool:
    """Have rotations go on from those on the first frame, in the sign and in the turn that they have; in place.

    False where they do not arrive in those of the last frame, on from where all stays as it is.
    """
    rows = [row for row in before if PART_OF[row] == ROTATION]
    if not rows:
        return True
    new, old = np.stack([values[row] for row in rows]), np.stack([before[row] for row in rows])
    if source.order is None:
        new *= -1.0 if new[:, 0] @ old[:, 0] < 0.0 else 1.0
    else:
        new += (FULL_TURN * np.rint((old[:, 0] - new[:, 0]) / FULL_TURN))[:, None]
    values.update(zip(rows, new, strict=True))
    return bool(np.abs(new[:, [0, -1]] - old[:, [0, -1]]).max() < SAME_ROTATION)


def is_complete(place: SlotTransform, source: Source) -> bool:
    """Whether all F-curves are as they were written for a source."""
    layout, channels, curves = Layout.of(source), _channels(place, source), place.curves
    written = [channels.get(row) for row in recorded_rows(place)]
    return (
        all(channel in curves and layout.fits(curves[channel]) for channel in written)
        and len(place.filled) == len(written)
        and all(user.is_noted(channel for channel in written if channel) for user in place.users)
    )


def clear(place: SlotTransform) -> None:
    """Take the in-betweens out of a slot, and give its users their original differences back."""
    _write(place, {}, None)
    record_in_betweens(place, "", ())
    _limit_ranges({place.slot.action}, set())


def _channels(place: SlotTransform, source: Source) -> dict[int, Channel]:
    """The channels that the differences of a source go into, by their rows."""
    rotation = "rotation_quaternion" if source.order is None else "rotation_euler"
    return place.users[0].differences_for(rotation)


def _write(place: SlotTransform, points: dict[Channel, np.ndarray], layout: Layout | None) -> None:
    """Replace the in-betweens of a transform by these samples, frame and value of each by turns.

    Channels that have none are taken out.
    """
    for user in place.users:
        user.note_original(points)
    gone = [channel for channel in place.filled if channel not in points]
    for channel, samples in points.items():
        fcurve = place.curves.get(channel)
        if fcurve is None or len(fcurve.sampled_points) != layout.count:
            if fcurve is not None:
                _remove(place, channel)
            fcurve = _new(place, channel, layout.count)
        fcurve.sampled_points.foreach_set("co", samples)
        layout.modify(fcurve)
    for channel in gone:
        _remove(place, channel)
    if gone:
        _tidy(place)
        restore_originals(place.users)
    for user in place.users:
        user.animated.update_tag(refresh={"TIME"})


def _remove(place: SlotTransform, channel: Channel) -> None:
    place.channelbag.fcurves.remove(place.curves.pop(channel))


def _tidy(place: SlotTransform) -> None:
    """Take out the group of the in-betweens where nothing is left in it."""
    groups = place.channelbag.groups
    group = groups.get(GROUP)
    if group is not None and not group.channels:
        groups.remove(group)


def _new(place: SlotTransform, channel: Channel, count: int) -> bpy.types.FCurve:
    """A sampled F-curve out of the animator's way: locked, and hidden in the Graph Editor."""
    path, index = channel
    channelbag = place.channelbag
    fcurve = place.curves[channel] = channelbag.fcurves.new(path, index=index)
    fcurve.group = channelbag.groups.get(GROUP) or channelbag.groups.new(GROUP)
    fcurve.keyframe_points.add(1)
    fcurve.convert_to_samples(0, count)
    fcurve.lock = fcurve.hide = True
    fcurve.select = False
    return fcurve


def _limit_ranges(actions: Iterable[bpy.types.Action], longer: Iterable[bpy.types.Action]) -> None:
    """Have Actions begin and end with their keys where samples lie outside of these, by a manual frame range.

    `longer` are those in which samples were just written there. A range that the animator has set stays.
    """
    for action in actions:
        ours = action.rigid_motion.range_is_ours
        if (action.use_frame_range and not ours) or not (ours or action in longer):
            continue
        curves = [
            fcurve
            for layer in action.layers
            for strip in layer.strips
            for bag in strip.channelbags
            for fcurve in bag.fcurves
        ]
        samples, keyed = [], []
        for fcurve in curves:
            if not fcurve.is_empty:
                (samples if is_filled_in(fcurve) else keyed).append(fcurve.range())
        if keyed and samples and not _is_within(samples, keyed):
            begin, end = _union(keyed)
            if (action.use_frame_range, action.frame_start, action.frame_end) != (True, begin, end):
                action.use_frame_range = True
                action.frame_start, action.frame_end = begin, end
            action.rigid_motion.range_is_ours = True
        elif ours:
            action.use_frame_range = action.rigid_motion.range_is_ours = False


def _union(ranges: Sequence[tuple[float, float]]) -> tuple[float, float]:
    return min(begin for begin, _ in ranges), max(end for _, end in ranges)


def _is_within(inner: Sequence[tuple[float, float]], outer: Sequence[tuple[float, float]]) -> bool:
    (first, last), (begin, end) = _union(inner), _union(outer)
    return begin <= first and last <= end


def hold_originals(place: SlotTransform) -> None:
    """Let a slot that is not filled in hold its users' original differences where another slot of theirs is.

    While a strip plays whose Action lacks a channel that another strip's has, Blender puts that channel to its default.
    """
    held = _held(place)
    present = {
        channel: next((point.co[1] for point in fcurve.sampled_points), None)
        for channel, fcurve in place.filled.items()
    }
    if held != present:
        # Where its own keys begin, for the Action to be no longer than it was. A damaged file may have them anywhere.
        starts = [start for fcurve in place.curves.values() if abs(start := fcurve.range()[0]) < FARTHEST]
        first = math.floor(min(starts, default=0.0))
        layout = Layout(first, first + 1, (first, first + 1))
        points = {
            channel: np.array((first, value, first + 1, value), dtype=np.float32) for channel, value in held.items()
        }
        _write(place, points, layout)


def _held(place: SlotTransform) -> dict[Channel, float]:
    """The channels that a slot which is not filled in has to have, and what they hold."""
    first, *others = (_held_for(user, place) for user in place.users)
    if any(held != first for held in others):
        return {}
    # What it does not key may be another strip's to move, below it, and then so are the differences of that.
    animated = {path for (path, _), fcurve in place.curves.items() if not is_filled_in(fcurve)}
    return {
        (path, index): value
        for (path, index), value in first.items()
        if path not in animated and path.removeprefix("delta_") in animated
    }


def _held_for(user: Transform, place: SlotTransform) -> dict[Channel, float]:
    if not len(user.animated.animation_data.nla_tracks):
        return {}
    originals = {path: getattr(user.motion, original)[:] for path, (original, _) in ORIGINALS.items()}
    originals = {
        path: values
        for path, values in originals.items()
        if all(map(math.isfinite, values)) and values != default_of(path)
    }
    # All objects of the file are gone through for the rest: only for the few that have delta transforms of their own.
    if not (originals and is_replacing(user.animated, place.slot)):
        return {}
    filled = {path for other in slot_transforms_of([user]) if recorded_digest(other) for path, _ in other.filled}
    return {
        (path, index): value
        for path, values in originals.items()
        if path in filled
        for index, value in enumerate(values)
    }


def restore_originals(transforms: Iterable[Transform]) -> None:
    """Give transforms their original differences back where no in-betweens are in their place any more."""
    noted = [transform for transform in transforms if any(transform.motion.filled)]
    if not noted:
        return
    places = slot_transforms_of(noted)
    for transform in noted:
        filled = [channel for place in places if transform in place.users for channel in place.curves]
        transform.restore_original(filled)
