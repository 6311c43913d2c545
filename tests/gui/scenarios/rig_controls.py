"""Rigify's human in Pose Mode: all controls selected by hand, a screw for all of them from the pie, and played."""

from __future__ import annotations

import bpy
import numpy as np

from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.rigs.human import controls, human
from tests.rigs.poses import KEYS, ends_of_bones, key_at_random

SCREW = "dq_sclerp"


def rig() -> bpy.types.Object:
    """The rig, asked for anew each time: undo replaces it."""
    return bpy.data.objects["rig"]


def scenario(hand: Hand) -> Steps[None]:
    """All controls by screws, undone, redone, and compared with real keys."""
    view = hand.area("VIEW_3D")
    bpy.data.batch_remove(bpy.data.objects)
    human()
    for collection in rig().data.collections_all:
        collection.is_visible = collection.name not in ("DEF", "MCH", "ORG")
    key_at_random(controls(rig()))
    bpy.context.scene.frame_end = KEYS[-1]
    bpy.context.view_layer.objects.active = rig()
    rig().select_set(True)
    space = view.spaces.active.region_3d
    space.view_location, space.view_distance = (0.0, 0.0, 0.9), 3.5
    bpy.ops.ed.undo_push(message="Rig")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("TAB", ctrl=True)
    assert bpy.context.mode == "POSE", bpy.context.mode
    yield from hand.press("A")
    native = ends_of_bones(rig())
    yield from hand.pie("T", "E", alt=True)
    screwed = [control for control in controls(rig()) if control.rigid_motion.mode == SCREW]
    assert len(screwed) > 200, f"only {len(screwed)} of all controls that are to be seen"
    screws = ends_of_bones(rig())
    assert np.abs(screws - native).max() > 0.01, "the screws are not Blender's own way"
    bpy.context.scene.frame_set(8)
    yield from hand.open_sidebar(view, "Animation")
    yield from hand.picture("controls")
    yield from hand.press("Z", ctrl=True)
    np.testing.assert_allclose(ends_of_bones(rig()), native, atol=2e-5)
    yield from hand.press("Z", ctrl=True, shift=True)
    np.testing.assert_allclose(ends_of_bones(rig()), screws, atol=2e-5)
    yield from hand.press("SPACE")
    yield from hand.wait_until(lambda: hand.window.screen.is_animation_playing, "the animation plays")
    yield 3.0
    yield from hand.press("SPACE")
    np.testing.assert_allclose(ends_of_bones(rig()), screws, atol=2e-5)
