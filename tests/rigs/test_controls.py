"""Modes on all controls of Rigify's human at once."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Quaternion

from addon.animation import bake, problem_of, set_mode, unbake
from tests.rigs.human import controls

KEYS = (1, 15, 31)


def test_all_of_its_controls_take_a_mode_and_everything_that_hangs_on_them_follows_as_it_follows_real_keys(rig):
    posed = controls(rig)
    key_at_random(posed)
    set_mode(posed, "dq_sclerp")
    assert {problem_of(control) for control in posed[::20]} == {""}
    shown = ends_of_bones(rig)
    bake(posed)
    reach = float(np.ptp(shown.reshape(-1, 3), axis=0).max())
    assert np.abs(ends_of_bones(rig) - shown).max() < 1e-5 * reach
    unbake(posed)
    assert np.array_equal(ends_of_bones(rig), shown)
    set_mode(posed, "BLENDER")
    assert np.abs(ends_of_bones(rig) - shown).max() > 0.001 * reach
    assert not [one for bone in rig.pose.bones for one in bone.constraints if one.name.startswith("Rigid Motion")]


def key_at_random(bones: list[bpy.types.PoseBone]) -> None:
    """Keys on three frames, moved and turned a little, where bones may be moved."""
    random = np.random.default_rng(0)
    for frame in KEYS:
        for bone in bones:
            moved = random.normal(size=3) * 0.02
            bone.location = [0.0 if locked else value for locked, value in zip(bone.lock_location, moved, strict=True)]
            turned = Quaternion((1.0, *(random.normal(size=3) * 0.15))).normalized()
            bone.keyframe_insert("location", frame=frame, group=bone.name)
            if bone.rotation_mode == "QUATERNION":
                bone.rotation_quaternion = turned
                bone.keyframe_insert("rotation_quaternion", frame=frame, group=bone.name)
            else:
                bone.rotation_euler = turned.to_euler(bone.rotation_mode)
                bone.keyframe_insert("rotation_euler", frame=frame, group=bone.name)
    bpy.context.view_layer.update()


def ends_of_bones(rig: bpy.types.Object) -> np.ndarray:
    """Where all bones begin and end on some frames, in armature space."""
    found = []
    for frame in range(KEYS[0], KEYS[-1] + 1, 4):
        bpy.context.scene.frame_set(frame)
        found.append([(*bone.head, *bone.tail) for bone in rig.pose.bones])
    return np.array(found)
