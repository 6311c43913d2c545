"""An offset layer on a cube: added, posed and keyed by hand, viewed, merged, and undone."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion.animation import key_frames
from tests.animation.oracle import shown_worlds
from tests.gui import places
from tests.gui.driver import FOLDED_PANEL, Hand, Steps
from tests.gui.keyed import FRAMES, cube, key_the_cube

EVERY = range(FRAMES[0], FRAMES[-1] + 1)


def worlds() -> np.ndarray:
    """Return the world matrices of the cube on all frames, (m, 4, 4)."""
    return shown_worlds([cube()], EVERY)[0]


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
    before = worlds()
    x, y = yield from hand.find_button(view, "UI", "show_speed", narrow=True)
    yield from hand.click((x + 60, y - FOLDED_PANEL))  # the header of Layer, to unfold it
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.search("Add Layer")
    assert cube().parent.name == "Cube Base"
    assert cube().animation_data.use_tweak_mode
    assert np.abs(worlds() - before).max() < 1e-5, "a layer at rest moves nothing"
    yield from keyed_by_hand(hand, view, 20)
    offset = np.linalg.inv(before[19]) @ worlds()[19]
    assert np.abs(offset[:3, 3]).max() > 0.3, "it was moved"
    yield from hand.picture("cube", places.box(places.region(view)))
    layered = worlds()
    yield from hand.search("Merge Layer")
    assert cube().parent is None
    assert "Cube Base" not in bpy.data.objects
    assert {*FRAMES} <= {*key_frames(cube()).tolist()}
    assert np.abs(worlds() - layered).max() < 0.002
    yield from hand.picture("merged", places.box(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    assert cube().parent.name == "Cube Base", "one step back, and there is the layer"
    assert np.abs(worlds() - layered).max() < 1e-4
    yield from hand.press("Z", ctrl=True, shift=True)
    assert cube().parent is None


def keyed_by_hand(hand: Hand, view: bpy.types.Area, frame: int) -> Steps[None]:
    """Move the selected object upwards on a frame, rotate it, and key both."""
    bpy.context.scene.frame_set(frame)
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
