"""Whatever is done to rigs, bones show what their keys and modes say by now, and nothing stale is left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import bpy
import numpy as np
import pytest
from mathutils import Euler

from rigid_motion.animation import modes_of, problem_of, refresh, set_mode, set_turns
from rigid_motion.animation.actions.marks import read_marks
from tests.animation.bones.poses import assert_posed, placed
from tests.animation.bones.rigs import (
    BETWEEN,
    HANDS,
    key_all,
    moving_rig,
    new_rig,
    select_only,
    with_edit_bones,
)
from tests.animation.keyed import curves_of
from tests.animation.modified import is_term
from tests.animation.scenes import FRAMES, push_down


def assert_nothing_stale() -> None:
    """Terms are as they would be planned now, and in no channels of a bone without a mode that a rig has."""
    assert refresh() == 0
    bones = {f"{bone.path_from_id()}." for obj in bpy.data.objects if obj.pose for bone in obj.pose.bones}
    layers = [layer for action in bpy.data.actions for layer in action.layers]
    for channelbag in (bag for layer in layers for strip in layer.strips for bag in strip.channelbags):
        for bone in bones:
            curves = [fcurve for fcurve in channelbag.fcurves if fcurve.data_path.startswith(bone)]
            if any(is_term(modifier) for fcurve in curves for modifier in fcurve.modifiers):
                assert any((read_marks(fcurve) > 1).any() for fcurve in curves), f"{bone} in {channelbag.id_data.name}"


def modes_in(rig: bpy.types.Object) -> dict[str, str]:
    """The modes that bones have from their first keys on, which their properties show."""
    modes = {bone.name: modes_of(bone, np.array(FRAMES[:1]))[0] for bone in rig.pose.bones}
    assert modes == {bone.name: bone.rigid_motion.mode for bone in rig.pose.bones}
    return modes


def new_hands(name: str) -> bpy.types.Object:
    """A body and two hands that move along the axes of the body, so that those at rest matter."""
    rig = new_rig(name, HANDS)
    for hand in ("Hand.L", "Hand.R"):
        rig.data.bones[hand].use_local_location = False
    return rig


@pytest.fixture
def rig(live_file) -> bpy.types.Object:
    """Hands that have different modes, the left one with a turn on top."""
    rig = key_all(new_hands("Rig"))
    for name, mode in (("Hand.L", "dq_sclerp"), ("Hand.R", "pga_lerp")):
        set_mode(rig.pose.bones[name], mode)
    set_turns(rig.pose.bones["Hand.L"], 1, [1.0])
    bpy.context.view_layer.update()
    return rig


OWN = {"Body": "BLENDER", "Hand.L": "dq_sclerp", "Hand.R": "pga_lerp"}
SWAPPED = OWN | {"Hand.L": "pga_lerp", "Hand.R": "dq_sclerp"}


def operate(operator: str, edit_bones: bpy.types.ArmatureEditBones) -> None:
    for bone in edit_bones:
        bone.select = bone.select_head = bone.select_tail = bone.name == "Hand.L"
    edit_bones.active = edit_bones["Hand.L"]
    assert getattr(bpy.ops.armature, operator)() == {"FINISHED"}


def join(rig: bpy.types.Object) -> None:
    """Join a rig that has modes; Blender leaves the keys of what is joined behind, so that its bones rest."""
    other = key_all(new_rig("Other", [replace(rest, name=f"Other {rest.name}", parent="") for rest in HANDS]))
    set_mode(list(other.pose.bones), "dq_sclerp")
    select_only(rig, other)
    bpy.ops.object.join()


IN_EDIT_MODE: dict[str, tuple[Callable[[bpy.types.ArmatureEditBones], object], dict[str, str]]] = {
    "two halves": (partial(operate, "subdivide"), {"Hand.L.001": "BLENDER"}),
    "symmetrized": (partial(operate, "symmetrize"), {}),
    "other rest": (lambda bones: setattr(bones["Hand.L"], "tail", (0.1, 0.9, 1.4)), {}),
    "another parent": (lambda bones: setattr(bones["Hand.L"], "parent", bones["Hand.R"]), {}),
}
EDITS = {name: (partial(with_edit_bones, edit=edit), others) for name, (edit, others) in IN_EDIT_MODE.items()} | {
    "joined": (join, {f"Other {rest.name}": "BLENDER" for rest in HANDS}),
}
"""What is done to a rig, and which bones have other modes by then."""


@pytest.mark.parametrize("edit", EDITS)
def test_bones_keep_their_modes_and_turns_and_new_ones_rest(rig, edit):
    change, others = EDITS[edit]
    change(rig)
    bpy.context.view_layer.update()
    assert modes_in(rig) == OWN | others
    assert {problem_of(bone) for bone in rig.pose.bones} == {""}
    assert all(bone.rigid_motion.turns == 1 for bone in rig.pose.bones if bone.rigid_motion.mode == "dq_sclerp")
    assert_posed(rig, BETWEEN)
    assert_nothing_stale()


def test_names_swapped_are_swapped_in_strips_and_not_in_actions_that_the_rig_does_not_use(rig):
    data = rig.animation_data
    stashed, unused = data.action, data.action.copy()
    unused.use_fake_user = True
    push_down(rig)
    data.nla_tracks[0].mute = True
    key_all(rig, seed=3)
    bpy.context.view_layer.update()
    hands = rig.data.bones["Hand.L"], rig.data.bones["Hand.R"]
    hands[0].name = "Spare"
    hands[1].name, hands[0].name = "Hand.L", "Hand.R"
    bpy.context.view_layer.update()
    data.nla_tracks.remove(data.nla_tracks[0])
    for action, modes in ((stashed, SWAPPED), (unused, OWN)):
        data.action, data.action_slot = action, action.slots[0]
        bpy.context.view_layer.update()
        assert modes_in(rig) == modes
        assert_posed(rig, BETWEEN)


@pytest.mark.parametrize("renamed", [0, 1], ids=["the first", "the second"])
def test_linked_animation_data_move_a_second_rig_as_the_first_and_follow_whose_bone_is_renamed(rig, renamed):
    users = (rig, new_hands("Other"))
    select_only(*users)
    assert bpy.ops.object.make_links_data(type="ANIMATION") == {"FINISHED"}
    bpy.context.view_layer.update()
    assert users[1].animation_data.action == rig.animation_data.action
    assert modes_in(users[1]) == OWN
    curves_of(rig.pose.bones["Hand.L"])["location", 0].keyframe_points[1].co_ui.y += 0.3
    bpy.context.view_layer.update()
    users[renamed].data.bones["Hand.R"].name = "Palm"
    bpy.context.view_layer.update()
    # Blender gives keys of a shared Action to the bone that was renamed, and leaves the other without.
    assert modes_in(users[renamed]) == {"Body": "BLENDER", "Hand.L": "dq_sclerp", "Palm": "pga_lerp"}
    assert modes_in(users[1 - renamed]) == OWN | {"Hand.R": "BLENDER"}
    for posed in users:
        assert_posed(posed, BETWEEN)
    assert_nothing_stale()


def test_while_one_bone_is_keyed_poses_of_others_that_are_not_keyed_yet_stay(live_file):
    """As Auto Key does it, and where all there is to the motion is written anew."""
    rig = moving_rig("motor_spline")
    live_file.scene.frame_set(17)
    for number, bone in enumerate(rig.pose.bones):
        bone.location.x += 0.1 * number
        bone.rotation_quaternion.rotate(Euler((0.2, 0.1 * number, 0.0)))
    posed, hand = placed(rig), rig.pose.bones["Hand"]
    for bone in (hand, *rig.pose.bones):
        for path in ("location", "rotation_quaternion"):
            bone.keyframe_insert(path, frame=17)
            np.testing.assert_allclose(placed(rig), posed, atol=1e-5, err_msg=f"{path} of {bone.name} keyed")
        if bone == hand:
            set_mode(hand, "dq_sclerp")
            curves_of(hand)["location", 0].keyframe_points[0].co_ui.y += 1.0
            np.testing.assert_allclose(placed(rig), posed, atol=1e-5)
    live_file.scene.frame_set(3)
    live_file.scene.frame_set(17)
    np.testing.assert_allclose(placed(rig), posed, atol=1e-5)
    assert_posed(rig, BETWEEN)


def test_what_comes_into_the_way_of_one_bone_is_no_matter_to_others_and_goes_again(live_file):
    rig = moving_rig()
    lower = rig.pose.bones["Lower"]
    curves_of(lower)["location", 1].modifiers.new("ENVELOPE")
    bpy.context.view_layer.update()
    assert "Lower" in problem_of(lower)
    assert not any(map(is_term, (item for curve in curves_of(lower).values() for item in curve.modifiers)))
    assert_posed(rig, BETWEEN, ["Body", "Upper"])
    modifiers = curves_of(lower)["location", 1].modifiers
    modifiers.remove(modifiers[0])
    bpy.context.view_layer.update()
    assert problem_of(lower) == ""
    assert_posed(rig, BETWEEN)
    assert_nothing_stale()
