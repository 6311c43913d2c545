"""Breakdown, push and relax along modes, compared with `interpolate` between the poses of the keys alone."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Quaternion

from rigid_motion.animation import Breakdowns, Refused, breakdown, set_mode, set_turns, write_channel
from rigid_motion.motion import KEYFRAME_MODES, Poses, interpolate
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import curves_of, key_frames, snapshot
from tests.animation.oracle import expected_bases, shown_worlds, world_now
from tests.animation.scenes import FRAMES, give_own_deltas, key, new_object, random_values
from tests.motion.bodies import matrices

FACTORS = (-0.3, 0.0, 0.35, 1.0, 1.25)
BEFORE, NOW, AFTER = 11.0, 17.0, 24.0


def key_poses(obj: bpy.types.Object) -> Poses:
    """Return the poses that `key` set on an object, with its delta transforms."""
    return Poses.from_matrices(expected_bases(obj, FRAMES))


def on_path(keys: Poses, mode: str, factor: float, times=FRAMES) -> Poses:
    """Return the pose at a factor between the second and the third key."""
    if KEYFRAME_MODES[mode].is_smooth and 0.0 <= factor <= 1.0:
        return interpolate(times, keys, np.array([times[1] + factor * (times[2] - times[1])]), mode)
    return interpolate((0.0, 1.0), keys[1:3], np.array([factor]), mode, extrapolate=True)


@pytest.mark.parametrize(
    ("mode", "what"), in_turn(KEYFRAME_MODES, [("QUATERNION", "even"), ("YZX", None), ("AXIS_ANGLE", "even")])
)
def test_a_breakdown_is_on_the_path_of_the_mode(live_file, mode, what):
    order, scale = what
    obj = new_object(rotation_mode=order)
    give_own_deltas(obj, 3)
    obj.delta_scale = (1.0, 1.0, 1.0)
    # In a smooth mode, handles would change the path.
    key(obj, seed=5, scale=scale, interpolation="LINEAR" if KEYFRAME_MODES[mode].is_smooth else "BEZIER")
    set_mode(obj, mode)
    bpy.context.scene.frame_set(int(NOW))
    keys = key_poses(obj)
    obj.delta_scale = (0.8, 0.8, 0.8)
    tries = Breakdowns(obj)
    for factor in FACTORS:
        if KEYFRAME_MODES[mode].is_smooth and not 0.0 <= factor <= 1.0:
            continue
        tries.apply(factor)
        expected = matrices(on_path(keys, mode, factor))[0] @ np.diag((0.8, 0.8, 0.8, 1.0))
        np.testing.assert_allclose(world_now(), expected, atol=2e-5 * np.abs(expected).max())
        assert key_frames(obj).tolist() == [FRAMES[0], BEFORE, NOW, AFTER, FRAMES[3]]
        # It is a key like any other: it stays when the frame changes.
        shown = shown_worlds([obj], [NOW])[0][0]
        np.testing.assert_allclose(shown, expected, atol=2e-5 * np.abs(expected).max())


def test_where_a_segment_is_blenders_a_breakdown_is_blenders_own(live_file):
    obj = new_object(rotation_mode="XYZ")
    key(obj, seed=2, scale="uneven")
    set_mode(obj, "dq_sclerp", (AFTER,))
    bpy.context.scene.frame_set(int(NOW))
    breakdown(obj, 0.25)
    bpy.context.view_layer.update()
    for path in ("location", "rotation_euler", "scale"):
        values = random_values(obj, path, 4, 2, False)
        np.testing.assert_allclose(getattr(obj, path), 0.75 * values[1] + 0.25 * values[2], atol=1e-5)


@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline", "pga_lerp", "lerp_slerp"])
@pytest.mark.parametrize("kind", ["PUSH", "RELAX"])
def test_push_and_relax_go_from_the_pose_that_is_seen_along_the_mode(live_file, kind, mode):
    obj = new_object()
    give_own_deltas(obj, 8)
    key(obj, seed=9, interpolation="LINEAR")
    set_mode(obj, mode)
    bpy.context.scene.frame_set(int(NOW))
    keys = key_poses(obj)
    share = (NOW - BEFORE) / (AFTER - BEFORE)
    between = on_path(keys, mode, share)
    np.testing.assert_allclose(world_now(), matrices(between)[0], atol=2e-5)
    obj.location = np.add(obj.location, (0.4, -0.3, 0.2))
    bpy.context.view_layer.update()
    seen = world_now()
    breakdown(obj, 0.3, kind)
    ends = Poses.from_matrices(np.concatenate((seen[None], matrices(between))))
    factor = -0.3 if kind == "PUSH" else 0.3
    expected = interpolate((0.0, 1.0), ends, np.array([factor]), mode, extrapolate=True)
    np.testing.assert_allclose(world_now(), matrices(expected)[0], atol=3e-5 * max(1.0, np.abs(seen).max()))


@pytest.mark.parametrize("frame", [-3, 1, 40, 55])
def test_what_cannot_be_keyed_is_refused_and_the_others_are_keyed(live_file, frame):
    early, good, bad, idle = (new_object(name) for name in ("Early", "Good", "Bad", "Idle"))
    for obj, frames in ((early, FRAMES), (good, np.add(FRAMES, frame - 17.0)), (bad, np.add(FRAMES, frame - 17.0))):
        key(obj, frames)
        set_mode(obj, "dq_sclerp")
    curves_of(bad)["location", 1].modifiers.new("ENVELOPE")
    bpy.context.scene.frame_set(frame)
    before = snapshot(early)
    with pytest.raises(Refused, match=f"^Early needs a key before and a key after frame {frame}:"):
        breakdown(early)
    refused: list[Refused] = []
    breakdown([good, bad, idle, early], 0.5, refused=refused)
    assert frame in key_frames(good).tolist()
    assert frame not in key_frames(bad).tolist()
    assert sorted(str(item)[:4] for item in refused) == ["Bad:", "Earl", "Idle"]
    assert snapshot(early) == before


@pytest.mark.parametrize("mode", ["motor_spline", "pga_lerp"])
def test_a_breakdown_leaves_the_path_and_changes_when_the_body_is_there(live_file, mode):
    obj = new_object(rotation_mode="QUATERNION")
    key(obj, seed=5, interpolation="LINEAR")
    set_mode(obj, mode)
    times = np.linspace(BEFORE, AFTER, 2001)
    path = matrices(interpolate(FRAMES, key_poses(obj), times, mode))
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
