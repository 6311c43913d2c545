"""Bones in Pose Mode, edited by hand: a mode from the pie, Auto Key between keys, undo, and the tool Edit Path."""

from __future__ import annotations

import math

import bpy
import numpy as np

from rigid_motion import animation
from tests.animation.bones.poses import assert_posed, seen
from tests.animation.keyed import key_frames
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import FRAMES, hand_bone, only_the_hand, pose_the_rig, rig
from tests.gui.scenarios.trail import take_the_tool

WHOLE = range(1, 46, 2)
SCREW = "dq_sclerp"

ALIKE = 2e-5
"""Tolerance for equal poses, in metres and for elements of a rotation matrix."""

APART = 0.1
"""The screw is at least this far from Blender's own path halfway between keys, in metres."""


def assert_as_keyed(*frames: float) -> None:
    """Check that the hand has keys on these frames, and that both bones are where their modes put them."""
    assert key_frames(hand_bone()).tolist() == list(frames), key_frames(hand_bone())
    assert_posed(rig(), WHOLE, ("Arm", "Hand"))


def scenario(hand: Hand) -> Steps[None]:
    """An animator chooses the screw for an arm and a hand, and continues to edit them."""
    view = yield from pose_the_rig(hand)
    yield from chosen(hand)
    yield from only_the_hand(hand, view)
    yield from turned(hand)
    yield from take_the_tool(hand, view)
    yield from hand.press("A")
    assert animation.key_frames(hand_bone(), selected=True).tolist() == [*FRAMES], "on the path of the bone"


def chosen(hand: Hand) -> Steps[None]:
    """Choose the screw for all bones in the pie; undo and redo it."""
    native = seen(rig(), "Hand")
    yield from hand.pie("T", "E", alt=True, picture="pie")
    assert {bone.rigid_motion.mode for bone in rig().pose.bones} == {SCREW}
    assert_as_keyed(*FRAMES)
    assert np.abs(seen(rig(), "Hand") - native)[:3, 3].max() > APART, "the screw is not Blender's own way"
    yield from hand.press("Z", ctrl=True)
    np.testing.assert_allclose(seen(rig(), "Hand"), native, atol=ALIKE)
    yield from hand.press("Z", ctrl=True, shift=True)
    assert_as_keyed(*FRAMES)


def turned(hand: Hand) -> Steps[None]:
    """Press R Z with Auto Key on a frame between keys: the visible pose is keyed. Undo it."""
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = True
    bpy.context.scene.frame_set(30)
    yield
    stood = seen(rig(), "Hand")
    for key in ("R", "Z"):
        yield from hand.press(key)
    yield from hand.type("30")
    yield from hand.press("RET")
    yield from hand.wait_until(lambda: 30.0 in key_frames(hand_bone()), "the turned hand is keyed")
    turn, cos, sin = np.eye(3), math.cos(math.radians(30)), math.sin(math.radians(30))
    turn[:2, :2] = (cos, -sin), (sin, cos)
    stood[:3, :3] = turn @ stood[:3, :3]
    np.testing.assert_allclose(seen(rig(), "Hand"), stood, atol=ALIKE)
    assert_as_keyed(1, 20, 30, 40)
    np.testing.assert_allclose(seen(rig(), "Hand"), stood, atol=ALIKE)
    yield from hand.picture("turned")
    yield from undo_until_keyed(hand, *FRAMES)


def undo_until_keyed(hand: Hand, *frames: float) -> Steps[None]:
    """Undo until the hand has keys on these frames, and check that the bones are where their modes put them."""
    for _ in range(8):
        yield from hand.press("Z", ctrl=True)
        if key_frames(hand_bone()).tolist() == list(frames):
            break
    assert_as_keyed(*frames)
