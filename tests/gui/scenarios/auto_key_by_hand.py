"""Auto Key on frames between keys: what is put somewhere (snapped, grabbed, typed) stays there once it is keyed."""

from __future__ import annotations

import bpy
import numpy as np

from tests.animation.keyed import curves_of, key_frames
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.scenarios.edits_by_hand import ALIKE, FRAMES, assert_on_the_screw, cube, key_the_cube

CURSOR = (1.0, 2.0, 0.5)


def place() -> np.ndarray:
    """Where the cube is on the screen."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    return np.array(cube().evaluated_get(depsgraph).matrix_world)


def scenario(hand: Hand) -> Steps[None]:
    """An animator works with Auto Key between the keys of a screw."""
    yield from hand.open_animation_workspace()
    view = hand.area("VIEW_3D")
    key_the_cube()
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.pie("T", "E", alt=True)
    assert_on_the_screw(*FRAMES)
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = True
    yield from snapped(hand, view)
    yield from grabbed(hand, view)
    yield from typed(hand)


def snapped(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Shift S, Selection to Cursor: the cube is keyed where the cursor is, and turned as it was on the screen."""
    bpy.context.scene.cursor.location = CURSOR
    before = place()
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.pie("S", "N", shift=True)
    yield from hand.wait_until(lambda: 10.0 in key_frames(cube()), "the snapped cube is keyed")
    np.testing.assert_allclose(place()[:3, 3], CURSOR, atol=ALIKE)
    np.testing.assert_allclose(place()[:3, :3], before[:3, :3], atol=ALIKE)
    assert_on_the_screw(1, 10, 20, 40)
    yield from hand.picture("snapped")


def grabbed(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """G X 2 on a frame between keys: two metres from where it was on the screen."""
    bpy.context.scene.frame_set(30)
    before = place()
    yield from hand.hover(places.centre(places.region(view)))
    for key in ("G", "X"):
        yield from hand.press(key)
    yield from hand.type("2")
    yield from hand.press("RET")
    yield from hand.wait_until(lambda: 30.0 in key_frames(cube()), "the grabbed cube is keyed")
    before[0, 3] += 2.0
    np.testing.assert_allclose(place(), before, atol=ALIKE)
    assert_on_the_screw(1, 10, 20, 30, 40)


def typed(hand: Hand) -> Steps[None]:
    """After the playhead was dragged, a value that is typed into the Properties editor is the value of the key."""
    yield from hand.click(places.playhead(hand.area("DOPESHEET_EDITOR"), 35))
    assert bpy.context.scene.frame_current == 35, bpy.context.scene.frame_current
    field = yield from hand.find_button(hand.area("PROPERTIES"), "WINDOW", "location")
    yield from hand.hover(field)
    yield from hand.press("RET")
    yield from hand.type("5")
    yield from hand.press("RET")
    yield from hand.wait_until(lambda: 35.0 in key_frames(cube()), "the typed value is keyed")
    assert curves_of(cube())["location", 0].evaluate(35) == 5.0
    assert abs(place()[0, 3] - 5.0) < ALIKE
    yield from hand.picture("typed")
