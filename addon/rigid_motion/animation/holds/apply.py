"""Apply holds: update the constraints of held objects from their keys: influences, and poses to arrive in."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import cast

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...blender import channelbag_in
from ..actions.channels import ensure_group, key_points, replace_keys
from ..actions.marks import hold, mend_marks, read_holds, write_holds
from ..actions.slots import Binding
from ..evaluation.components import PART_OF
from ..evaluation.sources import KeyedTransform
from ..fcurves.keys import BEZIER, CONSTANT, LINEAR
from ..transforms import GROUP_NAME, Channel, Transform
from .dependencies import follows, node_of
from .holders import (
    HOLD_KINDS,
    Constraint,
    Holder,
    add_constraint,
    add_passing,
    channel_of,
    constraints_to,
    holders_of,
    is_ours,
    keep_space,
    known_holder,
    passings_in,
    passings_of,
    spoken_of,
)
from .keying import InfluenceKeys, Passing, holding_keys, passing, passing_keys
from .placing import hang_of, matrices_of, poses_of, rows_of

MAX_SAME_FRAMES = 1e-4
"""Handles whose frames differ by less are the same."""


def has_holders(binding: Binding) -> bool:
    """Return whether any user of a binding has holding constraints of this extension."""
    return any(is_ours(constraint) for user in binding.users for constraint in user.carrier.constraints)


def restore_holds(binding: Binding) -> None:
    """Restore the holds of keys in which a setting was typed over, from the effect of the constraints on their frames.

    Keys of all channels may have lost their holds at once, as the Graph Editor copies a setting to all selected keys.
    """
    lost = [(fcurve, places) for fcurve in binding.moving.values() if (places := mend_marks(fcurve)).any()]
    if not lost:
        return
    holding, passings = (
        {number: binding.curves[one] for one, number in _influences(binding, of_user).items() if one in binding.curves}
        for of_user in (constraints_to, partial(_passings, binding=binding))
    )

    def held_on(frame: float) -> int:
        number = next((number for number, one in holding.items() if one.evaluate(frame + MAX_SAME_FRAMES) > 0.5), 0)
        ends = key_points(passings[number])[:, 0] if number in passings else np.empty(0)
        begins = ends[:-2][np.abs(ends[2:] - frame) < MAX_SAME_FRAMES]
        return hold(number, round(frame - float(begins[0])) if len(begins) else 0)

    for fcurve, places in lost:
        frames, holds = key_points(fcurve)[:, 0].tolist(), read_holds(fcurve)
        holds[places] = [held_on(frames[place]) for place in np.flatnonzero(places).tolist()]
        write_holds(fcurve, holds)


def apply_holds(binding: Binding, source: KeyedTransform, *, may_key: bool = True) -> bool:
    """Make the constraints of a transform hold it as its keys say. Returns whether anything was changed.

    Unless `may_key`, keys are only moved, not added, because Blender remembers their memory addresses; the rest is done
    later.
    """
    if source.held is None and not has_holders(binding):
        return False
    if not source.channels:
        # Without keys it stays in its present holder.
        return may_key and _remove_influences(binding)
    if may_key:
        changed = _add_missing_constraints(binding, source)
    elif not all(_is_complete(user, source, binding) for user in binding.users):
        return False
    else:
        changed = False
    holding, passings = _influences(binding, constraints_to), _influences(binding, partial(_passings, binding=binding))
    for keys_for, channels in ((holding_keys, holding), (passing_keys, passings)):
        for channel, number in channels.items():
            changed |= _write_influence(binding, channel, keys_for(source, number), may_key)
    none = InfluenceKeys(np.array([source.keyed_range[0]]), np.zeros(1), np.full(1, CONSTANT))
    for user in binding.users:
        ours = _passings(user, binding).values()
        # Constraints that pass in another Action have no effect in this one, even if keys copied from there name them.
        for constraint in (item for item in passings_of(user) if item not in ours):
            changed |= _write_influence(binding, channel_of(user, constraint), none, may_key)
    if passings and may_key and (poses := passing(source)) is not None:
        changed |= _write_arrival_poses(binding, source, poses)
    return changed


def _passings(user: Transform, binding: Binding) -> dict[int, Constraint]:
    return passings_in(user, binding.slot.action)


def _of_all_users(binding: Binding, of_user: Callable) -> dict[int, Constraint]:
    """Return the passing constraints of all users of a binding by number; the first user with a number counts."""
    return {number: item for user in reversed(binding.users) for number, item in of_user(user).items()}


def _influences(binding: Binding, of_user: Callable) -> dict[Channel, int]:
    """Return the numbers of constraints by the channels of their influences, which may differ in name between users."""
    return {
        channel_of(user, item): number for user in reversed(binding.users) for number, item in of_user(user).items()
    }


def channels_of(binding: Binding) -> set[Channel]:
    """Return the channels of all holding constraints of this extension, which are written from the transforms' keys."""
    ours = [(user, item) for user in binding.users for item in user.carrier.constraints if is_ours(item)]
    return {channel_of(user, item, prop) for user, item in ours for prop in ("influence", "eval_time")}


def _remove_influences(binding: Binding) -> bool:
    """Remove the F-curves of all holding constraints. Returns whether there were any."""
    there = channels_of(binding) & binding.curves.keys()
    for channel in there:
        binding.remove_curve(channel)
    return bool(there)


def _is_complete(user: Transform, source: KeyedTransform, binding: Binding) -> bool:
    held, passed = spoken_of(source)
    return held.keys() <= constraints_to(user).keys() and passed <= _passings(user, binding).keys()


def _add_missing_constraints(binding: Binding, source: KeyedTransform) -> bool:
    """Add missing constraints to all users if their holders are known, and update the spaces they are evaluated in."""
    (held, passed), changed = spoken_of(source), False
    for user in binding.users:
        if not user.animated.is_editable:
            continue
        for number in sorted(held.keys() - constraints_to(user).keys()):
            known = known_holder(binding, number)
            if known is not None and not follows(
                (cast(bpy.types.Object, known[0].target), known[0].bone), node_of(user)
            ):
                add_constraint(user, *known)
                changed = True
        holders = {0: Holder(0, None, ""), **{holder.number: holder for holder in holders_of(user)}}
        for number in sorted((passed & holders.keys()) - _passings(user, binding).keys()):
            fellow = _of_all_users(binding, partial(_passings, binding=binding)).get(number)
            label = f"{HOLD_KINDS['ACTION']} {holders[number].name or 'World'}" if fellow is None else fellow.name
            add_passing(user, holders[number], label)
            changed = True
        ours = _passings(user, binding)
        for constraint in (*constraints_to(user).values(), *filter(None, (ours.get(0),))):
            changed |= keep_space(constraint, user)
    return changed


def _write_influence(binding: Binding, channel: Channel, keys: InfluenceKeys, may_key: bool = True) -> bool:
    """Give an F-curve of a constraint these keys. Returns whether it had others."""
    if not may_key and len(binding.curves[channel].keyframe_points if channel in binding.curves else ()) != len(
        keys.frames
    ):
        return False
    fcurve, user = binding.ensure_curve(channel), binding.users[0]
    if fcurve.group is None and may_key:
        fcurve.group = ensure_group(binding.channelbag, user.carrier.name if user.is_part else GROUP_NAME)
    points = fcurve.keyframe_points
    desired = np.column_stack((keys.frames, keys.values)).astype(np.float32)
    eases = np.flatnonzero(keys.interpolations == BEZIER)
    third = (desired[eases + 1, 0] - desired[eases, 0]) / 3
    level = np.column_stack((third, np.zeros(len(eases))))
    handles = [("right", eases, level), ("left", eases + 1, -level)]
    codes = np.empty(len(points), np.int32)
    points.foreach_get("interpolation", codes)
    if (
        np.array_equal(codes, keys.interpolations)
        and np.array_equal(key_points(fcurve), desired)
        and all(
            np.abs(key_points(fcurve, f"handle_{side}")[at] - desired[at] - off).max(initial=0) < MAX_SAME_FRAMES
            for side, at, off in handles
        )
    ):
        return False
    if may_key:
        replace_keys(fcurve, keys.frames, keys.values, interpolation=keys.interpolations)
    else:
        points.foreach_set("co", desired.ravel())
        points.foreach_set("interpolation", keys.interpolations.astype(np.int32))
    for side, places, offs in handles:
        for place, off in zip(places.tolist(), offs.tolist(), strict=True):
            setattr(points[place], f"handle_{side}_type", "FREE")
            setattr(points[place], f"handle_{side}", points[place].co + Vector(off))
    if may_key:
        fcurve.update()
    return True


def _write_arrival_poses(binding: Binding, source: KeyedTransform, poses: Passing) -> bool:
    """Make the passing constraints show the poses in which the object arrives."""
    slot, changed, last = _slot_of(binding), False, int(np.ceil(poses.frames[-1]))
    bag = channelbag_in(binding.slot.action.layers[0].strips[0], slot)
    user = binding.users[0]
    # Parts without keys stay as they are.
    lacking = [PART_OF[row] not in source.keyed for row in range(len(poses.rows))]
    poses.rows[lacking] = user.components()[lacking, None]
    rows = _in_spaces(user, poses, {holder.number: holder.offset for holder in holders_of(user)})
    values = {channel: rows[row] for row, channel in user.channels.items()}
    if not user.is_part and user.order is None:
        # Action constraints rotate objects by a delta quaternion of length 0, which is half a turn about X.
        identity = np.ones(1), *np.zeros((3, 1))
        values |= {("delta_rotation_quaternion", index): one for index, one in enumerate(identity)}
    for (path, index), numbers in values.items():
        fcurve = bag.fcurves.find(path, index=index) or bag.fcurves.new(path, index=index)
        frames, there = poses.frames[: len(numbers)], key_points(fcurve)
        desired = np.column_stack((frames, numbers)).astype(np.float32)
        if there.shape != desired.shape or not np.allclose(there, desired, rtol=0.0, atol=1e-7):
            replace_keys(fcurve, frames, numbers)
            changed = True
    for user in binding.users:
        for number, constraint in _passings(user, binding).items():
            if (keys := poses.clocks.get(number)) is not None:
                clock = InfluenceKeys(keys[:, 0], keys[:, 1] / last, np.full(len(keys), LINEAR))
                changed |= _write_influence(binding, channel_of(user, constraint, "eval_time"), clock)
            shows = binding.slot.action, slot, 0, last
            if (constraint.action, constraint.action_slot, constraint.frame_start, constraint.frame_end) != shows:
                constraint.action, constraint.action_slot = binding.slot.action, slot
                constraint.frame_start, constraint.frame_end = 0, last
                changed = True
    return changed


def _in_spaces(user: Transform, poses: Passing, offsets: dict[int, Matrix]) -> np.ndarray:
    """Return poses (10, m) in the spaces of the constraints; `offsets` are the channel spaces in those."""
    rows = poses.rows.copy()
    for number, offset in {0: hang_of(user), **offsets}.items():
        at = np.flatnonzero(poses.numbers == number)
        if len(at) and offset != Matrix():
            placed = np.array(offset) @ matrices_of(rows[:, at], user.order)
            rows[:, at] = rows_of(*poses_of(placed), user, rows[:, at[0]])
    return rows


def _slot_of(binding: Binding) -> bpy.types.ActionSlot:
    """Return the slot with the poses in which the slot's users arrive; create it if there is none."""
    action = binding.slot.action
    own = next(slot for slot in action.slots if slot.handle == binding.slot.handle)
    name = f"{own.name_display} passing"
    return next((slot for slot in action.slots if slot.name_display == name), None) or action.slots.new("OBJECT", name)
