"""Choosing modes: what happens between which keys, and with how many turns more.

The mode of a segment is in the keys that begin it. What was chosen before there were any keys waits on the transform.
Turns are in a channel of their own, and without it there are none. For targets, and what is refused, see `apply`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...blender import scene
from ...motion.modes import no_such_mode
from ..actions.channels import key_points
from ..actions.marks import write_marks
from ..actions.modifiers import add_cycles
from ..actions.refusals import MOST_TURNS, refuse_linked, refuse_numbers
from ..actions.slots import Binding
from ..evaluation.components import MODE_NUMBERS
from ..evaluation.marks import near
from ..evaluation.sources import TURN_AXES, KeyedTransform
from ..fcurves.keys import Cycles
from ..following.refreshing import mark_all
from ..following.shared_turns import set_turns_in
from ..queries.keyed import active_binding, frames_in, key_frames, mode_shown, modes_in, modes_of, source_of
from ..queries.segments import frame_in_action, segment_at
from ..transforms import Refused, Transform, transform_of
from .apply import Readings, Target, Targets, apply_edit, editable_binding


def set_mode(
    targets: Targets, mode: str, frames: Sequence[float] | None = None, *, refused: list[Refused] | None = None
) -> None:
    """Choose what happens between keys.

    Parameters
    ----------
    mode : str
        One of `MODE_IDS`.
    frames : sequence of float, optional
        The frames of the keys that begin the segments meant; all other segments keep what they have. Without frames,
        all keys get the mode.
    """

    def plan(transform: Transform, readings: Readings) -> list[Binding]:
        bindings = [binding for binding, _ in readings] if mode == "BLENDER" else able(transform, readings)
        return bindings if frames is None else [editable_binding(transform, bindings)]

    def act(transform: Transform, bindings: list[Binding]) -> None:
        _act(transform, bindings, mode, lambda binding: set_mode_in(binding, mode, frames))

    if mode not in MODE_NUMBERS:
        raise Refused(no_such_mode(mode, MODE_NUMBERS))
    apply_edit(targets, plan, act, refused)


def set_mode_in(binding: Binding, mode: str, frames: Sequence[float] | None = None) -> None:
    """Have the keys of a slot say a mode: those on these frames, which begin segments, or all."""
    if frames is None:
        mark_all(binding, MODE_NUMBERS[mode])
        return
    chosen = np.asarray(frames)
    _mark(binding, lambda keyed: np.where(near(keyed, chosen), MODE_NUMBERS[mode], modes_in(binding, keyed)))


def _mark(binding: Binding, numbers_on: Callable[[np.ndarray], np.ndarray]) -> None:
    """Have the keys of a slot say the modes of these numbers (n,), which are asked for by their frames (n,)."""
    marks = [numbers_on(key_points(fcurve)[:, 0].astype(np.float64)) + 1 for fcurve in binding.keyed]
    for fcurve, of_keys in zip(binding.keyed, marks, strict=True):
        write_marks(fcurve, of_keys)


def _act(transform: Transform, bindings: Sequence[Binding], awaited: str, mark: Callable[[Binding], object]) -> None:
    """Mark what may be written of these bindings; without any keys the transform waits for them with a mode."""
    if not any(binding.is_keyed for binding in bindings):
        transform.motion.awaited = awaited
    for binding in bindings:
        if binding.slot.is_editable:
            mark(binding)


def copy_modes(model: Target, targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Give the keys of targets the modes that another transform, the model, has on their frames."""
    model = transform_of(model)

    def modes_on(frames: np.ndarray) -> np.ndarray:
        return np.array([MODE_NUMBERS[mode] for mode in modes_of(model, frames)], dtype=np.int64)

    first = mode_shown(model)
    is_blenders = first == "BLENDER" and not modes_on(key_frames(model)).any()

    def plan(transform: Transform, readings: Readings) -> list[Binding]:
        return [binding for binding, _ in readings] if is_blenders else able(transform, readings)

    def act(transform: Transform, bindings: list[Binding]) -> None:
        _act(transform, bindings, first, lambda binding: _mark(binding, modes_on))

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
    turns : int
        In the sense in which a segment turns anyway, against it where negative.
    frames : sequence of float, optional
        The frames of the keys that begin the segments meant, all others keep what they have. Without frames, all
        segments have so many.
    axis : str, optional
        One of `TURN_AXES`, for all segments: what turns are about. Left as it is where it is not given.
    """

    def plan(transform: Transform, readings: Readings) -> Binding:
        binding = editable_binding(transform, able(transform, readings))
        if turns and not any(modes_in(binding, frames_in(binding) if frames is None else np.asarray(frames))):
            text = n_("{name}: Blender's own in-betweens cannot add turns: choose a mode first")
            raise Refused(text, name=transform.name)
        return binding

    def act(_: Transform, binding: Binding) -> None:
        set_turns_in(binding, turns, frames_in(binding)[:-1] if frames is None else frames, axis)

    if isinstance(turns, bool) or not isinstance(turns, int) or abs(turns) > MOST_TURNS:
        text = n_("{turns} is not a number of turns: give a whole number from -{most} to {most}")
        raise Refused(text, turns=turns, most=MOST_TURNS)
    if axis is not None and axis not in TURN_AXES:
        raise Refused(n_("{axis} is not an axis of turns: give one of {axes}"), axis=axis, axes=", ".join(TURN_AXES))
    apply_edit(targets, plan, act, refused)


def on_turns(transform: Transform) -> None:
    """Take an edit of the property of turns as a choice for the segment on the frame that is shown."""
    source, turns = source_of(transform), transform.motion.turns
    frame = frame_in_action(transform.animated, scene().frame_current_final)
    segment = None if source is None else segment_at(source, frame)
    if segment is not None:
        set_turns(transform, turns, (segment.key,))


def repeat(targets: Targets, mode: str = "REPEAT", *, refused: list[Refused] | None = None) -> None:
    """Have motions repeat before their first keys and behind their last ones: Cycles on all of their channels.

    Blender has no way to add Cycles to a channel with other modifiers, and in-betweens repeat only where all channels
    do so together. The mode of cycles is REPEAT, REPEAT_OFFSET or MIRROR.
    """
    cycles = Cycles(mode, mode, 0, 0)

    def plan(transform: Transform, readings: Readings) -> Binding:
        # Where it is refused for its Cycles as they are, this is the way out.
        binding = editable_binding(transform, [binding for binding, _ in readings])
        source = next(source for one, source in readings if one is binding)
        if isinstance(source, KeyedTransform):
            channels = tuple((rows, replace(keys, cycles=cycles)) for rows, keys in source.channels)
            refuse_numbers(transform.name, replace(source, channels=channels))
        return binding

    def act(_: Transform, binding: Binding) -> None:
        for fcurve in binding.keyed:
            if len(fcurve.keyframe_points) > 1:
                add_cycles(fcurve, cycles)

    apply_edit(targets, plan, act, refused)


def able(transform: Transform, readings: Readings) -> list[Binding]:
    """Return the bindings of a transform, which is keyed so, that can have a mode beside Blender's own.

    That is its Action at least, or one of its strips where it has none: else `Refused`. Other strips keep Blender's.
    """
    refuse_linked(transform)
    result, refusals = [], {}
    for binding, source in readings:
        try:
            if isinstance(source, Refused):
                raise source
            refuse_numbers(transform.name, replace(source, mode=MODE_NUMBERS["dq_sclerp"]))
            result.append(binding)
        except Refused as refusal:
            refusals[binding] = refusal
    if (active := active_binding(transform, refusals)) is not None or (refusals and not result):
        raise refusals[active or next(iter(refusals))]
    return result
