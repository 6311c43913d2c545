"""Notes and warnings in panels about the segment under the playhead of an object or bone."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_

from .. import animation
from ..animation.actions.reading import planned_from
from ..animation.evaluation.components import LOCATION, PART_OF, ROTATION
from ..animation.evaluation.sources import KeyedTransform
from ..animation.queries.keyed import active_binding, source_of
from ..animation.queries.segments import NEAR_HALF_TURN, SegmentFacts, frame_in_action, is_up_to_date, segment_at
from ..animation.transforms import Transform, transform_of
from .targets import with_keyed_bones
from .wording import degrees, listed

Notes = list[tuple[str, str]]
"""Pairs of an icon and a text."""

NO_KEYS = n_("No keys of location, rotation or scale yet")
KEYED_BONES = n_("Its bones have keys. Choose their modes in Pose Mode")
NO_SEGMENT = n_("No segment on this frame")
RESTING_TEXT = n_("At rest until the key on frame {frame:g}, which is in another space")
PASSING_TEXT = n_("Passing over to the key on frame {frame:g}, which is in another space")
STRIPS_TEXT = n_("Moved by strips: enter one to see its segments (NLA Editor, Tab)")
BAKED_TEXT = n_("Baked to keys. Un-Bake restores the original keys")
OUT_OF_DATE = n_("The keys have changed since: Live Update is off, in the preferences")
PART_NAMES = {LOCATION: n_("Location"), ROTATION: n_("Rotation")}
MOVED_ALONE = n_("Key all of {part} (I) at {frames}: only a part of it has a key there, so the motion is not rigid")
DENSE_TEXT = n_(
    "{count} modifiers on a channel: with so many segments Blender plays slower. Reduce the keys, or clear the modes"
)

LONG_WAY_TEXT = n_(
    "Blender turns this segment by more than half a turn; the mode takes the short way. "
    "With Turns set to -1 it takes the long one"
)
TWO_AXES_TEXT = n_(
    "Two angles change by more than half a turn here; whole turns are about the axis of the larger one."
    " For both, set a key in between"
)
NEAR_HALF_TEXT = n_(
    "{angle} is nearly half a turn: a small change of a key can reverse its direction. To be sure, set a key in between"
)
UNEVEN_TEXT = n_("The scale is not uniform, and is left to Blender")

MANY_MODIFIERS = 64
"""Blender plays noticeably slower if many channels have more modifiers than this."""


def facts_and_notes(
    target: bpy.types.Object | bpy.types.PoseBone | Transform, frame: float
) -> tuple[SegmentFacts | None, Notes]:
    """Return the segment at a frame of the scene, and notes on it."""
    target = transform_of(target)
    source, problem = _source_and_problem(target)
    segment = None
    notes = []
    if problem:
        notes.append(("ERROR", problem))
    elif source is None:
        data = target.animated.animation_data
        in_strips = data is not None and any(track.strips for track in data.nla_tracks)
        of_bones = with_keyed_bones(target) != [target]
        notes.append(("INFO", KEYED_BONES if of_bones else STRIPS_TEXT if in_strips else NO_KEYS))
    else:
        frame = frame_in_action(target.animated, frame)
        # Between keys in different holders there is no segment: the object keeps its motion, or rests.
        segment = segment_at(source.run_at(frame).source if source.switches else source, frame)
        notes += (
            [("ERROR", caution) for caution in cautions(segment)]
            if segment
            else [("INFO", _note_between_segments(source, frame))]
        )
        notes += [("INFO", text) for text in _partial_key_notes(source)] if source.is_live else []
        if not animation.is_enabled() and not is_up_to_date(target, source):
            notes.append(("ERROR", OUT_OF_DATE))
    if (count := most_modifiers(target)) > MANY_MODIFIERS:
        notes.append(("INFO", iface_(DENSE_TEXT).format(count=count)))
    if animation.is_baked(target):
        notes.append(("INFO", BAKED_TEXT))
    return segment, notes


_problem: tuple[tuple, str] = ((), "")
"""Cache of `problem_of`, which is slow because it checks all users: all values it depends on, and its last result."""


def _source_and_problem(target: Transform) -> tuple[KeyedTransform | None, str]:
    """Return the keyed transform, and the reason why rigid motion cannot act on it, "" if it can."""
    global _problem
    try:
        source = source_of(target)
    except ValueError as refusal:
        return None, str(refusal)
    if source is None:
        return None, animation.problem_of(target)
    binding = active_binding(target)
    depends_on = (*target.identity, source.digest, binding and planned_from(binding))
    if _problem[0] != depends_on:
        _problem = depends_on, animation.problem_of(target)
    return (None if _problem[1] else source), _problem[1]


def _note_between_segments(source: KeyedTransform, frame: float) -> str:
    """Return the note for a frame of the Action without a segment."""
    switch = next((one for one in source.switches if one.frame > frame), None)
    if switch is None:
        return NO_SEGMENT
    return iface_(PASSING_TEXT if switch.begin < frame else RESTING_TEXT).format(frame=switch.frame)


def _partial_key_notes(source: KeyedTransform) -> Iterator[str]:
    """Yield warnings about frames on which only some components of location or rotation have keys."""
    for part in (LOCATION, ROTATION):
        frames = [
            set(keys.times.round(2).tolist())
            for rows, keys in source.channels
            if len(keys.times) > 1 and any(PART_OF[row] == part for row in rows)
        ]
        if alone := sorted(set().union(*frames) - set.intersection(*frames)) if frames else ():
            yield iface_(MOVED_ALONE).format(
                frames=listed([f"{frame:g}" for frame in alone]), part=iface_(PART_NAMES[part])
            )


def most_modifiers(target: Transform) -> int:
    """Return the largest number of modifiers on any channel of a target."""
    binding = active_binding(target)
    return 0 if binding is None else max((len(fcurve.modifiers) for fcurve in binding.curves.values()), default=0)


def cautions(segment: SegmentFacts) -> list[str]:
    """Return warnings about unexpected motion in a segment, with remedies.
    There are none for Blender's own in-betweens.
    """
    is_near_half = segment.turn > NEAR_HALF_TURN and not (segment.turns or segment.is_sure)
    texts = {
        LONG_WAY_TEXT: segment.long_way and not segment.turns,
        TWO_AXES_TEXT: segment.two_axes,
        NEAR_HALF_TEXT: is_near_half,
        UNEVEN_TEXT: segment.scales_unevenly,
    }
    said = [text for text, is_so in texts.items() if is_so and segment.mode != "BLENDER"]
    return [iface_(text).format(angle=degrees(segment.turn)) for text in said]
