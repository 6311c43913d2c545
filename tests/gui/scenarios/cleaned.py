"""A solved camera that shakes, and a BVH file that trembles: cleaned by a button, less so in the redo panel; undone."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion import animation
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.scenarios import native_curves

FRAMES = np.arange(1.0, 121.0)
SPIKE = 60


def solved_camera() -> None:
    """A camera that goes round a cube, as a solver has it: with a key on every frame, trembling, and once far off."""
    random, angles = np.random.default_rng(7), FRAMES / 60.0
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    camera = bpy.data.objects.new("Solved", bpy.data.cameras.new("Solved"))
    bpy.context.scene.collection.objects.link(camera)
    places_seen = np.stack((5.0 * np.sin(angles), -5.0 * np.cos(angles), 1.5 + 0.2 * angles), axis=1)
    turns = np.stack((1.3 + 0.0 * angles, 0.0 * angles, angles), axis=1)
    places_seen += 0.02 * random.normal(size=places_seen.shape)
    turns += 0.004 * random.normal(size=turns.shape)
    places_seen[SPIKE] += (0.5, 0.3, 0.4)
    for name, values in (("location", places_seen), ("rotation_euler", turns)):
        animation.write_channel(camera, name, FRAMES, values)
    camera.data.dof.focus_distance = 5.0
    for obj in bpy.data.objects:
        obj.select_set(obj == camera)
    bpy.context.view_layer.objects.active = camera


def shake_walk() -> None:
    """Have the imported walk tremble, as cheap motion capture does."""
    random = np.random.default_rng(8)
    action = native_curves.rig().animation_data.action
    for fcurve in action.layers[0].strips[0].channelbags[0].fcurves:
        if fcurve.data_path.endswith("rotation_euler"):
            for key in fcurve.keyframe_points:
                key.co.y += 0.01 * random.normal()
            fcurve.update()


def jerks(obj: bpy.types.Object) -> float:
    """How much the keys of an object's bones, or its own, jump from frame to frame."""
    curves = obj.animation_data.action.layers[0].strips[0].channelbags[0].fcurves
    values = (
        np.array([key.co.y for key in fcurve.keyframe_points]) for fcurve in curves if "rotation" in fcurve.data_path
    )
    return float(np.mean([np.abs(np.diff(each, n=4)).mean() for each in values if len(each) > 4]))


def cleaned_by(hand: Hand, view: bpy.types.Area, obj: str, picture: str) -> Steps[None]:
    """Click the button, ask for less in the redo panel, and undo it."""
    shaky = jerks(bpy.data.objects[obj])
    button = yield from hand.find_button(view, "UI", "rigid_motion.clean_motion")
    yield from hand.picture(f"{picture}-before", places.box(view))
    yield from hand.click(button)
    yield from hand.wait_until(lambda: jerks(bpy.data.objects[obj]) < 0.3 * shaky, "the button takes the trembling out")
    full = jerks(bpy.data.objects[obj])
    yield from hand.find_button(view, "UI", "show_paths", narrow=True)
    redo = yield from hand.unfold_redo_panel(view)
    yield from hand.picture(f"{picture}-after", places.box(view))
    yield from hand.enter("0.5", places.redo_row(redo, 0))
    yield from hand.wait_until(lambda: 1.5 * full < jerks(bpy.data.objects[obj]) < 0.9 * shaky, "half of the trembling")
    yield from hand.picture(f"{picture}-half", places.box(view))
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(
        lambda: abs(jerks(bpy.data.objects[obj]) - shaky) < 1e-6, "one step takes all of it back"
    )


def scenario(hand: Hand) -> Steps[None]:
    yield from hand.open_animation_workspace()
    view = hand.area("VIEW_3D")
    bpy.data.batch_remove(bpy.data.objects)
    solved_camera()
    bpy.context.scene.frame_end = int(FRAMES[-1])
    space = view.spaces.active.region_3d
    space.view_perspective, space.view_location, space.view_distance = "PERSP", (0.0, 0.0, 1.0), 14.0
    bpy.ops.ed.undo_push(message="Solve")
    yield from hand.open_sidebar(view, "Animation")
    yield from cleaned_by(hand, view, "Solved", "camera")

    bpy.data.batch_remove(bpy.data.objects)
    native_curves.import_walk()
    shake_walk()
    space.view_location, space.view_distance = (0.0, 0.0, 1.0), 5.0
    bpy.ops.ed.undo_push(message="Import")
    yield from cleaned_by(hand, view, native_curves.NAME, "walk")
