"""Clean Motion on a shaky solved camera: run by a button, weakened in the redo panel, and undone."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion import animation
from tests.gui import places
from tests.gui.driver import Hand, Steps

FRAMES = np.arange(1.0, 121.0)
SPIKE = 60


def solved_camera() -> None:
    """Make a camera that circles a cube as a solver leaves it: keyed on every frame, with jitter and one spike."""
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


def jerks() -> float:
    """Return the mean jerkiness of its rotation keys: their fourth differences from frame to frame."""
    curves = bpy.data.objects["Solved"].animation_data.action.layers[0].strips[0].channelbags[0].fcurves
    values = (
        np.array([key.co.y for key in fcurve.keyframe_points]) for fcurve in curves if "rotation" in fcurve.data_path
    )
    return float(np.mean([np.abs(np.diff(each, n=4)).mean() for each in values]))


def scenario(hand: Hand) -> Steps[None]:
    """Click the button, set a lower value in the redo panel, and undo it."""
    yield from hand.open_animation_workspace()
    view = hand.area("VIEW_3D")
    bpy.data.batch_remove(bpy.data.objects)
    solved_camera()
    bpy.context.scene.frame_end = int(FRAMES[-1])
    space = view.spaces.active.region_3d
    space.view_perspective, space.view_location, space.view_distance = "PERSP", (0.0, 0.0, 1.0), 14.0
    bpy.ops.ed.undo_push(message="Solve")
    yield from hand.open_sidebar(view, "Animation")
    shaky = jerks()
    button = yield from hand.find_button(view, "UI", "rigid_motion.clean_motion")
    yield from hand.picture("before", places.box(view))
    yield from hand.click(button)
    yield from hand.wait_until(lambda: jerks() < 0.3 * shaky, "the button takes the jitter out")
    full = jerks()
    yield from hand.find_button(view, "UI", "show_paths", narrow=True)
    redo = yield from hand.unfold_redo_panel(view)
    yield from hand.picture("after", places.box(view))
    yield from hand.enter("0.5", places.redo_row(redo, 0))
    yield from hand.wait_until(lambda: 1.5 * full < jerks() < 0.9 * shaky, "half of the jitter")
    yield from hand.picture("half", places.box(view))
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: abs(jerks() - shaky) < 1e-6, "one step takes all of it back")
