"""Transforms that operators act on in each editor. No screen is needed: areas exist in the background, too."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation import is_reduced, key_frames, modes_of
from rigid_motion.animation.transforms import transform_of
from rigid_motion.animation.transforms.sizes import first_tolerance
from rigid_motion.ui.notes import KEYED_BONES, facts_and_notes
from rigid_motion.ui.targets import (
    CURRENT,
    KEY_EDITORS,
    SELECTED,
    WHOLE,
    active_target,
    modes_meant,
    scope_for,
    targets_of,
)
from tests.animation.bones.rigs import select_bones, select_only
from tests.animation.layered import key_base, new, seen
from tests.animation.scenes import editor
from tests.rigs.recorded import recorded_rig
from tests.ui.conftest import FRAMES, keyed, select_keys
from tests.ui.rigs import keyed_rig, new_rig

operators = bpy.ops.rigid_motion
SCREW = "dq_sclerp"


@pytest.mark.parametrize("kind", KEY_EDITORS)
def test_in_a_key_editor_modes_are_for_the_selected_keys_of_all_objects_shown(tool, kind):
    other, left_out = keyed("Other"), keyed("Left Out")
    left_out.select_set(False)
    for obj in (tool, other, left_out):
        select_keys(obj, 11.0)
    with editor(kind) as space:
        space.dopesheet.show_only_selected = True
        operators.set_mode(mode=SCREW)
    assert modes_of(tool, FRAMES[:-1]) == modes_of(other, FRAMES[:-1]) == ["BLENDER", SCREW, "BLENDER"]
    assert modes_of(left_out, FRAMES[:-1]) == ["BLENDER"] * 3


@pytest.mark.parametrize("kind", ["VIEW_3D", *KEY_EDITORS])
def test_a_rig_in_object_mode_is_reduced_and_restored_in_every_editor(extension, kind, capfd):
    rig = recorded_rig()
    rig.select_set(True)
    select_bones(rig)
    bones = rig.pose.bones
    with editor(kind) as space:
        if kind in KEY_EDITORS:
            space.dopesheet.show_only_selected = True
        assert [text for _, text in facts_and_notes(rig, 5.0)[1]] == [KEYED_BONES]
        assert operators.reduce_keys.poll()
        assert not operators.restore_keys.poll()
        assert operators.reduce_keys(mode=SCREW, shared=True, tolerance=0.05) == {"FINISHED"}
        assert all(map(is_reduced, bones))
        (count,) = {len(key_frames(bone)) for bone in bones}
        said = capfd.readouterr().out
        assert f"7 bones: 630 keys became {7 * count}, largest error " in said
        assert f"; Frames: {count} with keys" in said
        assert operators.restore_keys() == {"FINISHED"}
        assert not any(map(is_reduced, bones))
        operators.reduce_keys(tolerance=0.05)
        assert operators.discard_dense_keys() == {"FINISHED"}
        assert not any(operator.poll() for operator in (operators.restore_keys, operators.discard_dense_keys))
    assert len(bpy.data.actions) == 1


def test_the_modes_meant_are_those_of_the_scope(tool):
    select_keys(tool, 11.0)
    operators.set_mode(mode=SCREW, on=SELECTED)
    bpy.context.scene.frame_set(5)
    assert modes_meant(bpy.context, transform_of(tool), WHOLE) == {"BLENDER", SCREW}
    assert modes_meant(bpy.context, transform_of(tool), SELECTED) == {SCREW}
    assert modes_meant(bpy.context, transform_of(tool), CURRENT) == {"BLENDER"}
    bpy.context.scene.frame_set(50)
    assert modes_meant(bpy.context, transform_of(tool), CURRENT) == set()
    assert modes_meant(bpy.context, None, WHOLE) == set()


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


def test_a_rig_whose_bones_alone_have_keys_gets_a_layer_as_a_whole_which_is_merged(extension):
    bone = key_base(new("bone", "XYZ"), "dq_sclerp")
    rig, before = bone.id_data, seen(bone)
    select_only(rig)
    assert not operators.merge_layer.poll()
    assert operators.add_layer() == {"FINISHED"}
    assert not operators.add_layer.poll()
    rig.location.x = 1.0
    rig.keyframe_insert("location", frame=20)
    bpy.context.view_layer.update()
    assert np.abs(seen(bone) - before).max() < 1e-5, "bones play on below"
    expected = seen(rig)
    assert operators.merge_layer(tolerance=0.002) == {"FINISHED"}
    assert not operators.merge_layer.poll()
    assert np.abs(seen(rig) - expected).max() < 0.003
    assert np.abs(seen(bone) - before).max() < 1e-5
