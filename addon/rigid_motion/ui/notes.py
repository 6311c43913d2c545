"""Notes of the panel on a target and a frame: the segment, what is amiss, and the way out."""

from __future__ import annotations

import bpy

from .. import animation
from ..animation.actions.records import recorded_digest
from ..animation.actions.slots import bindings_for
from ..animation.compute.sources import Source
from ..animation.queries.keyed import active_binding, source_of
from ..animation.queries.segments import (
    SegmentFacts,
    frame_in_action,
    has_edited_differences,
    is_blended,
    is_up_to_date,
    segment_at,
)
from ..animation.transforms import Transform, transform_of
from .targets import with_keyed_bones
from .wording import (
    BAKED,
    BLENDED,
    DELTA_EDITED,
    KEYED_BONES,
    NO_KEYS,
    NO_SEGMENT,
    OUT_OF_DATE,
    STRIPS,
    TROUBLES,
    cautions,
)

Notes = list[tuple[str, str]]
"""Texts, each behind its icon."""


def facts_and_notes(
    target: bpy.types.Object | bpy.types.PoseBone | Transform, frame: float
) -> tuple[SegmentFacts | None, Notes]:
    """Return the segment that a frame of the scene is in, and notes on it."""
    target = transform_of(target)
    source, problem = _read(target)
    segment = None
    notes = []
    if problem:
        notes.append(("ERROR", problem))
    elif source is None:
        data = target.animated.animation_data
        in_strips = data is not None and any(track.strips for track in data.nla_tracks)
        of_bones = with_keyed_bones(target) != [target]
        notes.append(("INFO", KEYED_BONES if of_bones else STRIPS if in_strips else NO_KEYS))
    else:
        frame = frame_in_action(target.animated, frame)
        segment = segment_at(source, frame)
        notes += [("ERROR", caution) for caution in cautions(segment)] if segment else [("INFO", NO_SEGMENT)]
        if not is_up_to_date(target, source):
            notes.append(("ERROR", OUT_OF_DATE))
        elif target.animated.visible_get() and has_edited_differences(target, frame):
            # What is hidden need not have been evaluated on this frame.
            notes.append(("INFO", DELTA_EDITED))
    if trouble := animation.constraint_trouble(target):
        notes.append(TROUBLES[trouble])
    if is_blended(target):
        notes.append(("INFO", BLENDED))
    if animation.is_baked(target):
        notes.append(("INFO", BAKED))
    return segment, notes


_problem: tuple[tuple, str] = ((), "")
"""The last answer of `problem_of`, which looks through all frames; and before it, all that it depends on."""


def _read(target: Transform) -> tuple[Source | None, str]:
    """Return what is keyed, or why rigid motion cannot act on it."""
    global _problem
    try:
        source = source_of(target)
    except ValueError as problem:
        return None, str(problem)
    if source is None:
        return None, animation.problem_of(target)
    # What the slot was filled in from as well: of several users it is the source of the leading one.
    binding = active_binding(target, bindings_for(target))
    depends_on = (target.animated.session_uid, target.prefix, source.digest, binding and recorded_digest(binding))
    if _problem[0] != depends_on:
        _problem = depends_on, animation.problem_of(target)
    return (None if _problem[1] else source), _problem[1]
