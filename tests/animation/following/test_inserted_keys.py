"""Inserted keys leave the motion unchanged between keys, in every mode and with any handles, and keep the pose seen
where that differs from the motion. Unkeyed poses stay while another channel is keyed, and vanish on the next frame.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

from rigid_motion.animation import key_frames, repeat, set_mode, write_channel
from rigid_motion.animation.evaluation import source_cache
from rigid_motion.animation.queries.keyed import source_of
from tests.animation.bones.rigs import in_turn, select_only
from tests.animation.keyed import MODE_IDS, WIDTHS, curve_of, curves_of, rotation_path, transform_paths
from tests.animation.oracle import assert_shown, shown_worlds, world_now
from tests.animation.scenes import key, new_object, push_down, random_values, tweak

ORDERS = ("QUATERNION", "XYZ", "ZXY", "AXIS_ANGLE")
FRAMES = (1.0, 17.0, 25.0, 49.0, 60.0)
POSES = [
    ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
    ((1.0, 0.4, -0.3), (0.9, 0.1, -0.2, 0.37)),
    ((1.9, 1.5, 0.1), (0.6, 0.3, -0.3, 0.67)),
    ((3.5, 1.9, 0.2), (0.2, 0.5, -0.3, 0.78)),
    ((3.0, 1.0, 1.2), (0.1, 0.2, -0.5, 0.78)),
]
POINTS = np.array(((0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0))).T
"""The origin, and three points 1 m away."""

MILLIMETRE = 1e-3
PLAYED = np.arange(1.0, 60.25, 0.25)


def keyed(carrier, frames=FRAMES, poses=POSES):
    """Key the carrier as I does, with Blender's default handles."""
    for frame, (location, quaternion) in zip(frames, poses, strict=False):
        carrier.location, carrier.rotation_quaternion = location, quaternion / np.linalg.norm(quaternion)
        insert(carrier, frame)
    return carrier


def insert(carrier, frame: float | None = None) -> None:
    """Key all of its transform, at this frame or at that of the scene."""
    for path in transform_paths(carrier):
        carrier.keyframe_insert(path, **({} if frame is None else {"frame": frame}))


def transform_curves(carrier) -> list[bpy.types.FCurve]:
    return [fcurve for (path, _), fcurve in curves_of(carrier).items() if path in WIDTHS]


def keys_of(carrier) -> list[bpy.types.Keyframe]:
    return [point for fcurve in transform_curves(carrier) for point in fcurve.keyframe_points]


def pulled(*, apart: bool) -> Callable:
    """Return an edit that sets handles by hand, on frames that the channels share or on frames of their own."""

    def pull(carrier) -> None:
        for number, fcurve in enumerate(transform_curves(carrier)):
            shares = np.random.default_rng(number if apart else 4).uniform(0.1, 0.6, size=(len(FRAMES), 2))
            slopes = 0.02 * np.random.default_rng(number).normal(size=len(FRAMES))
            # At the first and the last key, handles point outside.
            before, behind = np.diff(FRAMES, prepend=-5.0), np.diff(FRAMES, append=70.0)
            for point, share, slope, left, right in zip(
                fcurve.keyframe_points, shares, slopes, before, behind, strict=True
            ):
                point.handle_left_type = point.handle_right_type = "FREE"
                point.handle_left = point.co[0] - share[0] * left, point.co[1] - slope * left
                point.handle_right = point.co[0] + share[1] * right, point.co[1] + slope * right
            fcurve.update()

    return pull


def partly_linear(carrier) -> None:
    for point in curves_of(carrier)["location", 0].keyframe_points:
        point.interpolation = "LINEAR"


HANDLES = {
    "as I sets them": lambda carrier: None,
    "FREE": pulled(apart=False),
    "FREE, each channel otherwise": pulled(apart=True),
    "one channel linear": partly_linear,
}


def shown(obj: bpy.types.Object) -> np.ndarray:
    """Return the displayed points, shape (m, 3, 4)."""
    return (shown_worlds([obj], PLAYED)[0] @ POINTS)[:, :3]


def largest(now: np.ndarray, then: np.ndarray) -> float:
    return float(np.linalg.norm(now - then, axis=1).max())


def key_on(carrier, frame: int) -> None:
    bpy.context.scene.frame_set(frame)
    bpy.context.view_layer.update()
    insert(carrier)
    bpy.context.view_layer.update()


@pytest.mark.parametrize(("mode", "handles"), in_turn(MODE_IDS, [*HANDLES]))
def test_a_key_in_between_leaves_the_motion_as_it_was(live_file, mode, handles):
    """It is a breakdown where a regular key would change the path. Blender's own segments may change as in Blender."""
    obj = keyed(new_object())
    HANDLES[handles](obj)
    set_mode(obj, mode)
    seen = shown(obj)
    for frame in (31, 34, 9):
        key_on(obj, frame)
        assert mode == "BLENDER" or largest(shown(obj), seen) < MILLIMETRE, f"key on {frame}"
    depends = mode in ("pga_lerp", "cga_lerp", "motor_spline")
    types = {point.co[0]: point.type for point in keys_of(obj)}
    assert {types[frame] for frame in (31.0, 34.0, 9.0)} == {"BREAKDOWN" if depends else "KEYFRAME"}
    assert {types[frame] for frame in FRAMES} == {"KEYFRAME"}


def test_a_breakdown_that_is_moved_is_hit_and_takes_along_what_is_beside_it_alone(live_file):
    """A key beside it then changes the motion only up to the surrounding keys."""
    obj = keyed(new_object())
    set_mode(obj, "motor_spline")
    key_on(obj, 31)
    before = shown(obj)
    fcurve = curves_of(obj)["location", 2]
    next(point for point in fcurve.keyframe_points if point.co[0] == 31.0).co_ui.y += 0.4
    fcurve.update()
    bpy.context.view_layer.update()
    after = shown(obj)
    way = np.linalg.norm(after - before, axis=1).max(axis=1)
    assert way[PLAYED == 31.0] == pytest.approx(0.4, abs=1e-5)
    assert way[(PLAYED <= 25.0) | (PLAYED >= 49.0)].max() < 1e-5
    assert np.all(way[(PLAYED > 25.0) & (PLAYED < 31.0)] > 0.0)
    assert way.max() < 0.41
    bends = np.linalg.norm(np.diff(after[(PLAYED > 25.0) & (PLAYED < 48.0), :, 0], n=2, axis=0), axis=1)
    assert bends.max() < 0.01, "and nowhere suddenly"
    key_on(obj, 40)
    way = np.linalg.norm(shown(obj) - after, axis=1).max(axis=1)
    assert way[(PLAYED <= 31.0) | (PLAYED == 40.0) | (PLAYED >= 49.0)].max() < 1e-5
    assert way.max() < 0.4 / 6.0


@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline"])
@pytest.mark.parametrize("interpolation", ["BEZIER", "LINEAR"])
def test_it_rests_where_a_pose_was_computed_twice(live_file, mode, interpolation):
    """The poses differ by rounding in single precision, which handles that overshoot their keys must not amplify."""
    place, angles = POSES[1]
    twice = (np.nextafter(np.float32(place), np.float32(9.0)), angles)
    obj = keyed(new_object(), (1.0, 25.0, 49.0, 73.0), [POSES[0], POSES[1], twice, POSES[2]])
    for point in keys_of(obj):
        point.interpolation, point.handle_left_type, point.handle_right_type = interpolation, "AUTO", "AUTO"
    set_mode(obj, mode)
    (resting,) = shown_worlds([obj], np.arange(25.0, 50.0))
    assert np.abs(resting - resting[0]).max() < 2e-6


def moving(order: str = "QUATERNION") -> bpy.types.Object:
    """Return an object with screw motion, in the middle of a segment."""
    obj = key(new_object("Tool", order))
    set_mode(obj, "dq_sclerp")
    bpy.context.scene.frame_set(15)
    return obj


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
