"""Bones in Pose Mode: Breakdown and Relax from menus, dragged, confirmed, cancelled and undone; the tool Edit Path."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion import animation
from rigid_motion.motion import Poses, interpolate
from tests.animation.keyed import key_frames, snapshot
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import FRAMES, hand_bone, now, pose_the_rig
from tests.gui.scenarios.trail import take_the_tool

FRAME, WAY = 8, 300
SCREW = "dq_sclerp"

ALIKE = 2e-5
"""Tolerance for equal poses, in metres and for elements of a rotation matrix."""


def scenario(hand: Hand) -> Steps[None]:
    view = yield from pose_the_rig(hand)
    yield from hand.pie("T", "E", alt=True)
    assert hand_bone().rigid_motion.mode == SCREW
    bpy.context.scene.frame_set(FRAME)
    bpy.ops.ed.undo_push(message="Screw")
    yield from dragged_and_cancelled(hand, view)
    yield from dragged_and_confirmed(hand, view)
    yield from in_the_dope_sheet(hand, hand.area("DOPESHEET_EDITOR"))
    yield from take_the_tool(hand, view)
    yield from hand.press("A")
    assert animation.key_frames(hand_bone(), selected=True).tolist() == [*FRAMES], "on the path of the bone"


def assert_on_the_screw(factor: float) -> None:
    """Check that the hand is at a fraction of the way between its first two keys, as `make_the_rig` sets them."""
    quaternions = [(np.cos(a / 2), 0.6 * np.sin(a / 2), 0.0, 0.8 * np.sin(a / 2)) for a in (0.0, 1.6)]
    keys = Poses([(-1.0, -0.3, 0.4), (0.0, 0.0, 0.0)], quaternions)
    expected = interpolate((0.0, 1.0), keys, np.array([factor]), SCREW, extrapolate=True)
    np.testing.assert_allclose(now()[:3, 3], expected.positions[0], atol=ALIKE)
    turned = np.array(hand_bone().rotation_quaternion.normalized())
    np.testing.assert_allclose(turned * np.sign(turned @ expected.quaternions[0]), expected.quaternions[0], atol=ALIKE)
    assert key_frames(hand_bone()).tolist() == [1, FRAME, 20, 40]


def start(hand: Hand, view: bpy.types.Area) -> Steps[tuple[int, int]]:
    """Run Breakdown from Pose > In-Betweens; return the place of the mouse."""
    centre = places.centre(places.region(view))
    yield from hand.hover(centre)
    with bpy.context.temp_override(window=hand.window, area=view, region=places.region(view)):
        bpy.ops.wm.call_menu("INVOKE_DEFAULT", name="VIEW3D_MT_pose_slide")
    yield 0.3
    yield from hand.choose("Breakdown along Mode")
    yield 0.2
    return hand.place


def dragged_and_cancelled(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    before, seen, steps = snapshot(hand_bone()), now(), undo_steps()
    x, y = yield from start(hand, view)
    assert_on_the_screw(0.5)
    yield from hand.glide((x + WAY // 5, y), 4)
    yield
    assert_on_the_screw(0.7)
    yield from hand.picture("dragged")
    yield from hand.press("ESC")
    assert snapshot(hand_bone()) == before, "Esc leaves the keys as they were"
    np.testing.assert_allclose(now(), seen, atol=1e-6)
    assert undo_steps() == steps, "and no undo step"


def dragged_and_confirmed(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    before, steps = snapshot(hand_bone()), undo_steps()
    x, y = yield from start(hand, view)
    yield from hand.glide((x - 3 * WAY // 10, y), 4)
    yield from hand.click()
    assert_on_the_screw(0.2)
    assert undo_steps() == steps + 1
    yield from hand.press("Z", ctrl=True)
    assert snapshot(hand_bone()) == before, "one step back"


def in_the_dope_sheet(hand: Hand, sheet: bpy.types.Area) -> Steps[None]:
    """Run Relax by F3 for the bones whose channels are shown; the header shows the factor. A right click cancels."""
    before = snapshot(hand_bone())
    yield from hand.hover(places.centre(places.region(sheet)))
    for ending in ("RET", "RIGHTMOUSE"):
        yield from hand.search("Relax to In-Between of Mode")
        yield 0.2
        yield from hand.picture("dope-sheet")
        yield from hand.press(ending)
        if ending == "RET":
            assert key_frames(hand_bone()).tolist() == [1, FRAME, 20, 40]
            yield from hand.press("Z", ctrl=True)
        assert snapshot(hand_bone()) == before


def undo_steps() -> int:
    """Return how many operators Blender remembers."""
    return len(bpy.context.window_manager.operators)
