"""Pictures of the modes for the pages in docs/: a small scene shows the character of each mode.

In every scene bodies move from key to key, with ghosts on the way, and the overlay draws their paths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Euler, Matrix, Quaternion, Vector

from examples import figure
from tests.animation.bones.rigs import select_only
from tests.animation.held import put
from tests.animation.keyed import curves_of
from tests.animation.oracle import shown_worlds
from tests.gui import places
from tests.gui.driver import Hand, Steps

STRAIGHT, SCREW, SMOOTH = "lerp_slerp", "dq_sclerp", "motor_spline"

SIZE = (960, 480)
"""Width and height of a picture, in pixels."""

VIEW_SCALE = 1.44
"""Width seen by an orthographic viewport at a view distance of 1: Blender's 72 mm sensor with a 50 mm lens."""

TEXT = 0.045
"""Height of a text, as a fraction of the picture's width."""

Color = tuple[float, float, float]
NATIVE, MODE = (0.80, 0.80, 0.80), (0.20, 0.72, 1.0)
"""The overlay's colours of Blender's own path and of a mode's, as on the screen."""

WOOD, METAL, STAND = (0.72, 0.48, 0.26), (0.55, 0.58, 0.62), (0.30, 0.31, 0.33)

GHOST = 0.22
"""Opacity of a ghost."""


def scenario(hand: Hand) -> Steps[None]:
    """Take pictures of a lid, a hammer, a thrown stick, and a dart on a winding path."""
    bpy.context.preferences.view.ui_scale = 1.5  # pages show the pictures at a smaller size
    yield 1.0
    view = hand.area("VIEW_3D")
    settle(view)
    for shot in (lid, hammer, throw, flight):
        bpy.data.batch_remove([*bpy.data.objects, *bpy.data.curves])
        bpy.context.scene.rigid_motion_overlay.tick_step = 2
        width = shot(view)
        bpy.context.scene.rigid_motion_overlay.show_paths = True
        yield
        yield from picture(hand, view, shot.__name__, width)


def settle(view: bpy.types.Area) -> None:
    """Set up the viewport: bodies in their own colours, no overlays but the paths."""
    space = view.spaces.active
    space.show_gizmo = space.show_region_toolbar = space.show_region_ui = False
    space.shading.color_type = "OBJECT"
    overlay = space.overlay
    for name in ("floor", "axis_x", "axis_y", "cursor", "text", "outline_selected", "object_origins", "stats"):
        setattr(overlay, f"show_{name}", False)
    settings = bpy.context.scene.rigid_motion_overlay
    settings.show_axes = False


def picture(hand: Hand, view: bpy.types.Area, name: str, width: float) -> Steps[None]:
    """Take a picture of the middle of the viewport, which shows `width` of the scene from side to side."""
    part = places.region(view)
    space = view.spaces.active.region_3d
    for text in bpy.data.curves:
        text.size = TEXT * width
    space.view_distance = width * max(part.width, part.height) / SIZE[0] / VIEW_SCALE
    yield
    pixels = yield from hand.picture(name, places.box_around(places.centre(part), *SIZE))
    drawn = (np.abs(pixels / 255 - MODE).max(axis=2) < 0.02).sum()
    assert drawn > 200, f"{name}: {drawn} pixels of a path"


# Scenes: each builds itself, checks its claim, aims the viewport, and returns its width


def lid(view: bpy.types.Area) -> float:
    """Show the lid of a chest, with its origin in its middle. The screw keeps it in its hinge."""
    aim(view, (80, 0, 16), (0.35, 0, 0.34))
    body("Chest", STAND, ((0.6, 0, -0.3), (1.2, 0.7, 0.58)))
    cover = body("Lid", WOOD, ((0, 0, 0), (1.2, 0.7, 0.1)), ((0.62, 0, 0), (0.05, 0.12, 0.1)))
    for frame, angle in ((1, 0.0), (25, -110.0)):
        turn = Quaternion((0, 1, 0), math.radians(angle))
        put(cover, frame, turn @ Vector((0.6, 0, 0.05)), turn)
    native = shown(cover)
    choose(cover, SCREW)
    ghosts(cover, native, NATIVE, (13,))
    ghosts(cover, shown(cover), MODE, (8, 13, 18))
    label("Blender", (-0.42, -0.4, -0.16), NATIVE, view)
    label("Screw", (0.86, -0.4, 0.74), MODE, view)
    bpy.context.scene.frame_set(25)
    return 4.0


def hammer(view: bpy.types.Area) -> float:
    """Show a hammer swung about a wrist, with its origin in the head. The screw keeps it in the hand."""
    aim(view, (90, 0, 0), (0, 0, 0.38))
    wrist, grip = Vector((0, 0, 0)), Vector((0, 0, -1.0))
    tool = body("Hammer", WOOD, ((0, 0, -0.5), (0.07, 0.07, 1.1)), ((0, 0, 0.02), (0.4, 0.16, 0.17)))
    for frame, angle in ((1, -70.0), (25, 65.0)):
        turn = Quaternion((0, 1, 0), math.radians(angle))
        put(tool, frame, wrist - turn @ grip, turn)
    choose(tool, STRAIGHT)
    straight = shown(tool)
    choose(tool, SCREW)
    ghosts(tool, straight, NATIVE, (9, 13, 17))
    ghosts(tool, shown(tool), MODE, (9, 13, 17))
    body("Hand", STAND, (wrist, (0.16, 0.3, 0.16)))
    label("Screw", (0, 0, 1.15), MODE, view)
    label("Blender,\nStraight", (-1.08, 0, 0.1), NATIVE, view)
    bpy.context.scene.frame_set(25)
    return 3.9


def throw(view: bpy.types.Area) -> float:
    """Show a flying, turning stick. Its middle moves straight with Straight, and on a curve with the screw."""
    aim(view, (90, 0, 0), (0, 0, 0.77))
    sticks = [body(name, METAL, ((0, 0, 0), (0.9, 0.08, 0.08)), ((0.4, 0, 0), (0.16, 0.12, 0.12))) for name in "AB"]
    for stick, mode in zip(sticks, (STRAIGHT, SCREW), strict=True):
        for frame, x, angle in ((1, -1.6, 0.0), (25, 1.6, 150.0)):
            put(stick, frame, (x, 0, 0.3), Quaternion((0, 1, 0), math.radians(angle)))
        choose(stick, mode)
        color = MODE if mode == STRAIGHT else NATIVE
        ghosts(stick, shown(stick), color, (1, 7, 13, 19, 25))
    show_chosen_paths()
    label("Straight", (0, 0, -0.28), MODE, view)
    label("Screw", (-0.7, 0, 1.02), MODE, view)
    bpy.context.scene.frame_set(1)
    return 5.0


def flight(view: bpy.types.Area) -> float:
    """Show two darts with the same four keys. Smooth Screw has no corner at them."""
    aim(view, (0, 0, 0), (0, -0.1, 0))
    for mode, x, name in ((SCREW, -1.25, "Screw"), (SMOOTH, 1.25, "Smooth Screw")):
        dart = body(name, METAL, ((0, 0, 0), (0.34, 0.06, 0.06)), ((-0.15, 0, 0), (0.1, 0.22, 0.03)))
        for frame, place, heading in (
            (0, (x - 0.95, -0.5, 0), 60),
            (12, (x - 0.4, 0.5, 0), 20),
            (24, (x + 0.3, -0.35, 0), 0),
            (36, (x + 0.95, 0.5, 0), 45),
        ):
            put(dart, frame, place, Quaternion((0, 0, 1), math.radians(heading)))
        run_evenly(dart)
        choose(dart, mode)
        ghosts(dart, shown(dart), MODE, range(4, 37, 3))
        label(name, (x, -0.95, 0), MODE, view)
    show_chosen_paths()
    bpy.context.scene.rigid_motion_overlay.tick_step = 3
    bpy.context.scene.frame_set(0)
    return 4.9


# Parts of the scenes


def aim(view: bpy.types.Area, degrees: Sequence[float], middle: Sequence[float]) -> None:
    """Look at a point in the direction of a camera with this rotation."""
    space = view.spaces.active.region_3d
    space.view_perspective = "ORTHO"
    space.view_rotation = Euler([math.radians(angle) for angle in degrees]).to_quaternion()
    space.view_location = middle


def body(name: str, color: Color, *boxes: figure.Box) -> bpy.types.Object:
    """Make a body of boxes around its origin."""
    obj = figure.boxes(name, bpy.data.materials.new(name), *boxes)
    obj.rotation_mode, obj.color = "QUATERNION", (*linear(color), 1.0)
    return obj


def add(name: str, data: bpy.types.ID, color: Sequence[float]) -> bpy.types.Object:
    obj = bpy.data.objects.new(name, data)
    obj.rotation_mode = "QUATERNION"
    obj.color = color
    bpy.context.scene.collection.objects.link(obj)
    return obj


def run_evenly(obj: bpy.types.Object) -> None:
    """Remove the easing between the keys."""
    for fcurve in curves_of(obj).values():
        for point in fcurve.keyframe_points:
            point.interpolation = "LINEAR"


def choose(obj: bpy.types.Object, mode: str) -> None:
    """Choose a mode for an object, as an animator does, and show Blender's own path for comparison."""
    select_only(obj)
    bpy.ops.rigid_motion.set_mode(mode=mode)
    bpy.context.scene.rigid_motion_overlay.show_native = True


def show_chosen_paths() -> None:
    """Show the paths of all objects with keys, only in their own modes."""
    for obj in bpy.context.scene.objects:
        obj.select_set(obj.animation_data is not None)
    bpy.context.scene.rigid_motion_overlay.show_native = False


def shown(obj: bpy.types.Object) -> np.ndarray:
    """Return the object's world matrices on all frames from its first to its last key."""
    first, last = (int(frame) for frame in obj.animation_data.action.frame_range)
    return shown_worlds([obj], range(first, last + 1))[0]


def ghosts(obj: bpy.types.Object, worlds: np.ndarray, color: Color, frames: Sequence[int]) -> None:
    """Add transparent copies of the object on these frames, counted from 1."""
    for frame in frames:
        ghost = add("Ghost", obj.data, (*linear(color), GHOST))
        ghost.matrix_world = Matrix(worlds[frame - 1])


def label(text: str, place: Sequence[float], color: Color, view: bpy.types.Area) -> None:
    """Add a text that faces the viewer, centred at a place. `picture` gives all texts the same height."""
    data = bpy.data.curves.new(text, "FONT")
    data.body = text
    data.align_x, data.align_y = "CENTER", "CENTER"
    # It is lit like everything else, so its colour is brighter than it should appear.
    obj = add(text, data, (*(1.6 * part for part in linear(color)), 1.0))
    obj.location, obj.rotation_quaternion = place, view.spaces.active.region_3d.view_rotation
    obj.show_in_front = True


def linear(color: Color) -> Color:
    """Convert a colour from screen values to the linear values of objects."""
    return tuple(part**2.2 for part in color)
