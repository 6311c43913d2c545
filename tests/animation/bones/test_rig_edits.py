"""Whatever is done to rigs and Actions, bones show what their keys and modes say by now, and nothing stale is left."""

from __future__ import annotations

from math import tau

import bpy
import numpy as np
import pytest
from mathutils import Euler

from rigid_motion.animation import channelbag_of, modes_of, refresh, set_mode, set_turns
from tests.animation.bones.poses import assert_posed
from tests.animation.bones.rigs import (
    ARM,
    CONSTRAINT,
    FRAMES,
    PLAYED,
    Rest,
    key_all,
    moving_rig,
    new_rig,
    own_constraints,
    select_only,
    with_edit_bones,
    write_bone,
)
from tests.animation.scenes import push_down


def assert_nothing_stale(*actions: bpy.types.Action) -> None:
    """No F-curve is about a bone that no rig has, and differences are only of bones with a mode."""
    bones = {f"{bone.path_from_id()}." for obj in bpy.data.objects if obj.pose for bone in obj.pose.bones}
    for action in actions or bpy.data.actions:
        for layer in action.layers:
            for strip in layer.strips:
                for channelbag in strip.channelbags:
                    for fcurve in channelbag.fcurves:
                        path = fcurve.data_path
                        if path.startswith("pose.bones") and (fcurve.is_empty or CONSTRAINT in path):
                            assert any(path.startswith(bone) for bone in bones), f"{path} in {action.name}"


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


def rig_of_two_modes(**settings: object) -> bpy.types.Object:
    """The arm, with a mode on Upper, another on Lower, and none on the others."""
    rig = key_all(new_rig(), **settings)
    set_mode(rig.pose.bones["Upper"], "dq_sclerp")
    set_mode(rig.pose.bones["Lower"], "pga_lerp")
    bpy.context.view_layer.update()
    return rig


def modes_in(rig: bpy.types.Object) -> dict[str, str]:
    """The bones of a rig that have a mode other than Blender's."""
    modes = {pose_bone.name: whole_mode(pose_bone) for pose_bone in rig.pose.bones}
    return {name: mode for name, mode in modes.items() if mode != "BLENDER"}


def test_a_mode_that_is_set_right_after_names_were_swapped_leaves_the_other_bone_its_own(live_file):
    for choose in (
        lambda bone: set_mode(bone, "cga_slerp"),
        lambda bone: setattr(bone.rigid_motion, "mode", "cga_slerp"),
    ):
        rig = rig_of_two_modes()
        swap_two(rig)
        choose(rig.pose.bones["Upper"])
        bpy.context.view_layer.update()
        assert modes_in(rig) == {"Lower": "dq_sclerp", "Upper": "cga_slerp"}
        assert_posed(rig, PLAYED)


@pytest.mark.parametrize("renamed", ["One", "Two"])
def test_an_action_shared_with_another_rig_follows_whose_bone_is_renamed_as_its_keys_do(live_file, renamed):
    rig = rig_of_two_modes()
    rig.name = "One"
    other = new_rig("Two")
    other.animation_data_create().action = rig.animation_data.action
    other.animation_data.action_slot = rig.animation_data.action_slot
    bpy.context.view_layer.update()
    make_lower_fore(bpy.data.objects[renamed])
    bpy.context.view_layer.update()
    modes = {"One": modes_in(rig), "Two": modes_in(other)}
    assert modes.pop(renamed) == {"Upper": "dq_sclerp", "Fore": "pga_lerp"}
    # Blender gives keys of a shared Action to the bone that was renamed, and leaves the other without.
    assert list(modes.values()) == [{"Upper": "dq_sclerp"}]
    assert_posed(rig, PLAYED)
    assert_posed(other, PLAYED)


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
        assert_posed(rig, PLAYED)


def test_a_bone_that_takes_the_name_of_one_deleted_just_now_keeps_its_mode(live_file):
    rig = rig_of_two_modes(location=False)

    def put_upper_in_its_place(edit_bones: bpy.types.ArmatureEditBones) -> None:
        edit_bones.remove(edit_bones["Lower"])
        edit_bones["Upper"].name = "Lower"

    with_edit_bones(rig, put_upper_in_its_place)
    bpy.context.view_layer.update()
    assert modes_in(rig) == {"Lower": "dq_sclerp"}


@pytest.mark.parametrize("second", ["dq_sclerp", "BLENDER"])
def test_armatures_that_are_joined_move_on(live_file, second):
    rig = moving_rig("pga_lerp")
    others = [Rest(f"Other {rest.name}", rest.head, rest.tail, rest.parent and f"Other {rest.parent}") for rest in ARM]
    other = key_all(new_rig("Other", others))
    set_mode(list(other.pose.bones), second)
    select_only(rig, other)
    bpy.ops.object.join()
    bpy.context.view_layer.update()
    refresh()
    assert len(rig.pose.bones) == 8
    assert_posed(rig, PLAYED, [rest.name for rest in ARM])
    # Blender leaves the keys of what is joined behind: those bones rest, without in-betweens.
    assert_posed(rig, PLAYED)


def test_constraints_that_are_copied_to_another_bone_make_no_second_motion(live_file):
    rig = moving_rig()
    hand = rig.pose.bones["Hand"]
    hand.constraints.copy(own_constraints(rig)["Lower"][0])
    bpy.context.view_layer.update()
    refresh()
    assert_posed(rig, PLAYED)


@pytest.mark.parametrize("order", ["QUATERNION", "ZXY"])
def test_a_bone_without_keys_of_its_rotation_spins_as_well(live_file, order):
    rig = moving_rig("pga_lerp", order)
    lower, channels = rig.pose.bones["Lower"], channelbag_of(rig).fcurves
    for fcurve in [it for it in channels if it.data_path.startswith(f"{lower.path_from_id()}.rotation")]:
        channels.remove(fcurve)
    set_turns(lower, 1, [1.0])
    for angles in ((0.3, 0.2, 0.1), (1.0, 2.0, -1.0)):
        lower.rotation_euler, lower.rotation_quaternion = angles, Euler(angles).to_quaternion()
        bpy.context.view_layer.update()
        assert_posed(rig, PLAYED)


def test_a_renamed_bone_keeps_its_turns(live_file):
    rig = new_rig()
    hand = rig.pose.bones["Hand"]
    write_bone(hand, "rotation_quaternion", np.array((1.0, 25.0)), np.tile((1.0, 0.0, 0.0, 0.0), (2, 1)))
    set_mode(hand, "dq_sclerp")
    set_turns(hand, 1, [1.0], axis="Y")
    rig.data.bones["Hand"].name = "Palm"
    bpy.context.view_layer.update()
    bpy.context.scene.frame_set(13)
    palm = rig.pose.bones["Palm"]
    assert palm.rigid_motion.turns == 1
    angle = palm.matrix_basis.to_quaternion().angle
    seen = palm.parent.matrix.inverted() @ palm.matrix
    rest = palm.parent.bone.matrix_local.inverted() @ palm.bone.matrix_local
    turned = (rest.inverted() @ seen).to_quaternion()
    assert angle == pytest.approx(0.0, abs=1e-5)
    assert turned.angle == pytest.approx(tau / 2.0, abs=1e-3)
    assert abs(turned.axis.y) == pytest.approx(1.0, abs=1e-5)
