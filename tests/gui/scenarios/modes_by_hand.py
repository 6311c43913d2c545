"""A mode chosen from the menus, by the pies and in the panel, with refusals, undo and baking, all by mouse and keys."""

from __future__ import annotations

import bpy
import numpy as np

from tests.animation.keyed import curve_of
from tests.animation.oracle import assert_shown, shown_worlds
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import cube, key_the_cube

BETWEEN = range(4, 41, 9)
BLENDER, STRAIGHT, SCREW, SMOOTH = "BLENDER", "lerp_slerp", "dq_sclerp", "motor_spline"

ROW = 26
"""Pixels from one row of a panel to the next."""


def assert_modes(keys: dict[float, int], of_object: str = BLENDER) -> None:
    """The cube has this mode or else these keys of modes, and on every frame it is where they have it."""
    assert cube().rigid_motion.mode == of_object or keys, cube().rigid_motion.mode
    assert mode_keys() == keys, mode_keys()
    assert_shown([cube()], BETWEEN)


def mode_keys() -> dict[float, int]:
    """The keys of the cube's modes: frame and number of the mode."""
    curve = curve_of(cube(), "rigid_motion.mode")
    return {} if curve is None else {key.co.x: round(key.co.y) for key in curve.keyframe_points}


def scenario(hand: Hand) -> Steps[None]:
    """An animator tries modes on the cube in three editors, takes some back, and bakes."""
    yield from hand.open_animation_workspace()
    view, sheet = hand.area("VIEW_3D"), hand.area("DOPESHEET_EDITOR")
    key_the_cube()
    yield from in_the_viewport(hand, view)
    yield from in_the_panel(hand, view)
    yield from in_the_dope_sheet(hand, sheet)
    yield from baked(hand, view)
    sheet.type = "GRAPH_EDITOR"
    yield from in_the_graph_editor(hand, sheet)


def in_the_viewport(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """By the pie, taken back, from the Object menu and from the context menu: for the whole object."""
    centre = places.centre(places.region(view))
    around = places.box_around(centre, 840, 380)
    yield from hand.hover(centre)
    yield from hand.pie("T", "N", alt=True)
    assert_modes({}, SMOOTH)
    yield from hand.hover(centre)
    yield from hand.press("Z", ctrl=True)
    assert_modes({}, BLENDER)
    yield from hand.pie("T", "E", picture="pie", box=around, alt=True)
    assert_modes({}, SCREW)
    yield from hand.press("Z", ctrl=True)
    assert_modes({}, BLENDER)
    yield from hand.press("Z", ctrl=True, shift=True)
    assert_modes({}, SCREW)

    yield from hand.open_menu(view, "VIEW3D_MT_object")
    yield from hand.choose("Vector + Quaternion")
    assert_modes({}, STRAIGHT)
    yield from hand.click(centre, button="RIGHTMOUSE")
    yield from hand.picture("context-menu")
    yield from hand.choose("Clear Modes")
    assert_modes({}, BLENDER)

    cube().rotation_mode = "AXIS_ANGLE"
    yield from hand.hover(centre)
    yield from hand.pie("T", "E", alt=True)
    yield from hand.picture("refused")
    yield from hand.press("ESC")
    assert cube().rigid_motion.mode == BLENDER, "an object that turns by axis and angle refuses"
    cube().rotation_mode = "QUATERNION"


def in_the_dope_sheet(hand: Hand, sheet: bpy.types.Area) -> Steps[None]:
    """From the Key menu, the context menu and by the pie: for the selected keys."""
    yield from hand.click(places.key(sheet, 1))
    yield from hand.open_menu(sheet, "DOPESHEET_MT_key")
    yield from hand.press("UP_ARROW")
    yield from hand.press("RIGHT_ARROW")
    yield from hand.picture("menu", (sheet.x, sheet.y + sheet.height - 120, 920, 620))
    yield from hand.choose("Screw (Dual Quaternion)")
    yield from hand.picture("panel-of-keys", places.box(places.region(sheet, "UI")))
    assert_modes({1: 2, 20: 0})
    yield from hand.press("F9")
    yield from hand.picture("adjust-last-operation")
    yield from hand.press("ESC")
    yield from hand.click(places.key(sheet, 20))
    yield from hand.click(button="RIGHTMOUSE")
    yield from hand.choose("Motor Blend (PGA)")
    assert_modes({1: 2, 20: 3, 40: 0})
    yield from hand.hover(places.key(sheet, 100))
    yield from hand.pie("T", "SW", picture="pie-of-keys", alt=True)
    assert_modes({1: 2, 20: 6, 40: 0})
    yield from hand.press("A", alt=True)
    yield from hand.pie("T", "E", alt=True)
    yield from hand.picture("no-key-selected")
    yield from hand.press("ESC")
    assert mode_keys() == {1: 2, 20: 6, 40: 0}, "without a selected key nothing changes"


def in_the_panel(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """For the object by its property, then for the segment under the playhead; its turns, and exact between frames."""
    yield from hand.open_sidebar(view, "Animation")
    x, y = yield from hand.find_button(view, "UI", "rigid_motion.mode")
    yield from hand.click((x, y))
    yield from hand.choose_row(3)
    assert_modes({}, STRAIGHT)
    yield from hand.click((x, y - ROW))
    yield from hand.picture("modes-in-the-panel")
    yield from hand.choose_row(2)
    assert_modes({1: 2, 20: 1})
    turns = yield from hand.find_button(view, "UI", "rigid_motion.turns")
    yield from hand.click(turns)
    yield from hand.type("3")
    yield from hand.press("RET")
    assert cube().rigid_motion.turns == 3
    assert_modes({1: 2, 20: 1})
    exact = yield from hand.find_button(view, "UI", "rigid_motion.exact")
    yield from hand.click(exact)
    assert cube().constraints.keys() == ["Rigid Motion"]
    yield from hand.picture("panel")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.search("Set Turns")
    yield from hand.press("RET")
    last = bpy.context.window_manager.operators[-1]
    assert (last.bl_idname, last.turns) == ("RIGID_MOTION_OT_set_turns", 3), "it begins with the turns that there are"
    for _ in range(5):
        yield from hand.press("Z", ctrl=True)
    assert not cube().constraints
    assert_modes({}, BLENDER)


def baked(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """By the button and its dialog; and back by F3."""
    before = shown_worlds([cube()], BETWEEN)[0]
    button = yield from hand.find_button(view, "UI", "rigid_motion.bake")
    yield from hand.click(button)
    yield from hand.picture("bake")
    yield from hand.press("RET")
    assert len(cube().rigid_motion.bakes) == 1, "the dialog bakes"
    np.testing.assert_allclose(shown_worlds([cube()], BETWEEN)[0], before, atol=1e-5)
    yield from hand.picture("baked")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.search("Un-Bake")
    assert len(cube().rigid_motion.bakes) == 0
    assert_modes({1: 2, 20: 6, 40: 0})


def in_the_graph_editor(hand: Hand, graph: bpy.types.Area) -> Steps[None]:
    """From the Key menu."""
    yield
    yield from hand.hover(places.centre(places.region(graph)))
    yield from hand.press("A")
    yield from hand.open_menu(graph, "GRAPH_MT_key")
    yield from hand.choose("Vector + Quaternion")
    assert_modes({1: 1, 20: 1, 40: 1})
    yield from hand.picture("graph-editor")
