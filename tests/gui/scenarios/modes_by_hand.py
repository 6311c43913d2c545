"""Modes chosen from the menus, by the pies and in the panel, with undo and baking, all by mouse and keys."""

from __future__ import annotations

import bpy

from rigid_motion.animation.actions.marks import read_marks
from tests.animation.keyed import curve_of
from tests.animation.oracle import assert_shown
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import FRAMES, cube, key_the_cube

BETWEEN = range(4, 41, 9)
STRAIGHT, SCREW, SMOOTH = (dict.fromkeys(map(float, FRAMES), number) for number in (1, 2, 7))
"""Mode numbers by key frame, if the whole cube has that mode."""

ROW = 26
"""Pixels from one row of a panel to the next."""


def assert_modes(modes: dict[float, int]) -> None:
    """Check that the keys of the cube have these modes, and that it is where they put it on every frame."""
    assert marked_modes() == modes, marked_modes()
    assert_shown([cube()], BETWEEN)


def marked_modes() -> dict[float, int]:
    """Return the mode numbers by frame, for the keys of the cube that have one."""
    curve = curve_of(cube(), "location")
    marks = read_marks(curve).tolist()
    return {key.co.x: mark - 1 for key, mark in zip(curve.keyframe_points, marks, strict=True) if mark}


def scenario(hand: Hand) -> Steps[None]:
    """An animator tries modes on the cube in two editors, undoes some, and bakes."""
    yield from hand.open_animation_workspace()
    view, sheet = hand.area("VIEW_3D"), hand.area("DOPESHEET_EDITOR")
    key_the_cube()
    yield from in_the_viewport(hand, view)
    yield from in_the_panel(hand, view)
    yield from in_the_dope_sheet(hand, sheet)
    yield from baked(hand, view)


def in_the_viewport(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Choose a mode for the whole object: by the pie, undone, from the Object menu and from the context menu."""
    centre = places.centre(places.region(view))
    around = places.box_around(centre, 840, 380)
    yield from hand.hover(centre)
    yield from hand.pie("T", "N", alt=True)
    assert_modes(SMOOTH)
    yield from hand.hover(centre)
    yield from hand.press("Z", ctrl=True)
    assert_modes({})
    # The tooltip is wider than the free space next to the pie.
    bpy.context.preferences.view.show_tooltips = False
    yield from hand.pie("T", "E", picture="pie", box=around, alt=True)
    bpy.context.preferences.view.show_tooltips = True
    assert_modes(SCREW)
    yield from hand.press("Z", ctrl=True)
    assert_modes({})
    yield from hand.press("Z", ctrl=True, shift=True)
    assert_modes(SCREW)

    yield from hand.open_menu(view, "VIEW3D_MT_object")
    yield from hand.choose("Straight")
    assert_modes(STRAIGHT)
    yield from hand.click(centre, button="RIGHTMOUSE")
    yield from hand.picture("context-menu")
    yield from hand.choose("Clear Modes")
    assert_modes({})


def in_the_dope_sheet(hand: Hand, sheet: bpy.types.Area) -> Steps[None]:
    """Choose a mode for the selected keys: from the Key menu, the context menu and by the pie."""
    yield from hand.click(places.key(sheet, 1))
    yield from hand.open_menu(sheet, "DOPESHEET_MT_key")
    yield from hand.press("UP_ARROW")
    yield from hand.press("RIGHT_ARROW")
    yield from hand.picture("menu", (sheet.x, sheet.y + sheet.height - 120, 920, 660))
    # A search would find the same mode in the menu for all segments.
    yield from hand.press("DOWN_ARROW")
    yield from hand.press("DOWN_ARROW")
    yield from hand.press("RET")
    yield from hand.picture("panel-of-keys", places.box(places.region(sheet, "UI")))
    assert_modes({1: 2, 20: 0, 40: 0})
    yield from hand.press("F9")
    yield from hand.picture("adjust-last-operation")
    yield from hand.press("ESC")
    yield from hand.click(places.key(sheet, 20))
    yield from hand.hover(places.key(sheet, 100))
    yield from hand.pie("T", "NW", picture="pie-of-keys", alt=True)
    assert_modes({1: 2, 20: 1, 40: 0})
    yield from hand.hover(places.key(sheet, 100))
    yield from hand.press("A", alt=True)
    yield from hand.pie("T", "E", alt=True)
    yield from hand.picture("no-key-selected")
    yield from hand.press("ESC")
    assert marked_modes() == {1: 2, 20: 1, 40: 0}, "without a selected key nothing changes"


def in_the_panel(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Choose a mode in the panel for the whole object, then for the segment under the playhead; set its turns."""
    bpy.ops.rigid_motion.set_mode(mode="motor_spline")
    bpy.ops.ed.undo_push(message="Mode")
    yield from hand.open_sidebar(view, "Animation")
    x, y = yield from hand.find_button(view, "UI", "rigid_motion.turns")
    # Above the turns are rows for the frames, the segment and the object.
    yield from hand.click((x, y + 3 * ROW))
    yield from hand.choose_row(3)
    assert_modes(STRAIGHT)
    yield from hand.click((x, y + 2 * ROW))
    yield from hand.picture("modes-in-the-panel")
    yield from hand.choose_row(2)
    assert_modes({1: 2, 20: 1, 40: 1})
    turns = yield from hand.find_button(view, "UI", "rigid_motion.turns")
    yield from hand.click(turns)
    yield from hand.type("3")
    yield from hand.press("RET")
    assert cube().rigid_motion.turns == 3
    assert_modes({1: 2, 20: 1, 40: 1})
    yield from hand.picture("panel")
    yield from hand.hover(places.centre(places.region(view)))
    for _ in range(4):
        yield from hand.press("Z", ctrl=True)
    assert_modes({})


def baked(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Bake by the button and its dialog; unbake by F3."""
    button = yield from hand.find_button(view, "UI", "rigid_motion.bake")
    yield from hand.click(button)
    yield from hand.picture("bake")
    yield from hand.press("RET")
    assert len(cube().rigid_motion.bakes) == 1, "the dialog bakes"
    yield from hand.picture("baked")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.search("Un-Bake")
    assert len(cube().rigid_motion.bakes) == 0
    assert_modes({1: 2, 20: 1, 40: 0})
