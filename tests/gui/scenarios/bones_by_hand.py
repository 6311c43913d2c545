"""Two bones in Pose Mode, by hand: pies, keys, Auto Key between keys, undo.

Where the bones are seen is held against `tests.animation.oracle`, which is given their channels as those of an object.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from tests.animation.keyed import curves_of
from tests.animation.oracle import expected_bases
from tests.gui import places
from tests.gui.driver import Hand, Steps

FRAMES = (1, 20, 40)
WHOLE = range(1, 46, 2)
SCREW, STRAIGHT, SMOOTH = "dq_sclerp", "lerp_slerp", "motor_spline"

ALIKE = 2e-5
"""What poses may differ by that are the same, in metres and in parts of a rotation matrix."""

APART = 0.1
"""How far, in metres, the screw is at least from Blender's own way half-way between keys."""


def rig() -> bpy.types.Object:
    """The rig, asked for anew each time: undo replaces it."""
    return bpy.data.objects["Rig"]


def hand_bone() -> bpy.types.PoseBone:
    return rig().pose.bones["Hand"]


def make_the_rig() -> None:
    """An arm and a hand that stands off it, each moved and turned from key to key."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    obj = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    arm, hand = (obj.data.edit_bones.new(name) for name in ("Arm", "Hand"))
    arm.head, arm.tail = (0, 0, 0), (0, 0.2, 1.5)
    hand.head, hand.tail, hand.parent = (0, 0.3, 1.7), (0.4, 0.3, 2.6), arm
    bpy.ops.object.mode_set(mode="OBJECT")
    for number, bone in enumerate(obj.pose.bones):
        for frame, x, angle in zip(FRAMES, (-1, 0, 1), (0, 1.6, 3.0), strict=True):
            bone.location = (x, 0.3 * number * x, 0.4 * abs(x))
            turn = angle * (0.5 + number) / 1.5
            bone.rotation_quaternion = (math.cos(turn / 2), 0.6 * math.sin(turn / 2), 0, 0.8 * math.sin(turn / 2))
            bone.keyframe_insert("location", frame=frame)
            bone.keyframe_insert("rotation_quaternion", frame=frame)
    bpy.context.scene.frame_set(10)


def shown(name: str = "Hand", frames=WHOLE) -> np.ndarray:
    """How a bone is seen on these frames, in the space of its channels. The scene returns to its frame."""
    scene, result = bpy.context.scene, []
    before = scene.frame_current
    for frame in frames:
        scene.frame_set(frame)
        result.append(now(name))
    scene.frame_set(before)
    return np.array(result)


def now(name: str = "Hand") -> np.ndarray:
    """The same as it is on the screen."""
    bone = rig().evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones[name]
    above = {}
    if bone.parent is not None:
        above = {"parent_matrix": bone.parent.matrix, "parent_matrix_local": bone.parent.bone.matrix_local}
    return np.array(bone.bone.convert_local_to_pose(bone.matrix, bone.bone.matrix_local, **above, invert=True))


def in_world(name: str = "Hand") -> np.ndarray:
    evaluated = rig().evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array(evaluated.matrix_world @ evaluated.pose.bones[name].matrix)


@contextmanager
def as_object(name: str) -> Iterator[bpy.types.Object]:
    """An object with the channels of a bone, for the oracle."""
    prefix, twin = f'pose.bones["{name}"].', bpy.data.objects.new("Twin", None)
    twin.rotation_mode, data = "QUATERNION", twin.animation_data_create()
    data.action = bpy.data.actions.new("Twin")
    data.action_slot = data.action.slots.new("OBJECT", "Twin")
    strip = data.action.layers.new("Layer").strips.new(type="KEYFRAME")
    channelbag = strip.channelbag(data.action_slot, ensure=True)
    try:
        for (path, index), fcurve in curves_of(rig()).items():
            if path.startswith(prefix) and "constraints" not in path:
                copy = channelbag.fcurves.new(path.removeprefix(prefix), index=index)
                copy.extrapolation = fcurve.extrapolation
                copy.keyframe_points.add(len(fcurve.keyframe_points))
                for key, own in zip(copy.keyframe_points, fcurve.keyframe_points, strict=True):
                    key.co, key.interpolation = own.co, own.interpolation
                    key.handle_left_type, key.handle_right_type = own.handle_left_type, own.handle_right_type
                    key.handle_left, key.handle_right = own.handle_left, own.handle_right
        twin.rigid_motion.mode = rig().pose.bones[name].rigid_motion.mode
        yield twin
    finally:
        action = data.action
        bpy.data.objects.remove(twin)
        bpy.data.actions.remove(action)


def key_frames(name: str = "Hand") -> list[float]:
    fcurve = curves_of(rig())[f'pose.bones["{name}"].location', 0]
    return [key.co.x for key in fcurve.keyframe_points]


def assert_as_keyed(*frames: float, name: str = "Hand") -> None:
    """A bone has keys on these frames, and is seen where its modes have it between them."""
    assert key_frames(name) == list(frames), key_frames(name)
    with as_object(name) as twin:
        expected = expected_bases(twin, WHOLE)
    np.testing.assert_allclose(shown(name), expected, atol=ALIKE)


def pose_the_rig(hand: Hand) -> Steps[bpy.types.Area]:
    """The rig in the Animation workspace, in Pose Mode with all bones selected, by hand; and the viewport."""
    yield from hand.open_animation_workspace()
    view = hand.area("VIEW_3D")
    view.spaces.active.region_3d.view_distance, view.spaces.active.region_3d.view_location = 5, (0, 0, 1.2)
    make_the_rig()
    bpy.ops.ed.undo_push(message="Rig")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("TAB", ctrl=True)
    assert bpy.context.mode == "POSE", bpy.context.mode
    yield from hand.press("A")
    return view


def scenario(hand: Hand) -> Steps[None]:
    """An animator has an arm and a hand move by screws, and works on."""
    view = yield from pose_the_rig(hand)
    sheet = hand.area("DOPESHEET_EDITOR")
    yield from chosen(hand, view)
    yield from key_by_key(hand, view, sheet)
    yield from posed(hand, view)


def chosen(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """The screw for all bones from the pie; undone and redone."""
    native = shown()
    yield from hand.pie("T", "E", alt=True, picture="pie")
    for name in ("Arm", "Hand"):
        assert rig().pose.bones[name].rigid_motion.mode == SCREW
        assert_as_keyed(*FRAMES, name=name)
    assert np.abs(shown() - native)[:, :3, 3].max() > APART, "the screw is not Blender's own way"
    bpy.context.scene.rigid_motion_overlay.show_paths = True
    yield from hand.picture("screw")
    yield from hand.press("Z", ctrl=True)
    np.testing.assert_allclose(shown(), native, atol=ALIKE)
    yield from hand.press("Z", ctrl=True, shift=True)
    assert_as_keyed(*FRAMES)


def key_by_key(hand: Hand, view: bpy.types.Area, sheet: bpy.types.Area) -> Steps[None]:
    """The keys of one frame get another mode in the Dope Sheet, and are moved; undone."""
    yield from hand.click(places.key(sheet, 20))
    yield from hand.hover(places.centre(places.region(sheet)))
    yield from hand.pie("T", "NW", alt=True, picture="pie-of-keys")
    for name in ("Arm", "Hand"):
        modes = curves_of(rig())[f'pose.bones["{name}"].rigid_motion.mode', 0]
        assert [key.co.x for key in modes.keyframe_points] == [1, 20, 40], [key.co.x for key in modes.keyframe_points]
        assert_as_keyed(*FRAMES, name=name)
    yield from hand.picture("mixed")
    before = shown()
    yield from hand.click(places.key(sheet, 20))
    yield from hand.press("G")
    yield from hand.glide(places.key(sheet, 28))
    yield from hand.click()
    for name in ("Arm", "Hand"):
        assert_as_keyed(1, 28, 40, name=name)
    yield from hand.picture("key-moved")
    for _ in range(2):
        yield from hand.press("Z", ctrl=True)
    if key_frames() != list(FRAMES):
        yield from hand.press("Z", ctrl=True)
    np.testing.assert_allclose(shown(), before, atol=ALIKE)
    assert_as_keyed(*FRAMES)


def posed(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """G and R with Auto Key on a frame between keys: what is under the cursor is what is keyed. Undone."""
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = True
    before = shown()
    yield from only_the_hand(hand, view)
    bpy.context.scene.frame_set(10)
    yield
    stood = in_world()
    for key in ("G", "X"):
        yield from hand.press(key)
    yield from hand.type("0.5")
    yield from hand.press("RET")
    yield from hand.wait_until(lambda: 10.0 in key_frames(), "the grabbed hand is keyed")
    stood[0, 3] += 0.5
    np.testing.assert_allclose(in_world(), stood, atol=ALIKE)
    assert_as_keyed(1, 10, 20, 40)
    np.testing.assert_allclose(in_world(), stood, atol=ALIKE)
    yield from hand.picture("grabbed")

    bpy.context.scene.frame_set(30)
    yield
    stood = in_world()
    for key in ("R", "Z"):
        yield from hand.press(key)
    yield from hand.type("30")
    yield from hand.press("RET")
    yield from hand.wait_until(lambda: 30.0 in key_frames(), "the turned hand is keyed")
    turn, cos, sin = np.eye(3), math.cos(math.radians(30)), math.sin(math.radians(30))
    turn[:2, :2] = (cos, -sin), (sin, cos)
    stood[:3, :3] = turn @ stood[:3, :3]
    np.testing.assert_allclose(in_world(), stood, atol=ALIKE)
    assert_as_keyed(1, 10, 20, 30, 40)
    np.testing.assert_allclose(in_world(), stood, atol=ALIKE)
    yield from hand.picture("turned")
    for _ in range(8):
        yield from hand.press("Z", ctrl=True)
        if key_frames() == list(FRAMES):
            break
    assert_as_keyed(*FRAMES)
    np.testing.assert_allclose(shown(), before, atol=ALIKE)
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = False


def only_the_hand(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Click on the hand on the screen."""
    bone = in_world()
    middle = bone[:3, 3] + 0.5 * rig().data.bones["Hand"].length * bone[:3, 1]
    yield from hand.click(places.point(view, middle))
    yield from hand.wait_until(
        lambda: [bone.name for bone in bpy.context.selected_pose_bones] == ["Hand"], "the hand alone is selected"
    )
