"""Paths of pose bones lead where Blender shows their heads, or their tails where they only turn."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.animation.transforms import transform_of
from rigid_motion.ui.overlay import drawing
from rigid_motion.ui.overlay.cache import paths_of
from rigid_motion.ui.overlay.kinds import space_of_bone
from tests.ui.rigs import FRAMES, key_bone, keyed_rig, new_rig, select

WHOLE = np.arange(FRAMES[0], FRAMES[-1] + 1.0)
SCREW = "dq_sclerp"


def path_and_place(bone):
    """The path of a bone, and how the overlay places its points in the world on the current frame."""
    target = transform_of(bone)
    space, turned = space_of_bone(bone, bpy.context.evaluated_depsgraph_get())
    (path,) = paths_of([target], bpy.context.scene, {target: turned})
    matrix = np.array(space)
    return path, lambda points: points @ matrix[:3, :3].T + matrix[:3, 3]


def shown(bone, frames, end="head"):
    """Where Blender shows an end of a bone in the world."""
    result = []
    for frame in frames:
        bpy.context.scene.frame_set(int(frame))
        rig = bone.id_data.evaluated_get(bpy.context.evaluated_depsgraph_get())
        result.append(tuple(rig.matrix_world @ getattr(rig.pose.bones[bone.name], end)))
    return np.array(result)


def assert_leads(bone, end):
    path, place = path_and_place(bone)
    expected = shown(bone, WHOLE, end)
    on = np.searchsorted(path.frames, WHOLE)
    assert place(path.desired[on]) == pytest.approx(expected, abs=1e-5)
    assert np.abs(place(path.native[on]) - expected).max() > 0.01


@pytest.mark.parametrize("name", ["Hip", "Hand"])
def test_the_path_of_a_bone_that_moves_is_that_of_its_head(scene, name):
    bone = key_bone(new_rig().pose.bones[name])
    set_mode(bone, SCREW)
    assert_leads(bone, "head")


@pytest.mark.parametrize("connected", [False, True])
def test_the_path_of_a_bone_that_only_turns_is_that_of_its_tail(scene, connected):
    rig = new_rig()
    if connected:
        bpy.ops.object.mode_set(mode="EDIT")
        rig.data.edit_bones["Hand"].use_connect = True
        bpy.ops.object.mode_set(mode="POSE")
    bone = key_bone(rig.pose.bones["Hand"], paths=("rotation_quaternion",))
    bone.location = (0.3, 0.2, 0.1)
    set_mode(bone, "cga_slerp" if not connected else SCREW)
    path, place = path_and_place(bone)
    on = np.searchsorted(path.frames, WHOLE)
    assert place(path.desired[on]) == pytest.approx(shown(bone, WHOLE, "tail"), abs=1e-5)


def test_axes_of_a_bone_are_as_it_is_turned(scene):
    rig = new_rig()
    rig.data.bones["Hand"].use_local_location = False
    bone = key_bone(rig.pose.bones["Hand"])
    set_mode(bone, SCREW)
    path, place = path_and_place(bone)
    axes = place(path.axes)
    for frame, ends in zip(path.axis_frames, axes, strict=True):
        bpy.context.scene.frame_set(int(frame))
        matrix = np.array(rig.matrix_world @ rig.pose.bones["Hand"].matrix)
        assert ends[:, 0] == pytest.approx(np.tile(matrix[:3, 3], (3, 1)), abs=1e-5)
        strokes = (ends[:, 1] - ends[:, 0]) / (0.5 * bone.bone.length)
        assert strokes == pytest.approx(matrix[:3, :3].T, abs=1e-5)


def test_the_overlay_is_for_the_selected_bones_and_not_for_the_rig(scene):
    rig = keyed_rig()
    rig.keyframe_insert("location", frame=1)
    select(rig, ("Hand",))
    assert [bone.name for bone in drawing.selected_in_view(bpy.context)] == ["Hand"]
