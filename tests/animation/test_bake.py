"""Baked poses, read back from the evaluated scene, are the poses that were baked."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, bake_poses, read_poses, set_mode, unbake
from rigid_motion.motion import Poses, interpolate
from rigid_motion.motion.quaternions import angle_between
from tests.animation.keyed import curves_of, rotation_path, snapshot
from tests.animation.oracle import shown_worlds
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


@pytest.mark.parametrize("order", ["QUATERNION", "AXIS_ANGLE", "XZY"])
def test_poses_are_shown_however_an_object_turns_and_between_frames_it_goes_no_other_way(empty, order):
    empty.rotation_mode = order
    frames, poses = motion(200)
    bake_poses(empty, frames, poses)
    assert_read_back(empty, frames, poses)
    steps = angle_between(poses.quaternions[1:], poses.quaternions[:-1])
    between = read_poses(empty, frames[:-1] + 0.5).quaternions
    assert np.all(angle_between(between, poses.quaternions[:-1]) < steps + 1e-3)


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


def give_cycles(obj: bpy.types.Object, mode: str) -> None:
    for (path, _), fcurve in curves_of(obj).items():
        keys = fcurve.keyframe_points
        if mode == "REPEAT_OFFSET" and path != "location":
            keys[-1].co_ui.y = keys[0].co.y
        cycles = fcurve.modifiers.new("CYCLES")
        cycles.mode_before = cycles.mode_after = mode


def give_to_location(obj: bpy.types.Object, kind: str, **settings: float) -> None:
    for index in range(3):
        modifier = curves_of(obj)["location", index].modifiers.new(kind)
        for name, value in settings.items():
            setattr(modifier, name, value)


BESIDE_KEYS = {
    "nothing": lambda obj: None,
    "noise": lambda obj: give_to_location(obj, "NOISE", scale=3.0),
    "holds": lambda obj: give_to_location(obj, "STEPPED", frame_step=4.0, frame_offset=2.0),
    "cycles": lambda obj: give_cycles(obj, "REPEAT"),
    "cycles that go on": lambda obj: give_cycles(obj, "REPEAT_OFFSET"),
    "mirrored cycles": lambda obj: give_cycles(obj, "MIRROR"),
    "cycles with limits": lambda obj: (give_cycles(obj, "REPEAT"), give_to_location(obj, "LIMITS", use_max_x=True)),
    "a slope": lambda obj: [setattr(fcurve, "extrapolation", "LINEAR") for fcurve in curves_of(obj).values()],
    "an angle on another frame": lambda obj: curves_of(obj)[rotation_path(obj), 1].keyframe_points.insert(50.0, 3.0),
    "location on other frames": lambda obj: [
        curves_of(obj)["location", index].keyframe_points.insert(17.0, 2.0) for index in range(3)
    ],
}


@pytest.mark.parametrize("order", ["QUATERNION", "XYZ", "AXIS_ANGLE"])
@pytest.mark.parametrize("beside", BESIDE_KEYS)
def test_baked_keys_are_shown_as_before_whatever_there_is_beside_keys(live_file, beside, order):
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 0, 70
    obj = key(new_object(rotation_mode=order), seed=len(beside), scale="even")
    BESIDE_KEYS[beside](obj)
    set_mode(obj, "pga_slerp", FRAMES[:2])
    set_mode(obj, "dq_sclerp", FRAMES[2:3])
    frames = np.arange(0.0, 71.0)
    if beside == "noise":  # Outside of the keys it goes on.
        frames = np.arange(FRAMES[0], FRAMES[-1] + 1.0)
    (before,), keys = shown_worlds([obj], frames), snapshot(obj)
    bake(obj)
    bpy.context.view_layer.update()
    assert np.abs(shown_worlds([obj], frames)[0] - before).max() < 2e-5 * np.abs(before).max()
    unbake(obj)
    assert snapshot(obj) == keys
    assert len(bpy.data.actions) == 1
