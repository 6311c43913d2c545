"""Changes of held objects and their holders other than key edits: they are repaired, or reported in one line."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation.following import refreshing
from tests.animation.bones.rigs import in_turn, with_edit_bones
from tests.animation.holds.model import assert_held
from tests.animation.holds.staging import (
    FRAMES,
    LET_GO,
    PASSED,
    PICKED_UP,
    PROPS,
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
from tests.animation.keyed import snapshot
from tests.animation.oracle import shown_worlds, world_of
from tests.animation.scenes import key, new_object, push_down

__all__ = ["stage"]

# Changes of the objects themselves


def single_user(prop: bpy.types.Object) -> None:
    data = prop.animation_data
    slot = data.action_slot
    data.action = data.action.copy()
    data.action_slot = data.action.slots[slot.identifier]


CHANGES: dict[str, Callable[[bpy.types.Object], object]] = {
    "holder renamed": lambda _: setattr(found("Hand"), "name", "Left Hand"),
    "other constraint": lambda prop: setattr(prop.constraints.new("LIMIT_SCALE"), "name", "Held In Nothing"),
    "passing constraint deleted": lambda prop: prop.constraints.remove(prop.constraints["Pass To Grip"]),
}


@pytest.mark.parametrize(("change", "name"), in_turn(CHANGES, PROPS[:2]))
def test_what_is_held_is_so_whatever_is_done_to_it(stage, name, change, tmp_path):
    stage(name)
    CHANGES[change](found(name))
    update()
    assert animation.problem_of(found(name)) == ""
    assert_held([found(name)], FRAMES)
    before = shown_worlds([found(name)], FRAMES)[0]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "held.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "held.blend"))
    assert np.abs(shown_worlds([found(name)], FRAMES)[0] - before).max() < 1e-5


def test_keys_that_say_nothing_let_it_go(stage):
    """The object gets an Action of its own, from before it was held."""
    prop = stage()
    prop.animation_data.action = None
    key(prop, (1.0, 40.0), seed=3)
    update()
    assert spaces(prop) == []
    assert_held([prop], FRAMES)


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


def mute_influence(prop: bpy.types.Object) -> None:
    influence(prop, "Held In Hand").mute = True


PROBLEMS: dict[str, tuple[Callable[[bpy.types.Object], object], str]] = {
    "holder deleted": (lambda _: bpy.data.objects.remove(found("Hand")), "What held Tool is gone: choose a target in"),
    "bone deleted": (
        lambda _: with_edit_bones(found("Rig/Grip").id_data, lambda bones: bones.remove(bones["Grip"])),
        "What held Tool is gone: choose a target in its constraint Held In Grip",
    ),
    "constraint muted": (lambda prop: setattr(prop.constraints["Held In Hand"], "mute", True), "Held In Hand is muted"),
    "passing muted": (lambda prop: setattr(prop.constraints["Pass To Grip"], "mute", True), "Pass To Grip is muted"),
    "influence muted": (mute_influence, "Held In Hand is muted"),
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
    points = [(0.3, 0.1, 0.2), (1.0, 0.0, 0.0)]
    if kind == "VERTEX":
        data = bpy.data.meshes.new("Shape")
        data.from_pydata(points, [], [])
    else:
        data = bpy.data.curves.new("Path", "CURVE")
        data.use_path = True
        for point, place in zip((spline := data.splines.new("BEZIER")).bezier_points, points[:1], strict=True):
            point.co = place
        spline.bezier_points.add(1)
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
    for act in (
        lambda: animation.hold_in(found(name), found("Hand")),
        lambda: animation.hold_in(found(name), None),
    ):
        with pytest.raises(animation.Refused, match=line):
            act()
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
