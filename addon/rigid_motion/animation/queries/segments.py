"""Segment facts: numbers about an object's motion at one frame, and the reasons why it does not follow its mode.

Frames are those of the Action, angles are radians, lengths are Blender's units in the space of the object's channels.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from ..actions.reading import is_marked, leading, planned_from, sources_of_users
from ..actions.refusals import refuse_numbers
from ..actions.slots import bindings_of
from ..evaluation.components import MODE_NAMES
from ..evaluation.sources import SAME_FRAME, KeyedTransform
from ..evaluation.spans import spans
from ..evaluation.turning import turning_in, values_at_ends
from ..fcurves.keys import cycled
from ..holds.problems import refuse_holds
from ..transforms import Refused, Transform, transform_of
from .keyed import active_binding

HALF_TURN = np.pi + 1e-3
"""Half a turn in radians, with a margin for single precision."""

NEAR_HALF_TURN = np.radians(170.0)
"""The angle from which on a small change of a key may reverse a rotation by the shortest way."""

MAX_SAME_VALUE_GAP = 1e-6
"""Values that differ by less count as equal."""

DIFFERING_REFUSAL = n_(
    "{name} moves by the same Action slot as {leader}, but has another rotation mode, driver, delta transform or "
    "Local Location; the in-betweens are those of {leader}: "
    "give it an Action of its own (Object > Relations > Make Single User)"
)
"""The message for why the motion of a slot, computed for {leader}, does not fit another user of it; with a remedy."""


@dataclass(frozen=True)
class SegmentFacts:
    """One segment, from one key to the next."""

    first: float
    last: float
    mode: str
    distance: float

    key: float
    """The frame of the key that decides its mode: its first key, or the original of that key if cycles repeat it."""

    turn: float
    """The angle of its rotation, spins included."""

    turns: float
    """The signed number of extra turns beyond the shortest way, from Euler angles and from the turns channel."""

    long_way: bool
    """True if Blender's own in-betweens of quaternions turn by more than half a turn and the modes by less."""

    is_sure: bool
    """True if the keys decide the direction of rotation even near half a turn, as angles do."""

    two_axes: bool
    """True if two Euler angles change by more than half a turn; the larger one decides."""

    scales_unevenly: bool
    """True if its scale changes and is not uniform; the modes leave such a scale to Blender."""


def frame_in_action(obj: bpy.types.Object, frame: float) -> float:
    """Return a frame of the scene in the time of the keys in the editors: in tweak mode, in that of the strip."""
    data = obj.animation_data
    return frame if data is None else data.nla_tweak_strip_time_to_scene(frame, invert=True)


def segment_at(source: KeyedTransform, frame: float) -> SegmentFacts | None:
    """Return the segment at a frame, None before the first key and after the last if no cycle repeats them.

    A key belongs to the segment that it starts; the last key to the segment that it ends.
    """
    keys, moment, backwards = source.key_frames, frame, False
    if source.cyclic is not None:
        (moment,), (backwards,) = cycled(source.cyclic, np.array([frame]))
    if len(keys) < 2 or not keys[0] - SAME_FRAME <= moment <= keys[-1] + SAME_FRAME:
        return None
    index = int(np.clip(np.searchsorted(keys, moment + SAME_FRAME, side="right") - 1, 0, len(keys) - 2))
    ends = keys[index : index + 2]
    first, last = frame + moment - ends[::-1] if backwards else frame - moment + ends
    rows = values_at_ends(source, index)
    location, rotation, scale = np.split(rows, (3, 7))
    alike = float(rotation[:, 0] @ rotation[:, 1]) / float(np.prod(np.linalg.norm(rotation, axis=0)) or 1.0)
    swept, turned = np.abs(np.diff(rotation[:3])), turning_in(source, index)
    return SegmentFacts(
        first=float(first),
        last=float(last),
        key=float(ends[0]),
        mode=MODE_NAMES[source.modes[index]],
        turn=float(turned.totals[0]),
        turns=float(turned.spins.turns[0]),
        distance=float(np.linalg.norm(location[:, 1] - location[:, 0])),
        long_way=source.order is None and -1.0 + MAX_SAME_VALUE_GAP < alike < -MAX_SAME_VALUE_GAP,
        is_sure=source.order is not None and bool(np.any(swept > NEAR_HALF_TURN)),
        two_axes=source.order is not None and int(np.count_nonzero(swept > HALF_TURN)) > 1,
        scales_unevenly=not source.uniform_scale and bool(np.any(np.abs(np.diff(scale)) > MAX_SAME_VALUE_GAP)),
    )


def is_up_to_date(target: bpy.types.Object | bpy.types.PoseBone | Transform, source: KeyedTransform) -> bool:
    """Return whether in-betweens fit the present keys. They may not while live update is off."""
    binding = active_binding(transform_of(target))
    planned = None if binding is None else planned_from(binding)
    return planned is None or (source.is_live and planned == source.digest24)


def problem_of(target: bpy.types.Object | bpy.types.PoseBone | Transform) -> str:
    """Return why a target does not move or is not held according to its keys, with a remedy; "" if all is well."""
    transform = transform_of(target)
    bindings = bindings_of([transform])
    try:
        for binding, sources in zip(bindings, sources_of_users(bindings), strict=True):
            source = sources[binding.users.index(transform)]
            if isinstance(source, Refused):
                if not is_marked(binding):
                    continue
                raise source
            refuse_numbers(transform.name, source)
            refuse_holds(transform, binding, source)
            if source.is_live:
                spans(source)
                leader = leading(sources)
                if isinstance(leader, KeyedTransform) and leader.digest != source.digest:
                    name = binding.users[sources.index(leader)].name
                    raise Refused(DIFFERING_REFUSAL, name=transform.name, leader=name)
    except Refused as problem:
        return str(problem)
    except ValueError as problem:
        return rpt_("{name} has keys too large to compute with ({problem}): delete them (Dope Sheet, X)").format(
            name=transform.name, problem=problem
        )
    return ""
