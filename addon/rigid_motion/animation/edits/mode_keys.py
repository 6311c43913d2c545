"""Choosing modes: which segment is filled in how, and with how many turns more.

The mode of a transform is in the slot that moves it: in its mode channel, a key of which decides from its frame on
until the next, or else in its record, for all segments. What was chosen before there was a slot waits on the transform.
Turns are in a channel likewise, and without it there are none.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...motion.modes import no_such_mode
from ..actions.mode_property import is_keyed, set_pending_mode
from ..actions.reading import keyed_in, read
from ..actions.records import follow_renamed, record_mode, record_turns_axis
from ..actions.refusals import MOST_TURNS, refuse_linked, refuse_numbers
from ..actions.slots import Binding, bindings_of
from ..compute.components import MODE_NUMBERS
from ..compute.sources import TURN_AXES
from ..live import follower
from ..live.segment_keys import set_mode_in, set_turns_in
from ..queries.keyed import active_binding, frames_in, modes_in
from ..queries.segments import frame_in_action, segment_at
from ..transforms import Refused, Transform
from .apply import Readings, Targets, apply_edit


def set_mode(
    targets: Targets, mode: str, frames: Sequence[float] | None = None, *, refused: list[Refused] | None = None
) -> None:
    """Choose what happens between keys.

    Parameters
    ----------
    targets, refused
        See `apply`.
    mode : str
        One of `MODE_IDS`.
    frames : sequence of float, optional
        The frames of the keys that begin the segments meant. They get a key in the mode channel, and so does the key
        behind them where another mode goes on; all other segments keep what they have. Without frames, there is one
        mode for all segments, and the mode channel goes.
    """

    def plan(transform: Transform, readings: Readings) -> list[Binding]:
        bindings = [binding for binding, _ in readings] if mode == "BLENDER" else able(transform, readings)
        if frames is None:
            return bindings
        return [_binding_of(transform, bindings)]

    def act(transform: Transform, bindings: list[Binding]) -> None:
        if not bindings:
            set_pending_mode(transform, mode)
        for binding in bindings:
            if frames is not None:
                set_mode_in(binding, mode, frames)
            elif binding.slot.action.is_editable:
                set_whole(binding, mode)

    if mode not in MODE_NUMBERS:
        raise Refused(no_such_mode(mode, MODE_NUMBERS))
    whole = None if frames is not None else partial(replace, mode=MODE_NUMBERS[mode])
    apply_edit(targets, plan, act, refused, whole)


def set_turns(
    targets: Targets,
    turns: int,
    frames: Sequence[float] | None = None,
    *,
    axis: str | None = None,
    refused: list[Refused] | None = None,
) -> None:
    """Choose how many whole turns more are made between keys.

    Parameters
    ----------
    targets, refused
        See `apply`.
    turns : int
        In the sense in which a segment turns anyway, against it where negative.
    frames : sequence of float, optional
        The frames of the keys that begin the segments meant, all others keep what they have. Without frames, all
        segments have so many.
    axis : str, optional
        One of `TURN_AXES`, for all segments of the Action: what turns are about. Left as it is where it is not given.
    """

    def plan(transform: Transform, readings: Readings) -> Binding:
        binding = _binding_of(transform, able(transform, readings))
        if turns and not any(modes_in(binding, frames_in(binding) if frames is None else np.asarray(frames))):
            text = n_("{name}: Blender's own in-betweens make no turns more: choose a mode first")
            raise Refused(text, name=transform.name)
        return binding

    def act(_: Transform, binding: Binding) -> None:
        if axis is not None:
            record_turns_axis(binding, axis)
        set_turns_in(binding, turns, frames_in(binding)[:-1] if frames is None else frames)

    if isinstance(turns, bool) or not isinstance(turns, int) or abs(turns) > MOST_TURNS:
        text = n_("{turns} is no number of turns: give a whole number from -{most} to {most}")
        raise Refused(text, turns=turns, most=MOST_TURNS)
    if axis is not None and axis not in TURN_AXES:
        raise Refused(n_("{axis} is no axis of turns: give one of {axes}"), axis=axis, axes=", ".join(TURN_AXES))
    apply_edit(targets, plan, act, refused)


def _binding_of(transform: Transform, bindings: Sequence[Binding]) -> Binding:
    """Return the slot whose keys the editors show. `Refused` where there is none."""
    binding = active_binding(transform, bindings)
    if binding is None:
        raise Refused(
            n_("{name} has no Action with keys to set a mode on: key it first, or enter a strip (NLA Editor, Tab)"),
            name=transform.name,
        )
    return binding


def on_turns(transform: Transform) -> None:
    """Take an edit of the property of turns as a choice for the segment on the frame that is shown."""
    binding, turns = active_binding(transform), transform.motion.turns
    source = None if binding is None or not binding.slot.action.is_editable else read(binding)
    frame = frame_in_action(transform.animated, bpy.context.scene.frame_current_final)
    segment = segment_at(source, frame) if source is not None and source.channels else None
    if segment is not None:
        set_turns(transform, turns, (segment.key,))


def on_property(transform: Transform) -> None:
    """Take an edit of the mode property as a choice for the whole."""
    mode = transform.motion.mode
    bindings = [binding for binding in bindings_of([transform]) if binding.slot.action.is_editable]
    if not bindings:
        set_pending_mode(transform, mode)
    follow_renamed(bindings)
    if mode != "BLENDER":
        with suppress(Refused):
            bindings = able(transform, list(zip(bindings, keyed_in(bindings), strict=True)))
    for binding in bindings:
        if not is_keyed(binding):
            record_mode(binding, MODE_NUMBERS[mode])
    follower.refresh([transform])


def set_whole(binding: Binding, mode: str) -> None:
    """Set one mode for all segments of a slot."""
    channel = binding.users[0].mode_channel
    if channel in binding.curves:
        binding.channelbag.fcurves.remove(binding.curves.pop(channel))
    record_mode(binding, MODE_NUMBERS[mode])


def able(transform: Transform, readings: Readings) -> list[Binding]:
    """Return the bindings of a transform, which is keyed so, that can have a mode beside Blender's own.

    That is its Action at least, or one of its strips where it has none: else `Refused`. Other strips keep Blender's.
    """
    transform.rotation  # noqa: B018 - raises where it turns by axis and angle
    refuse_linked(transform)
    active, result, refusals = active_binding(transform, [binding for binding, _ in readings]), [], []
    for binding, source in readings:
        try:
            if isinstance(source, Refused):
                raise source
            refuse_numbers(transform.name, replace(source, mode=MODE_NUMBERS["dq_sclerp"]))
            result.append(binding)
        except Refused as refusal:
            if binding is active:
                raise
            refusals.append(refusal)
    if refusals and not result:
        raise refusals[0]
    return result
