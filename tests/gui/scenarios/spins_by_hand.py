"""A wheel with a spoke that turns three times: by Euler keys at every half turn, and by Turns set in the panel."""

from __future__ import annotations

import math

import bmesh
import bpy
import numpy as np
from mathutils import Matrix

from tests.animation.oracle import assert_shown, shown_worlds
from tests.gui import places
from tests.gui.driver import Hand, Steps

FRAMES = (1, 13, 25, 37, 49, 61, 73)
EACH = range(1, 74)


def wheel(name: str) -> bpy.types.Object:
    """An object, asked for anew each time: undo replaces it."""
    return bpy.data.objects[name]


def make_wheel(name: str, rotation_mode: str, y: float) -> None:
    """A tyre that stands on the ground, with one spoke to tell its turns by."""
    shape = bmesh.new()
    lying = Matrix.Rotation(math.pi / 2, 4, "X")
    bmesh.ops.create_cone(shape, cap_ends=False, segments=48, radius1=0.8, radius2=0.8, depth=0.3, matrix=lying)
    spoke = Matrix.Translation((0.0, 0.0, 0.4)) @ Matrix.Diagonal((0.14, 0.2, 0.8, 1.0))
    bmesh.ops.create_cube(shape, size=1.0, matrix=spoke)
    mesh = bpy.data.meshes.new(name)
    shape.to_mesh(mesh)
    obj = bpy.data.objects.new(name, mesh)
    obj.rotation_mode, obj.location = rotation_mode, (-3.0, y, 0.8)
    bpy.context.collection.objects.link(obj)


def select(name: str) -> None:
    bpy.context.view_layer.update()
    for obj in bpy.data.objects:
        obj.select_set(obj.name == name)
    bpy.context.view_layer.objects.active = wheel(name)


def turned(name: str, frames=EACH) -> np.ndarray:
    """By how much a wheel has turned about y on each frame since the first, in radians, from frame to frame."""
    axes = shown_worlds([wheel(name)], frames)[0][:, :3, 2]
    return np.unwrap(np.arctan2(axes[:, 0], axes[:, 2]))


def scenario(hand: Hand) -> Steps[None]:
    """An animator keys a wheel by I, chooses a mode by the pie, and sets turns in the panel and by F3."""
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    make_wheel("Angles", "XYZ", 1.5)
    make_wheel("Quaternions", "QUATERNION", -1.0)
    bpy.context.scene.frame_end = 73
    view = hand.area("VIEW_3D")
    view.spaces.active.region_3d.view_distance = 13
    centre = places.centre(places.region(view))
    yield from by_angles(hand, view, centre)
    yield from by_turns(hand, view, centre)


def by_angles(hand: Hand, view: bpy.types.Area, centre: places.Place) -> Steps[None]:
    """A key at every half turn, and the mode of the pie: three turns one way."""
    select("Angles")
    for number, frame in enumerate(FRAMES):
        bpy.context.scene.frame_set(frame)
        wheel("Angles").location.x = -3.0 + number
        wheel("Angles").rotation_euler.y = number * math.pi
        yield from hand.hover(centre)
        yield from hand.press("I")
    yield from hand.pie("T", "NW", alt=True)
    assert wheel("Angles").rigid_motion.mode == "lerp_slerp"
    angles = turned("Angles")
    assert np.all(np.diff(angles) > 0.0), angles
    np.testing.assert_allclose(angles[[0, -1]], (0.0, 6.0 * math.pi), atol=1e-4)
    assert_shown([wheel("Angles")], EACH)
    bpy.context.scene.frame_set(20)
    yield from hand.open_sidebar(view, "Animation")
    yield from hand.picture("half-turns-in-the-panel", places.box(places.region(view, "UI")))


def by_turns(hand: Hand, view: bpy.types.Area, centre: places.Place) -> Steps[None]:
    """Two keys that turn by a quarter, and three turns more by the field of the panel; undone, and by F3."""
    select("Quaternions")
    for frame, x, angle in ((1, -3.0, 0.0), (73, 3.0, math.pi / 2)):
        bpy.context.scene.frame_set(frame)
        wheel("Quaternions").location.x = x
        wheel("Quaternions").rotation_quaternion = (math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0)
        yield from hand.hover(centre)
        yield from hand.press("I")
    yield from hand.pie("T", "E", alt=True)
    bpy.context.scene.frame_set(30)
    without = turned("Quaternions")
    field = yield from hand.find_button(view, "UI", "rigid_motion.turns")
    yield from hand.click(field)
    yield from hand.type("3")
    yield from hand.press("RET")
    assert wheel("Quaternions").rigid_motion.turns == 3
    np.testing.assert_allclose(turned("Quaternions")[-1] - without[-1], 6.0 * math.pi, atol=1e-4)
    assert_shown([wheel("Quaternions")], EACH)
    yield from hand.picture("turns-in-the-panel", places.box(places.region(view, "UI")))
    yield from hand.hover(centre)
    yield from hand.press("Z", ctrl=True)
    assert wheel("Quaternions").rigid_motion.turns == 0
    np.testing.assert_allclose(turned("Quaternions"), without, atol=1e-5)
    yield from hand.press("Z", ctrl=True, shift=True)
    np.testing.assert_allclose(turned("Quaternions")[-1] - without[-1], 6.0 * math.pi, atol=1e-4)
    yield from hand.search("Set Turns")
    yield from hand.picture("set-turns")
    yield from hand.press("RET")
    last = bpy.context.window_manager.operators[-1]
    assert (last.bl_idname, last.turns) == ("RIGID_MOTION_OT_set_turns", 3), "it begins with the turns that there are"
    assert wheel("Quaternions").rigid_motion.turns == 3
