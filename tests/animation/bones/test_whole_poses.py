"""Poses that are put on bones as a whole between two keys: what was put there is seen, and what is keyed."""

from __future__ import annotations

import importlib
from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion.animation import key_frames, set_mode
from tests.animation.bones.poses import assert_posed, placed
from tests.animation.bones.rigs import BETWEEN, key_all, new_rig, own_clipboard, pose_mode
from tests.animation.bones.test_rig_edits import HANDS
from tests.animation.keyed import rotation_path
from tests.animation.scenes import new_object

NOW = 15
EXACT = {"rtol": 0.0, "atol": 1e-5}


@pytest.fixture(params=("QUATERNION", "XYZ", "AXIS_ANGLE"))
def rig(request, live_file) -> bpy.types.Object:
    """A rig in Pose Mode with a mode on each of its bones, in the middle of a segment."""
    rig = key_all(new_rig(bones=HANDS, rotation_mode=request.param), amount=0.6)
    set_mode(list(rig.pose.bones), "dq_sclerp")
    live_file.scene.frame_set(NOW)
    return pose_mode(rig)


def insert_keys(rig: bpy.types.Object) -> None:
    for bone in rig.pose.bones:
        for path in ("location", rotation_path(bone)):
            bone.keyframe_insert(path)
    bpy.context.view_layer.update()


def as_an_animator(operator: Callable, **settings: object) -> None:
    """With undo, as in a window."""
    assert operator("EXEC_DEFAULT", True, **settings) == {"FINISHED"}


def assert_keyed_as_seen(rig: bpy.types.Object, seen: np.ndarray) -> None:
    """A pose is seen, stays so as it is keyed, and is there when one comes back."""
    np.testing.assert_allclose(placed(rig), seen, **EXACT)
    insert_keys(rig)
    np.testing.assert_allclose(placed(rig), seen, **EXACT)
    assert all(float(NOW) in key_frames(bone) for bone in rig.pose.bones)
    for frame in (NOW + 1, NOW):
        bpy.context.scene.frame_set(frame)
    np.testing.assert_allclose(placed(rig), seen, **EXACT)
    assert_posed(rig, BETWEEN[::3])


def test_the_visual_transform_applied_leaves_bones_where_they_are(rig):
    seen = placed(rig)
    as_an_animator(bpy.ops.pose.visual_transform_apply)
    assert_keyed_as_seen(rig, seen)


@pytest.mark.parametrize("flipped", [False, True], ids=["as it is", "flipped"])
def test_a_pose_copied_on_an_in_between_is_pasted_as_it_was_seen(rig, live_file, tmp_path, flipped):
    live_file.scene.frame_set(30)
    copied = placed(rig)
    with own_clipboard(tmp_path):
        as_an_animator(bpy.ops.pose.copy)
        live_file.scene.frame_set(NOW)
        as_an_animator(bpy.ops.pose.paste, flipped=flipped)
    if flipped:
        mirror = np.diag((-1.0, 1.0, 1.0, 1.0))
        copied = mirror @ copied[[0, 2, 1]] @ mirror
    assert_keyed_as_seen(rig, copied)


@pytest.mark.parametrize("cleared", ["transforms", "rot"])
def test_cleared_bones_rest_and_undo_brings_back_what_was_seen(rig, cleared):
    bpy.ops.ed.undo_push(message="Begin")
    seen = placed(rig)
    as_an_animator(getattr(bpy.ops.pose, f"{cleared}_clear"))
    np.testing.assert_allclose([bone.matrix_basis.to_quaternion().angle for bone in rig.pose.bones], 0.0, atol=1e-6)
    with bpy.context.temp_override(mode="OBJECT"):
        assert bpy.ops.ed.undo() == {"FINISHED"}
    rig = bpy.data.objects["Rig"]
    assert_keyed_as_seen(rig, seen)


def test_rigify_keeps_a_transform_where_it_is_seen_when_a_parent_is_switched(rig):
    """What *Switch Parent* does: a matrix of the properties, the switch, and the matrix set again."""
    # Its functions alone: as an add-on it would leave classes behind, which the tests of its human register anew.
    tools = importlib.import_module("rigify.utils.animation")
    seen, hand = placed(rig), rig.pose.bones["Hand.R"]
    matrix = tools.get_transform_matrix(rig, "Hand.R", with_constraints=False)
    # The switch: what the hand hangs on is elsewhere from now on.
    hand.parent.constraints.new("COPY_ROTATION").target = new_object("Elsewhere")
    assert np.abs(placed(rig)[2] - seen[2]).max() > 0.01
    tools.set_transform_from_matrix(rig, "Hand.R", matrix, keyflags=set())
    for _ in range(2):
        np.testing.assert_allclose(placed(rig)[2], seen[2], **EXACT)
        for frame in (NOW + 1, NOW):
            bpy.context.scene.frame_set(frame)
