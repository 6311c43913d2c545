"""What is done to held things and to what holds them, beside their keys: repaired, or said in a line."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Quaternion

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
from tests.animation.keyed import Carrier, curves_of, key_frames, snapshot
from tests.animation.oracle import shown_worlds, world_of
from tests.animation.scenes import key, linked, new_object, push_down

__all__ = ["stage"]

# What is done to the things themselves


def single_user(prop: bpy.types.Object) -> None:
    data = prop.animation_data
    slot = data.action_slot
    data.action = data.action.copy()
    data.action_slot = data.action.slots[slot.identifier]


def relink(prop: bpy.types.Object) -> None:
    action, slot = prop.animation_data.action, prop.animation_data.action_slot
    prop.animation_data.action = None
    update()
    prop.animation_data.action = action
    prop.animation_data.action_slot = slot


def rename_bones(prop: Carrier) -> None:
    for bone in found("Rig/Grip").id_data.data.bones:
        bone.name += "'s"


def new_parent(prop: bpy.types.Object) -> None:
    """What is in the space of its parent goes with it; what is held does not."""
    prop.parent = None if prop.parent else found("Parent")


def hand_over_handles(prop: bpy.types.Object) -> None:
    """Handles that stay where they are, but are Blender's from now on, which do not see the keys in other things."""
    points = [point for fcurve in moving(prop) for point in fcurve.keyframe_points]
    for handle_type in ("FREE", "AUTO_CLAMPED"):
        for point in points:
            point.handle_left_type = point.handle_right_type = handle_type
        prop.animation_data.action.update_tag()
        update()


CHANGES: dict[str, Callable[[bpy.types.Object], object]] = {
    "single user": single_user,
    "linked anew": relink,
    "bones renamed": rename_bones,
    "holder renamed": lambda _: setattr(found("Hand"), "name", "Left Hand"),
    "constraints renamed": lambda prop: [setattr(one, "name", f"Anew {n}") for n, one in enumerate(prop.constraints)],
    "other constraint": lambda prop: setattr(prop.constraints.new("LIMIT_SCALE"), "name", "Held In Nothing"),
    "parented or not": new_parent,
    "turns otherwise": lambda prop: setattr(prop, "rotation_mode", "XYZ"),
    "handles of Blender's": hand_over_handles,
    "passing constraint deleted": lambda prop: prop.constraints.remove(prop.constraints["Pass To Grip"]),
    "hand keyed": lambda _: retime(found("Hand"), lambda x: x + 1.0),
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


@pytest.mark.parametrize(("order", "mode"), [("QUATERNION", "pga_lerp"), ("YXZ", "motor_spline"), ("ZYX", "BLENDER")])
def test_keys_that_do_not_say_what_they_are_held_in_are_held_as_others_on_their_frames_say(live_file, order, mode):
    prop = key(new_object("Tool", order), (1.0, 13.0, 26.0, 37.0), seed=6)
    animation.set_mode(prop, mode)
    for frame, holder in ((11.0, key(new_object("Hand"), seed=2)), (24.0, None)):
        go_to(frame)
        animation.hold_in(prop, holder, frames=3)
    frames, prop.rotation_mode = key_frames(prop), "AXIS_ANGLE"
    random = np.random.default_rng(401)
    for frame in frames:
        prop.rotation_axis_angle = random.normal(size=4)
        prop.keyframe_insert("rotation_axis_angle", frame=frame)
    update()
    assert_held([prop], np.arange(1.0, 37.25, 0.25))


def test_unlinked_it_stays_in_what_it_is_held_in(stage):
    prop = stage()
    go_to(25.0)
    before = world_of(prop)
    prop.animation_data.action = None
    update()
    assert np.abs(world_of(prop) - before).max() < 1e-6


def test_without_keys_it_stays_in_what_it_is_held_in(stage):
    prop = stage()
    go_to(25.0)
    before = world_of(prop)
    for fcurve in moving(prop):
        fcurve.keyframe_points.clear()
    prop.animation_data.action.update_tag()
    update()
    assert np.abs(world_of(prop) - before).max() < 1e-6
    assert not any(path.startswith("constraints") for path, _ in curves_of(prop))


def test_keys_that_say_nothing_let_it_go(stage):
    """An Action of its own from before it was held, on what has been held since."""
    prop = stage()
    prop.animation_data.action = None
    key(prop, (1.0, 40.0), seed=3)
    update()
    assert spaces(prop) == []
    assert_held([prop], FRAMES)


@pytest.mark.parametrize("with_hand", [False, True])
@pytest.mark.parametrize("is_linked", [False, True])
def test_duplicates_are_held_in_the_same_or_in_what_was_duplicated_along(stage, with_hand, is_linked):
    prop = stage()
    for obj in bpy.data.objects:
        obj.select_set(obj == prop or (with_hand and obj.name == "Hand"))
    bpy.context.view_layer.objects.active = prop
    bpy.ops.object.duplicate(linked=is_linked)
    update()
    copy = bpy.data.objects["Tool.001"]
    holders = {holder.name for holder in animation.hold_facts(copy).holders}
    assert holders == {"Hand.001" if with_hand else "Hand", "Grip"}
    go_to(55.0)
    animation.hold_in(copy, found("Other"))
    assert_held([prop, copy], FRAMES)
    passing = {item.action for item in copy.constraints if item.type == "ACTION"}
    assert passing == {copy.animation_data.action}


def test_an_action_on_another_object_has_that_held_likewise(stage):
    prop, other = stage(), new_object("Second", "QUATERNION")
    other.animation_data_create().action = prop.animation_data.action
    other.animation_data.action_slot = prop.animation_data.action_slot
    prop.animation_data.action = None
    update()
    assert animation.problem_of(other) == ""
    assert_held([other], FRAMES)


def test_two_strips_pass_each_in_its_own_way(stage):
    """A constraint shows the poses of one Action alone."""
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
    # Three rounds of the hands later.
    assert np.abs(shown_worlds([prop], inside + 177.0)[0] - first).max() < 1e-4


@pytest.mark.parametrize("name", ["Tool", "Rig"])
def test_what_is_appended_or_linked_is_held_along(stage, name, tmp_path):
    stage("Rig/Bone" if name == "Rig" else "Tool")
    path = "Rig/Bone" if name == "Rig" else "Tool"
    before = shown_worlds([found(path)], FRAMES)[0]
    library = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    for is_linked in (False, True):
        bpy.ops.wm.read_homefile(use_empty=True)
        if is_linked:
            obj = linked(library, name).override_create(remap_local_usages=True)
        else:
            with bpy.data.libraries.load(str(library)) as (_, wanted):
                wanted.objects = [name]
            (obj,) = wanted.objects
            bpy.context.scene.collection.objects.link(obj)
        update()
        prop = obj.pose.bones["Bone"] if name == "Rig" else obj
        assert np.abs(shown_worlds([prop], FRAMES)[0] - before).max() < 1e-5
        if not is_linked:
            go_to(56.0)
            animation.hold_in(prop, new_object("New Hand"))
            assert_held([prop], FRAMES)


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


# What cannot be repaired is said


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
    """Others that are held in the same tell what it was."""
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
    """On the first vertex, or at the beginning of the path, of something that moves."""
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
    """It remembers where in memory they are."""
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


def visual_key(prop: Carrier, _: Matrix) -> None:
    for path in ("location", "rotation_quaternion"):
        prop.keyframe_insert(path, options={"INSERTKEY_VISUAL"})


def visual_transform(prop: Carrier, _: Matrix) -> None:
    for obj in bpy.data.objects:
        obj.select_set(obj == prop)
    bpy.context.view_layer.objects.active = prop
    bpy.ops.object.visual_transform_apply()


BLENDERS_OWN: dict[str, Callable[[Carrier, Matrix], object]] = {
    "visual key": visual_key,
    "Apply Visual Transform": visual_transform,
    "matrix_world": lambda prop, matrix: setattr(prop, "matrix_world", matrix),
}


@pytest.mark.parametrize("own", BLENDERS_OWN)
@pytest.mark.parametrize("by_hand", [False, True])
def test_blender_puts_what_a_child_of_holds_elsewhere(stage, own, by_hand):
    """Ours as any: should a Blender know better, the documentation is to be changed."""
    prop = stage(held=not by_hand)
    go_to(25.0)
    if by_hand:
        constraint = prop.constraints.new("CHILD_OF")
        constraint.target, constraint.set_inverse_pending = found("Hand"), False
        update()
    matrix = Matrix(world_of(prop))
    BLENDERS_OWN[own](prop, matrix)
    update()
    go_to(25.0) if own == "visual key" else None
    assert np.abs(world_of(prop) - np.array(matrix)).max() > 1.0


@pytest.mark.parametrize(("frame", "name"), in_turn((10.0, 25.0, 36.0, 55.5), PROPS))
def test_a_pose_that_is_keyed_stays_where_it_is_seen_in_whatever_holds_it(stage, name, frame):
    """By *Insert Keyframe*, for its channels are in the hand; not by visual keying."""
    prop = stage(name)
    go_to(frame)
    prop.matrix_basis = Matrix.LocRotScale((0.1, 0.2, -0.3), Quaternion((0.6, 0.0, 0.8, 0.0)), None)
    update()
    there = world_of(prop)
    for path in ("location", "rotation_quaternion"):
        prop.keyframe_insert(path, frame=frame)
    go_to(frame)
    assert np.abs(world_of(prop) - there).max() < 1e-5
    assert_held([prop], FRAMES)


@pytest.mark.parametrize("name", PROPS)
def test_on_the_key_that_it_passes_to_it_is_seen_as_it_is_posed(stage, name):
    stage(name)
    go_to(PASSED)
    before = world_of(found(name))
    found(name).location.x += 1.0
    update()
    assert 0.9 < np.linalg.norm((world_of(found(name)) - before)[:3, 3]) < 1.1
