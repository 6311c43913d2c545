"""Editing of a prop's path by hand: keys selected, moved, rotated, retimed, inserted and deleted with the mouse.

Each edit is one step of undo and redo.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Vector

from rigid_motion.animation import key_frames
from tests.animation.keyed import snapshot
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import FRAMES, cube, key_the_cube, on_screen
from tests.gui.places import Place

NEAR_PX = 3
"""Tolerance in pixels between a dragged key and the mouse."""


def scenario(hand: Hand) -> Steps[None]:
    key_the_cube()
    cube().scale = (0.4, 0.6, 0.25)
    view = hand.area("VIEW_3D")
    view.spaces.active.region_3d.view_distance = 14
    bpy.ops.rigid_motion.set_mode(mode="motor_spline")
    yield from take_the_tool(hand, view)
    yield from selected(hand, view)
    for edit in (moved, dragged, turned, retimed, inserted, deleted):
        yield from edit(hand, view)


def take_the_tool(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.search("Edit Path")
    mode = bpy.context.mode
    yield from hand.wait_until(
        lambda: bpy.context.workspace.tools.from_space_view3d_mode(mode).idname == "rigid_motion.edit_path",
        "the tool is taken",
    )
    assert bpy.context.scene.rigid_motion_overlay.show_paths
    yield from hand.picture(f"tool-{mode.lower()}", places.box(places.region(view)))


def at(view: bpy.types.Area, frame: float) -> Place:
    """Return the place of the cube on the screen, on a frame."""
    scene = bpy.context.scene
    before = scene.frame_current
    where = world_of(frame)
    scene.frame_set(before)
    return places.point(view, where)


def drag(hand: Hand, first: Place, last: Place, steps: int = 6, **modifiers: bool) -> Steps[None]:
    """Press the left button at a place, and release it at another."""
    yield from hand.hover(first)
    held = [f"LEFT_{name.upper()}" for name in modifiers]
    for name in held:
        hand._event(name, "PRESS", **modifiers)
    hand._event("LEFTMOUSE", "PRESS", **modifiers)
    yield
    for step in range(1, steps + 1):
        hand.place = tuple(a + (b - a) * step // steps for a, b in zip(first, last, strict=True))
        hand._event("MOUSEMOVE", "NOTHING", **modifiers)
        yield 0
    hand._event("LEFTMOUSE", "RELEASE", **modifiers)
    for name in held:
        hand._event(name, "RELEASE")
    yield


def assert_at(view: bpy.types.Area, frame: float, place: Place) -> None:
    """Check that the cube is at a place on the screen, on a frame."""
    off = np.subtract(at(view, frame), place)
    assert np.abs(off).max() <= NEAR_PX, (frame, off)


def back_and_forth(hand: Hand, before: dict) -> Steps[None]:
    """Check that the edit is one step of undo and redo; end with it undone."""
    after = snapshot(cube())
    assert after != before
    yield from hand.press("Z", ctrl=True)
    assert snapshot(cube()) == before, "one step back"
    yield from hand.press("Z", ctrl=True, shift=True)
    assert snapshot(cube()) == after, "and forth"
    yield from hand.press("Z", ctrl=True)
    assert snapshot(cube()) == before


def frames_selected() -> list[float]:
    return key_frames(cube(), selected=True).tolist()


def selected(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    yield from hand.press("A", alt=True)
    assert frames_selected() == []
    yield from hand.click(at(view, FRAMES[1]))
    assert frames_selected() == [FRAMES[1]]
    yield from hand.click(at(view, FRAMES[0]), shift=True)
    assert frames_selected() == [*FRAMES[:2]]
    yield from hand.press("A")
    assert frames_selected() == [*FRAMES]
    keys = [at(view, frame) for frame in FRAMES[1:]]
    low, high = np.min(keys, axis=0) - 30, np.max(keys, axis=0) + 30
    yield from drag(hand, (int(low[0]), int(high[1])), (int(high[0]), int(low[1])))
    assert frames_selected() == [*FRAMES[1:]], "a box from where no key is"
    yield from hand.press("B")
    first = at(view, FRAMES[0])
    yield from drag(hand, (first[0] - 30, first[1] - 30), (first[0] + 30, first[1] + 30))
    assert frames_selected() == [FRAMES[0]]
    yield from hand.picture("selected", places.box(places.region(view)))


def moved(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Move keys by G: to the mouse, cancelled, and along an axis by a number."""
    yield from hand.click(at(view, FRAMES[1]))
    before, (x, y) = snapshot(cube()), at(view, FRAMES[1])
    yield from hand.press("G")
    yield from hand.glide((x + 60, y + 40))
    assert_at(view, FRAMES[1], (x + 60, y + 40))
    yield from hand.picture("moving-cube", places.box(view))
    yield from hand.picture("path-of-cube", places.box_around((x, y), 700, 420))
    yield from hand.press("ESC")
    assert snapshot(cube()) == before, "Esc brings all back"

    place = world_of(FRAMES[1])
    yield from hand.press("G")
    yield from hand.press("Z")
    yield from hand.type("0.5")
    yield from hand.press("RET")
    assert (world_of(FRAMES[1]) - place - Vector((0, 0, 0.5))).length < 1e-5
    yield from back_and_forth(hand, before)


def world_of(frame: float) -> Vector:
    """Return the place of the cube in the world, on a frame."""
    bpy.context.scene.frame_set(int(frame))
    return Vector(on_screen("Cube")[:3, 3])


def dragged(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Drag a key with the left button, which also selects it."""
    before, (x, y) = snapshot(cube()), at(view, FRAMES[0])
    yield from drag(hand, (x, y), (x + 40, y - 50))
    assert frames_selected() == [FRAMES[0]]
    assert_at(view, FRAMES[0], (x + 40, y - 50))
    yield from hand.press("Z", ctrl=True)
    assert snapshot(cube()) == before


def turned(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Rotate keys by R: with the mouse, and about Z by degrees."""
    yield from hand.click(at(view, FRAMES[1]))
    before, (x, y) = snapshot(cube()), at(view, FRAMES[1])
    yield from hand.hover((x + 120, y))
    yield from hand.press("R")
    yield from hand.glide((x, y + 120))
    assert_at(view, FRAMES[1], (x, y))
    yield from hand.picture("turning-cube", places.box(view))
    yield from hand.press("ESC")
    assert snapshot(cube()) == before
    yield from hand.press("R")
    yield from hand.press("Z")
    yield from hand.type("90")
    yield from hand.press("RET")
    yield from back_and_forth(hand, before)


def retimed(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Retime a key: drag it with Alt along the path to its place five frames later."""
    before = snapshot(cube())
    later = at(view, FRAMES[1] + 5)
    yield from drag(hand, at(view, FRAMES[1]), later, alt=True)
    frames = key_frames(cube()).tolist()
    assert frames[::2] == [FRAMES[0], FRAMES[2]]
    assert abs(frames[1] - FRAMES[1] - 5) <= 1, frames
    yield from hand.picture("retimed-cube", places.box(places.region(view)))
    yield from back_and_forth(hand, before)


def inserted(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Insert a key by Ctrl-clicking on the path."""
    before, frame = snapshot(cube()), 30
    yield from hand.click(at(view, frame), ctrl=True)
    frames = key_frames(cube()).tolist()
    assert len(frames) == 4
    assert abs(frames[2] - frame) <= 1, frames
    assert frames_selected() == [frames[2]]
    yield from hand.picture("inserted-cube", places.box(places.region(view)))
    yield from back_and_forth(hand, before)


def deleted(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    before = snapshot(cube())
    yield from hand.click(at(view, FRAMES[1]))
    yield from hand.press("X")
    assert key_frames(cube()).tolist() == [FRAMES[0], FRAMES[2]]
    assert cube(), "the thing itself is still there"
    yield from back_and_forth(hand, before)
