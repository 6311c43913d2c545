"""The path of a bone below another that moves edited by hand, as that of a prop is in `trail`."""

from __future__ import annotations

import bpy

from tests.gui.driver import Hand, Steps
from tests.gui.keyed import hand_bone, only_the_hand, pose_the_rig
from tests.gui.scenarios.trail import deleted, inserted, moved, retimed, take_the_tool, turned


def scenario(hand: Hand) -> Steps[None]:
    view = yield from pose_the_rig(hand)
    bpy.ops.rigid_motion.set_mode(mode="dq_sclerp")
    yield from only_the_hand(hand, view)
    yield from take_the_tool(hand, view)
    yield from hand.press("A", alt=True)
    for edit in (moved, turned, retimed, inserted, deleted):
        yield from edit(hand, view, hand_bone)
