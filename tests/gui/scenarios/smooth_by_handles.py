"""Smooth Screw on keys that the I key sets: it eases as Screw does, and a key on the way changes nothing."""

from __future__ import annotations

import math

import bpy
import numpy as np

from tests.animation.keyed import curves_of
from tests.animation.oracle import assert_shown, shown_worlds
from tests.gui import places
from tests.gui.driver import Hand, Steps

FRAMES = range(1, 26)


def cube() -> bpy.types.Object:
    """The default cube, asked for anew each time: undo replaces it."""
    return bpy.data.objects["Cube"]


def pose(x: float, y: float, angle: float) -> None:
    obj = cube()
    obj.location = (x, y, 0)
    obj.rotation_quaternion = (math.cos(angle / 2), 0, 0, math.sin(angle / 2))


def scenario(hand: Hand) -> Steps[None]:
    """An animator sets two keys by I, chooses modes by the pie, sees the path, sets a third key, and two in between."""
    view = hand.area("VIEW_3D")
    view.spaces.active.region_3d.view_distance = 14
    centre = places.centre(places.region(view))
    cube().rotation_mode, cube().scale = "QUATERNION", (0.5, 0.5, 0.5)
    for frame, values in ((1, (-3, -1, 0)), (25, (2, 1, 1.9))):
        yield from key_by_hand(hand, centre, frame, values)
    yield from hand.hover(centre)
    yield from hand.pie("T", "E", alt=True)
    assert cube().rigid_motion.mode == "dq_sclerp"
    screw = shown_worlds([cube()], FRAMES)[0]
    yield from hand.hover(centre)
    yield from hand.pie("T", "N", alt=True)
    assert cube().rigid_motion.mode == "motor_spline"
    assert_shown([cube()], FRAMES)
    smooth = shown_worlds([cube()], FRAMES)[0]
    assert np.abs(smooth - screw).max() < 1e-5, "between two keys both are one motion, with one easing"
    steps = np.linalg.norm(np.diff(smooth[:, :3, 3], axis=0), axis=1)
    assert steps[0] < 0.3 * steps.max(), steps
    assert steps[-1] < 0.3 * steps.max(), steps

    bpy.context.scene.rigid_motion_overlay.show_paths = True
    yield from hand.picture("two-keys", places.box(places.region(view)))
    yield from key_by_hand(hand, centre, 90, (4, -2, 2.5))
    assert_shown([cube()], range(1, 91, 3))
    moved = shown_worlds([cube()], FRAMES)[0]
    assert np.abs(moved - smooth).max() < 0.3, "a key far away changes little"
    yield from hand.picture("three-keys", places.box(places.region(view)))

    before = shown_worlds([cube()], range(1, 91))[0]
    for frame in (12, 45):
        bpy.context.scene.frame_set(frame)
        yield from hand.hover(centre)
        yield from hand.press("I")
        assert_shown([cube()], range(1, 91, 3))
        after = shown_worlds([cube()], range(1, 91))[0]
        assert np.abs(after - before).max() < 1e-3, "a key on an in-between leaves the motion as it was"
    types = [key.type for key in curves_of(cube())["location", 0].keyframe_points]
    assert types == ["KEYFRAME", "BREAKDOWN", "KEYFRAME", "BREAKDOWN", "KEYFRAME"], types
    yield from hand.picture("keys-in-between", places.box(places.region(view)))


def key_by_hand(hand: Hand, centre: tuple[int, int], frame: int, values: tuple[float, float, float]) -> Steps[None]:
    """Pose the cube on a frame, and press I over the viewport."""
    bpy.context.scene.frame_set(frame)
    pose(*values)
    yield from hand.hover(centre)
    yield from hand.press("I")
