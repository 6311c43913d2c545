"""Keys inserted between keys when the displayed pose differs from the original motion."""

from __future__ import annotations

import importlib

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

from rigid_motion.animation import key_frames, repeat, set_mode, write_channel
from rigid_motion.animation.evaluation import source_cache
from rigid_motion.animation.queries.keyed import source_of
from tests.animation.bones.rigs import in_turn, select_only
from tests.animation.keyed import curves_of, rotation_path, transform_paths
from tests.animation.oracle import shown_worlds, world_now
from tests.animation.scenes import key, new_object, push_down, random_values, tweak

ORDERS = ("QUATERNION", "XYZ", "ZXY", "AXIS_ANGLE")


def moving(order: str = "QUATERNION") -> bpy.types.Object:
    """Return an object with screw motion, in the middle of a segment."""
    obj = key(new_object("Tool", order))
    set_mode(obj, "dq_sclerp")
    bpy.context.scene.frame_set(15)
    return obj


def insert(obj: bpy.types.Object) -> None:
    """Key all transform channels at their current values."""
    for path in transform_paths(obj):
        obj.keyframe_insert(path)


@pytest.mark.parametrize("order", ORDERS)
def test_a_pose_pasted_by_copy_global_transform_with_auto_key_is_where_it_lands(live_file, order):
    obj = moving(order)
    obj.parent = key(new_object("Arm", "YXZ"), (1.0, 40.0), seed=9)
    live_file.view_layer.update()
    select_only(obj)
    matrix = Matrix.LocRotScale((1.0, 5.0, -2.0), Euler((0.3, 0.2, 0.1)), (1.0, 1.0, 1.0))
    live_file.scene.tool_settings.use_keyframe_insert_auto = True
    # Does the operator's work: the operator itself has no clipboard to paste from without a window.
    # An add-on bundled with Blender until 4.5, built into Blender since.
    in_blender = "bl_operators." if bpy.app.version >= (5, 0) else ""
    importlib.import_module(f"{in_blender}copy_global_transform").set_matrix(live_file, matrix)
    assert np.abs(world_now() - np.array(matrix)).max() < 2e-5
    assert 15.0 in key_frames(obj)


@pytest.mark.parametrize(("order", "mode"), in_turn(ORDERS, ["dq_sclerp", "motor_spline"]))
def test_a_key_of_one_component_keys_all_of_the_body_there_and_on_the_keys_around(live_file, order, mode):
    obj = new_object("Tool", order)
    for path, frames in (("location", (1.0, 40.0)), (rotation_path(obj), (1.0, 20.0, 40.0))):
        write_channel(obj, path, np.array(frames), random_values(obj, path, len(frames), 3))
    set_mode(obj, mode)
    keys = [1.0, 10.0, 20.0, 40.0]
    before = shown_worlds([obj], keys)[0]
    bpy.context.scene.frame_set(10)
    obj.keyframe_insert("location", index=1)
    bpy.context.view_layer.update()
    np.testing.assert_allclose(shown_worlds([obj], keys)[0], before, atol=1e-5)
    for fcurve in curves_of(obj).values():
        assert [point.co.x for point in fcurve.keyframe_points] == keys


def test_sources_that_are_kept_for_comparison_are_few_and_go_with_the_file(live_file, monkeypatch):
    tool = moving()
    monkeypatch.setattr(source_cache, "MOST_KEYS", 3 * source_of(tool).key_count)
    fcurve = curves_of(tool)["location", 0]
    for value in range(5):
        fcurve.keyframe_points[1].co_ui.y = value
        bpy.context.view_layer.update()
    known = source_cache.known
    assert 0 < known.size == sum(source.key_count for source in known.values()) <= source_cache.MOST_KEYS
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert (len(known), known.size) == (0, 0)


def test_a_key_of_another_user_of_a_slot_has_the_pose_of_that_one(live_file):
    first = key(new_object("A"))
    set_mode(first, "dq_sclerp")
    second = first.copy()
    second.name = "B"
    bpy.context.scene.collection.objects.link(second)
    tweak(first, push_down(first, 50))
    bpy.context.scene.frame_set(17)
    bpy.context.view_layer.objects.active = second
    before = np.array(second.matrix_world)
    insert(second)
    bpy.context.view_layer.update()
    assert np.abs(np.array(second.matrix_world) - before).max() < 1e-5


@pytest.mark.parametrize(("how", "mode"), in_turn(["LINEAR", "REPEAT", "MIRROR"], ["dq_sclerp", "motor_spline"]))
@pytest.mark.parametrize("frame", [-7, 47])
def test_a_key_outside_of_the_keys_keeps_the_pose_where_the_motion_goes_on(live_file, how, frame, mode):
    live_file.scene.frame_start, live_file.scene.frame_end = -20, 60
    obj = key(new_object())
    set_mode(obj, mode)
    if how == "LINEAR":
        for fcurve in curves_of(obj).values():
            fcurve.extrapolation = "LINEAR"
            fcurve.update()
    else:
        repeat(obj, how)
    bpy.context.view_layer.update()
    live_file.scene.frame_set(frame)
    before = world_now()
    insert(obj)
    assert np.abs(world_now() - before).max() < 2e-5 * max(1.0, np.abs(before).max())
