"""F-curves edited by hand: keys dragged, and a value typed.

During a drag, the pose on the screen is compared with `tests.animation.oracle` after every redraw.
"""

from __future__ import annotations

import bpy
import numpy as np

from tests.animation.keyed import curves_of, key_frames, snapshot
from tests.animation.oracle import assert_shown, expected_worlds
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import FRAMES, cube, key_the_cube, on_screen

WHOLE = range(1, 61)

ALIKE = 2e-5
"""Tolerance for equal poses, in metres and for elements of a rotation matrix."""


def assert_place_on_the_screw() -> None:
    """Check that the screen shows the mode's pose for the present keys."""
    frame = bpy.context.scene.frame_current
    np.testing.assert_allclose(on_screen("Cube"), expected_worlds(cube(), [frame])[0], atol=ALIKE)


def scenario(hand: Hand) -> Steps[None]:
    """An animator chooses the screw, and edits its F-curves."""
    yield from hand.open_animation_workspace()
    view, sheet = hand.area("VIEW_3D"), hand.area("DOPESHEET_EDITOR")
    key_the_cube()
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.pie("T", "E", alt=True)
    sheet.type = "GRAPH_EDITOR"
    yield 0.3
    yield from hand.hover(places.centre(places.region(sheet)))
    yield from hand.press("HOME")
    yield from hand.picture("curves")
    yield from dragged(hand, sheet)
    sheet.type = "DOPESHEET_EDITOR"
    yield 0.3
    yield from typed(hand, sheet)


def dragged(hand: Hand, graph: bpy.types.Area) -> Steps[None]:
    """Drag keys and handles: the body follows them; Esc restores everything."""
    middle = places.centre(places.region(graph))
    before, there = snapshot(cube()), on_screen("Cube")
    for key, confirm in (("G", False), ("S", True), ("G", True)):
        yield from hand.hover(middle)
        yield from hand.press("A")
        for fcurve in curves_of(cube()).values():
            for point in fcurve.keyframe_points:
                point.select_control_point = point.co.x == FRAMES[1]
                point.select_left_handle = point.select_right_handle = point.select_control_point
        yield from hand.press(key)
        for step in range(1, 9):
            yield from hand.hover((middle[0] + 4 * step, middle[1] + 9 * step))
            yield
            assert_place_on_the_screw()
        yield from (hand.click() if confirm else hand.press("ESC"))
        yield
        assert_shown([cube()], WHOLE)
        if not confirm:
            assert snapshot(cube()) == before
            np.testing.assert_allclose(on_screen("Cube"), there, atol=ALIKE)
    yield from hand.picture("dragged")
    for _ in range(2):
        yield from hand.press("Z", ctrl=True)
    assert_shown([cube()], WHOLE)


def typed(hand: Hand, sheet: bpy.types.Area) -> Steps[None]:
    """With Auto Key, a value typed into the Properties editor becomes the value of the key."""
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = True
    cube().select_set(True)
    bpy.context.view_layer.objects.active = cube()
    yield from hand.click(places.playhead(sheet, 35))
    field = yield from hand.find_button(hand.area("PROPERTIES"), "WINDOW", "location")
    yield from hand.enter("5", field)
    yield from hand.wait_until(lambda: 35.0 in key_frames(cube()), "the typed value is keyed")
    assert curves_of(cube())["location", 0].evaluate(35) == 5.0
    assert abs(on_screen("Cube")[0, 3] - 5.0) < ALIKE
    yield from hand.picture("typed")
