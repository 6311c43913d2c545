"""Edits of held objects and their holders: keys keep their spaces, or one line reports the problem."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation.actions.marks import read_holds
from rigid_motion.animation.following import refreshing
from tests.animation.bones.rigs import in_turn, with_edit_bones
from tests.animation.holds.model import assert_held
from tests.animation.holds.staging import FRAMES, LET_GO, PASSED, PICKED_UP, PROPS, found, go_to, stage, update
from tests.animation.keyed import WIDTHS, Carrier, curves_of, snapshot
from tests.animation.oracle import shown_worlds, world_of
from tests.animation.scenes import key, new_object, push_down

__all__ = ["stage"]


def spaces(prop: Carrier) -> list[tuple[float, int]]:
    """Return the frames of switches, and the numbers of the new holders."""
    return [(switch.frame, switch.after) for switch in animation.queries.keyed.source_of(prop).switches]


def influence(prop: Carrier, constraint: str) -> bpy.types.FCurve:
    return next(c for (path, _), c in curves_of(prop).items() if f'"{constraint}"].influence' in path)


def moving(prop: Carrier) -> list[bpy.types.FCurve]:
    return [curve for (path, _), curve in curves_of(prop).items() if path in WIDTHS]


def retime(prop: Carrier, to: Callable[[float], float], curves: Sequence[bpy.types.FCurve] | None = None) -> None:
    for fcurve in curves or curves_of(prop).values():
        for point in fcurve.keyframe_points:
            point.co_ui.x = to(point.co.x)
        fcurve.update()


def delete(prop: Carrier, frame: float) -> None:
    for fcurve in moving(prop):
        for point in reversed(fcurve.keyframe_points):
            if abs(point.co.x - frame) < 0.01:
                fcurve.keyframe_points.remove(point)
        fcurve.update()


def copy(prop: Carrier, frame: float, by: float) -> None:
    """Duplicate keys as Shift D does."""
    for fcurve in moving(prop):
        there = next(point for point in fcurve.keyframe_points if abs(point.co.x - frame) < 0.01)
        fields = {field: getattr(there, field) for field in ("back", "amplitude", "period")}
        made = fcurve.keyframe_points.insert(there.co.x + by, there.co.y)
        for field, value in fields.items():
            setattr(made, field, value)
        fcurve.update()


SAME = [(PICKED_UP, 1), (PASSED, 2), (LET_GO, 0)]


def single_user(prop: Carrier) -> None:
    data = prop.id_data.animation_data
    slot = data.action_slot
    data.action = data.action.copy()
    data.action_slot = data.action.slots[slot.identifier]


def keys_from_before(prop: Carrier) -> None:
    """Give it an Action of its own, from before it was held."""
    prop.id_data.animation_data.action = None
    key(prop, (1.0, 40.0), seed=3)


def insert(prop: Carrier, frame: float, path: str, index: int = -1) -> None:
    go_to(frame)
    prop.keyframe_insert(path, frame=frame, index=index)


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
    "keys that say nothing": (keys_from_before, []),
    "influence moved": (lambda prop: retime(prop, lambda x: x + 3.0, [influence(prop, "Held In Hand")]), SAME),
    "influence deleted": (
        lambda prop: [influence(prop, name).keyframe_points.clear() for name in ("Held In Hand", "Pass To Grip")],
        SAME,
    ),
    "inserted in a hold": (lambda prop: insert(prop, 25.0, "location", 1), SAME),
    "inserted in a pass": (lambda prop: insert(prop, 34.0, "location"), SAME),
    "inserted before a switch": (lambda prop: insert(prop, 48.25, "rotation_quaternion"), SAME),
    "holder renamed": (lambda _: setattr(found("Hand"), "name", "Left Hand"), SAME),
    "other constraint": (lambda prop: setattr(prop.constraints.new("LIMIT_SCALE"), "name", "Held In Nothing"), SAME),
    "passing constraint deleted": (lambda prop: prop.constraints.remove(prop.constraints["Pass To Grip"]), SAME),
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
    for setting in ("amplitude", "period", "back"):
        # All keys may get it at once, by *Copy to Selected*.
        for fcurve in moving(prop):
            for point in fcurve.keyframe_points:
                setattr(point, setting, typed)
            fcurve.update()
        update()
        assert spaces(prop) == expected
        # `back` also stores the mode.
        assert setting == "back" or np.abs(shown_worlds([prop], FRAMES)[0] - before).max() < 1e-5


def test_two_strips_pass_each_in_its_own_way(stage):
    """A constraint shows the poses of only one Action."""
    prop = stage()
    action, slot = prop.animation_data.action, prop.animation_data.action_slot
    inside = FRAMES[(FRAMES > 4.0) & (FRAMES < 60.0)]
    for carrier in ("Hand", "Rig/Grip"):
        animation.repeat(found(carrier))
    first = shown_worlds([prop], inside)[0]
    single_user(prop)
    retime(prop, lambda x: x + (3.0 if x < LET_GO else 0.0), moving(prop))
    update()
    second = shown_worlds([prop], inside)[0]
    push_down(prop, 4)
    strip = prop.animation_data.nla_tracks.new().strips.new("First", 178, action)
    strip.action_slot, strip.extrapolation = slot, "HOLD_FORWARD"
    update()
    assert np.abs(shown_worlds([prop], inside)[0] - second).max() < 1e-5
    # After three cycles of the hands.
    assert np.abs(shown_worlds([prop], inside + 177.0)[0] - first).max() < 1e-4


def test_a_mirrored_bone_is_held_when_it_is_keyed(stage):
    stage("Rig/Bone")
    rig = found("Rig/Bone").id_data
    with_edit_bones(rig, lambda bones: setattr(bones["Bone"], "name", "Bone.L"))

    def symmetrize(bones: bpy.types.ArmatureEditBones) -> None:
        for bone in bones:
            bone.select = bone.select_head = bone.select_tail = bone.name == "Bone.L"
        bpy.ops.armature.symmetrize()

    with_edit_bones(rig, symmetrize)
    update()
    assert animation.problem_of(found("Rig/Bone.L")) == ""
    assert_held([found("Rig/Bone.L")], FRAMES)
    go_to(30.0)
    found("Rig/Bone.R").rotation_mode = "QUATERNION"
    animation.hold_in(found("Rig/Bone.R"), found("Other"))
    assert_held([found("Rig/Bone.R")], FRAMES[FRAMES > 30.0])


# Problems that cannot be repaired are reported


PROBLEMS: dict[str, tuple[Callable[[bpy.types.Object], object], str]] = {
    "holder deleted": (lambda _: bpy.data.objects.remove(found("Hand")), "What held Tool is gone: choose a target in"),
    "bone deleted": (
        lambda _: with_edit_bones(found("Rig/Grip").id_data, lambda bones: bones.remove(bones["Grip"])),
        "What held Tool is gone: choose a target in its constraint Held In Grip",
    ),
    "constraint muted": (lambda prop: setattr(prop.constraints["Held In Hand"], "mute", True), "Held In Hand is muted"),
    "passing muted": (lambda prop: setattr(prop.constraints["Pass To Grip"], "mute", True), "Pass To Grip is muted"),
    "influence muted": (lambda prop: setattr(influence(prop, "Held In Hand"), "mute", True), "Held In Hand is muted"),
    "cycles": (lambda prop: animation.repeat(prop), "Tool repeats by Cycles, and cannot be held"),
    "delta transforms": (lambda prop: setattr(prop, "delta_location", (1.0, 0.0, 0.0)), "Tool has delta transforms"),
    "hand parented": (
        lambda prop: setattr(found("Hand"), "parent", prop),
        "Tool cannot be held in Hand, which follows it",
    ),
    "hand constrained": (
        lambda prop: (
            setattr(found("Parent").constraints.new("COPY_LOCATION"), "target", prop)
            or setattr(found("Hand"), "parent", found("Parent"))
        ),
        "Tool cannot be held in Hand, which follows it",
    ),
    "hand driven": (
        lambda prop: setattr(
            found("Hand").driver_add("delta_location", 0).driver.variables.new().targets[0], "id", prop
        ),
        "Tool cannot be held in Hand, which follows it",
    ),
    "arm reaches for it": (
        lambda prop: setattr(found("Rig/Grip").constraints.new("IK"), "target", prop),
        "Tool cannot be held in Grip, which follows it",
    ),
}


@pytest.mark.parametrize("what", PROBLEMS)
def test_what_is_amiss_is_said_in_a_line(stage, what):
    change, line = PROBLEMS[what]
    prop = stage()
    assert animation.problem_of(prop) == ""
    change(prop)
    update()
    assert line in animation.problem_of(found("Tool"))


def test_a_constraint_that_was_deleted_and_is_nowhere_else_is_missed(stage):
    """Other objects with the same holder identify the missing target."""
    prop, other = stage(), new_object("Second", "QUATERNION")
    prop.constraints.remove(prop.constraints["Held In Hand"])
    update()
    assert "Tool say that it is held from frame 20 on, but not in what" in animation.problem_of(prop)
    go_to(5.0)
    animation.hold_in(other, found("Hand"))
    animation.refresh()
    assert animation.problem_of(prop) == ""
    assert_held([prop], FRAMES)


def test_two_cannot_hold_each_other(stage):
    prop, other = stage(), new_object("Second", "QUATERNION")
    animation.hold_in(other, prop)
    with pytest.raises(animation.Refused, match="Tool cannot be held in Second"):
        animation.hold_in(prop, other)


def hang(prop: bpy.types.Object, kind: str) -> None:
    """Parent the prop to the first vertex of a moving mesh, or to the start of a moving path."""
    if kind == "VERTEX":
        data = bpy.data.meshes.new("Shape")
        data.from_pydata([(0.3, 0.1, 0.2)], [], [])
    else:
        data = bpy.data.curves.new("Path", "CURVE")
        data.use_path = True
        data.splines.new("BEZIER").bezier_points.add(1)
    prop.parent, prop.parent_type = key(new_object("Shape", data=data), seed=5), kind
    update()


@pytest.mark.parametrize(
    ("name", "change", "line"),
    [
        ("Tool", lambda prop: hang(prop, "VERTEX"), "Tool hangs on vertices or the path"),
        ("Tool", lambda prop: hang(prop, "OBJECT"), "Tool hangs on vertices or the path"),
        ("Tool", lambda prop: setattr(prop, "delta_location", (1.0, 0.0, 0.0)), "Tool has delta transforms"),
        (
            "Rig/Grip",
            lambda grip: with_edit_bones(
                grip.id_data,
                lambda bones: [
                    setattr(bones["Grip"], *one) for one in (("parent", bones["Bone"]), ("use_connect", True))
                ],
            ),
            "Grip is connected to its parent",
        ),
    ],
)
def test_where_no_constraint_can_place_it_nothing_is_keyed(stage, name, change, line):
    stage(name, held=False)
    change(found(name))
    before = snapshot(found(name))
    for holder in (found("Hand"), None):
        with pytest.raises(animation.Refused, match=line):
            animation.hold_in(found(name), holder)
    assert snapshot(found(name)) == before


def test_keys_are_only_moved_while_blender_moves_keys(stage, monkeypatch):
    """Blender remembers the keys' addresses in memory."""
    prop = stage()
    monkeypatch.setattr(refreshing, "is_keying_safe", lambda: False)
    places = {key.as_pointer() for key in influence(prop, "Held In Hand").keyframe_points}
    retime(prop, lambda x: 30.0 if x == PASSED else x, moving(prop))
    update()
    assert places == {key.as_pointer() for key in influence(prop, "Held In Hand").keyframe_points}
    assert spaces(prop)[1] == (30.0, 2)
    assert [key.co.x for key in influence(prop, "Held In Hand").keyframe_points] == [1.0, 20.0, 30.0]
    delete(prop, 30.0)
    update()
    assert places == {key.as_pointer() for key in influence(prop, "Held In Hand").keyframe_points}
    monkeypatch.undo()
    retime(prop, lambda x: 22.0 if x == PICKED_UP else x, moving(prop))
    update()
    assert_held([prop], FRAMES)


@pytest.mark.parametrize("name", PROPS)
def test_on_the_key_that_it_passes_to_it_is_seen_as_it_is_posed(stage, name):
    stage(name)
    go_to(PASSED)
    before = world_of(found(name))
    found(name).location.x += 1.0
    update()
    assert 0.9 < np.linalg.norm((world_of(found(name)) - before)[:3, 3]) < 1.1
