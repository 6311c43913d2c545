"""Poses without keys stay while something else is keyed, as in Blender, and go with the next frame."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from tests.animation.keyed import curve_of, curves_of, rotation_path
from tests.animation.oracle import assert_shown, world_now
from tests.animation.scenes import key, new_object, random_values

ORDERS = ("QUATERNION", "ZXY", "AXIS_ANGLE")


def posed(order: str) -> bpy.types.Object:
    """An object that was moved, turned, scaled and given another property between two keys."""
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


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("part", range(3))
def test_what_is_not_keyed_stays_until_the_next_frame(live_file, order, part):
    obj = posed(order)
    paths = ["location", rotation_path(obj), "scale"]
    pose, seen = {path: tuple(getattr(obj, path)) for path in paths}, world_now()
    obj.keyframe_insert(paths[part])
    assert np.abs(world_now() - seen).max() < 1e-6
    assert {path: tuple(getattr(obj, path)) for path in paths} == pose
    assert obj["speed"] == 5.0
    live_file.scene.frame_set(16)
    live_file.scene.frame_set(15)
    assert np.abs(np.subtract(getattr(obj, paths[part]), pose[paths[part]])).max() < 1e-5
    assert all(
        np.abs(np.subtract(getattr(obj, path), pose[path])).max() > 0.01 for path in paths if path != paths[part]
    )
    assert obj["speed"] == 1.0
    assert_shown([obj], np.arange(1.0, 41.0, 1.375))


@pytest.mark.parametrize("order", ORDERS)
def test_one_component_that_is_keyed_leaves_its_fellows_as_they_are_posed(live_file, order):
    obj = posed(order)
    seen, kept = world_now(), tuple(obj.location)
    obj.keyframe_insert("location", index=1)
    assert np.abs(world_now() - seen).max() < 1e-6
    live_file.scene.frame_set(15)
    # The others have keys there, too, with the values that the motion had.
    assert obj.location.y == pytest.approx(kept[1], abs=1e-6)
    assert {len(curve_of(obj, "location", index).keyframe_points) for index in range(3)} == {5}


def test_what_is_edited_goes_where_it_has_it(live_file):
    obj = posed("QUATERNION")
    scale = tuple(obj.scale)
    for fcurve in (curve_of(obj, "location", index) for index in range(3)):
        fcurve.keyframe_points[1].co_ui.y += 2.0
        fcurve.update()
    bpy.context.view_layer.update()
    assert list(obj.location) == pytest.approx(
        [curves_of(obj)["location", i].evaluate(15.0) for i in range(3)], abs=1e-5
    )
    assert tuple(obj.scale) == scale


def test_poses_of_other_users_of_the_action_stay(live_file):
    obj = posed("QUATERNION")
    other = new_object("Other")
    other.animation_data_create().action = obj.animation_data.action
    other.animation_data.action_slot = obj.animation_data.action_slot
    bpy.context.view_layer.update()
    other.scale = (3.0, 3.0, 3.0)
    bpy.context.view_layer.update()
    obj.keyframe_insert("location")
    bpy.context.view_layer.update()
    assert tuple(other.scale) == (3.0, 3.0, 3.0)
