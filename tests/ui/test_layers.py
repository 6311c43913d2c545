"""*Add Layer* and *Merge Layer* as operators."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion.animation import key_frames
from tests.animation.bones.rigs import select_only
from tests.animation.layered import FRAMES, key_base, key_offset, new, seen


def test_a_layer_is_added_and_merged_and_neither_is_offered_twice(extension):
    tool = key_base(new("object", "XYZ"), "dq_sclerp")
    select_only(tool)
    assert not bpy.ops.rigid_motion.merge_layer.poll()
    assert bpy.ops.rigid_motion.add_layer() == {"FINISHED"}
    assert not bpy.ops.rigid_motion.add_layer.poll()
    key_offset(tool)
    bpy.context.view_layer.update()
    assert bpy.ops.rigid_motion.merge_layer(tolerance=0.01) == {"FINISHED"}
    assert not bpy.ops.rigid_motion.merge_layer.poll()
    assert len(key_frames(tool)) > 4
    assert tool.parent is None


def test_a_rig_whose_bones_alone_have_keys_gets_a_layer_as_a_whole(extension):
    bone = key_base(new("bone", "XYZ"), "dq_sclerp")
    rig, before = bone.id_data, seen(bone)
    select_only(rig)
    assert bpy.ops.rigid_motion.add_layer() == {"FINISHED"}
    rig.location.x = 1.0
    rig.keyframe_insert("location", frame=20)
    bpy.context.view_layer.update()
    assert np.abs(seen(bone) - before).max() < 1e-5, "bones play on below"
    expected = seen(rig, FRAMES)
    assert bpy.ops.rigid_motion.merge_layer(tolerance=0.002) == {"FINISHED"}
    assert np.abs(seen(rig, FRAMES) - expected).max() < 0.003
    assert np.abs(seen(bone) - before).max() < 1e-5
