"""Holding objects: sets the space of their keys, and the frames over which they pass from one holder to the next.

For targets and refusals see `apply`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import cast

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_
from mathutils import Matrix

from ..actions.channels import key_points
from ..actions.marks import hold, read_holds, read_marks, write_holds, write_marks
from ..actions.reading import is_marked
from ..actions.refusals import refuse_layered
from ..actions.slots import Binding, bindings_of
from ..evaluation.components import MODE_NUMBERS, PART_OF, ROWS, SCALE
from ..evaluation.differences import seen_values
from ..evaluation.runs import MOST_FRAMES
from ..evaluation.sources import SAME_FRAME, KeyedTransform, Marks
from ..following import follower
from ..holds.holders import Holder, add_holder, basis_in, holders_of, world_in
from ..holds.placing import matrices_of, poses_of, rows_of, world_matrix
from ..holds.problems import MAX_VALUE_ROUNDING, refuse_holder, refuse_motion, refuse_space
from ..queries.keyed import active_binding, modes_in, source_of
from ..queries.segments import frame_in_action
from ..transforms import WIDTHS, Refused, Transform, transform_of
from .apply import Readings, Target, apply_edit, editable_binding, editable_keys

HAND_TO_HAND = 4
"""The default number of frames of a pass from hand to hand. Picking up and letting go are immediate."""

DEFAULT_MODE = "motor_spline"
"""The mode for keys of held objects that have none."""

NOT_HELD_YET = n_("{name} is not passed on frame {frame:g} or later: hold it in something first (Hold In)")
NOT_SHOWN = n_("{name} is hidden or excluded, so Blender does not know where it is: show it first")
NO_SUCH_BONE = n_("{holder} has no bone {bone}: give the name of one of its pose bones")
NOT_HELD = n_("{name} is not held, so there is no grip to match: hold it first (Hold In)")
NO_GRIP = n_("{name} was not held in {holder} before frame {frame:g}, so there is no grip to match")
FRAMES_REFUSAL = n_("{frames} is not a number of frames for a pass: give a whole number from 0 to {most}")


@dataclass(frozen=True)
class HoldFacts:
    """How an object is held on the current frame."""

    holders: tuple[Holder, ...]
    """All holders that it has had."""

    now: Holder | None
    """The present holder, None if there is none."""

    switch: float | None
    """The frame of the next key at which it passes on, this frame included."""

    until: float | None
    """The frame of the next key after this frame at which it passes on; None if there is none."""

    frames: int
    """The number of frames of the pass at the switch."""

    apart: float | None
    """The distance between its places in both holders, if this frame is that of the switch; in Blender's units."""

    turned: float | None
    """The angle between them, in radians."""


def hold_in(
    prop: Target,
    holder: bpy.types.Object | bpy.types.PoseBone | None,
    bone: str | None = None,
    *,
    frames: int | None = None,
) -> None:
    """Key an object on the current frame in the space of a holder. It stays in its visible place.

    If it has no key before, or moves, it is also keyed on the frame before. Until then it moves as it did, except that
    smooth paths end there. Its keys without a mode get *Smooth Screw*.

    Parameters
    ----------
    prop
        An object or a pose bone.
    holder
        An object or a pose bone. None lets go: the key is in the space of the prop's parent, or the world.
    bone : str, optional
        The name of a bone of the holder.
    frames : int, optional
        The number of frames before the key over which it passes from its previous holder. The default is 4 from one
        holder to another, and 0 (immediately) if it is picked up or let go.

    Raises
    ------
    Refused
        If the holder follows the prop, or the prop repeats, is linked, or has a parent space that no constraint can
        place it in.
    """
    target, name = _target(holder, bone)

    def plan(transform: Transform, readings: Readings) -> KeyedTransform | None:
        if frames is not None:
            _refuse_frames(frames)
        binding = active_binding(transform, [one for one, _ in readings])
        source = next((source for one, source in readings if one is binding), None)
        if isinstance(source, Refused):
            raise source
        refuse_space(transform)
        refuse_layered(transform)
        if target is not None:
            refuse_motion(transform, source)
            for user in (transform,) if binding is None else binding.users:
                refuse_holder(user, target, name)
        if not transform.animated.evaluated_get(bpy.context.evaluated_depsgraph_get()).is_evaluated:
            raise Refused(NOT_SHOWN, name=transform.name)
        return source if source and source.channels else None

    def act(transform: Transform, source: KeyedTransform | None) -> None:
        _key_hold(transform, source, target, name, frames)

    apply_edit(prop, plan, act, None)


def hold_keys(prop: Target, frames: np.ndarray, holders: Sequence[tuple[bpy.types.Object, str] | None]) -> None:
    """Mark all keys of an object with their holders. Its channels must already have its poses in the holders' spaces.

    Parameters
    ----------
    prop
        An object or a pose bone.
    frames : array, shape (n,)
        Frames of the Action, rising.
    holders : sequence of n
        The holder of keys from each of these frames on: an object and the name of one of its bones, "" for none; or
        None for the prop's parent, or the world. Passes are immediate.

    Raises
    ------
    Refused
        If a holder follows the prop, or the prop is linked, has delta transforms, or too many holders.
    """

    def plan(transform: Transform, readings: Readings) -> Binding:
        refuse_motion(transform, None)
        for holder in dict.fromkeys(filter(None, holders)):
            refuse_holder(transform, *holder)
        return editable_binding(transform, [one for one, _ in readings])

    def act(transform: Transform, binding: Binding) -> None:
        numbers = {holder: add_holder(binding, *holder) for holder in dict.fromkeys(filter(None, holders))}
        codes = np.array([hold(numbers[holder] if holder else 0) for holder in holders])
        _mark_all(_binding_of(transform), Marks(frames - SAME_FRAME / 2, codes))

    apply_edit(prop, plan, act, None)


def match_grip(prop: Target) -> None:
    """Give an object's key on the current frame the grip that the same holder had on it before."""

    def plan(transform: Transform, readings: Readings) -> np.ndarray:
        _, source = editable_keys(transform, readings)
        frame = _current_frame(transform)
        if not source.switches:
            raise Refused(NOT_HELD, name=transform.name)
        runs = source.runs
        place = runs.index(source.run_at(frame))
        numbers = [source.hold_at(run.stretch.first)[0] for run in runs]
        before = [number for number in range(place) if numbers[number] == numbers[place]]
        if not numbers[place] or not before:
            holder = next((one.name for one in holders_of(transform) if one.number == numbers[place]), "")
            raise Refused(NO_GRIP, name=transform.name, holder=holder or "World", frame=frame)
        grip = runs[before[-1]].source
        return components_on(transform, grip, grip.keyed_range[1])

    def act(transform: Transform, rows: np.ndarray) -> None:
        key_components(transform, rows, ("location", transform.rotation))

    apply_edit(prop, plan, act, None)


def pass_frames(prop: Target, frames: int, *, at: float | None = None) -> None:
    """Set the number of frames of an object's pass to its next holder: at the switch on the current frame, or the next.

    `at` is another frame of the Action to use as the current one.
    """
    _refuse_frames(frames)

    def plan(transform: Transform, readings: Readings) -> tuple[Binding, float, int]:
        binding, source = editable_keys(transform, readings)
        frame = _current_frame(transform) if at is None else at
        switch = next((one for one in source.switches if one.frame > frame - SAME_FRAME), None)
        if switch is None:
            raise Refused(NOT_HELD_YET, name=transform.name, frame=frame)
        return binding, switch.frame, switch.after

    def act(_: Transform, planned: tuple[Binding, float, int]) -> None:
        binding, frame, number = planned
        _write_hold_code(binding, frame, hold(number, frames))

    apply_edit(prop, plan, act, None)


def hold_facts(prop: Target) -> HoldFacts:
    """Return how an object is held on the current frame."""
    transform = transform_of(prop)
    source, binding = source_of(transform), active_binding(transform, bindings_of([transform]))
    holders = () if binding is None else tuple(holders_of(transform))
    if source is None or source.held is None or binding is None:
        return HoldFacts(holders, None, None, None, 0, None, None)
    frame, by_number = _current_frame(transform), {holder.number: holder for holder in holders}
    number, _ = source.hold_at(frame)
    switch = next((one for one in source.switches if one.frame > frame - SAME_FRAME), None)
    until = next((one.frame for one in source.switches if one.frame > frame + SAME_FRAME), None)
    apart = turned = None
    if switch is not None and abs(switch.frame - frame) < SAME_FRAME:
        carried = _carried(transform, source, by_number.get(switch.before), frame)
        seen = world_matrix(transform)
        if carried is not None:
            apart = (carried.translation - seen.translation).length
            turned = carried.to_quaternion().rotation_difference(seen.to_quaternion()).angle
    frames = 0 if switch is None else source.hold_at(switch.frame)[1]
    at = None if switch is None else switch.frame
    return HoldFacts(holders, by_number.get(number), at, until, frames, apart, turned)


def _target(holder: object, bone: str | None) -> tuple[bpy.types.Object | None, str]:
    """Return the holding object and the name of its bone, "" for none."""
    if isinstance(holder, bpy.types.PoseBone):
        return cast(bpy.types.Object, holder.id_data), holder.name
    if holder is not None and not isinstance(holder, bpy.types.Object):
        raise TypeError(f"neither an object nor a pose bone: {holder!r}")
    if holder is not None and bone and (holder.pose is None or bone not in holder.pose.bones):
        raise Refused(NO_SUCH_BONE, holder=holder.name, bone=bone)
    return holder, bone or ""


def _refuse_frames(frames: int) -> None:
    if isinstance(frames, bool) or not isinstance(frames, int) or not 0 <= frames <= MOST_FRAMES:
        raise Refused(FRAMES_REFUSAL, frames=frames, most=MOST_FRAMES)


def _current_frame(transform: Transform) -> float:
    """Return the current frame in the time of the Action."""
    return frame_in_action(transform.animated, cast(bpy.types.Scene, bpy.context.scene).frame_current_final)


def _key_hold(
    transform: Transform, source: KeyedTransform | None, target: bpy.types.Object | None, bone: str, frames: int | None
) -> None:
    """Key a transform with this source in the space of a holder on the current frame."""
    seen, posed, frame = world_matrix(transform), transform.components(), _current_frame(transform)
    before = 0 if source is None else source.hold_at(frame - 2 * SAME_FRAME)[0]
    if _needs_key_before(source, frame):
        rows = components_on(transform, source, frame - 1.0)
        key_components(transform, rows, ("location", transform.rotation), frame - 1.0)
        # Like any inserted key, it does not change the motion.
        follower.refresh([transform])
    binding = _binding_of(transform)
    number = 0 if target is None else add_holder(binding, target, bone)
    passes = source is not None and any(one.begin < frame < one.frame for one in source.switches)
    if number == (0 if source is None else source.hold_at(frame)[0]) and not passes:
        # Converting to the world and back would move a resting object by rounding.
        key_components(transform, posed, ("location", transform.rotation), frame)
    else:
        _key_seen(transform, number, seen, frame)
    binding = _binding_of(transform)
    _reset_handles(binding, frame)
    _mark_all(binding, None if source is None else source.held)
    if frames is None:
        frames = HAND_TO_HAND if before and number and before != number else 0
    _write_hold_code(binding, frame, hold(number, frames if number != before else 0))
    following = (
        None if source is None else next((one for one in source.switches if one.frame > frame + SAME_FRAME), None)
    )
    if following is not None and following.begin < frame:
        # The object was already passing to the following holder: now that pass begins here.
        _write_hold_code(binding, following.frame, hold(following.after, int(following.frame - frame)))


def _key_seen(transform: Transform, number: int, seen: Matrix, frame: float) -> None:
    """Key a transform in the space of the holder with a number, at the place of a world matrix."""
    holder = next((holder for holder in holders_of(transform) if holder.number == number), None)
    basis = np.array(basis_in(transform, holder, seen))
    rows = rows_of(*poses_of(basis[None]), transform, transform.components())[:, 0]
    paths = ["location", transform.rotation]
    if not np.allclose(rows[ROWS[SCALE]], transform.components()[ROWS[SCALE]], rtol=1e-4):
        paths.append("scale")
    key_components(transform, rows, paths, frame)


def _needs_key_before(source: KeyedTransform | None, frame: float) -> bool:
    """Return whether a source has no key before a frame, or is not at rest since the last one."""
    keys = np.empty(0) if source is None else source.keyed_frames
    keys = keys[keys < frame - SAME_FRAME]
    if source is None or not len(keys):
        return True
    first, last = seen_values(source, np.array([keys[-1], max(frame - 1.0, keys[-1])])).T
    return bool(np.abs(last - first).max() > MAX_VALUE_ROUNDING)


def components_on(transform: Transform, source: KeyedTransform | None, frame: float) -> np.ndarray:
    """Return the components (10,) of a transform on a frame of a source. Parts without keys are as they are now."""
    rows = transform.components()
    if source is not None:
        is_keyed = [PART_OF[row] in source.keyed for row in range(len(rows))]
        rows[is_keyed] = seen_values(source, np.array([frame]))[is_keyed, 0]
    return rows


def _carried(transform: Transform, source: KeyedTransform, holder: Holder | None, frame: float) -> Matrix | None:
    """Return the world matrix at which a holder carries a transform on the current frame, which is that of a switch."""
    run = next((run for run in source.runs if run.stretch.until > frame - SAME_FRAME), None)
    if run is None:
        return None
    rows = components_on(transform, run.source, float(run.moments(np.array([frame]))[0]))
    return world_in(transform, holder, Matrix(matrices_of(rows[:, None], transform.order)[0].tolist()))


def key_components(transform: Transform, rows: np.ndarray, paths: Iterable[str], frame: float | None = None) -> None:
    """Key a transform's components (10,) as Blender does by hand, on a frame of its Action or the current frame."""
    scene_frame, data = cast(bpy.types.Scene, bpy.context.scene).frame_current_final, transform.animated.animation_data
    if frame is not None:
        scene_frame = frame if data is None else data.nla_tweak_strip_time_to_scene(frame)
    starts = {prop: ROWS[part].start for part, prop in transform.properties.items()}
    for path in paths:
        setattr(transform.carrier, path, rows[starts[path] :][: WIDTHS[path]])
        transform.carrier.keyframe_insert(path, frame=scene_frame, group=transform.group)


def _binding_of(transform: Transform) -> Binding:
    """Return the binding of a transform in its own Action."""
    return next(one for one in bindings_of([transform]) if one.slot.plays_in(transform.animated))


def _mark_all(binding: Binding, held: Marks | None) -> None:
    """Mark all keys with a mode and a hold if they have none: the present mode, and the holds of `held`, or none."""
    is_new = not is_marked(binding)
    for fcurve in binding.keyed:
        frames = key_points(fcurve)[:, 0].astype(np.float64)
        modes = np.full(len(frames), MODE_NUMBERS[DEFAULT_MODE]) if is_new else modes_in(binding, frames)
        marks, holds = read_marks(fcurve), read_holds(fcurve)
        write_marks(fcurve, np.where(marks, marks, modes + 1))
        said = np.zeros(len(frames), int) if held is None else held.at(frames)
        write_holds(fcurve, np.where(holds >= 0, holds, said))


def _reset_handles(binding: Binding, frame: float) -> None:
    """Let Blender set the handles of the keys on a frame, as the previous handles are in another space."""
    for fcurve in binding.keyed:
        for key in fcurve.keyframe_points:
            if abs(key.co.x - frame) < SAME_FRAME:
                key.handle_left_type = key.handle_right_type = "AUTO_CLAMPED"
        fcurve.update()


def _write_hold_code(binding: Binding, frame: float, code: int) -> None:
    """Mark the keys on a frame with a hold code: see `marks.hold`."""
    for fcurve in binding.keyed:
        is_there = np.abs(key_points(fcurve)[:, 0] - frame) < SAME_FRAME
        write_holds(fcurve, np.where(is_there, code, read_holds(fcurve)))
