"""Choosing modes: what happens between which keys, and with how many turns more.

The mode of a segment is in the keys that begin it. What was chosen before there were any keys waits on the transform.
Turns are in a channel of their own, and without it there are none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...motion.modes import no_such_mode
from ..actions.channels import key_points
from ..actions.marks import write_marks
from ..actions.modifiers import add_cycles
from ..actions.reading import read
from ..actions.refusals import MOST_TURNS, OTHER_ROUNDS, refuse_linked, refuse_numbers
from ..actions.slots import Binding
from ..evaluation.components import MODE_NUMBERS
from ..evaluation.sources import SAME_FRAME, TURN_AXES, Source
from ..fcurves.keys import Cycles
from ..following.refreshing import mark_all
from ..following.shared_turns import is_among, set_turns_in
from ..queries.keyed import active_binding, frames_in, key_frames, modes_in, modes_of
from ..queries.segments import frame_in_action, segment_at
from ..transforms import WIDTHS, Refused, Transform, transform_of
from .apply import Readings, Target, Targets, apply_edit


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
        The frames of the keys that begin the segments meant; all other segments keep what they have. Without frames,
        all keys get the mode.
    """

    def plan(transform: Transform, readings: Readings) -> list[Binding]:
        bindings = [binding for binding, _ in readings] if mode == "BLENDER" else able(transform, readings)
        if frames is None:
            return bindings
        return [_binding_of(transform, bindings)]

    def act(transform: Transform, bindings: list[Binding]) -> None:
        if not any(binding.is_keyed for binding in bindings):
            transform.motion.awaited = mode
        for binding in bindings:
            if binding.slot.is_editable:
                set_mode_in(binding, mode, frames)

    if mode not in MODE_NUMBERS:
        raise Refused(no_such_mode(mode, MODE_NUMBERS))
    apply_edit(targets, plan, act, refused)


def set_mode_in(binding: Binding, mode: str, frames: Sequence[float] | None = None) -> None:
    """Have the keys of a slot say a mode: those on these frames, which begin segments, or all."""
    if frames is None:
        mark_all(binding, MODE_NUMBERS[mode])
        return
    chosen, keyed = np.asarray(frames, dtype=np.float64), frames_in(binding)
    modes = modes_in(binding, keyed)
    for (path, _), fcurve in binding.curves.items():
        if path.removeprefix(binding.prefix) in WIDTHS and fcurve.keyframe_points:
            times = key_points(fcurve)[:, 0].astype(np.float64)
            at = np.searchsorted(keyed, times - SAME_FRAME)
            write_marks(
                fcurve, np.where(is_among(chosen, times), MODE_NUMBERS[mode], modes[np.clip(at, 0, len(keyed) - 1)]) + 1
            )


def copy_modes(model: Target, targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Give targets the modes that another transform has, key by key where both have keys on the same frames.

    Otherwise all of their keys get the mode that it has on the frame that is shown, or outside of its keys its first.

    Parameters
    ----------
    model
        What has the modes.
    targets, refused
        See `apply`.
    """
    model = transform_of(model)
    frames, now = key_frames(model), frame_in_action(model.animated, bpy.context.scene.frame_current_final)
    modes = np.array(modes_of(model, frames if len(frames) else np.zeros(1)))
    within = int(np.searchsorted(frames, now + SAME_FRAME, side="right")) - 1
    mode = str(modes[min(within, max(len(frames) - 2, 0)) if within >= 0 and now <= frames[-1] + SAME_FRAME else 0])

    def plan(transform: Transform, readings: Readings) -> list[Binding]:
        return able(transform, readings) if np.any(modes != "BLENDER") else [binding for binding, _ in readings]

    def act(transform: Transform, bindings: list[Binding]) -> None:
        if not any(binding.is_keyed for binding in bindings):
            transform.motion.awaited = mode
        for binding in bindings:
            if binding.slot.is_editable:
                keyed = frames_in(binding)
                is_alike = len(keyed) == len(frames) and np.abs(keyed - frames).max(initial=0.0) < SAME_FRAME
                set_mode_in(binding, str(modes[0]) if is_alike else mode)
                for other in dict.fromkeys(modes[1:].tolist()) if is_alike else ():
                    set_mode_in(binding, other, keyed[modes == other])

    apply_edit(targets, plan, act, refused)


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
        One of `TURN_AXES`, for all segments: what turns are about. Left as it is where it is not given.
    """

    def plan(transform: Transform, readings: Readings) -> Binding:
        binding = _binding_of(transform, able(transform, readings))
        if turns and not any(modes_in(binding, frames_in(binding) if frames is None else np.asarray(frames))):
            text = n_("{name}: Blender's own in-betweens make no turns more: choose a mode first")
            raise Refused(text, name=transform.name)
        return binding

    def act(_: Transform, binding: Binding) -> None:
        set_turns_in(binding, turns, frames_in(binding)[:-1] if frames is None else frames, axis)

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
    source = None if binding is None or not binding.slot.is_editable else read(binding)
    frame = frame_in_action(transform.animated, bpy.context.scene.frame_current_final)
    segment = segment_at(source, frame) if source is not None and source.channels else None
    if segment is not None:
        set_turns(transform, turns, (segment.key,))


def repeat(targets: Targets, mode: str = "REPEAT", *, refused: list[Refused] | None = None) -> None:
    """Have motions repeat before their first keys and behind their last ones: Cycles on all of their channels.

    Blender has no way to add Cycles to a channel with other modifiers, and in-betweens repeat only where all channels
    do so together.

    Parameters
    ----------
    targets, refused
        See `apply`.
    mode : str
        REPEAT, REPEAT_OFFSET or MIRROR.
    """
    cycles = Cycles(mode, mode, 0, 0)

    def plan(transform: Transform, readings: Readings) -> Binding:
        # Where it is refused for its Cycles as they are, this is the way out.
        binding = _binding_of(transform, [binding for binding, _ in readings])
        refuse_linked(transform, binding)
        ends = {tuple(key_points(fcurve)[[0, -1], 0].tolist()) for fcurve in _moving(binding)}
        if len(ends) != 1:
            text = n_("{name} needs the first and the last keys of all its channels on the same frames to repeat")
            raise Refused(text, name=transform.name)
        source = next(source for one, source in readings if one is binding)
        if isinstance(source, Source) and source.is_live:
            channels = tuple((rows, replace(keys, cycles=cycles)) for rows, keys in source.channels)
            if not replace(source, channels=channels).is_repeatable:
                raise Refused(OTHER_ROUNDS, name=transform.name)
        return binding

    def act(_: Transform, binding: Binding) -> None:
        for fcurve in _moving(binding):
            add_cycles(fcurve, cycles)

    apply_edit(targets, plan, act, refused)


def _moving(binding: Binding) -> list[bpy.types.FCurve]:
    """Return the channels of location, rotation and scale in a slot that have several keys."""
    return [
        fcurve
        for (path, _), fcurve in binding.curves.items()
        if path.removeprefix(binding.prefix) in WIDTHS and len(fcurve.keyframe_points) > 1
    ]


def able(transform: Transform, readings: Readings) -> list[Binding]:
    """Return the bindings of a transform, which is keyed so, that can have a mode beside Blender's own.

    That is its Action at least, or one of its strips where it has none: else `Refused`. Other strips keep Blender's.
    """
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
