"""Pops on the path of the cube are marked, buttons in the sidebar jump to them, and Clean Motion takes them out."""

from __future__ import annotations

import bpy
import numpy as np

from tests.animation.keyed import curves_of
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import cube

POPS = (24, 51)
JITTER = 0.005


def marks(hand: Hand, view: bpy.types.Area, name: str) -> Steps[int]:
    """Take a picture of the viewport, and return the number of pixels of marks."""
    part = places.region(view)
    pixels = yield from hand.picture(name, places.box(part))
    shown = pixels[:, : part.width * 3 // 4] / 255
    return int((np.abs(shown - (1.0, 0.15, 0.75)).max(axis=2) < 0.06).sum())


def scenario(hand: Hand) -> Steps[None]:
    obj, scene, random = cube(), bpy.context.scene, np.random.default_rng(7)
    obj.scale = (0.3, 0.3, 0.3)
    for frame in range(1, 71):
        angle = frame / 20.0
        place = (3.0 * np.cos(angle), 3.0 * np.sin(angle), 0.04 * frame + 0.25 * (frame in POPS))
        obj.location = place + JITTER * random.normal(size=3)
        obj.keyframe_insert("location", frame=frame)
    scene.frame_end = 70
    scene.frame_set(1)
    view = hand.area("VIEW_3D")
    view.spaces.active.region_3d.view_distance = 14
    yield from hand.open_sidebar(view, "Animation")
    show = yield from hand.find_button(view, "UI", "show_paths", narrow=True)
    yield from hand.click(show)
    yield from hand.click((show[0] + 60, show[1]))  # the header, to unfold the panel
    assert not (yield from marks(hand, view, "without"))
    deviations = yield from hand.find_button(view, "UI", "show_deviations")
    yield from hand.click(deviations)
    assert scene.rigid_motion_overlay.show_deviations
    yield from hand.hover((places.centre(places.region(view))[0] // 2, 200))
    seen = yield from marks(hand, view, "marked")
    assert seen > 60, seen
    assert scene.frame_current == 1
    before = yield from hand.find_button(view, "UI", "rigid_motion.go_to_deviation", narrow=True)
    yield from hand.click((before[0] + round(23 * bpy.context.preferences.system.ui_scale), before[1]))
    assert scene.frame_current == POPS[0], scene.frame_current
    yield from hand.press("LEFTMOUSE")
    assert scene.frame_current == POPS[1], scene.frame_current
    yield from hand.click(before)
    assert scene.frame_current == POPS[0], scene.frame_current
    yield from marks(hand, view, "gone-to")
    yield from cleaned(hand, view)


def cleaned(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Click the button, move the keys less far in the redo panel, and undo it."""
    shaky = jerks()
    yield from hand.click((yield from hand.find_button(view, "UI", "rigid_motion.clean_motion")))
    yield from hand.wait_until(lambda: jerks() < 0.3 * shaky, "the button takes the jitter out")
    full = jerks()
    redo = yield from hand.unfold_redo_panel(view)
    yield from hand.picture("cleaned", places.box(view))
    yield from hand.enter("0.5", places.redo_row(redo, 0))
    yield from hand.wait_until(lambda: 1.5 * full < jerks() < 0.9 * shaky, "half of the jitter")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: abs(jerks() - shaky) < 1e-6, "one step takes all of it back")


def jerks() -> float:
    """Return the mean jerkiness of the keys: their fourth differences from frame to frame."""
    values = [[key.co.y for key in fcurve.keyframe_points] for fcurve in curves_of(cube()).values()]
    return float(np.abs(np.diff(values, n=4)).mean())
