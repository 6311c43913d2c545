"""Modes and extra turns of segments: choosing, copying and repeating them.

The keys that begin a segment store its mode. A mode chosen before there are any keys is stored on the transform. Turns
are in a channel of their own; without it there are none. For targets and refusals see `apply`.
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
    """Set the mode of segments.

    Parameters
    ----------
    mode : str
        One of `MODE_IDS`.
    frames : sequence of float, optional
        The frames of the keys that begin the chosen segments; all other segments keep their modes. Without frames, all
        keys get the mode.
    """

    def plan(transform: Transform, readings: Readings) -> list[Binding]:
        bindings = [binding for binding, _ in readings] if mode == "BLENDER" else for_modes(transform, readings)
        return bindings if frames is None else [editable_binding(transform, bindings)]

    def act(transform: Transform, bindings: list[Binding]) -> None:
        _mark_or_store(transform, bindings, mode, lambda binding: set_mode_in(binding, mode, frames))

    if mode not in MODE_NUMBERS:
        raise Refused(no_such_mode(mode, MODE_NUMBERS))
    apply_edit(targets, plan, act, refused)


def set_mode_in(binding: Binding, mode: str, frames: Sequence[float] | None = None) -> None:
    """Mark the keys of a slot with a mode: those on these frames, which begin segments, or all."""
    if frames is None:
        mark_all(binding, MODE_NUMBERS[mode])
        return
    chosen = np.asarray(frames)
    _mark(binding, lambda keyed: np.where(near(keyed, chosen), MODE_NUMBERS[mode], modes_in(binding, keyed)))


def _mark(binding: Binding, numbers_on: Callable[[np.ndarray], np.ndarray]) -> None:
    """Mark the keys of a slot with the numbers of modes (n,) that a function returns for their frames (n,)."""
    marks = [numbers_on(key_points(fcurve)[:, 0].astype(np.float64)) + 1 for fcurve in binding.keyed]
    for fcurve, of_keys in zip(binding.keyed, marks, strict=True):
        write_marks(fcurve, of_keys)


def _mark_or_store(
    transform: Transform, bindings: Sequence[Binding], awaited: str, mark: Callable[[Binding], object]
) -> None:
    """Mark the editable ones of these bindings. If none has keys, store the mode on the transform."""
    if not any(binding.is_keyed for binding in bindings):
        transform.motion.awaited = awaited
    for binding in bindings:
        if binding.slot.is_editable:
            mark(binding)


def copy_modes(model: Target, targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Give the keys of targets the modes of another transform, the model, on the same frames."""
    model = transform_of(model)

    def modes_on(frames: np.ndarray) -> np.ndarray:
        return np.array([MODE_NUMBERS[mode] for mode in modes_of(model, frames)], dtype=np.int64)

    first = mode_shown(model)
    is_blenders = first == "BLENDER" and not modes_on(key_frames(model)).any()

    def plan(transform: Transform, readings: Readings) -> list[Binding]:
        return [binding for binding, _ in readings] if is_blenders else for_modes(transform, readings)

    def act(transform: Transform, bindings: list[Binding]) -> None:
        _mark_or_store(transform, bindings, first, lambda binding: _mark(binding, modes_on))

    apply_edit(targets, plan, act, refused)


def set_turns(
    targets: Targets,
    turns: int,
    frames: Sequence[float] | None = None,
    *,
    axis: str | None = None,
    refused: list[Refused] | None = None,
) -> None:
    """Set the number of extra whole turns between keys.

    Parameters
    ----------
    turns : int
        The number of turns, in the direction of the segment's own rotation; negative for the opposite direction.
    frames : sequence of float, optional
        The frames of the keys that begin the chosen segments; all others keep their turns. Without frames, all segments
        get this number.
    axis : str, optional
        The axis of turns, one of `TURN_AXES`, for all segments. The default keeps the present one.
    """

    def plan(transform: Transform, readings: Readings) -> Binding:
        binding = editable_binding(transform, for_modes(transform, readings))
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
    """Apply an edit of the turns property to the segment on the current frame."""
    source, turns = source_of(transform), transform.motion.turns
    frame = frame_in_action(transform.animated, scene().frame_current_final)
    segment = None if source is None else segment_at(source, frame)
    if segment is not None:
        set_turns(transform, turns, (segment.key,))


def repeat(targets: Targets, mode: str = "REPEAT", *, refused: list[Refused] | None = None) -> None:
    """Repeat motions before their first keys and after their last ones: add Cycles to all of their channels.

    Blender cannot add Cycles to a channel with other modifiers, and in-betweens repeat only if all channels do so
    together. The mode of cycles is REPEAT, REPEAT_OFFSET or MIRROR.
    """
    cycles = Cycles(mode, mode, 0, 0)

    def plan(transform: Transform, readings: Readings) -> Binding:
        # A transform that is refused because of its present Cycles can be mended this way.
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


def for_modes(transform: Transform, readings: Readings) -> list[Binding]:
    """Return those of a transform's bindings that can have a mode other than Blender's own.

    These must include its Action, or one of its strips if it has none; otherwise `Refused` is raised. Other strips keep
    Blender's in-betweens.
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
