"""Holding by hand: a bone of a rig picks up a mug, hands it over to another bone and lets it go.

By clicks and keys: the pie, its menu, the sidebar, the Key menu of the Dope Sheet, and the redo panel.
"""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion.animation import hold_facts
from tests.animation.bones.rigs import select_bones
from tests.gui import places
from tests.gui.driver import FOLDED_PANEL, Hand, Steps
from tests.gui.keyed import on_screen, pose_the_rig, rig

TAKEN, PASSED, FREE = 10, 20, 34

SLIP = 2e-6
"""Tolerance for the mug's place in its holder: for elements of its matrix, lengths in metres."""


def mug() -> bpy.types.Object:
    return bpy.data.objects["Mug"]


def now() -> str:
    """Return the name of the bone that holds the mug, "" for none."""
    holder = hold_facts(mug()).now
    return "" if holder is None else holder.bone


def scenario(hand: Hand) -> Steps[None]:
    """An animator passes a mug between the bones of an arm."""
    view, sheet = (yield from pose_the_rig(hand)), hand.area("DOPESHEET_EDITOR")
    obj = bpy.data.objects.new("Mug", bpy.data.meshes.new("Mug"))
    obj.data.from_pydata([(0, 0, 0), (0.2, 0, 0), (0, 0.2, 0), (0, 0, 0.3)], [], [(0, 1, 2), (0, 1, 3), (1, 2, 3)])
    obj.location, obj.rotation_mode = (0.4, 0.3, 1.8), "QUATERNION"
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.scene.frame_end = 40
    yield from hand.open_sidebar(sheet, "Animation")
    yield from picked_up(hand, view)
    yield from handed_over(hand, sheet)
    yield from let_go(hand, view)
    yield from seen_in_the_sheet(hand, sheet)
    yield from seen_along_its_path(hand, view)


def at(frame: int, bone: str) -> Steps[None]:
    """Go to a frame, and select the mug and then a bone."""
    bpy.context.scene.frame_set(frame)
    mug().select_set(True)
    select_bones(rig(), bone)
    bpy.ops.ed.undo_push(message="Select")
    yield


def picked_up(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Pick the mug up by the pie; undo and redo it as one step."""
    yield from at(TAKEN, "Hand")
    there = on_screen("Mug")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.pie("T", "NE", alt=True, picture="pie")
    yield 0.3
    yield from hand.picture("hold-menu")
    yield from hand.choose("Hold In")
    yield from hand.wait_until(lambda: now() == "Hand", "the hand holds the mug")
    assert np.abs(on_screen("Mug") - there).max() < SLIP
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: now() == "" and not mug().animation_data, "one undo takes it all back")
    yield from hand.press("Z", ctrl=True, shift=True)
    yield from hand.wait_until(lambda: now() == "Hand", "redone")


def handed_over(hand: Hand, sheet: bpy.types.Area) -> Steps[None]:
    """Hand the mug over by the Dope Sheet's Key menu, then over more frames in the redo panel."""
    yield from at(PASSED, "Arm")
    yield from hand.open_menu(sheet, "DOPESHEET_MT_key")
    yield from hand.choose("Hold In")
    yield from hand.wait_until(lambda: now() == "Arm", "the arm holds the mug")
    assert hold_facts(mug()).frames == 4
    yield from set_in_redo_panel(hand, sheet, 6)


def set_in_redo_panel(hand: Hand, area: bpy.types.Area, frames: int) -> Steps[None]:
    """Set the number of frames of a transition in the unfolded redo panel."""
    redo = yield from hand.unfold_redo_panel(area)
    yield from hand.picture(f"redo-{frames}")
    yield from hand.enter(str(frames), places.redo_row(redo, 0))
    yield from hand.wait_until(lambda: hold_facts(mug()).frames == frames, f"it passes over {frames} frames")


def let_go(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Let the mug go over three frames: in the dialog of Pass, and in the redo panel."""
    yield from at(FREE, "Arm")
    for verb in ("Let Go", "Pass"):
        yield from hand.hover(places.centre(places.region(view)))
        yield from hand.pie("T", "NE", alt=True)
        yield 0.3
        yield from hand.choose(verb)
        yield from hand.wait_until(lambda: now() == "", "the mug is let go")
    yield 0.3
    yield from hand.picture("pass")
    yield from hand.press("RET")
    yield from set_in_redo_panel(hand, view, 3)


def seen_in_the_sheet(hand: Hand, sheet: bpy.types.Area) -> Steps[None]:
    """Set the number of frames of a transition in the panel."""
    bpy.ops.object.mode_set(mode="OBJECT")
    rig().select_set(False)
    bpy.context.view_layer.objects.active = mug()
    bpy.context.scene.frame_set(PASSED)
    bpy.ops.ed.undo_push(message="Select")
    yield
    x, y = yield from hand.find_button(sheet, "UI", "show_paths", narrow=True)
    yield from hand.click((x + 60, y - FOLDED_PANEL))
    yield 0.3
    yield from hand.picture("panel")
    number = yield from hand.find_button(sheet, "UI", "rigid_motion_pass")
    yield from hand.click((number[0] + FOLDED_PANEL, number[1] + FOLDED_PANEL))
    yield 0.3
    yield from hand.picture("holders")
    yield from hand.press("ESC")
    yield from hand.enter("5", number)
    yield from hand.wait_until(lambda: hold_facts(mug()).frames == 5, "the number in the panel is at the key")
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: hold_facts(mug()).frames == 6, "undone")


def seen_along_its_path(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Take a picture of the path in the colours of the holders."""
    settings = bpy.context.scene.rigid_motion_overlay
    settings.show_paths = settings.show_ghosts = True
    yield from hand.picture("path", places.box(places.region(view)))
