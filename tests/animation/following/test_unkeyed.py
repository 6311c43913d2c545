"""Unkeyed poses stay while another channel is keyed, as in Blender, and vanish on the next frame."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import curve_of, rotation_path
from tests.animation.oracle import assert_shown, world_now
from tests.animation.scenes import key, new_object, random_values

ORDERS = ("QUATERNION", "ZXY", "AXIS_ANGLE")


def posed(order: str) -> bpy.types.Object:
    """Return an object that was moved, turned, scaled and given another property between two keys."""
    obj = key(new_object("Tool", order), scale="even")
    obj["speed"] = 1.0
    obj.keyframe_insert('["speed"]', frame=1)
    set_mode(obj, "dq_sclerp")
    bpy.context.scene.frame_set(15)
    for path in ("location", rotation_path(obj), "scale"):
        setattr(obj, path, random_values(obj, path, 1, 7)[0])
    obj["speed"] = 5.0
    bpy.context.view_layer.update()
    return obj


@pytest.mark.parametrize(("keyed", "order"), in_turn([(0, -1), (1, -1), (2, -1), (0, 1)], ORDERS))
def test_what_is_not_keyed_stays_until_the_next_frame(live_file, keyed, order):
    part, index = keyed
    obj = posed(order)
    paths = ["location", rotation_path(obj), "scale"]
    pose, seen = {path: np.array(getattr(obj, path)) for path in paths}, world_now()
    obj.keyframe_insert(paths[part], index=index)
    assert np.abs(world_now() - seen).max() < 1e-6
    assert all(np.array_equal(getattr(obj, path), pose[path]) for path in paths)
    assert obj["speed"] == 5.0
    live_file.scene.frame_set(16)
    live_file.scene.frame_set(15)
    for path in paths:
        error = np.abs(np.subtract(getattr(obj, path), pose[path]))
        is_keyed = np.isin(np.arange(len(error)), index if index >= 0 else range(4)) & (path == paths[part])
        # Channels keyed along with it have keys there, too, with the values of the motion.
        assert error[is_keyed].max(initial=0.0) < 1e-5
        assert is_keyed.all() or error[~is_keyed].max() > 0.01
    assert {len(curve_of(obj, paths[part], each).keyframe_points) for each in range(3)} == {5}
    assert obj["speed"] == 1.0
    assert_shown([obj], np.arange(1.0, 41.0, 1.375))


def test_what_is_edited_goes_where_it_has_it_and_poses_of_other_users_of_the_action_stay(live_file):
    obj = posed("QUATERNION")
    other = new_object("Other")
    other.animation_data_create().action = obj.animation_data.action
    other.animation_data.action_slot = obj.animation_data.action_slot
    bpy.context.view_layer.update()
    for one, size in ((obj, 2.0), (other, 3.0)):
        one.scale = (size, size, size)
    bpy.context.view_layer.update()
    for index in range(3):
        fcurve = curve_of(obj, "location", index)
        fcurve.keyframe_points[1].co_ui.y += 2.0
        fcurve.update()
    bpy.context.view_layer.update()
    assert list(obj.location) == pytest.approx(
        [curve_of(obj, "location", index).evaluate(15.0) for index in range(3)], abs=1e-5
    )
    obj.keyframe_insert("location")
    bpy.context.view_layer.update()
    assert tuple(obj.scale) == (2.0, 2.0, 2.0)
    assert tuple(other.scale) == (3.0, 3.0, 3.0)
