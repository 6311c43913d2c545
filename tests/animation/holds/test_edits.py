"""Edits of held objects and their holders: keys keep their spaces, or one line reports the problem."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation.actions.marks import read_holds
from tests.animation.bones.rigs import in_turn
from tests.animation.holds.model import assert_held
from tests.animation.holds.staging import (
    FRAMES,
    LET_GO,
    PASSED,
    PICKED_UP,
    PROPS,
    copy,
    delete,
    found,
    go_to,
    influence,
    moving,
    retime,
    spaces,
    stage,
    update,
)
from tests.animation.keyed import Carrier
from tests.animation.oracle import shown_worlds, world_of
from tests.animation.scenes import new_object

__all__ = ["stage"]

EDITS: dict[str, tuple[Callable[[Carrier], object], list[tuple[float, int]]]] = {
    "all keys moved": (lambda prop: retime(prop, lambda x: x + 7.5), [(27.5, 1), (43.5, 2), (57.5, 0)]),
    "scaled": (lambda prop: retime(prop, lambda x: 2 * x), [(40.0, 1), (72.0, 2), (100.0, 0)]),
    "one key moved": (
        lambda prop: retime(prop, lambda x: 44.0 if x == PASSED else x, moving(prop)),
        [(20.0, 1), (44.0, 2), (50.0, 0)],
    ),
    "one channel moved": (
        lambda prop: retime(prop, lambda x: 46.0 if x == LET_GO else x, moving(prop)[:1]),
        [(20.0, 1), (36.0, 2), (46.0, 0)],
    ),
    "copied": (lambda prop: copy(prop, PICKED_UP, 22.0), [(20.0, 1), (36.0, 2), (42.0, 1), (50.0, 0)]),
    "put down deleted": (lambda prop: delete(prop, LET_GO), [(20.0, 1), (36.0, 2), (60.0, 0)]),
    "picked up deleted": (lambda prop: delete(prop, PICKED_UP), [(36.0, 2), (50.0, 0)]),
    "influence moved": (
        lambda prop: retime(prop, lambda x: x + 3.0, [influence(prop, "Held In Hand")]),
        [(20.0, 1), (36.0, 2), (50.0, 0)],
    ),
    "influence deleted": (
        lambda prop: [influence(prop, name).keyframe_points.clear() for name in ("Held In Hand", "Pass To Grip")],
        [(20.0, 1), (36.0, 2), (50.0, 0)],
    ),
    "inserted in a hold": (
        lambda prop: [(go_to(25.0), prop.keyframe_insert("location", frame=25.0, index=1))],
        [(20.0, 1), (36.0, 2), (50.0, 0)],
    ),
    "inserted in a pass": (
        lambda prop: [(go_to(34.0), prop.keyframe_insert("location", frame=34.0))],
        [(20.0, 1), (36.0, 2), (50.0, 0)],
    ),
    "inserted before a switch": (
        lambda prop: [(go_to(48.25), prop.keyframe_insert("rotation_quaternion", frame=48.25))],
        [(20.0, 1), (36.0, 2), (50.0, 0)],
    ),
}


@pytest.mark.parametrize(("edit", "name"), in_turn(EDITS, PROPS))
def test_keys_take_their_space_along(stage, name, edit):
    change, expected = EDITS[edit]
    before = shown_worlds([stage(name)], FRAMES)[0]
    go_to(30.0)
    change(found(name))
    update()
    bpy.ops.ed.undo_push(message="Edit")
    after = shown_worlds([found(name)], FRAMES)[0]
    for _ in range(2):
        assert spaces(found(name)) == expected
        assert_held([found(name)], FRAMES)
        assert animation.problem_of(found(name)) == ""
        bpy.ops.ed.undo()
        assert np.abs(shown_worlds([found(name)], FRAMES)[0] - before).max() < 1e-5
        bpy.ops.ed.redo()
    assert np.abs(shown_worlds([found(name)], FRAMES)[0] - after).max() < 1e-5
    if edit.startswith("in"):
        assert np.abs(after - before).max() < (1e-5 if "influence" in edit or "hold" in edit else np.inf)


@pytest.mark.parametrize(("frame", "name"), in_turn((1.0, 20.4, 34.0), PROPS))
def test_it_stays_where_it_is_seen_in_whatever_it_is_held(stage, name, frame):
    stage(name)
    for holder in ("Other", "Hand", None):
        go_to(frame)
        before = world_of(found(name))
        animation.hold_in(found(name), holder and found(holder))
        go_to(frame)
        assert np.abs(world_of(found(name)) - before).max() < 1e-5
        now = animation.hold_facts(found(name)).now
        assert (now and now.name) == holder
        assert_held([found(name)], FRAMES)


def test_what_moves_does_so_until_it_is_held(stage):
    prop = stage(held=False)
    go_to(PICKED_UP)
    frames = FRAMES[FRAMES <= 19.0]
    before = shown_worlds([prop], frames)[0]
    animation.hold_in(prop, found("Hand"))
    assert np.abs(shown_worlds([prop], frames)[0] - before).max() < 2e-5


def test_all_users_of_a_slot_are_held(stage):
    prop, other = stage(), new_object("Second", "QUATERNION")
    other.animation_data_create().action = prop.animation_data.action
    other.animation_data.action_slot = prop.animation_data.action_slot
    update()
    go_to(55.0)
    animation.hold_in(prop, found("Other"))
    assert_held([prop, other], FRAMES)
    with pytest.raises(animation.Refused, match="Second cannot be held in itself"):
        animation.hold_in(prop, other)


@pytest.mark.parametrize("hide", ["hide_viewport", "excluded", "hidden"])
def test_what_is_hidden_holds_and_what_is_not_there_is_refused(stage, hide):
    prop, hand = stage(held=False), found("Other")

    def hidden(obj: bpy.types.Object) -> None:
        if hide == "excluded":
            collection = bpy.data.collections.new("Away")
            bpy.context.scene.collection.children.link(collection)
            collection.objects.link(obj)
            bpy.context.scene.collection.objects.unlink(obj)
            bpy.context.view_layer.layer_collection.children[collection.name].exclude = True
        elif hide == "hidden":
            obj.hide_set(True)
        else:
            obj.hide_viewport = True
        update()

    hidden(hand)
    go_to(30.0)
    before = world_of(prop)
    animation.hold_in(prop, hand)
    update()
    assert np.abs(world_of(prop) - before).max() < 1e-5
    assert_held([prop], FRAMES)
    hidden(found("Tool"))
    go_to(40.0)
    if hide == "hidden":
        animation.hold_in(prop, None)
    else:
        with pytest.raises(animation.Refused, match="Tool is hidden or excluded"):
            animation.hold_in(prop, None)


@pytest.mark.parametrize(("seed", "name"), in_turn(range(6), PROPS))
def test_a_setting_that_is_typed_takes_no_hold_and_no_mode_off(stage, name, seed):
    """*Back*, *Amplitude* or *Period* of the active key, in the Graph Editor's sidebar: one key of one channel."""
    prop, random = stage(name), np.random.default_rng(seed)
    frames = animation.key_frames(prop)
    before, expected, modes = shown_worlds([prop], FRAMES)[0], spaces(prop), animation.modes_of(prop, frames)
    for _ in range(30):
        fcurve = moving(prop)[random.integers(len(moving(prop)))]
        point = fcurve.keyframe_points[random.integers(len(fcurve.keyframe_points))]
        typed = random.choice([0.0, 0.3, 1.0, 1.7, 2.0, 4.1, random.uniform(0.0, 9.0)])
        setattr(point, random.choice(["back", "amplitude", "period"]), typed)
        fcurve.update()
        update()
        assert spaces(prop) == expected
        assert animation.modes_of(prop, frames) == modes
    assert {bytes(read_holds(fcurve)) for fcurve in moving(prop)} == {bytes(read_holds(moving(prop)[0]))}
    assert np.abs(shown_worlds([prop], FRAMES)[0] - before).max() < 1e-5


@pytest.mark.parametrize(("setting", "typed"), in_turn(["back", "amplitude", "period"], (0.0, 0.8, 1.70158, 5.0, 8.3)))
@pytest.mark.parametrize("name", PROPS[1:])
def test_a_setting_that_all_keys_get_at_once_takes_no_hold_off(stage, name, setting, typed):
    """As *Copy to Selected* of a field does."""
    prop = stage(name)
    before, expected = shown_worlds([prop], FRAMES)[0], spaces(prop)
    for fcurve in moving(prop):
        for point in fcurve.keyframe_points:
            setattr(point, setting, typed)
        fcurve.update()
    update()
    assert spaces(prop) == expected
    if setting != "back":
        # `back` also stores the mode.
        assert np.abs(shown_worlds([prop], FRAMES)[0] - before).max() < 1e-5
