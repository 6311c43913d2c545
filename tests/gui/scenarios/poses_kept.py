"""Poses of a bone copied, and pasted between two of its keys: what is pasted, also with Auto Key, is what was seen."""

from __future__ import annotations

import bpy
import numpy as np

from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.scenarios.bones_by_hand import (
    ALIKE,
    APART,
    FRAMES,
    SCREW,
    hand_bone,
    key_frames,
    now,
    only_the_hand,
    pose_the_rig,
    shown,
)

BETWEEN, OTHER = 10, 30


def scenario(hand: Hand) -> Steps[None]:
    """From an in-between by Ctrl C and by the menu, from a key with Auto Key and without; each undone again."""
    view = yield from pose_the_rig(hand)
    native = shown()
    yield from hand.pie("T", "E", alt=True)
    assert hand_bone().rigid_motion.mode == SCREW
    yield from only_the_hand(hand, view)
    assert np.abs(shown() - native).max() > APART
    copied = yield from _go(BETWEEN)
    yield from hand.press("C", ctrl=True)
    yield from _paste_and_key(hand, OTHER, copied, auto=False)
    yield from _go(BETWEEN)
    yield from hand.open_menu(view, "VIEW3D_MT_pose")
    yield from hand.picture("menu")
    yield from hand.choose("Copy Pose on Screen")
    yield from hand.hover(places.centre(places.region(view)))
    yield from _paste_and_key(hand, OTHER, copied, auto=False)
    copied = yield from _go(FRAMES[-1])
    yield from hand.press("C", ctrl=True)
    for auto in (True, False):
        yield from _paste_and_key(hand, BETWEEN, copied, auto=auto)


def _go(frame: int) -> Steps[np.ndarray]:
    bpy.context.scene.frame_set(frame)
    yield
    return now()


def _paste_and_key(hand: Hand, frame: int, copied: np.ndarray, *, auto: bool) -> Steps[None]:
    """Ctrl V, and I where Auto Key is off; undone."""
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = auto
    yield from _go(frame)
    yield from hand.press("V", ctrl=True)
    np.testing.assert_allclose(now(), copied, atol=ALIKE)
    if not auto:
        assert frame not in key_frames()
        yield from hand.press("I")
    yield from hand.wait_until(lambda: frame in key_frames(), "the pasted pose is keyed")
    np.testing.assert_allclose(now(), copied, atol=ALIKE)
    yield from hand.picture(f"pasted-{'auto-key' if auto else 'keyed'}")
    for _ in range(1 if auto else 2):
        yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: frame not in key_frames(), "the key is undone")
