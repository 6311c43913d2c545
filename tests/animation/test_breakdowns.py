"""Breakdown, push and relax along modes: poses against `interpolate`, which is given the poses of the keys alone."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Quaternion

from rigid_motion.animation import Breakdowns, Refused, breakdown, set_mode, set_turns, write_channel
from rigid_motion.motion import KEYFRAME_MODES, Poses, interpolate
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import curves_of, key_frames, snapshot
from tests.animation.oracle import Own, as_quaternion, assert_shown, matrices, shown_worlds, unit
from tests.animation.scenes import FRAMES, give_own_deltas, key, new_object, random_values

FACTORS = (-0.3, 0.0, 0.35, 1.0, 1.25)
BEFORE, NOW, AFTER = 11.0, 17.0, 24.0


def key_poses(obj: bpy.types.Object, seed: int, own: Own, scaled: bool = False) -> Poses:
    """What `key` sets on an object, with delta transforms of its own."""
    rotation = "rotation_quaternion" if obj.rotation_mode == "QUATERNION" else "rotation_euler"
    turned = random_values(obj, rotation, len(FRAMES), seed)
    quaternions = [
        unit(row) if obj.rotation_mode == "QUATERNION" else as_quaternion(row, obj.rotation_mode) for row in turned
    ]
    scales = random_values(obj, "scale", len(FRAMES), seed, True)[:, 0] if scaled else None
    own_turn = np.array(own.quaternion)
    w, x, y, z = own_turn
    left = np.array(((w, -x, -y, -z), (x, w, -z, y), (y, z, w, -x), (z, -y, x, w)))
    return Poses(random_values(obj, "location", len(FRAMES), seed) + own.location, quaternions @ left.T, scales)


def as_matrix(poses: Poses, scale: float) -> np.ndarray:
    """The matrix of one pose (1,), of something that has this scale of its own."""
    scales = scale * (np.ones(1) if poses.scales is None else poses.scales)
    return matrices(poses.positions, poses.quaternions, np.repeat(scales[:, None], 3, axis=1))[0]


def on_path(keys: Poses, mode: str, factor: float, times=FRAMES) -> Poses:
    """The pose of a factor between the second key and the third."""
    if KEYFRAME_MODES[mode].is_smooth and 0.0 <= factor <= 1.0:
        return interpolate(times, keys, np.array([times[1] + factor * (times[2] - times[1])]), mode)
    return interpolate((0.0, 1.0), keys[1:3], np.array([factor]), mode, extrapolate=True)


def basis(obj: bpy.types.Object) -> np.ndarray:
    bpy.context.view_layer.update()
    return np.array(obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_basis)


@pytest.mark.parametrize(("mode", "order"), in_turn(KEYFRAME_MODES, ["QUATERNION", "YZX"]))
@pytest.mark.parametrize("scale", [None, "even"])
def test_a_breakdown_is_on_the_path_of_the_mode(live_file, mode, order, scale):
    obj = new_object(rotation_mode=order)
    own = give_own_deltas(obj, 3)
    # Handles would shape a smooth mode.
    key(obj, seed=5, scale=scale, interpolation="LINEAR" if KEYFRAME_MODES[mode].is_smooth else "BEZIER")
    set_mode(obj, mode)
    bpy.context.scene.frame_set(int(NOW))
    keys = key_poses(obj, 5, own, scale is not None)
    tries = Breakdowns(obj)
    for factor in FACTORS:
        if KEYFRAME_MODES[mode].is_smooth and not 0.0 <= factor <= 1.0:
            continue
        tries.apply(factor)
        expected = as_matrix(on_path(keys, mode, factor), own.scale[0])
        np.testing.assert_allclose(basis(obj), expected, atol=2e-5 * np.abs(expected).max())
        assert key_frames(obj).tolist() == [FRAMES[0], BEFORE, NOW, AFTER, FRAMES[3]]
        # It is a key like any other: from frame to frame and back it stays.
        shown = shown_worlds([obj], [NOW])[0][0]
        np.testing.assert_allclose(shown, expected, atol=2e-5 * np.abs(expected).max())


@pytest.mark.parametrize("order", ["QUATERNION", "XYZ"])
def test_where_a_segment_is_blenders_a_breakdown_is_blenders_own(live_file, order):
    obj = new_object(rotation_mode=order)
    key(obj, seed=2, scale="uneven")
    set_mode(obj, "dq_sclerp", (AFTER,))
    bpy.context.scene.frame_set(int(NOW))
    breakdown(obj, 0.25)
    bpy.context.view_layer.update()
    location, scale = (random_values(obj, path, 4, 2, False) for path in ("location", "scale"))
    np.testing.assert_allclose(obj.location, 0.75 * location[1] + 0.25 * location[2], atol=1e-5)
    np.testing.assert_allclose(obj.scale, 0.75 * scale[1] + 0.25 * scale[2], atol=1e-5)
    if order == "XYZ":
        angles = random_values(obj, "rotation_euler", 4, 2)
        np.testing.assert_allclose(obj.rotation_euler, 0.75 * angles[1] + 0.25 * angles[2], atol=1e-5)
    else:
        first, last = (unit(row) for row in random_values(obj, "rotation_quaternion", 4, 2)[1:3])
        half = np.arccos(np.clip(np.abs(np.dot(first, last)), 0.0, 1.0))
        last = np.multiply(last, np.sign(np.dot(first, last)))
        expected = (np.sin(0.75 * half) * np.array(first) + np.sin(0.25 * half) * last) / np.sin(half)
        turned = np.array(obj.rotation_quaternion.normalized())
        np.testing.assert_allclose(turned * np.sign(turned @ expected), expected, atol=1e-5)


def test_a_key_on_the_frame_is_made_anew_and_the_others_stay(live_file):
    obj = key(new_object(), seed=4)
    set_mode(obj, "cga_slerp")
    before = snapshot(obj)
    bpy.context.scene.frame_set(int(BEFORE))
    breakdown(obj, 0.5)
    poses = key_poses(obj, 4, Own())
    expected = interpolate((0.0, 1.0), poses[np.array((0, 2))], np.array([0.5]), "cga_slerp")
    np.testing.assert_allclose(basis(obj), as_matrix(expected, 1.0), atol=2e-5)
    after = snapshot(obj)
    assert set(after) == set(before)
    for channel, (*_, keys) in after.items():
        others = [number for number in range(4) if number != 1]
        assert [keys[number][:2] for number in others] == [before[channel][-1][number][:2] for number in others]


def test_another_factor_and_cancelling_leave_nothing_behind(live_file):
    obj = key(new_object(), seed=6)
    set_mode(obj, "dq_sclerp")
    bpy.context.scene.frame_set(int(NOW))
    breakdown(obj, 0.7)
    once = snapshot(obj)
    bpy.context.view_layer.update()
    for fcurve in curves_of(obj).values():
        if len(fcurve.keyframe_points) == 5:
            fcurve.keyframe_points.remove(fcurve.keyframe_points[2])
    bpy.context.scene.frame_set(int(NOW))
    before, played = snapshot(obj), shown_worlds([obj], np.arange(1.0, 41.0))[0]
    bpy.context.scene.frame_set(int(NOW))
    # A pose without a key is the animator's as well.
    obj.location = (7.0, 8.0, 9.0)
    bpy.context.view_layer.update()
    seen = basis(obj)
    tries = Breakdowns(obj)
    for factor in (0.1, 0.9, 0.7):
        tries.apply(factor)
        bpy.context.view_layer.update()
    assert snapshot(obj) == once, "as if it had been this factor from the first"
    tries.cancel()
    assert snapshot(obj) == before
    assert tuple(obj.location) == (7.0, 8.0, 9.0)
    np.testing.assert_allclose(basis(obj), seen, atol=1e-6)
    assert np.abs(shown_worlds([obj], np.arange(1.0, 41.0))[0] - played).max() == 0.0


@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline", "pga_lerp", "lerp_slerp"])
@pytest.mark.parametrize("kind", ["PUSH", "RELAX"])
def test_push_and_relax_go_from_the_pose_that_is_seen_along_the_mode(live_file, kind, mode):
    obj = new_object()
    own = give_own_deltas(obj, 8)
    key(obj, seed=9, interpolation="LINEAR")
    set_mode(obj, mode)
    bpy.context.scene.frame_set(int(NOW))
    keys = key_poses(obj, 9, own)
    share = (NOW - BEFORE) / (AFTER - BEFORE)
    between = on_path(keys, mode, share)
    np.testing.assert_allclose(basis(obj), as_matrix(between, own.scale[0]), atol=2e-5)
    obj.location = np.add(obj.location, (0.4, -0.3, 0.2))
    bpy.context.view_layer.update()
    seen = basis(obj)
    breakdown(obj, 0.3, kind)
    now = Poses(seen[None, :3, 3], np.array([bpy_quaternion(seen)]))
    ends = Poses(
        np.concatenate((now.positions, between.positions)), np.concatenate((now.quaternions, between.quaternions))
    )
    factor = -0.3 if kind == "PUSH" else 0.3
    expected = interpolate((0.0, 1.0), ends, np.array([factor]), mode, extrapolate=True)
    np.testing.assert_allclose(basis(obj), as_matrix(expected, own.scale[0]), atol=3e-5 * max(1.0, np.abs(seen).max()))


def bpy_quaternion(matrix: np.ndarray) -> np.ndarray:
    return np.array(Matrix(matrix.tolist()).to_quaternion())


def axis_and_angle(obj: bpy.types.Object) -> None:
    obj.rotation_mode = "AXIS_ANGLE"


@pytest.mark.parametrize("frame", [-3, 1, 40, 55])
def test_without_keys_on_both_sides_it_is_refused(live_file, frame):
    obj = key(new_object())
    set_mode(obj, "dq_sclerp")
    bpy.context.scene.frame_set(frame)
    before = snapshot(obj)
    with pytest.raises(Refused, match=f"^Tool needs a key before and a key after frame {frame}:"):
        breakdown(obj)
    assert snapshot(obj) == before


def test_what_cannot_be_keyed_is_refused_and_the_others_are_keyed(live_file):
    good, bad, idle = (new_object(name) for name in ("Good", "Bad", "Idle"))
    for obj in (good, bad):
        key(obj)
        set_mode(obj, "dq_sclerp")
    axis_and_angle(bad)
    bpy.context.scene.frame_set(int(NOW))
    refused: list[Refused] = []
    breakdown([good, bad, idle], 0.5, refused=refused)
    assert NOW in key_frames(good).tolist()
    assert NOW not in key_frames(bad).tolist()
    assert sorted(str(item).split(" ")[0] for item in refused) == ["Bad", "Idle"]


def test_a_breakdown_below_noise_and_holds_is_that_of_the_keys(live_file):
    poses = []
    for with_modifiers in (False, True):
        obj = key(new_object(), seed=6)
        set_mode(obj, "dq_sclerp")
        if with_modifiers:
            for (path, _), fcurve in curves_of(obj).items():
                if path in ("location", "rotation_quaternion"):
                    fcurve.modifiers.new("STEPPED").frame_step = 5.0
            curves_of(obj)["location", 0].modifiers.new("NOISE").strength = 3.0
            bpy.context.view_layer.update()
        bpy.context.scene.frame_set(int(NOW))
        breakdown(obj, 0.4)
        poses.append(
            [
                next(point.co[1] for point in fcurve.keyframe_points if point.co[0] == NOW)
                for (path, _), fcurve in curves_of(obj).items()
                if path in ("location", "rotation_quaternion")
            ]
        )
    np.testing.assert_allclose(*poses, atol=1e-6)


@pytest.mark.parametrize("mode", ["motor_spline", "pga_lerp"])
def test_a_breakdown_leaves_the_path_and_changes_when_the_body_is_there(live_file, mode):
    obj = new_object(rotation_mode="QUATERNION")
    key(obj, seed=5, interpolation="LINEAR")
    set_mode(obj, mode)
    times = np.linspace(BEFORE, AFTER, 2001)
    path = animation_of(obj, mode, times)
    beside = shown_worlds([obj], [*range(1, 11), *range(25, 41)])[0]
    bpy.context.scene.frame_set(int(NOW))
    breakdown(obj, 0.8)
    assert {
        point.type for curve in curves_of(obj).values() for point in curve.keyframe_points if point.co[0] == NOW
    } == {"BREAKDOWN"}
    shown = shown_worlds([obj], np.arange(BEFORE, AFTER + 1.0))[0]
    nearest = np.abs(shown[:, None] - path).max(axis=(2, 3)).min(axis=1)
    assert nearest.max() < 2e-3 * np.abs(path).max()
    np.testing.assert_allclose(shown_worlds([obj], [*range(1, 11), *range(25, 41)])[0], beside, atol=2e-5)


@pytest.mark.parametrize(("growth", "there"), [(0.0, (1.3, 1.3, 1.3)), (0.01, (1.1, 1.2, 1.3))])
def test_a_breakdown_may_scale_otherwise_than_the_keys_around_it(live_file, growth, there):
    obj = key(new_object(rotation_mode="QUATERNION"), seed=5, scale="even")
    set_mode(obj, "pga_lerp")
    bpy.context.scene.frame_set(int(NOW))
    breakdown(obj, 0.8)
    for axis in range(3):
        for point in curves_of(obj)["scale", axis].keyframe_points:
            point.co_ui.y = there[axis] if point.co[0] == NOW else 1.0 + growth * point.co[0]
    bpy.context.view_layer.update()
    assert_shown([obj], np.arange(-2.0, 44.0))


def animation_of(obj: bpy.types.Object, mode: str, times: np.ndarray) -> np.ndarray:
    """What a mode makes of linear keys at times (m,), as matrices."""
    keys = key_poses(obj, 5, Own())
    poses = interpolate(FRAMES, keys, times, mode)
    return matrices(poses.positions, poses.quaternions, np.ones((len(times), 3)))


@pytest.mark.parametrize("factor", [0.25, 0.5])
def test_a_breakdown_shares_turns_out_and_cancelling_gives_them_back(live_file, factor):
    obj = new_object(rotation_mode="QUATERNION")
    write_channel(obj, "location", np.array((1.0, 25.0)), np.array(((0.0, 0.0, 0.0), (4.0, 0.0, 0.0))))
    write_channel(obj, "rotation_quaternion", np.array((1.0, 25.0)), np.array(((1.0, 0.0, 0.0, 0.0),) * 2))
    set_mode(obj, "dq_sclerp")
    set_turns(obj, 2)
    before = snapshot(obj)
    motion = shown_worlds([obj], np.arange(1.0, 26.0, 0.5))[0]
    bpy.context.scene.frame_set(13)
    tries = Breakdowns(obj)
    for each in (0.9, 0.1, factor):
        tries.apply(each)
    for share, frame in ((0.5 * factor, 7.0), (factor, 13.0), (0.5 + 0.5 * factor, 19.0)):
        shown = shown_worlds([obj], [frame])[0][0]
        turned = np.array(Quaternion((0.0, 0.0, 1.0), 4.0 * np.pi * share).to_matrix())
        np.testing.assert_allclose(shown[:3, :3], turned, atol=2e-5)
        assert shown[0, 3] == pytest.approx(4.0 * share, abs=2e-5)
    bpy.context.scene.frame_set(13)
    tries.cancel()
    assert snapshot(obj) == before
    np.testing.assert_allclose(shown_worlds([obj], np.arange(1.0, 26.0, 0.5))[0], motion, atol=1e-6)
