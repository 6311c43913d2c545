"""Paths and ghosts of held objects are where Blender shows them, in each holder and between two holders."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import hold_in, set_mode
from rigid_motion.ui.overlay.cache import path_of
from rigid_motion.ui.overlay.points import PASSING_HOLDER
from tests.animation.keyed import curves_of
from tests.animation.scenes import key, new_object
from tests.ui.overlay.seen import assert_where_it_is_seen
from tests.ui.rigs import FRAMES, key_bone, new_rig

pytestmark = pytest.mark.any_blender


def passed_around(prop, holders):
    """Hold a prop in one holder after the other from frame 8 on, some of them over several frames, and let it go."""
    for frame, holder, frames in zip((8, 18, 27, 36), (*holders, holders[0], None), (0, 5, None, 3), strict=True):
        bpy.context.scene.frame_set(frame)
        hold_in(prop, holder, frames=frames)


@pytest.fixture
def hands(scene):
    left, right = (key(new_object(name), FRAMES, seed=seed) for seed, name in enumerate(("Left", "Right")))
    set_mode([left, right], "motor_spline")
    return left, right


@pytest.mark.parametrize("parented", [False, True])
def test_an_object_in_a_bone_and_in_a_hand_that_move_by_keys(scene, hands, parented):
    prop, rig = new_object("Prop"), new_rig()
    for name in ("Hip", "Hand"):
        key_bone(rig.pose.bones[name])
    prop.location = (0.3, 0.2, 0.1)
    if parented:
        prop.parent = key(new_object("Floor"), FRAMES, seed=7)
    passed_around(prop, (rig.pose.bones["Hand"], hands[1]))
    path = assert_where_it_is_seen(prop, scene)
    assert [piece.holder for piece in path.pieces] == [0, 1, PASSING_HOLDER, 2, PASSING_HOLDER, 1, PASSING_HOLDER]
    assert [piece.last for piece in path.pieces[:-1]] == [piece.first for piece in path.pieces[1:]]


def test_what_is_held_last_goes_on_to_the_end_of_the_scene(scene, hands):
    scene.frame_end = 41
    prop = new_object("Prop")
    scene.frame_set(8)
    hold_in(prop, hands[0])
    path = assert_where_it_is_seen(prop, scene)
    assert path.frames[[0, -1]].tolist() == [7.0, 41.0]


def test_a_bone_in_hands(scene, hands):
    rig = new_rig()
    key_bone(rig.pose.bones["Hip"])
    passed_around(rig.pose.bones["Hand"], hands)
    assert_where_it_is_seen(rig.pose.bones["Hand"], scene)


def test_an_edit_of_the_hand_moves_the_path(scene, hands):
    prop = new_object("Prop")
    passed_around(prop, hands)
    before = path_of(prop, bpy.context)
    for point in curves_of(hands[0])["location", 2].keyframe_points:
        point.co.y += 1.0
    bpy.context.view_layer.update()
    path = assert_where_it_is_seen(prop, scene)
    assert np.abs(path.desired - before.desired).max() > 0.5
    assert path_of(prop, bpy.context) is path


def test_a_hand_that_follows_is_known_where_it_was_seen(scene, hands):
    follower = new_object("Follower")
    follower.constraints.new("COPY_TRANSFORMS").target = hands[0]
    prop = new_object("Prop")
    passed_around(prop, (follower, hands[1]))
    before = path_of(prop, bpy.context)
    scene.frame_end = 41
    bpy.ops.rigid_motion.update_path()
    assert scene.frame_current == 36
    assert np.abs(path_of(prop, bpy.context).desired - before.desired).max() > 0.1
    assert_where_it_is_seen(prop, scene)
    for point in curves_of(hands[0])["location", 2].keyframe_points:
        point.co.y += 1.0
    bpy.context.view_layer.update()
    assert_where_it_is_seen(prop, scene)


def test_after_an_undo_all_is_looked_at_anew(scene, hands):
    follower = new_object("Follower")
    follower.constraints.new("COPY_TRANSFORMS").target = hands[0]
    passed_around(new_object("Prop"), (follower, hands[1]))
    bpy.ops.rigid_motion.update_path()
    bpy.ops.ed.undo_push(message="Held")
    before = path_of(bpy.data.objects["Prop"], bpy.context)
    hands[0].location.z += 1.0
    bpy.ops.ed.undo_push(message="Moved")
    bpy.ops.ed.undo()
    path = path_of(bpy.data.objects["Prop"], bpy.context)
    assert path is not before
    assert path.desired == pytest.approx(before.desired, abs=1e-5)
