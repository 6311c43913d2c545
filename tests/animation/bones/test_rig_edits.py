"""Whatever is done to rigs, bones show what their keys and modes say by now, and nothing stale is left."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import tau

import bpy
import numpy as np
import pytest
from mathutils import Euler

from rigid_motion.animation import modes_of, problem_of, refresh, set_mode, set_turns
from rigid_motion.animation.actions.marks import read_marks
from tests.animation.bones.poses import assert_posed, seen, shown_poses
from tests.animation.bones.rigs import (
    ARM,
    BETWEEN,
    FRAMES,
    Rest,
    key_all,
    moving_rig,
    new_rig,
    select_only,
    with_edit_bones,
    write_bone,
)
from tests.animation.keyed import curves_of, snapshot
from tests.animation.modified import is_term
from tests.animation.scenes import push_down

HANDS = (
    Rest("Body", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    Rest("Hand.L", (0.5, 0.0, 1.0), (1.0, 0.1, 1.0), "Body", roll=0.3),
    Rest("Hand.R", (-0.5, 0.0, 1.0), (-1.0, 0.1, 1.0), "Body", roll=-0.3),
)
"""Two bones that mirror each other."""


def assert_nothing_stale(*actions: bpy.types.Action) -> None:
    """Terms are as they would be planned now, and in no channels of a bone without a mode that a rig has."""
    assert refresh() == 0
    bones = {f"{bone.path_from_id()}." for obj in bpy.data.objects if obj.pose for bone in obj.pose.bones}
    for action in actions or bpy.data.actions:
        for channelbag in (bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags):
            for bone in bones:
                curves = [fcurve for fcurve in channelbag.fcurves if fcurve.data_path.startswith(bone)]
                if any(is_term(modifier) for fcurve in curves for modifier in fcurve.modifiers):
                    assert any((read_marks(fcurve) > 1).any() for fcurve in curves), f"{bone} in {action.name}"


def make_lower_fore(rig: bpy.types.Object) -> None:
    rig.data.bones["Lower"].name = "Fore"


def swap_two(rig: bpy.types.Object) -> None:
    rig.data.bones["Lower"].name = "Spare"
    rig.data.bones["Upper"].name = "Lower"
    rig.data.bones["Spare"].name = "Upper"


def whole_mode(pose_bone: bpy.types.PoseBone) -> str:
    """The mode that a bone has from its first key on, which its property shows."""
    (mode,) = modes_of(pose_bone, np.array(FRAMES[:1]))
    assert pose_bone.rigid_motion.mode == mode
    return mode


def modes_in(rig: bpy.types.Object) -> dict[str, str]:
    """The bones of a rig that have a mode other than Blender's."""
    modes = {pose_bone.name: whole_mode(pose_bone) for pose_bone in rig.pose.bones}
    return {name: mode for name, mode in modes.items() if mode != "BLENDER"}


def rig_of_two_modes(name: str = "Rig", **settings: object) -> bpy.types.Object:
    """The arm, with a mode on Upper, another on Lower, and none on the others."""
    rig = key_all(new_rig(name), **settings)
    set_mode(rig.pose.bones["Upper"], "dq_sclerp")
    set_mode(rig.pose.bones["Lower"], "pga_lerp")
    bpy.context.view_layer.update()
    return rig


# Names


def test_names_swapped_are_swapped_in_strips_and_not_in_actions_that_the_rig_does_not_use(live_file):
    rig = rig_of_two_modes()
    stashed, unused = rig.animation_data.action, rig.animation_data.action.copy()
    unused.use_fake_user = True
    push_down(rig)
    rig.animation_data.nla_tracks[0].mute = True
    key_all(rig, seed=3)
    bpy.context.view_layer.update()
    swap_two(rig)
    bpy.context.view_layer.update()
    for track in list(rig.animation_data.nla_tracks):
        rig.animation_data.nla_tracks.remove(track)
    for action, modes in (
        (stashed, {"Lower": "dq_sclerp", "Upper": "pga_lerp"}),
        (unused, {"Upper": "dq_sclerp", "Lower": "pga_lerp"}),
    ):
        rig.animation_data.action, rig.animation_data.action_slot = action, action.slots[0]
        bpy.context.view_layer.update()
        assert modes_in(rig) == modes
        assert_posed(rig, BETWEEN)


def test_a_renamed_bone_keeps_its_turns(live_file):
    rig = new_rig()
    hand = rig.pose.bones["Hand"]
    write_bone(hand, "rotation_quaternion", np.array((1.0, 25.0)), np.tile((1.0, 0.0, 0.0, 0.0), (2, 1)))
    set_mode(hand, "dq_sclerp")
    set_turns(hand, 1, [1.0], axis="Y")
    rig.data.bones["Hand"].name = "Palm"
    bpy.context.view_layer.update()
    palm = rig.pose.bones["Palm"]
    for frame, turned in ((7, tau / 4.0), (13, tau / 2.0), (25, 0.0)):
        bpy.context.scene.frame_set(frame)
        assert palm.matrix_basis.to_quaternion().angle == pytest.approx(turned, abs=1e-3)
    bpy.context.scene.frame_set(7)
    assert abs(palm.matrix_basis.to_quaternion().axis.y) == pytest.approx(1.0, abs=1e-5)
    assert palm.rigid_motion.turns == 1


# Edit Mode


def select_in_edit_mode(edit_bones: bpy.types.ArmatureEditBones, name: str) -> bpy.types.EditBone:
    for bone in edit_bones:
        bone.select = bone.select_head = bone.select_tail = bone.name == name
    edit_bones.active = edit_bones[name]
    return edit_bones[name]


def operate(operator: str, edit_bones: bpy.types.ArmatureEditBones, **settings: object) -> None:
    select_in_edit_mode(edit_bones, "Hand.L")
    assert getattr(bpy.ops.armature, operator)(**settings) == {"FINISHED"}


def add_one(edit_bones: bpy.types.ArmatureEditBones) -> None:
    finger = edit_bones.new("Finger")
    finger.head, finger.tail, finger.parent = (0.1, 0.2, 0.3), (1.0, 0.3, 1.2), edit_bones["Hand.L"]


def flip_names(edit_bones: bpy.types.ArmatureEditBones) -> None:
    for bone in edit_bones:
        bone.select = bone.select_head = bone.select_tail = True
    assert bpy.ops.armature.flip_names() == {"FINISHED"}


EDITS: dict[str, tuple[Callable[[bpy.types.ArmatureEditBones], None], dict[str, str]]] = {
    "none": (lambda bones: None, {}),
    "a bone more": (add_one, {"Finger": "BLENDER"}),
    "a duplicate": (partial(operate, "duplicate"), {"Hand.L.001": "BLENDER"}),
    "two halves": (partial(operate, "subdivide"), {"Hand.L.001": "BLENDER"}),
    "symmetrized": (partial(operate, "symmetrize"), {}),
    "names flipped": (flip_names, {"Hand.L": "pga_lerp", "Hand.R": "dq_sclerp"}),
    "one less": (lambda bones: bones.remove(bones["Hand.L"]), {"Hand.L": ""}),
    "other rest": (lambda bones: setattr(bones["Hand.L"], "tail", (0.1, 0.9, 1.4)), {}),
    "another roll of the parent": (lambda bones: setattr(bones["Body"], "roll", 1.5), {}),
    "another parent": (lambda bones: setattr(bones["Hand.L"], "parent", bones["Hand.R"]), {}),
}
"""What is done in Edit Mode, and which bones have other modes by then: "" where they are gone."""


@pytest.mark.parametrize("edit", EDITS)
def test_in_edit_mode_bones_keep_their_modes_and_new_ones_rest(live_file, edit):
    rig = key_all(new_rig("Rig", HANDS))
    for name, mode in (("Hand.L", "dq_sclerp"), ("Hand.R", "pga_lerp")):
        # They move along the axes of the body: those at rest matter.
        rig.data.bones[name].use_local_location = False
        set_mode(rig.pose.bones[name], mode)
    change, others = EDITS[edit]
    with_edit_bones(rig, change)
    bpy.context.view_layer.update()
    modes = {"Body": "BLENDER", "Hand.L": "dq_sclerp", "Hand.R": "pga_lerp"} | others
    assert {bone.name: whole_mode(bone) for bone in rig.pose.bones} == {
        name: mode for name, mode in modes.items() if mode
    }
    assert {problem_of(bone) for bone in rig.pose.bones} == {""}
    assert_posed(rig, BETWEEN)
    assert_nothing_stale()


def test_armatures_that_are_joined_move_on(live_file):
    rig = moving_rig("pga_lerp")
    others = [Rest(f"Other {rest.name}", rest.head, rest.tail, rest.parent and f"Other {rest.parent}") for rest in ARM]
    other = key_all(new_rig("Other", others))
    set_mode(list(other.pose.bones), "dq_sclerp")
    select_only(rig, other)
    bpy.ops.object.join()
    bpy.context.view_layer.update()
    assert len(rig.pose.bones) == 8
    # Blender leaves the keys of what is joined behind: those bones rest.
    assert_posed(rig, BETWEEN)
    assert_nothing_stale()


# Actions


@pytest.mark.parametrize("modes", [("dq_sclerp", "BLENDER"), ("dq_sclerp", "pga_lerp")])
def test_an_action_that_is_flipped_mirrors_the_motion_with_its_modes(live_file, modes):
    rig = key_all(new_rig("Rig", HANDS), interpolation="LINEAR")
    body, *hands = rig.pose.bones
    for bone, mode in zip((body, *hands), ("dq_sclerp", *modes), strict=True):
        set_mode(bone, mode)
    bpy.context.view_layer.update()
    (before,) = shown_poses([rig], BETWEEN)
    rig.animation_data.action.flip_with_pose(rig)
    bpy.context.view_layer.update()
    assert [whole_mode(hand) for hand in hands] == list(modes[::-1])
    assert_posed(rig, BETWEEN)
    assert_nothing_stale()
    (after,) = shown_poses([rig], BETWEEN)
    mirror = np.diag((-1.0, 1.0, 1.0, 1.0))
    # Blender's own in-betweens of quaternions of any length are others in a mirror.
    which = np.isin(BETWEEN, FRAMES) if "BLENDER" in modes else slice(None)
    for name, opposite in (("Body", "Body"), ("Hand.L", "Hand.R"), ("Hand.R", "Hand.L")):
        np.testing.assert_allclose(after[name][which], (mirror @ before[opposite] @ mirror)[which], atol=2e-5)


@pytest.mark.parametrize("renamed", ["One", "Two"])
def test_linked_animation_data_move_a_second_rig_as_the_first_and_follow_whose_bone_is_renamed(live_file, renamed):
    rig, other = rig_of_two_modes("One"), new_rig("Two")
    select_only(rig, other)
    assert bpy.ops.object.make_links_data(type="ANIMATION") == {"FINISHED"}
    bpy.context.view_layer.update()
    assert other.animation_data.action == rig.animation_data.action
    assert modes_in(other) == modes_in(rig)
    curves_of(rig.pose.bones["Upper"])["location", 0].keyframe_points[1].co_ui.y += 0.3
    bpy.context.view_layer.update()
    make_lower_fore(bpy.data.objects[renamed])
    bpy.context.view_layer.update()
    modes = {"One": modes_in(rig), "Two": modes_in(other)}
    assert modes.pop(renamed) == {"Upper": "dq_sclerp", "Fore": "pga_lerp"}
    # Blender gives keys of a shared Action to the bone that was renamed, and leaves the other without.
    assert list(modes.values()) == [{"Upper": "dq_sclerp"}]
    for posed in (rig, other):
        assert_posed(posed, BETWEEN)
    assert_nothing_stale()


@pytest.mark.parametrize("leaves", ["its Action", "its slot"])
def test_a_rig_that_turns_otherwise_is_told_so_and_gets_in_betweens_of_its_own_when_the_other_leaves(live_file, leaves):
    rig = key_all(new_rig("A"))
    other = rig.copy()
    other.name = "B"
    bpy.context.scene.collection.objects.link(other)
    for bone in other.pose.bones:
        bone.rotation_mode = "XYZ"
    key_all(other, seed=4)
    set_mode(list(rig.pose.bones), "dq_sclerp")
    for _ in range(2):
        other.update_tag()
        bpy.context.view_layer.update()
    assert_posed(rig, BETWEEN)
    assert "moves by the same Action slot as" in problem_of(other.pose.bones["Body"])
    data = rig.animation_data
    if leaves == "its Action":
        data.action = None
    else:
        data.action_slot = data.action.slots.new("OBJECT", "Other")
    bpy.context.view_layer.update()
    assert_posed(other, BETWEEN)
    assert_nothing_stale()


# Keys


def test_while_one_bone_is_keyed_poses_of_others_that_are_not_keyed_yet_stay(live_file):
    """As Auto Key does it, and where all there is to the motion is written anew."""
    rig = moving_rig("motor_spline")
    live_file.scene.frame_set(17)
    for number, bone in enumerate(rig.pose.bones):
        bone.location.x += 0.1 * number
        bone.rotation_quaternion.rotate(Euler((0.2, 0.1 * number, 0.0)))
    bpy.context.view_layer.update()
    posed = {bone.name: seen(rig, bone.name) for bone in rig.pose.bones}
    hand = rig.pose.bones["Hand"]
    for path in ("location", "rotation_quaternion"):
        hand.keyframe_insert(path, frame=17)
        bpy.context.view_layer.update()
        for name, matrix in posed.items():
            np.testing.assert_allclose(seen(rig, name), matrix, atol=1e-5, err_msg=f"{name}, {path} keyed")
    set_mode(hand, "dq_sclerp")
    curves_of(hand)["location", 0].keyframe_points[0].co_ui.y += 1.0
    bpy.context.view_layer.update()
    for name, matrix in posed.items():
        np.testing.assert_allclose(seen(rig, name), matrix, atol=1e-5, err_msg=name)
    for bone in rig.pose.bones:
        bone.keyframe_insert("location", frame=17)
        bone.keyframe_insert("rotation_quaternion", frame=17)
    bpy.context.view_layer.update()
    live_file.scene.frame_set(3)
    live_file.scene.frame_set(17)
    for name, matrix in posed.items():
        np.testing.assert_allclose(seen(rig, name), matrix, atol=1e-5, err_msg=name)
    assert_posed(rig, BETWEEN)


def test_a_rig_of_a_hundred_bones_is_edited_bone_by_bone(live_file):
    bones = [
        Rest(f"Bone {n}", (0.1 * n, 0.0, 0.1), (0.1 * n, 0.1, 0.3), f"Bone {n - 25}" if n > 24 else "")
        for n in range(100)
    ]
    rig = key_all(new_rig("Rig", bones), amount=0.2)
    set_mode(list(rig.pose.bones), "dq_sclerp")
    keys = {bone.name: snapshot(bone) for bone in rig.pose.bones}
    for name in ("Bone 3", "Bone 50", "Bone 99"):
        curves_of(rig.pose.bones[name])["location", 1].keyframe_points[2].co_ui.y += 0.2
        bpy.context.view_layer.update()
        assert [bone.name for bone in rig.pose.bones if snapshot(bone) != keys[bone.name]] == [name]
        keys[name] = snapshot(rig.pose.bones[name])
    rig.data.bones["Bone 50"].name = "Renamed"
    set_mode(rig.pose.bones["Bone 51"], "BLENDER")
    live_file.scene.frame_set(30)
    for bone in rig.pose.bones:
        bone.keyframe_insert("location")
        bone.keyframe_insert("rotation_quaternion")
    bpy.context.view_layer.update()
    assert_posed(rig, BETWEEN[::9])
    assert_nothing_stale()
