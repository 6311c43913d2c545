"""Menus, pie menus, search, sidebar and buttons of Blender itself, each reached as an animator reaches them."""

from __future__ import annotations

import bpy
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from tests.gui import places
from tests.gui.driver import Hand, Steps


def cube() -> bpy.types.Object:
    """The default cube, asked for anew each time: undo replaces it."""
    return bpy.data.objects["Cube"]


def interpolations() -> list[str]:
    """How the keys of the cube's x location go on."""
    animation = cube().animation_data
    curves = action_get_channelbag_for_slot(animation.action, animation.action_slot).fcurves
    return [key.interpolation for key in curves.find("location", index=0).keyframe_points]


def scenario(hand: Hand) -> Steps[None]:
    """Two keys get their interpolation from two menus; a pie, a search, a field and a list do their part."""
    hand.window.workspace = bpy.data.workspaces["Animation"]
    yield from hand.wait_until(lambda: hand.window.screen.name == "Animation", "the Animation workspace opens")
    view, sheet = hand.area("VIEW_3D"), hand.area("DOPESHEET_EDITOR")
    for frame in (1, 50):
        cube().keyframe_insert("location", frame=frame)
    yield

    yield from hand.click(places.key(sheet, 1))
    yield from hand.open_menu(sheet, "DOPESHEET_MT_key")
    yield from hand.picture("key-menu")
    yield from hand.choose("Linear")
    assert interpolations() == ["LINEAR", "BEZIER"], interpolations()

    yield from hand.click(places.key(sheet, 50))
    yield from hand.click(button="RIGHTMOUSE")
    yield from hand.choose("Constant")
    assert interpolations() == ["LINEAR", "CONSTANT"], interpolations()

    yield from hand.hover(places.centre(view))
    yield from hand.pie("PERIOD", "E", picture="pivot-pie")
    assert bpy.context.scene.tool_settings.transform_pivot_point == "CURSOR"

    yield from hand.search("Shade Auto Smooth")
    assert [modifier.name for modifier in cube().modifiers] == ["Smooth by Angle"]

    yield from hand.open_sidebar(view, "View")
    lens = yield from hand.find_button(view, "UI", "lens")
    yield from hand.click(lens)
    yield from hand.press("A", ctrl=True)
    yield from hand.type("85")
    yield from hand.press("RET")
    assert view.spaces.active.lens == 85
    yield from hand.open_sidebar(view, "Item")
    mode = yield from hand.find_button(view, "UI", "rotation_mode")
    yield from hand.click(mode)
    yield from hand.picture("rotation-modes")
    yield from hand.choose_row(2)
    assert cube().rotation_mode == "XZY", cube().rotation_mode
    yield from hand.picture("sidebar")
