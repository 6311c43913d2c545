"""The constraint of a bone in its tab, muted and removed and restored by hand; and bones baked from the menus.

Where the bones are seen is held against `tests.animation.oracle`, as in `bones_by_hand`.
"""

from __future__ import annotations

import bpy
import numpy as np

from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.scenarios.bones_by_hand import (
    ALIKE,
    APART,
    FRAMES,
    assert_as_keyed,
    hand_bone,
    key_frames,
    only_the_hand,
    pose_the_rig,
    shown,
)

CONSTRAINT = "Rigid Motion"


def scenario(hand: Hand) -> Steps[None]:
    """An animator looks into the constraint of the hand, and bakes the hand alone."""
    view = yield from pose_the_rig(hand)
    yield from hand.pie("T", "E", alt=True)
    assert_as_keyed(*FRAMES)
    yield from only_the_hand(hand, view)
    yield from tampered_with(hand, view)
    yield from baked(hand, view)


def tampered_with(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """The eye of the constraint in its tab, off and on; taken off, and restored from the panel."""
    before = shown()
    properties = hand.area("PROPERTIES")
    properties.spaces.active.context = "BONE_CONSTRAINT"
    yield 0.5
    yield from hand.picture("constraint")
    eye = yield from hand.find_button(properties, "WINDOW", "enabled", narrow=True)
    yield from hand.click(eye)
    assert hand_bone().constraints[CONSTRAINT].mute
    assert np.abs(shown() - before).max() > APART, "muted, it shows Blender's own in-betweens"
    yield from hand.open_sidebar(view, "Animation")
    yield from hand.picture("muted")
    yield from hand.open_sidebar(view, "Item")
    yield from hand.click(eye)
    np.testing.assert_allclose(shown(), before, atol=ALIKE)

    hand_bone().constraints.remove(hand_bone().constraints[CONSTRAINT])
    bpy.ops.ed.undo_push(message="Remove Constraint")
    yield 0.5
    assert np.abs(shown() - before).max() > APART
    yield from hand.picture("removed")
    button = yield from hand.find_button(hand.area("DOPESHEET_EDITOR"), "UI", "rigid_motion.mend")
    yield from hand.click(button)
    np.testing.assert_allclose(shown(), before, atol=ALIKE)
    yield from hand.picture("restored")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    assert CONSTRAINT not in hand_bone().constraints
    yield from hand.press("Z", ctrl=True, shift=True)
    np.testing.assert_allclose(shown(), before, atol=ALIKE)


def baked(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """From the menus of Pose Mode, and back: the same poses all the while."""
    before = shown()
    yield from hand.open_menu(view, "VIEW3D_MT_pose")
    yield from hand.picture("pose-menu")
    yield from hand.choose("Bake to Keys")
    yield from hand.press("RET")
    assert key_frames() == [float(frame) for frame in range(1, 41)], key_frames()
    assert key_frames("Arm") == list(FRAMES)
    np.testing.assert_allclose(shown(), before, atol=ALIKE)
    yield from hand.picture("baked")
    yield from hand.click(places.centre(places.region(view)), button="RIGHTMOUSE")
    yield 0.3
    yield from hand.picture("context-menu")
    yield from hand.choose("Un-Bake")
    assert_as_keyed(*FRAMES)
    np.testing.assert_allclose(shown(), before, atol=ALIKE)
    yield from hand.picture("un-baked")
