"""Live in-betweens: what the evaluated scene shows on every frame, whatever was edited, in every kind of object."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation import key_frames, read_poses, set_mode
from rigid_motion.motion import KEYFRAME_MODES, Poses, interpolate
from rigid_motion.motion.eulers import ORDERS
from rigid_motion.motion.quaternions import angle_between
from tests.animation.bones.rigs import in_turn

FRAMES = np.arange(1.0, 42.0)
KEYS = np.array((1.0, 11.0, 21.0, 31.0, 41.0))
EASED = ("SINE", "QUAD", "CUBIC", "QUART", "QUINT", "EXPO", "CIRC", "BACK", "BOUNCE")


@pytest.fixture
def scene(empty_file):
    """An empty file with the extension's data switched on."""
    animation.register()
    yield empty_file.scene
    animation.unregister()


def keyed(
    name: str = "Tool", rotation_mode: str = "QUATERNION", interpolation: str = "LINEAR", data=None, seed: int = 3
):
    """An object with five random keys of location and rotation."""
    obj = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(obj)
    obj.rotation_mode = rotation_mode
    rotation = "rotation_quaternion" if rotation_mode == "QUATERNION" else "rotation_euler"
    random = np.random.default_rng(seed)
    for frame in KEYS:
        obj.location = random.normal(size=3)
        values = random.normal(size=len(getattr(obj, rotation)))
        # Angles stay within half a turn of one another.
        setattr(obj, rotation, values if rotation_mode == "QUATERNION" else 1.5 * np.tanh(values))
        obj.keyframe_insert("location", frame=frame)
        obj.keyframe_insert(rotation, frame=frame)
    for fcurve in curves(obj):
        for key in fcurve.keyframe_points:
            key.interpolation = interpolation
        fcurve.update()
    return obj


def curves(obj):
    """The F-curves that the animator has."""
    return [fcurve for fcurve in animation.channelbag_of(obj).fcurves if fcurve.keyframe_points]


def keys_of(obj):
    """All there is to the animator's keys."""
    return {
        (fcurve.data_path, fcurve.array_index): [
            (*key.co, *key.handle_left, *key.handle_right, key.interpolation, key.easing, key.type)
            for key in fcurve.keyframe_points
        ]
        for fcurve in curves(obj)
        if "rigid_motion" not in fcurve.data_path
    }


def assert_same(read: Poses, expected: Poses) -> None:
    assert np.abs(read.positions - expected.positions).max() < 1e-5
    assert angle_between(read.quaternions, expected.quaternions).max() < 1e-5


@pytest.mark.parametrize(("mode", "rotation_mode"), in_turn(KEYFRAME_MODES, ["QUATERNION", *ORDERS]))
def test_every_mode_and_rotation_order_arrives_on_every_frame(scene, mode, rotation_mode):
    obj = keyed(rotation_mode=rotation_mode)
    poses, keys = read_poses(obj, KEYS), keys_of(obj)
    set_mode(obj, mode)
    assert_same(read_poses(obj, FRAMES), interpolate(KEYS, poses, FRAMES, mode))
    assert keys_of(obj) == keys


@pytest.mark.parametrize(("interpolation", "easing"), in_turn(EASED, ["EASE_IN", "EASE_OUT", "EASE_IN_OUT"]))
def test_timing_follows_the_easing_of_the_keys(scene, interpolation, easing):
    obj = keyed(interpolation=interpolation)
    for fcurve in curves(obj):
        for key in fcurve.keyframe_points:
            key.easing = easing
    poses = read_poses(obj, KEYS)
    set_mode(obj, "dq_sclerp")
    assert_same(read_poses(obj, FRAMES), eased(obj, poses, interpolation, easing))


@pytest.mark.parametrize("interpolation", ["ELASTIC", "BEZIER", "CONSTANT"])
def test_timing_follows_elastic_and_flat_handles_and_holds(scene, interpolation):
    obj = keyed(interpolation=interpolation)
    for fcurve in curves(obj):
        for key in fcurve.keyframe_points:
            key.handle_left_type = key.handle_right_type = "FREE"
            key.handle_left, key.handle_right = (key.co.x - 3, key.co.y), (key.co.x + 3, key.co.y)
    poses = read_poses(obj, KEYS)
    set_mode(obj, "dq_sclerp")
    assert_same(read_poses(obj, FRAMES), eased(obj, poses, interpolation, "AUTO"))


def eased(obj, poses: Poses, interpolation: str, easing: str) -> Poses:
    """Each segment run through as an F-curve from 0 to 1 is, with Blender's own evaluation of it."""
    channelbag = animation.channelbag_of(obj)
    positions, quaternions = [], []
    for frame in FRAMES:
        first = min(int((frame - 1) // 10), 3)
        probe = channelbag.fcurves.new("probe")
        for place, value in ((KEYS[first], 0.0), (KEYS[first + 1], 1.0)):
            key = probe.keyframe_points.insert(place, value)
            key.interpolation, key.easing = interpolation, easing
            key.handle_left_type = key.handle_right_type = "FREE"
            key.handle_left, key.handle_right = (place - 3, value), (place + 3, value)
        share = probe.evaluate(frame)
        channelbag.fcurves.remove(probe)
        between = interpolate([0.0, 1.0], poses[[first, first + 1]], [share], "dq_sclerp", extrapolate=True)
        positions.append(between.positions[0])
        quaternions.append(between.quaternions[0])
    return Poses(positions, quaternions)


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
def test_what_a_smooth_mode_hangs_together_with_is_baked_as_a_whole(scene, modes, options, baked):
    obj = keyed()
    for frame, mode in modes.items():
        set_mode(obj, mode, [one for one in key_frames(obj) if one >= frame])
    before = read_poses(obj, FRAMES)
    assert animation.bake(obj, **options) == baked
    assert_same(read_poses(obj, FRAMES), before)
