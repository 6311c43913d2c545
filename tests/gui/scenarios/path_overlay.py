"""Paths of the cube on the screen: shown from the panel, compared, hidden, and updated when keys move.

The pixels of the screen show that they are drawn, and in their colours.
"""

from __future__ import annotations

import bpy
import numpy as np

from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import FRAMES, cube, key_the_cube

Color = tuple[float, float, float]
NATIVE, MODE, SELECTED = (0.80, 0.80, 0.80), (0.20, 0.72, 1.0), (1.0, 0.75, 0.20)
"""The overlay's colours, as in the default preferences."""


def look(hand: Hand, view: bpy.types.Area, name: str) -> Steps[dict[Color, int]]:
    """Take a picture of the viewport, and count its pixels of each of the overlay's colours."""
    part = places.region(view)
    pixels = yield from hand.picture(name, places.box(part))
    # The sidebar and the rotation gizmo cover the right of the viewport.
    shown = pixels[:, : part.width * 2 // 3] / 255
    return {color: int((np.abs(shown - color).max(axis=2) < 0.02).sum()) for color in (NATIVE, MODE, SELECTED)}


def scenario(hand: Hand) -> Steps[None]:
    """An animator looks at the cube's path, previews a screw, plays, and hides it all."""
    key_the_cube()
    cube().scale = (0.4, 0.6, 0.25)
    for screen in bpy.data.screens:
        for area in screen.areas:
            if area.type == "VIEW_3D":
                area.spaces.active.region_3d.view_distance = 12
    yield from shown_from_the_panel(hand, hand.area("VIEW_3D"))
    yield from hidden(hand, hand.area("VIEW_3D"))

    yield from hand.open_animation_workspace()
    yield from beside_the_dope_sheet(hand, hand.area("VIEW_3D"), hand.area("DOPESHEET_EDITOR"))


def shown_from_the_panel(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Show Blender's path alone, then with that of a mode as a preview."""
    settings = bpy.context.scene.rigid_motion_overlay
    without = yield from look(hand, view, "without")
    assert without[MODE] == 0, without

    yield from hand.open_sidebar(view, "Animation")
    show = yield from hand.find_button(view, "UI", "show_paths", narrow=True)
    yield from hand.click(show)
    assert settings.show_paths
    x, y = show
    yield from hand.click((x + 60, y))  # the header, to unfold the panel
    seen = yield from look(hand, view, "native")
    assert seen[NATIVE] > without[NATIVE] + 100, seen
    assert seen[MODE] == 0, "no mode is chosen yet"

    mode = yield from hand.find_button(view, "UI", "rigid_motion_overlay.mode")
    yield from hand.click(mode)
    yield from hand.choose_row(2)
    assert settings.mode == "dq_sclerp", settings.mode
    seen = yield from look(hand, view, "compared")
    assert seen[MODE] > 300, seen
    assert seen[NATIVE] > without[NATIVE] + 100, seen
    assert cube().rigid_motion.mode == "BLENDER", "looking changes nothing"
    x, y, width, height = places.box(places.region(view))
    yield from hand.picture("path-and-panel", (x + width - 860, y + height - 725, 860, 475))


def hidden(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Hide the paths with all overlays, and with the object."""
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("Z", shift=True, alt=True)
    assert not view.spaces.active.overlay.show_overlays
    seen = yield from look(hand, view, "overlays-off")
    assert seen[MODE] == 0, seen
    yield from hand.press("Z", shift=True, alt=True)

    yield from hand.press("H")
    seen = yield from look(hand, view, "cube-hidden")
    assert seen[MODE] == 0, seen
    yield from hand.press("H", alt=True)
    seen = yield from look(hand, view, "shown-again")
    assert seen[MODE] > 300, seen


def beside_the_dope_sheet(hand: Hand, view: bpy.types.Area, sheet: bpy.types.Area) -> Steps[None]:
    """Select and move a key in the Dope Sheet: the viewport follows, and playback leaves the path."""
    yield from hand.hover(places.centre(places.region(sheet)))
    yield from hand.press("A", alt=True)
    seen = yield from look(hand, view, "no-key-selected")
    assert seen[SELECTED] == 0, seen
    yield from hand.click(places.key(sheet, FRAMES[1]))
    seen = yield from look(hand, view, "key-selected")
    assert seen[SELECTED] > 20, seen

    yield from hand.press("G")
    yield from hand.glide(places.key(sheet, FRAMES[1] + 12))
    yield from hand.click()
    seen = yield from look(hand, view, "key-moved")
    assert seen[SELECTED] > 20, seen

    before = bpy.context.scene.frame_current
    yield from hand.press("SPACE")
    yield from hand.wait_until(lambda: bpy.context.scene.frame_current > before + 3, "playback goes on")
    yield from hand.press("SPACE")
    seen = yield from look(hand, view, "played")
    assert seen[MODE] > 100, seen
