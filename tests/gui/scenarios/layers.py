"""An offset layer on a cube: added, posed and keyed by hand, viewed, merged, and undone."""

from __future__ import annotations

import bpy
import numpy as np

from tests.gui import places
from tests.gui.driver import FOLDED_PANEL, Hand, Steps
from tests.gui.keyed import FRAMES, cube, key_the_cube, on_screen


def scenario(hand: Hand) -> Steps[None]:
    key_the_cube()
    cube().scale = (0.4, 0.6, 0.25)
    view = hand.area("VIEW_3D")
    view.spaces.active.region_3d.view_distance = 14
    bpy.ops.rigid_motion.set_mode(mode="dq_sclerp")
    bpy.context.scene.frame_end = FRAMES[-1]
    bpy.context.scene.frame_set(1)
    bpy.context.scene.rigid_motion_overlay.show_paths = True
    bpy.ops.ed.undo_push(message="Mode")
    yield from hand.open_sidebar(view, "Animation")
    x, y = yield from hand.find_button(view, "UI", "show_speed", narrow=True)
    yield from hand.click((x + 60, y - FOLDED_PANEL))  # the header of Layer, to unfold it
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.search("Add Layer")
    assert cube().parent.name == "Cube Base"
    bpy.context.scene.frame_set(20)
    before = on_screen("Cube")
    yield from keyed_by_hand(hand, view)
    assert np.abs(on_screen("Cube") - before).max() > 0.3, "it was moved"
    yield from hand.picture("cube", places.box(places.region(view)))
    layered = on_screen("Cube")
    yield from hand.search("Merge Layer")
    assert cube().parent is None
    assert np.abs(on_screen("Cube") - layered).max() < 0.002
    yield from hand.picture("merged", places.box(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    assert cube().parent.name == "Cube Base", "one step back, and there is the layer"
    yield from hand.press("Z", ctrl=True, shift=True)
    assert cube().parent is None


def keyed_by_hand(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Move the selected object upwards, rotate it, and key both."""
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("G")
    yield from hand.press("Z")
    yield from hand.type("1")
    yield from hand.press("RET")
    yield from hand.press("R")
    yield from hand.type("40")
    yield from hand.press("RET")
    yield from hand.press("I")
    yield 0.5
