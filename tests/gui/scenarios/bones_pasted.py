"""Poses pasted between keys, keyed at once by Auto Key or later by hand: the key is the pose that was copied."""

from __future__ import annotations

import bpy
import numpy as np

from tests.gui.driver import Hand, Steps
from tests.gui.scenarios.bones_by_hand import (
    ALIKE,
    FRAMES,
    SCREW,
    hand_bone,
    key_frames,
    now,
    only_the_hand,
    pose_the_rig,
)

BETWEEN = 10


def scenario(hand: Hand) -> Steps[None]:
    """A pose is copied on a key and pasted between two others, twice; undone in between."""
    view = yield from pose_the_rig(hand)
    yield from hand.pie("T", "E", alt=True)
    assert hand_bone().rigid_motion.mode == SCREW
    yield from only_the_hand(hand, view)
    bpy.context.scene.frame_set(FRAMES[-1])
    yield
    copied = now()
    yield from hand.press("C", ctrl=True)
    for auto in (True, False):
        bpy.context.scene.tool_settings.use_keyframe_insert_auto = auto
        bpy.context.scene.frame_set(BETWEEN)
        yield
        yield from hand.press("V", ctrl=True)
        if not auto:
            assert BETWEEN not in key_frames()
            yield from hand.press("I")
        yield from hand.wait_until(lambda: BETWEEN in key_frames(), "the pasted pose is keyed")
        np.testing.assert_allclose(now(), copied, atol=ALIKE)
        yield from hand.picture(f"pasted-{'auto-key' if auto else 'keyed'}")
        for _ in range(1 if auto else 2):
            yield from hand.press("Z", ctrl=True)
        yield from hand.wait_until(lambda: BETWEEN not in key_frames(), "the key is undone")
