"""Writing in-betweens: differences as sampled F-curves, in the Action that has the keys.

A sampled F-curve has a value on every whole frame and no keys: Blender alone evaluates it, and the Dope Sheet shows
nothing of it. There are samples only where a mode counts, and only of components that it changes; which F-curves these
are is up to the writer. Where some have to lie outside of the keys, a manual frame range keeps the Action, its strips
and exports from being longer for it.

Large Actions are in *draft* while they are edited: they have one sample a frame, and as many as they need once it
matters. After every edit Blender copies all of an Action, with up to 16 samples a frame of each bone. On whole frames,
which is what is seen in the viewport, one is as good. An Action keeps itself that it is in draft: so it goes through
undo.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

import bpy

from ..actions.reading import keyed_in
from ..actions.records import record_in_betweens, recorded, recorded_digest, recorded_rows
from ..actions.slots import Binding, bindings_in, handles_of_differences, is_filled_in, is_time, slots_in
from ..compute.sample_rates import Need, sampled
from ..compute.source_cache import cached_source
from ..compute.sources import Source
from ..transforms import Channel
from ..transforms.sizes import metres_per_channel_unit, reach_at_rest
from .corners import corners
from .sampled import Layout
from .table import release, writer_of
from .times import most_samples

LARGE = 2_000
"""Bones times frames. Less is computed and copied in a few milliseconds, however many samples a frame there are."""

TOLERANCE = 0.00005
"""The largest error of a body between frames, in metres, within a metre of its origin; and what reaches farther, by
this part of its reach. It is half of what is promised, for bones hang on one another."""


def begin_drafts(readings: Sequence[tuple[Binding, Source]]) -> list[tuple[Binding, Source]]:
    """Have large Actions that are to be filled in go on in draft.

    Returns what else of them is to be filled in anew, for the samples between frames that it has.
    """
    apart: defaultdict[bpy.types.Action, list[tuple[Binding, Source]]] = defaultdict(list)
    for binding, source in readings:
        if binding.kind.has_difference_slot:
            apart[binding.slot.action].append((binding, source))
    others = []
    for action, large in apart.items():
        longest = max(last - first for first, last in (source.frame_range for _, source in large))
        is_large = max(len(large), len(action.rigid_motion.slots)) * longest >= LARGE
        if not is_large or is_draft(action) or any(slot.is_seen_between for slot in slots_in([action])):
            continue
        action.rigid_motion.is_draft = action.rigid_motion.has_longer = True
        if any(record.rate > 1 for record in action.rigid_motion.slots):
            known = {(binding.slot.key, binding.prefix) for binding, _ in large}
            for binding in bindings_in([action]):
                source = cached_source(recorded_digest(binding)) if recorded(binding).rate > 1 else None
                if source is not None and (binding.slot.key, binding.prefix) not in known:
                    others.append((binding, source))
    return others


def is_draft(action: bpy.types.Action) -> bool:
    """Return whether an Action is in draft; none is while the extension is off."""
    motion = getattr(action, "rigid_motion", None)
    return motion is not None and motion.is_draft


def end_drafts(actions: Collection[bpy.types.Action], filled_in: Iterable[Binding]) -> None:
    """Have these Actions be in draft no more, all of which is about to be filled in anew but what moves nothing now.

    That will be when it does.
    """
    result = {(binding.slot.action, binding.slot.handle, binding.prefix) for binding in filled_in}
    for action in actions:
        action.rigid_motion.is_draft = False
        for record in action.rigid_motion.slots:
            if (action, record.handle, record.prefix) not in result:
                record.digest = ""


def fill_in(readings: Sequence[tuple[Binding, Source]], *, in_draft: bool = False) -> None:
    """Compute and write the in-betweens of these.

    Large Actions may begin a draft, where `in_draft`.
    """
    if in_draft:
        readings = [*readings, *begin_drafts(readings)]
    needs = _needs(readings)
    # However far cycles are seen, one round is all that is written where it repeats.
    rounds = [replace(source, seen=None) if source.repeats else source for _, source in readings]
    longer, emptied = set(), []
    for (binding, source), need, samples in zip(readings, needs, sampled(rounds, needs), strict=True):
        layout, channels = _layout(binding, source, samples.rate), _channels(binding, source)
        pieces, error = corners(source, samples, layout, need)
        error = max(samples.error, error) if math.isfinite(need.tolerance) else recorded(binding).error
        record_in_betweens(binding, source.digest, samples, samples.rate, error)
        writer_of(binding).write(
            binding,
            {channels[row]: layout.points(points) for row, points in samples.items()},
            layout,
            {channels[row]: points for row, points in pieces.items()},
        )
        _tag(binding)
        if not samples:
            emptied += binding.users
        first, last = source.keyed_range
        if layout.outermost[0] < first or layout.outermost[1] > last:
            longer.add(binding.slot.action)
    release(emptied)
    limit_ranges({binding.slot.action for binding, _ in readings}, longer)


def finish_drafts(actions: Iterable[bpy.types.Action]) -> None:
    """Have those of these Actions that are in draft be exact between frames as well."""
    drafts = {action for action in actions if is_draft(action) and action.is_editable}
    if not drafts:
        return
    bindings = [binding for binding in bindings_in(drafts) if recorded_digest(binding)]
    readings = [
        (binding, source)
        for binding, source in zip(bindings, keyed_in(bindings), strict=True)
        if isinstance(source, Source) and source.digest == recorded_digest(binding)
    ]
    end_drafts(drafts, [binding for binding, _ in readings])
    fill_in(readings)


def _needs(readings: Sequence[tuple[Binding, Source]]) -> list[Need]:
    """Return how exact each of these is to be between frames: in a draft, not at all."""
    reaches: dict[bpy.types.Bone, float] = {}
    needs = []
    for binding, source in readings:
        if is_draft(binding.slot.action):
            needs.append(Need(math.inf, 0.0, most=1))
            continue
        needs.append(need_of(binding, source, reaches))
    return needs


def need_of(binding: Binding, source: Source, reaches: dict[bpy.types.Bone, float]) -> Need:
    """Return how exact a source is to be between frames; for `reaches` see `reach_at_rest`."""
    user = binding.users[0]
    unit, reach = metres_per_channel_unit(user), reach_at_rest(user, reaches)
    most = most_samples(source) if binding.kind.has_difference_slot else 1
    return Need(TOLERANCE * max(1.0 / unit, reach), reach, most=most)


def is_complete(binding: Binding, source: Source) -> bool:
    """Return whether all F-curves are as they were written for a source."""
    channels, curves = _channels(binding, source), binding.filled
    layout = _layout(binding, source, recorded(binding).rate)
    written = [channels.get(row) for row in recorded_rows(binding)]
    return (
        all(channel in curves and layout.fits(curves[channel]) for channel in written)
        and len(curves) == len(written)
        and writer_of(binding).is_shown(binding, layout, written)
    )


def _layout(binding: Binding, source: Source, rate: int) -> Layout:
    """Return how the samples of a source lie in F-curves, so many of them a frame."""
    return Layout.of(source, rate, is_apart=binding.kind.has_difference_slot)


def clear(bindings: Sequence[Binding]) -> None:
    """Take the in-betweens out of slots, and give their users their original differences back."""
    for binding in bindings:
        writer_of(binding).write(binding, {}, None, {})
        _tag(binding)
        record_in_betweens(binding, "", ())
    release(user for binding in bindings for user in binding.users)
    limit_ranges({binding.slot.action for binding in bindings})


def hold(binding: Binding, beside: Sequence[Binding]) -> None:
    """Have a slot hold what the NLA needs of it beside others that are filled in, which are among these."""
    if writer_of(binding).hold(binding, beside):
        _tag(binding)


def _tag(binding: Binding) -> None:
    for user in binding.users:
        user.animated.update_tag(refresh={"TIME"})


def _channels(binding: Binding, source: Source) -> dict[int, Channel]:
    """Return the channels that the differences of a source go into, by their rows."""
    rotation = "rotation_quaternion" if source.order is None else "rotation_euler"
    return binding.users[0].differences_for(rotation)


def limit_ranges(actions: Iterable[bpy.types.Action], longer: Iterable[bpy.types.Action] = ()) -> None:
    """Have Actions begin and end with their keys where samples lie outside of these, by a manual frame range.

    `longer` are those in which samples were just written there. A range that the animator has set stays.
    """
    for action in actions:
        motion = action.rigid_motion
        if action in longer and not motion.has_longer:
            motion.has_longer = True
        was_set_for_samples = motion.range_is_set_here
        if (action.use_frame_range and not was_set_for_samples) or not (was_set_for_samples or motion.has_longer):
            continue
        bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
        apart = handles_of_differences(action)
        # Those of bones first: one that lies outside is enough to know, and in a draft any is going to again.
        most = 1 if is_draft(action) else None
        samples = [fcurve for bag in bags if bag.slot_handle in apart for fcurve in bag.fcurves[:most]]
        begin, end = math.inf, -math.inf
        farthest = tuple(action.curve_frame_range)
        for fcurve in (fcurve for bag in bags if bag.slot_handle not in apart for fcurve in bag.fcurves):
            # There may be thousands: no more are asked than can say anything.
            if samples and (begin, end) == farthest:
                break
            if not _is_outside(fcurve, begin, end):
                continue
            if is_filled_in(fcurve) or is_time(fcurve):
                samples.append(fcurve)
            else:
                first, last = fcurve.range()
                begin, end = min(begin, first), max(end, last)
        is_outside = (samples and is_draft(action)) or any(_is_outside(fcurve, begin, end) for fcurve in samples)
        if begin <= end and is_outside:
            if (action.use_frame_range, action.frame_start, action.frame_end) != (True, begin, end):
                action.use_frame_range = True
                action.frame_start, action.frame_end = begin, end
            if not was_set_for_samples:
                motion.range_is_set_here = True
        elif was_set_for_samples:
            action.use_frame_range = motion.range_is_set_here = False
        if not samples and motion.has_longer:
            motion.has_longer = motion.is_draft = False


def _is_outside(fcurve: bpy.types.FCurve, begin: float, end: float) -> bool:
    """Return whether keys or samples of an F-curve lie outside of these frames. A modifier alone makes no range."""
    first, last = fcurve.range()
    return (first < begin or last > end) and (len(fcurve.keyframe_points) > 0 or len(fcurve.sampled_points) > 0)
