"""*Add Layer* and *Merge Layer* as operators."""

from __future__ import annotations

import bpy
import numpy as np

from tests.animation.bones.rigs import select_only
from tests.animation.layered import FRAMES, key_base, new, seen

operators = bpy.ops.rigid_motion


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
    expected = seen(rig, FRAMES)
    assert operators.merge_layer(tolerance=0.002) == {"FINISHED"}
    assert not operators.merge_layer.poll()
    assert np.abs(seen(rig, FRAMES) - expected).max() < 0.003
    assert np.abs(seen(bone) - before).max() < 1e-5
