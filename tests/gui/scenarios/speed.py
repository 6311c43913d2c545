"""Speed of the cube as a curve in the Graph Editor; equalised by the button in the sidebar, and undone.

The pixels of the screen show that the curve is drawn, and is level afterwards.
"""

from __future__ import annotations

import bpy
import numpy as np

from tests.animation.keyed import key_frames
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import FRAMES, cube, key_the_cube

BLUE, ORANGE = (0.20, 0.72, 1.0), (1.0, 0.75, 0.20)


def rows_of(pixels: np.ndarray, color: tuple[float, float, float]) -> np.ndarray:
    """Return the rows, from below, of the pixels of a colour in the left three fifths of a picture, without text."""
    shown = pixels[:, : pixels.shape[1] * 3 // 5] / 255
    return len(shown) - np.nonzero(np.abs(shown - color).max(axis=2) < 0.05)[0]


def frames() -> list[float]:
    return key_frames(cube()).tolist()


def scenario(hand: Hand) -> Steps[None]:
    key_the_cube()
    bpy.ops.rigid_motion.set_mode(mode="dq_sclerp")
    bpy.ops.ed.undo_push(message="Mode")
    bpy.context.scene.frame_end = FRAMES[-1]
    yield from hand.open_animation_workspace()
    editor = hand.area("DOPESHEET_EDITOR")
    editor.ui_type = "FCURVES"
    yield
    for area in bpy.context.window_manager.windows[0].screen.areas:
        if area.type == "VIEW_3D":
            area.spaces.active.region_3d.view_distance = 14
    yield from hand.hover(places.centre(places.region(editor)))
    yield from hand.press("HOME")
    yield from hand.open_sidebar(editor, "Animation")
    yield 0.5
    part = places.box(places.region(editor))
    without = yield from hand.picture("without", part)
    assert not len(rows_of(without, BLUE)), "no speed yet"
    show = yield from hand.find_button(editor, "UI", "show_speed", narrow=True)
    yield from hand.click(show)
    assert bpy.context.scene.rigid_motion_overlay.show_speed
    yield from hand.hover(places.centre(places.region(editor)))
    uneven = rows_of((yield from hand.picture("uneven", part)), BLUE)
    assert len(uneven) > 200, len(uneven)
    assert np.ptp(uneven) > 30, "it stops at its keys"
    before = frames()
    yield from hand.search("Equalise Speed")
    assert frames() != before, "the key in the middle moves"
    assert frames()[::2] == before[::2], "the others stay"
    yield from hand.hover(places.centre(places.region(editor)))
    even = rows_of((yield from hand.picture("even", part)), BLUE)
    assert len(even) > 200, len(even)
    assert np.ptp(even) < 25, np.ptp(even)
    yield from hand.press("Z", ctrl=True)
    assert frames() == before
