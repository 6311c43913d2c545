"""Paths of pose bones lead where Blender shows their heads, or their tails where they only turn."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.ui.overlay import drawing
from tests.animation.bones.poses import seen
from tests.animation.bones.rigs import select_bones
from tests.ui.overlay.test_parents import WHOLE, shown
from tests.ui.rigs import key_bone, keyed_rig, new_rig, path_and_space

SCREW = "dq_sclerp"


def placed(space, points):
    """Points in the world that the overlay draws in a space."""
    return points @ space[:3, :3].T + space[:3, 3]


@pytest.mark.parametrize("name", ["Hip", "Hand"])
def test_the_path_of_a_bone_that_moves_is_that_of_its_head(scene, name):
    bone = key_bone(new_rig().pose.bones[name])
    set_mode(bone, SCREW)
    path, space = path_and_space(bone)
    expected = shown(bone)
    on = np.searchsorted(path.frames, WHOLE)
    assert placed(space, path.desired[on]) == pytest.approx(expected, abs=1e-5)
    assert np.abs(placed(space, path.native[on]) - expected).max() > 0.01


@pytest.mark.parametrize("connected", [False, True])
def test_the_path_of_a_bone_that_only_turns_is_that_of_its_tail(scene, connected):
    bone = key_bone(new_rig(use_connect=connected).pose.bones["Hand"], location=False)
    bone.location = (0.3, 0.2, 0.1)
    set_mode(bone, "cga_slerp" if not connected else SCREW)
    path, space = path_and_space(bone)
    on = np.searchsorted(path.frames, WHOLE)
    tail = shown(bone, (0.0, bone.bone.length, 0.0))
    assert placed(space, path.desired[on]) == pytest.approx(tail, abs=1e-5)


def test_axes_of_a_bone_are_as_it_is_turned(scene):
    rig = new_rig(use_local_location=False)
    bone = key_bone(rig.pose.bones["Hand"])
    set_mode(bone, SCREW)
    path, space = path_and_space(bone)
    for frame, ends in zip(path.axis_frames, placed(space, path.axes), strict=True):
        bpy.context.scene.frame_set(int(frame))
        matrix = np.array(rig.matrix_world) @ seen(rig, "Hand")
        assert ends[:, 0] == pytest.approx(np.tile(matrix[:3, 3], (3, 1)), abs=1e-5)
        strokes = (ends[:, 1] - ends[:, 0]) / (0.5 * bone.bone.length)
        assert strokes == pytest.approx(matrix[:3, :3].T, abs=1e-5)


def test_the_overlay_is_for_the_selected_bones_and_not_for_the_rig(scene):
    rig = keyed_rig()
    rig.keyframe_insert("location", frame=1)
    select_bones(rig, "Hand")
    assert [bone.name for bone in drawing.selected_in_view(bpy.context)] == ["Hand"]
