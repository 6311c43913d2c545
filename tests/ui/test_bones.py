"""Pose bones in the interface: which bones editors act on, and what operators do with them."""

from __future__ import annotations

import bpy
import pytest

from rigid_motion import animation
from rigid_motion.animation.transforms import transform_of
from rigid_motion.animation.transforms.sizes import first_tolerance
from rigid_motion.ui.targets import (
    KEY_EDITORS,
    SELECTED,
    WHOLE,
    active_target,
    scope_for,
    targets_of,
)
from tests.animation.scenes import editor
from tests.rigs.recorded import recorded_rig
from tests.ui.rigs import keyed_rig, new_rig

operators = bpy.ops.rigid_motion
SCREW = "dq_sclerp"


@pytest.fixture
def rig(extension) -> bpy.types.Object:
    return keyed_rig()


def bone(rig, name="Hand"):
    return rig.pose.bones[name]


def names(targets):
    return [target.name for target in targets]


def test_the_bones_of_all_rigs_in_pose_mode_are_meant(rig):
    other = keyed_rig("Other")
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.select_set(True)
    bpy.ops.object.mode_set(mode="POSE")
    assert sorted(names(targets_of(bpy.context))) == ["Other/Arm", "Other/Hand", "Rig/Arm", "Rig/Hand"]
    assert active_target(bpy.context) == transform_of(bone(other))
    assert scope_for(bpy.context) == WHOLE
    operators.set_mode(mode=SCREW)
    assert bone(rig, "Arm").rigid_motion.mode == bone(other).rigid_motion.mode == SCREW


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


def test_key_poses_begin_with_a_larger_tolerance_for_as_long_as_nobody_sets_one(extension, monkeypatch):
    body, asked = recorded_rig(), []
    body.select_set(True)
    monkeypatch.setattr(animation, "reduce_keys_of", lambda *args, **_: asked.append(args[2]))
    bones = list(map(transform_of, body.pose.bones))
    own, offered = (first_tolerance(bpy.context.scene, bones, shared=shared) for shared in (False, True))
    # The last call is the redo panel after switching Key Poses on: the tolerance is the one offered for own keys.
    for tolerances in ({}, {"tolerance": 0.5 * offered}, {"tolerance": own, "offered": own}):
        with pytest.raises(RuntimeError):
            operators.reduce_keys(shared=True, **tolerances)
    assert asked == pytest.approx([offered, 0.5 * offered, offered])
