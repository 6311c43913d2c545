"""Drafts: large Actions have one sample a frame while they are edited, and as many as they need once it matters.

After every edit Blender copies all of an Action, with up to 16 samples a frame of each bone. On whole frames, which is
what is seen in the viewport, one is as good. An Action keeps itself that it is in draft: so it goes through undo.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence

import bpy
import numpy as np

from ..actions.records import record_in_betweens, recorded, recorded_digest, recorded_rows
from ..actions.slots import Binding, bindings_in, slots_in
from ..compute.source_cache import cached_source
from ..compute.sources import Source
from .table import writer_of

LARGE = 10_000
"""Bones times frames. Blender copies less in a few milliseconds, however many samples a frame there are."""


def begin_drafts(readings: Sequence[tuple[Binding, Source]]) -> None:
    """Have large Actions that are to be filled in go on in draft."""
    apart: defaultdict[bpy.types.Action, list[tuple[Binding, Source]]] = defaultdict(list)
    for binding, source in readings:
        if binding.kind.has_difference_slot:
            apart[binding.slot.action].append((binding, source))
    for action, large in apart.items():
        if not is_draft(action):
            longest = max(last - first for first, last in (source.frame_range for _, source in large))
            if max(len(large), len(action.rigid_motion.slots)) * longest >= LARGE:
                _begin_draft(action, [binding for binding, _ in large])


def _begin_draft(action: bpy.types.Action, known: Iterable[Binding]) -> None:
    """Take out of an Action the samples between frames. `known` are some of its bindings."""
    # Strips may show what is between the frames of an Action on whole frames of the scene.
    if any(slot.in_nla for slot in slots_in([action])):
        return
    action.rigid_motion.is_draft = action.rigid_motion.has_longer = True
    if any(record.rate > 1 for record in action.rigid_motion.slots):
        bindings = {(binding.slot.handle, binding.prefix): binding for binding in (*bindings_in([action]), *known)}
        for binding in bindings.values():
            _take_out_between_frames(binding)


def _take_out_between_frames(binding: Binding) -> None:
    """Leave the samples on whole frames, where it is known how they lie."""
    written, source, rows = recorded(binding), cached_source(recorded_digest(binding)), recorded_rows(binding)
    if written.rate == 1 or source is None:
        return
    (first, last), (begin, end) = source.sample_range(1), source.sample_range(written.rate)
    frames = np.arange(first, last + 1)
    # Beside the outermost keys, off whole frames, all is as it is on these.
    chosen = np.clip(frames * written.rate - begin, 0, end - begin)
    samples = np.empty(2 * (end - begin + 1), np.float32)
    layout, points = writer_of(binding).layout(source, 1), {}
    for channel, fcurve in binding.filled.items():
        if 2 * len(fcurve.sampled_points) != len(samples):
            return
        fcurve.sampled_points.foreach_get("co", samples)
        points[channel] = layout.points(np.stack((frames, samples[1::2][chosen]), axis=1, dtype=np.float32).ravel())
    record_in_betweens(binding, source.digest, rows, 1, written.error)
    writer_of(binding).write(binding, points, layout, {})


def is_draft(action: bpy.types.Action) -> bool:
    """Return whether an Action is in draft; none is while the extension is off."""
    motion = getattr(action, "rigid_motion", None)
    return motion is not None and motion.is_draft


def drafts_among(actions: Iterable[bpy.types.Action]) -> set[bpy.types.Action]:
    """Return those that are in draft and can be finished."""
    return {action for action in actions if is_draft(action) and action.is_editable}


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
