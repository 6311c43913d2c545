"""Live in-betweens: what the evaluated scene shows on every frame, whatever was edited, in every kind of object."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation import MODE_IDS, Refused, key_frames, modes_of, problem_of, read_poses, set_mode
from rigid_motion.motion import KEYFRAME_MODES, Poses, interpolate
from rigid_motion.motion.eulers import ORDERS
from rigid_motion.motion.quaternions import angle_between, multiply, rotate

FRAMES = np.arange(1.0, 42.0)
KEYS = np.array((1.0, 11.0, 21.0, 31.0, 41.0))


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


def assert_same(read: Poses, wanted: Poses) -> None:
    assert np.abs(read.positions - wanted.positions).max() < 1e-5
    assert angle_between(read.quaternions, wanted.quaternions).max() < 1e-5


def assert_fresh(obj, mode: str, frames: np.ndarray = FRAMES) -> None:
    """The object moves as `interpolate` says, between the poses it has at its keys (which have LINEAR timing)."""
    at = key_frames(obj)
    assert_same(read_poses(obj, frames), interpolate(at, read_poses(obj, at), frames, mode))


@pytest.mark.parametrize("mode", KEYFRAME_MODES)
@pytest.mark.parametrize("rotation_mode", ["QUATERNION", *ORDERS])
def test_every_mode_and_rotation_order_arrives_on_every_frame(scene, mode, rotation_mode):
    obj = keyed(rotation_mode=rotation_mode)
    poses, keys = read_poses(obj, KEYS), keys_of(obj)
    set_mode(obj, mode)
    assert_same(read_poses(obj, FRAMES), interpolate(KEYS, poses, FRAMES, mode))
    assert keys_of(obj) == keys


def test_a_parent_carries_the_motion_along(scene):
    obj, parent = keyed(), bpy.data.objects.new("Arm", None)
    local = interpolate(KEYS, read_poses(obj, KEYS), FRAMES, "dq_sclerp")
    bpy.context.collection.objects.link(parent)
    parent.rotation_mode, parent.location, parent.rotation_quaternion = "QUATERNION", (1, 2, 3), (0.5, 0.5, 0.5, 0.5)
    obj.parent = parent
    set_mode(obj, "dq_sclerp")
    turn = np.broadcast_to((0.5, 0.5, 0.5, 0.5), local.quaternions.shape)
    wanted = Poses(np.array((1, 2, 3)) + rotate(turn, local.positions), multiply(turn, local.quaternions))
    assert_same(read_poses(obj, FRAMES), wanted)


@pytest.mark.parametrize("rotation_mode", ["QUATERNION", "XYZ", "ZXY"])
def test_own_delta_transforms_are_kept_and_given_back(scene, rotation_mode):
    obj = keyed(rotation_mode=rotation_mode)
    obj.delta_location = (0.5, -1.0, 2.0)
    obj.delta_rotation_quaternion = (0.5, 0.5, 0.5, 0.5)
    obj.delta_rotation_euler = (0.4, 0.5, -0.6)
    before = read_poses(obj, FRAMES)
    set_mode(obj, "dq_sclerp")
    assert_fresh(obj, "dq_sclerp")
    assert_same(read_poses(obj, KEYS), before[(KEYS - 1).astype(int)])
    set_mode(obj, "BLENDER")
    assert_same(read_poses(obj, FRAMES), before)
    assert tuple(obj.delta_location) == (0.5, -1.0, 2.0)
    assert not [fcurve for fcurve in animation.channelbag_of(obj).fcurves if fcurve.data_path.startswith("delta")]


def edited(obj) -> dict:
    fcurve = curves(obj)[0]
    key = fcurve.keyframe_points[2]

    def moved():
        for curve in curves(obj):
            if "rigid_motion" not in curve.data_path:
                curve.keyframe_points[2].co_ui.x = 25.0
                curve.update()

    def deleted():
        for curve in curves(obj):
            curve.keyframe_points.remove(curve.keyframe_points[2])

    return {
        "a value": lambda: setattr(key.co_ui, "y", 3.0),
        "a move": moved,
        "a deletion": deleted,
        "an insertion elsewhere": lambda: [curve.keyframe_points.insert(26.0, 0.3) for curve in curves(obj)],
        "another rotation mode": lambda: setattr(obj, "rotation_mode", "XYZ"),
    }


@pytest.mark.parametrize("edit", ["a value", "a move", "a deletion", "an insertion elsewhere", "another rotation mode"])
@pytest.mark.parametrize("then", ["update", "frame"])
def test_an_edit_shows_at_once(scene, edit, then):
    obj = keyed()
    set_mode(obj, "dq_sclerp")
    scene.frame_set(7)
    bpy.context.view_layer.update()
    edited(obj)[edit]()
    if then == "update":
        bpy.context.view_layer.update()
    else:
        scene.frame_set(8)
    assert_fresh(obj, "dq_sclerp")


@pytest.mark.parametrize("rotation_mode", ["QUATERNION", "YXZ"])
def test_a_key_inserted_in_between_keeps_the_pose_on_the_screen(scene, rotation_mode):
    obj = keyed(rotation_mode=rotation_mode, interpolation="BEZIER")
    set_mode(obj, "dq_sclerp")
    scene.frame_set(15)
    shown = read_poses(obj, np.array((15.0,)))
    obj.keyframe_insert("location")
    bpy.context.view_layer.update()
    assert 15.0 in key_frames(obj)
    assert_same(read_poses(obj, np.array((15.0,))), shown)
    assert np.abs(obj.delta_location).max() == 0.0


def test_a_key_of_a_pose_made_by_hand_keeps_what_was_on_the_screen(scene):
    obj = keyed()
    set_mode(obj, "dq_sclerp")
    scene.frame_set(15)
    obj.location.x += 1.0
    bpy.context.view_layer.update()
    shown = obj.matrix_world.copy()
    obj.keyframe_insert("location")
    obj.keyframe_insert("rotation_quaternion")
    bpy.context.view_layer.update()
    scene.frame_set(16)
    scene.frame_set(15)
    assert np.abs(np.array(obj.matrix_world) - np.array(shown)).max() < 1e-5


def test_a_key_that_is_given_a_value_has_that_value(scene):
    obj = keyed()
    set_mode(obj, "dq_sclerp")
    scene.frame_set(15)
    for index, fcurve in enumerate(curves(obj)):
        fcurve.keyframe_points.insert(15.0, 0.25 * index + 0.1)
    bpy.context.view_layer.update()
    values = [fcurve.evaluate(15.0) for fcurve in curves(obj)]
    assert np.allclose(values, 0.25 * np.arange(len(values)) + 0.1)


def test_a_key_of_the_mode_channel_decides_its_segment(scene):
    obj = keyed()
    poses = read_poses(obj, KEYS)
    set_mode(obj, "lerp_slerp")
    set_mode(obj, "dq_sclerp", [11.0])
    assert modes_of(obj, KEYS) == ["lerp_slerp", "dq_sclerp", "lerp_slerp", "lerp_slerp", "lerp_slerp"]
    read = read_poses(obj, FRAMES)
    assert_same(read[10:21], interpolate(KEYS, poses, FRAMES[10:21], "dq_sclerp"))
    assert_same(read[20:], interpolate(KEYS, poses, FRAMES[20:], "lerp_slerp"))
    assert_same(read[:11], interpolate(KEYS, poses, FRAMES[:11], "lerp_slerp"))


def test_setting_a_mode_on_keys_merges_with_what_stands(scene):
    obj = keyed()
    set_mode(obj, "dq_sclerp", [11.0, 21.0])
    set_mode(obj, "pga_lerp", [21.0])
    assert modes_of(obj, KEYS) == ["BLENDER", "dq_sclerp", "pga_lerp", "BLENDER", "BLENDER"]


@pytest.mark.parametrize("interpolation", ["SINE", "QUAD", "CUBIC", "QUART", "QUINT", "EXPO", "CIRC", "BACK", "BOUNCE"])
@pytest.mark.parametrize("easing", ["EASE_IN", "EASE_OUT", "EASE_IN_OUT"])
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


def test_uniform_scale_follows_the_mode_and_other_scale_stays_blenders(scene):
    for factors, uniform in (((1, 1, 1), True), ((1, 2, 1), False)):
        obj = keyed()
        for frame, size in zip(KEYS, (1.0, 2.0, 0.5, 1.5, 1.0), strict=True):
            obj.scale = np.array(factors) * size
            obj.keyframe_insert("scale", frame=frame)
        for fcurve in curves(obj):
            for key in fcurve.keyframe_points:
                key.interpolation = "LINEAR"
        at_keys = read_poses(obj, KEYS)
        native = read_poses(obj, FRAMES).scales
        set_mode(obj, "cga_slerp")
        if uniform:
            wanted = interpolate(KEYS, at_keys, FRAMES, "cga_slerp")
            assert_same(read_poses(obj, FRAMES), wanted)
            assert np.abs(read_poses(obj, FRAMES).scales - wanted.scales).max() < 1e-5
        else:
            assert np.abs(read_poses(obj, FRAMES).scales - native).max() < 1e-6


@pytest.mark.parametrize("options", [{}, {"step": 0.25}, {"step": 7.0}, {"first": 13, "last": 20}], ids=str)
@pytest.mark.parametrize("rotation_mode", ["QUATERNION", "XZY"])
def test_baking_keeps_the_motion_and_un_baking_gives_back_what_was_there(scene, options, rotation_mode):
    obj = keyed(rotation_mode=rotation_mode, interpolation="BEZIER")
    set_mode(obj, "dq_sclerp")
    before, keys, action = read_poses(obj, FRAMES), keys_of(obj), obj.animation_data.action
    animation.bake(obj, **options)
    assert animation.is_baked(obj)
    assert obj.animation_data.action != action
    types = {key.type for fcurve in curves(obj) if fcurve.data_path == "location" for key in fcurve.keyframe_points}
    assert types == {"KEYFRAME", "GENERATED"}
    if options.get("step", 1.0) <= 1.0:
        assert_same(read_poses(obj, FRAMES), before)
    animation.unbake(obj)
    assert obj.animation_data.action == action
    assert keys_of(obj) == keys
    assert_same(read_poses(obj, FRAMES), before)
    assert list(bpy.data.actions) == [action]


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


def test_there_is_nothing_to_bake_without_a_mode(scene):
    with pytest.raises(Refused, match="Tool has no rigid in-betweens"):
        animation.bake(keyed())


def test_undo_and_redo_bring_back_what_was_to_be_seen(scene):
    obj = keyed()
    bpy.ops.ed.undo_push(message="keys")
    set_mode(obj, "dq_sclerp")
    bpy.ops.ed.undo_push(message="mode")
    before = read_poses(obj, FRAMES)
    curves(obj)[0].keyframe_points[2].co_ui.y += 2.0
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="edit")
    after = read_poses(obj, FRAMES)
    bpy.ops.ed.undo()
    assert_same(read_poses(bpy.data.objects["Tool"], FRAMES), before)
    bpy.ops.ed.redo()
    assert_same(read_poses(bpy.data.objects["Tool"], FRAMES), after)


def test_a_saved_file_comes_back_filled_in(scene, tmp_path):
    obj = keyed()
    set_mode(obj, "dq_sclerp")
    before = read_poses(obj, FRAMES)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    obj = bpy.data.objects["Tool"]
    assert_same(read_poses(obj, FRAMES), before)
    assert MODE_IDS.index(obj.rigid_motion.mode) > 0
    assert animation.refresh() == 0


def test_numbers_that_are_none_leave_blenders_own_motion(scene):
    obj, other = keyed("Broken"), keyed("Whole", seed=5)
    set_mode(other, "dq_sclerp")
    curves(obj)[1].keyframe_points[2].co.y = float("nan")
    obj.rigid_motion.mode = "dq_sclerp"
    assert problem_of(obj) == "Broken: key 3 of Location Y is not a finite number: delete it (Dope Sheet, X)"
    assert_fresh(other, "dq_sclerp")
