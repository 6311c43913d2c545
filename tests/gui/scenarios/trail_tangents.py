"""Tangents at the keys of a path, dragged by their handles, and Proportional Editing of keys."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Quaternion, Vector

from rigid_motion.animation import key_frames
from tests.animation.held import put
from tests.animation.keyed import snapshot
from tests.animation.oracle import shown_worlds
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import FRAMES, cube
from tests.gui.places import Place
from tests.gui.scenarios.trail import at, back_and_forth, frames_selected, take_the_tool, world_of

MIDDLE = FRAMES[1]
INSTANT = 0.02
"""Frames over which a velocity is measured."""


def scenario(hand: Hand) -> Steps[None]:
    key_an_arc()
    view = hand.area("VIEW_3D")
    view.spaces.active.region_3d.view_distance = 11
    bpy.ops.rigid_motion.set_mode(mode="motor_spline")
    overlay = bpy.context.scene.rigid_motion_overlay
    overlay.show_native = overlay.show_axes = False
    yield from take_the_tool(hand, view)
    yield from hand.press("A", alt=True)
    yield from hand.click(at(view, MIDDLE))
    yield from hand.picture("tangents", places.box_around(at(view, MIDDLE), 760, 480))
    yield from faster(hand, view)
    yield from bent(hand, view)
    yield from followed(hand, view)


def key_an_arc() -> None:
    """Set three keys on an arc, with the cube turning along it."""
    obj = cube()
    obj.scale, obj.rotation_mode = (0.4, 0.6, 0.25), "QUATERNION"
    for frame, location, angle in zip(FRAMES, ((-3, -2, 0), (-0.5, 1.5, 0.8), (3, 2.5, 0)), (0.9, 0.4, 0), strict=True):
        put(obj, frame, location, Quaternion((0.1, 0, 1), angle))
    bpy.context.scene.frame_set(FRAMES[0])
    bpy.ops.ed.undo_push(message="Keys")


def velocity(side: int) -> Vector:
    """Return the velocity after (1) or before (-1) the middle key, in units per second, pointing away from the key."""
    here, beside = shown_worlds([cube()], (MIDDLE, MIDDLE + side * INSTANT))[0][:, :3, 3]
    bpy.context.scene.frame_set(FRAMES[0])
    return Vector(beside - here) / INSTANT * bpy.context.scene.render.fps


def handle(view: bpy.types.Area, side: int) -> Place:
    """Return the place of the handle on the screen."""
    return places.point(view, world_of(MIDDLE) + velocity(side) / 3.0)


def towards(first: Place, last: Place, factor: float) -> Place:
    return tuple(round(a + factor * (b - a)) for a, b in zip(first, last, strict=True))


def faster(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Make the cube 60 % faster after the key alone."""
    before, key = snapshot(cube()), at(view, MIDDLE)
    speeds, end = [velocity(side).length for side in (-1, 1)], handle(view, 1)
    yield from held_down(hand, end)
    yield from hand.glide(towards(key, end, 1.6))
    yield from hand.picture("dragging", places.box_around(key, 700, 420))
    hand._event("LEFTMOUSE", "RELEASE")
    yield
    now = [velocity(side).length for side in (-1, 1)]
    np.testing.assert_allclose(now, np.multiply(speeds, (1.0, 1.6)), rtol=0.1)
    yield from hand.picture("faster", places.box(view))
    yield from back_and_forth(hand, before)


def held_down(hand: Hand, place: Place) -> Steps[None]:
    """Press the left button at a place, and begin to drag."""
    yield from hand.hover(place)
    hand._event("LEFTMOUSE", "PRESS")
    yield
    yield from hand.glide((place[0] + 8, place[1]), 2)


def bent(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """With B, bend the path to leave the key in the direction of the dragged handle."""
    before, key, end = snapshot(cube()), at(view, MIDDLE), handle(view, 1)
    aside = end[0] - 20, end[1] + 90
    yield from held_down(hand, end)
    yield from hand.press("B")
    yield from hand.glide(aside)
    yield from hand.picture("bent")
    yield from hand.picture("bending", places.box_around(key, 700, 420))
    hand._event("LEFTMOUSE", "RELEASE")
    yield
    assert len(key_frames(cube())) == len(FRAMES) + 1
    assert frames_selected() == [MIDDLE]
    wanted, now = np.subtract(aside, key), np.subtract(handle(view, 1), key)
    assert wanted @ now > 0.99 * np.linalg.norm(wanted) * np.linalg.norm(now), (wanted, now)
    yield from back_and_forth(hand, before)


def followed(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Move a key: keys on both sides follow it within the range that the wheel sets."""
    for frame in (10, 15, 25, 30):
        bpy.ops.rigid_motion.insert_path_key(frame=frame)
    yield from hand.press("A", alt=True)
    yield from hand.click(at(view, MIDDLE))
    before, (x, y) = snapshot(cube()), at(view, MIDDLE)
    stands = {frame: world_of(frame) for frame in (1, 10, 15, 20, 25, 30, 40)}
    tools = bpy.context.scene.tool_settings
    yield from hand.press("G")
    yield from hand.press("O")
    assert tools.use_proportional_action
    while tools.proportional_size < 7.0:
        yield from hand.press("PAGE_UP")
    yield from hand.glide((x, y + 120))
    yield from hand.picture("proportional", places.box(view))
    yield from hand.picture("following", places.box_around((x, y), 700, 500))
    yield from hand.click()
    moved = {frame: (world_of(frame) - place).length for frame, place in stands.items()}
    assert all(moved[frame] < 1e-5 for frame in (1, 10, 30, 40)), moved
    assert moved[20] > moved[15] > 0.2 < moved[25] < moved[20], moved
    yield from back_and_forth(hand, before)
    is_on = bpy.context.scene.tool_settings.use_proportional_action
    yield from hand.press("O")
    assert bpy.context.scene.tool_settings.use_proportional_action != is_on, "O is a key of the tool, too"
