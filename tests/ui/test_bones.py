"""Pose bones in the interface: which are meant, what menus, operators and the panel say, and their constraint."""

from __future__ import annotations

import bpy
import pytest

from rigid_motion import animation
from rigid_motion.animation import constraint_trouble, modes_of, restore_constraints, set_mode
from rigid_motion.animation.transforms import CONSTRAINT, Refused, transform_of
from rigid_motion.animation.transforms.sizes import first_tolerance
from rigid_motion.animation.writers.bone_constraints import CHANGED, MUTED, NOT_FIRST, OTHER_SLOT, REMOVED, WEAK
from rigid_motion.ui import menus
from rigid_motion.ui.panels import facts_and_notes
from rigid_motion.ui.targets import (
    KEY_EDITORS,
    SELECTED,
    WHOLE,
    active_target,
    scope_for,
    targets_of,
)
from rigid_motion.ui.wording import BLENDED, TROUBLES
from tests.animation.bones.poses import seen
from tests.animation.bones.rigs import select_bones
from tests.animation.scenes import editor
from tests.rigs.recorded import FRAMES as RECORDED
from tests.rigs.recorded import recorded_rig
from tests.ui.conftest import keyed, select_keys
from tests.ui.rigs import FRAMES, key_bone, keyed_rig, new_rig
from tests.ui.test_menus import drawn

operators = bpy.ops.rigid_motion
SCREW = "dq_sclerp"


@pytest.fixture
def rig(extension) -> bpy.types.Object:
    return keyed_rig()


def bone(rig, name="Hand"):
    return rig.pose.bones[name]


def names(targets):
    return [target.name for target in targets]


def modes(rig, name):
    return modes_of(bone(rig, name), FRAMES[:-1])


def test_in_pose_mode_the_selected_bones_are_meant_and_not_the_rig(rig):
    with editor("VIEW_3D"):
        assert names(targets_of(bpy.context)) == ["Rig/Arm", "Rig/Hand"]
        assert active_target(bpy.context) == transform_of(bone(rig))
        assert scope_for(bpy.context) == WHOLE


def test_the_bones_of_all_rigs_in_pose_mode_are_meant(rig):
    other = keyed_rig("Other")
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.select_set(True)
    bpy.ops.object.mode_set(mode="POSE")
    assert sorted(names(targets_of(bpy.context))) == ["Other/Arm", "Other/Hand", "Rig/Arm", "Rig/Hand"]
    operators.set_mode(mode=SCREW)
    assert modes(rig, "Arm") == modes(other, "Hand") == [SCREW] * 3


def test_while_weights_are_painted_for_a_posed_rig_its_bones_are_meant(rig):
    skin = bpy.data.objects.new("Skin", bpy.data.meshes.new("Skin"))
    skin.data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    bpy.context.collection.objects.link(skin)
    skin.modifiers.new("Armature", "ARMATURE").object = rig
    skin.select_set(True)
    bpy.context.view_layer.objects.active = skin
    assert bpy.context.mode == "OBJECT"
    assert names(targets_of(bpy.context)) == ["Rig", "Skin"]
    bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
    assert names(targets_of(bpy.context)) == ["Rig/Arm", "Rig/Hand"]
    rig.data.bones.active = rig.data.bones["Arm"]
    assert active_target(bpy.context) == transform_of(bone(rig, "Arm"))


@pytest.mark.parametrize("kind", KEY_EDITORS)
def test_a_key_editor_means_the_bones_and_objects_whose_channels_it_shows(rig, kind):
    rig.keyframe_insert("location", frame=1)
    rig["reach"] = 1.0
    unmoved = new_rig("Unmoved")
    unmoved["reach"] = 1.0
    unmoved.keyframe_insert('["reach"]', frame=1)
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.select_set(True)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="POSE")
    with editor(kind) as space:
        space.dopesheet.show_only_selected = False
        assert sorted(names(targets_of(bpy.context))) == ["Rig", "Rig/Arm", "Rig/Hand", "Rig/Hip"]
        space.dopesheet.show_only_selected = True
        assert {"Rig/Arm", "Rig/Hand"} <= set(names(targets_of(bpy.context))) <= {"Rig", "Rig/Arm", "Rig/Hand"}
        assert scope_for(bpy.context) == SELECTED


@pytest.mark.parametrize("kind", KEY_EDITORS)
def test_each_bone_gets_the_mode_from_its_own_selected_keys_on(rig, kind):
    select_keys(bone(rig, "Arm"), 1.0)
    select_keys(bone(rig, "Hand"), 11.0, 21.0)
    select_keys(bone(rig, "Hip"), 1.0)
    with editor(kind) as space:
        space.dopesheet.show_only_selected = True
        operators.set_mode(mode=SCREW)
    assert modes(rig, "Arm") == [SCREW, "BLENDER", "BLENDER"]
    assert modes(rig, "Hand") == ["BLENDER", SCREW, SCREW]
    assert modes(rig, "Hip") == ["BLENDER"] * 3


@pytest.fixture
def body(extension) -> bpy.types.Object:
    """A recorded body that is selected as an object, as an import leaves it."""
    body = recorded_rig()
    body.select_set(True)
    return body


def test_of_a_rig_that_is_selected_as_an_object_all_bones_are_reduced_and_restored(body, capfd):
    assert operators.reduce_keys.poll()
    assert not operators.restore_keys.poll()
    assert operators.reduce_keys(shared=True, tolerance=0.02) == {"FINISHED"}
    counts = {len(animation.key_frames(bone)) for bone in body.pose.bones}
    assert len(counts) == 1
    (count,) = counts
    said = capfd.readouterr().out
    assert f"7 bones: 630 keys became {7 * count}, largest error " in said
    assert f", keys on {count} frames" in said
    assert operators.restore_keys() == {"FINISHED"}
    assert {len(animation.key_frames(bone)) for bone in body.pose.bones} == {len(RECORDED)}


def test_the_tolerance_to_begin_with_is_one_of_the_rigs_size(body):
    body.scale = (100.0, 100.0, 100.0)
    bpy.context.view_layer.update()
    operators.reduce_keys()
    largest = animation.total_reduction(list(body.pose.bones)).largest_error
    assert 0.001 * max(body.dimensions) < largest < 0.0031 * max(body.dimensions)


def test_key_poses_begin_with_a_larger_tolerance_for_as_long_as_nobody_sets_one(body):
    operators.reduce_keys(shared=True)
    few = len(animation.key_frames(body.pose.bones["Root"]))
    assert few < 0.3 * len(RECORDED)
    operators.restore_keys()
    offered = first_tolerance(bpy.context.scene, list(map(transform_of, body.pose.bones)), shared=True)
    operators.reduce_keys(shared=True, tolerance=0.5 * offered)
    assert len(animation.key_frames(body.pose.bones["Root"])) > few
    operators.restore_keys()
    # The redo panel, after Key Poses was switched on: the tolerance stands that own keys were offered.
    own = first_tolerance(bpy.context.scene, list(map(transform_of, body.pose.bones)))
    operators.reduce_keys(shared=True, tolerance=own, offered=own)
    assert len(animation.key_frames(body.pose.bones["Root"])) == few


def test_the_menu_of_poses_ticks_the_mode_of_the_active_bone_and_has_a_pie(rig):
    set_mode(bone(rig, "Arm"), "pga_lerp")
    set_mode(bone(rig), SCREW)
    entries = drawn(menus.RIGID_MOTION_MT_pose)
    assert [p.mode for name, icon, p in entries if name == "rigid_motion.set_mode" and icon == "CHECKMARK"] == [SCREW]
    assert "rigid_motion.mend" in [name for name, *_ in entries]
    assert [p.name for name, _, p in entries if name == "wm.call_menu_pie"] == ["RIGID_MOTION_MT_pie_pose"]


def notes_on(target, frame=5.0):
    bpy.context.scene.frame_set(int(frame))
    segment, notes = facts_and_notes(target, frame)
    return notes, segment and segment.mode


@pytest.mark.parametrize("order", ["QUATERNION", "XYZ"])
def test_the_transform_on_screen_is_that_of_the_bone(extension, order):
    rig = new_rig()
    bone = rig.pose.bones["Hand"]
    bone.rotation_mode = order
    rotation = "rotation_quaternion" if order == "QUATERNION" else "rotation_euler"
    key_bone(bone, scale="even")
    select_bones(rig, "Hand")
    set_mode(bone, SCREW)
    bpy.context.scene.frame_set(6)
    before = seen(rig, "Hand")
    shown = bpy.context.window_manager.rigid_motion_shown
    values = [tuple(shown.location), tuple(getattr(shown, rotation)), tuple(shown.scale)]
    assert values[0] != pytest.approx(tuple(bone.location), abs=1e-3)
    bone.constraints[CONSTRAINT].mute = True
    animation.set_enabled(False)
    rig.animation_data.action = None
    bone.location, bone.scale = values[0], values[2]
    setattr(bone, rotation, values[1])
    bpy.context.view_layer.update()
    assert seen(rig, "Hand") == pytest.approx(before, abs=1e-5)


def put_behind(bone):
    bone.constraints.new("COPY_LOCATION").target = bone.id_data
    bone.constraints.move(1, 0)


def show_another(bone):
    animation.set_enabled(False)
    ours(bone).action = bpy.data.actions.new("Other")


def ours(bone):
    return bone.constraints[CONSTRAINT]


TAMPERINGS = [
    (lambda bone: bone.constraints.remove(ours(bone)), REMOVED),
    (lambda bone: setattr(ours(bone), "name", "Mine"), REMOVED),
    (lambda bone: setattr(ours(bone), "use_eval_time", False), REMOVED),
    (show_another, OTHER_SLOT),
    (lambda bone: setattr(ours(bone), "mute", True), MUTED),
    (lambda bone: setattr(ours(bone), "mix_mode", "AFTER_FULL"), CHANGED),
    (put_behind, NOT_FIRST),
    (lambda bone: setattr(ours(bone), "influence", 0.5), WEAK),
]


@pytest.mark.parametrize(("tamper", "trouble"), TAMPERINGS)
def test_a_constraint_that_is_not_as_it_was_made_is_noted_and_mended(rig, tamper, trouble):
    hand = bone(rig)
    set_mode([hand, bone(rig, "Arm")], SCREW)
    bpy.context.scene.frame_set(5)
    before = seen(rig, "Hand")
    tamper(hand)
    bpy.context.view_layer.update()
    assert constraint_trouble(hand) == trouble
    assert constraint_trouble(bone(rig, "Arm")) == ""
    notes, mode = notes_on(hand)
    assert (notes, mode) == ([TROUBLES[trouble]], SCREW)

    assert operators.mend() == {"FINISHED"}
    assert constraint_trouble(hand) == ""
    assert hand.constraints[0].name == CONSTRAINT
    assert len([item for item in hand.constraints if item.type == "ACTION"]) == 1
    for constraint in list(hand.constraints)[1:]:
        hand.constraints.remove(constraint)
    bpy.context.scene.frame_set(4)
    bpy.context.scene.frame_set(5)
    assert seen(rig, "Hand") == pytest.approx(before, abs=1e-5)
    assert not operators.mend.poll()


def test_an_influence_that_is_keyed_is_meant_so(rig):
    set_mode(bone(rig), SCREW)
    constraint = bone(rig).constraints[CONSTRAINT]
    constraint.influence = 0.5
    constraint.keyframe_insert("influence", frame=1)
    assert constraint_trouble(bone(rig)) == ""


def test_what_has_no_in_betweens_has_no_trouble_and_cannot_be_mended(rig):
    bpy.ops.object.mode_set(mode="OBJECT")
    tool = keyed("Tool")
    set_mode(tool, SCREW)
    refused = []
    restore_constraints([tool, bone(rig)], refused=refused)
    assert [str(refusal).split(" has ")[0] for refusal in refused] == ["Tool", "Rig/Hand"]
    assert constraint_trouble(tool) == constraint_trouble(bone(rig)) == ""
    with pytest.raises(Refused, match="choose a mode"):
        restore_constraints(bone(rig))


def test_strips_that_are_blended_are_noted(rig):
    set_mode(bone(rig), SCREW)
    data = rig.animation_data
    action, data.action = data.action, None
    strip = data.nla_tracks.new().strips.new("Strip", 1, action)
    assert ("INFO", BLENDED) not in notes_on(bone(rig))[0]
    strip.blend_in = 10.0
    assert ("INFO", BLENDED) in notes_on(bone(rig))[0]
    assert ("INFO", BLENDED) not in notes_on(bone(rig, "Arm"))[0]


def test_a_transition_between_strips_is_noted(rig):
    set_mode(bone(rig), SCREW)
    data = rig.animation_data
    action, slot, data.action = data.action, data.action_slot, None
    track = data.nla_tracks.new()
    for start in (1, 100):
        strip = track.strips.new("Strip", start, action)
        strip.action_slot, strip.action_frame_start, strip.action_frame_end, strip.select = slot, 1, 21, True
    bpy.context.view_layer.update()
    assert ("INFO", BLENDED) not in notes_on(bone(rig))[0]
    bpy.ops.object.mode_set(mode="OBJECT")
    with editor("NLA_EDITOR"):
        bpy.ops.nla.transition_add()
    assert [strip.type for strip in track.strips] == ["CLIP", "TRANSITION", "CLIP"]
    assert ("INFO", BLENDED) in notes_on(bone(rig))[0]
