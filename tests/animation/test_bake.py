"""Baked poses, read back from the evaluated scene, are the poses that were baked."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, bake_poses, read_poses, set_mode
from rigid_motion.motion import Poses, interpolate
from rigid_motion.motion.eulers import ORDERS
from rigid_motion.motion.quaternions import angle_between
from tests.animation.keyed import curves_of
from tests.animation.oracle import assert_shown, expected_worlds, shown_worlds
from tests.animation.scenes import FRAMES, key, new_object


@pytest.fixture
def empty(empty_file) -> bpy.types.Object:
    """An empty in quaternion mode, in the scene."""
    return new_object("Tool")


def motion(count: int = 60, scaled: bool = False, step: float = 1.0) -> tuple[np.ndarray, Poses]:
    """Frames and wild poses: half of the keys have the other sign."""
    random = np.random.default_rng(11)
    keys = Poses(
        random.normal(size=(8, 3)),
        random.normal(size=(8, 4)),
        np.exp(random.normal(size=8)) if scaled else None,
    )
    frames = 1.0 + step * np.arange(count)
    poses = interpolate(np.linspace(frames[0], frames[-1], 8), keys, frames, "dq_sclerp")
    poses.quaternions[::2] *= -1.0
    return frames, poses


def assert_read_back(obj: bpy.types.Object, frames: np.ndarray, poses: Poses) -> None:
    read = read_poses(obj, frames)
    assert np.abs(read.positions - poses.positions).max() < 1e-5
    assert angle_between(read.quaternions, poses.quaternions).max() < 1e-5 * np.pi
    if poses.scales is not None:
        assert np.abs(read.scales / poses.scales - 1.0).max() < 1e-5


def test_a_shared_action_keeps_what_others_have_in_it(empty):
    frames, poses = motion()
    bake_poses(empty, frames, poses)
    other = new_object("Other")
    data = other.animation_data_create()
    data.action = empty.animation_data.action
    data.action_slot = data.action.slots.new("OBJECT", "Other")
    still = Poses(poses.positions * 0.0, poses.quaternions)
    bake_poses(other, frames, still)
    assert_read_back(empty, frames, poses)
    assert_read_back(other, frames, still)


def test_an_object_that_turns_by_axis_and_angle_is_refused_untouched(empty):
    empty.rotation_mode = "AXIS_ANGLE"
    with pytest.raises(ValueError, match="Tool turns by axis and angle"):
        bake_poses(empty, *motion())
    assert empty.animation_data is None


@pytest.mark.parametrize("order", ORDERS)
def test_a_part_is_baked_where_its_angles_are_not_all_keyed_outside_of_it(live_file, order):
    for seed in range(10):
        obj = key(new_object(f"Tool {seed}", order), seed=seed)
        for frame, index in ((-5.0, 1), (50.0, 2)):
            curves_of(obj)["rotation_euler", index].keyframe_points.insert(frame, 3.0)
        set_mode(obj, "dq_sclerp")
        frames = np.arange(FRAMES[0], FRAMES[-1] + 1.0)
        assert_shown([obj], frames)
        expected = expected_worlds(obj, frames)
        assert bake(obj, first=frames[0], last=frames[-1]) == (frames[0], frames[-1])
        assert np.abs(shown_worlds([obj], frames)[0] - expected).max() < 1e-5 * np.abs(expected).max()


def test_delta_scales_that_cancel_out_leave_the_scale_to_blender(live_file):
    obj = key(new_object(), scale="even")
    obj.delta_scale = (2.0, -1.0, -1.0)
    set_mode(obj, "dq_sclerp")
    frames = np.arange(FRAMES[0], FRAMES[-1] + 1.0)
    places = shown_worlds([obj], frames)[0][..., 3]
    bake(obj)
    np.testing.assert_allclose(shown_worlds([obj], frames)[0][..., 3], places, rtol=0, atol=1e-5 * np.abs(places).max())
    for index in range(3):
        points = curves_of(obj)["scale", index].keyframe_points
        assert np.isfinite([point.co.y for point in points]).all()


@pytest.mark.parametrize(
    ("modes", "options", "baked"),
    [
        ({1: "motor_spline"}, {"last": 12}, (1.0, 41.0)),
        ({1: "motor_spline"}, {"first": 30}, (1.0, 41.0)),
        ({1: "motor_spline", 31: "dq_sclerp"}, {"last": 12}, (1.0, 31.0)),
        ({1: "dq_sclerp", 11: "motor_spline"}, {"last": 5}, (1.0, 41.0)),
        ({1: "dq_sclerp", 11: "pga_lerp", 31: "motor_spline"}, {"last": 5}, (1.0, 11.0)),
    ],
    ids=str,
)
def test_what_a_smooth_mode_hangs_together_with_is_baked_as_a_whole(live_file, modes, options, baked):
    frames = np.arange(1.0, 42.0)
    obj = key(new_object(), frames[::10], interpolation="LINEAR")
    for frame, mode in modes.items():
        set_mode(obj, mode, [one for one in frames[::10] if one >= frame])
    before = read_poses(obj, frames)
    assert bake(obj, **options) == baked
    assert_read_back(obj, frames, before)
