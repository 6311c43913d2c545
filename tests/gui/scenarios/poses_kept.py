"""On an in-between, by hand: poses copied and pasted elsewhere, the visual transform applied, keys cleared, the Action
unlinked and baked by Blender. What is seen stays."""

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
    rig,
    shown,
)

BETWEEN, OTHER = 10, 30


def scenario(hand: Hand) -> Steps[None]:
    """All that may happen to a bone between two of its keys, each undone again."""
    view = yield from pose_the_rig(hand)
    native = shown()
    yield from hand.pie("T", "E", alt=True)
    assert hand_bone().rigid_motion.mode == SCREW
    yield from only_the_hand(hand, view)
    assert np.abs(shown() - native).max() > APART
    yield from _copy(hand)
    yield from _copy_by_the_menu(hand, view)
    yield from _apply(hand)
    yield from _clear(hand)
    yield from _unlink(hand, view)
    yield from _bake(hand)


def _go(frame: int) -> Steps[np.ndarray]:
    bpy.context.scene.frame_set(frame)
    yield
    return now()


def _assert_seen(seen: np.ndarray) -> None:
    np.testing.assert_allclose(now(), seen, atol=ALIKE)


def _copy(hand: Hand) -> Steps[None]:
    """Ctrl C on an in-between, Ctrl V between two other keys, I; on a key it is Blender's own."""
    seen = yield from _go(BETWEEN)
    yield from hand.picture("copied")
    yield from hand.press("C", ctrl=True)
    _assert_seen(seen)
    yield from _go(OTHER)
    yield from hand.press("V", ctrl=True)
    _assert_seen(seen)
    yield from hand.press("I")
    yield from hand.wait_until(lambda: OTHER in key_frames(), "the pasted pose is keyed")
    _assert_seen(seen)
    yield from hand.picture("pasted")
    for _ in range(2):
        yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: OTHER not in key_frames(), "the key is undone")
    seen = yield from _go(FRAMES[-1])
    yield from hand.press("C", ctrl=True)
    yield from _go(BETWEEN)
    yield from hand.press("V", ctrl=True)
    _assert_seen(seen)
    yield from hand.press("G", alt=True)
    yield from hand.press("Z", ctrl=True)
    _assert_seen(seen)
    yield from hand.press("Z", ctrl=True)


def _copy_by_the_menu(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    seen = yield from _go(BETWEEN)
    yield from hand.open_menu(view, "VIEW3D_MT_pose")
    yield from hand.picture("menu")
    yield from hand.choose("Copy Pose on Screen")
    yield from hand.hover(places.centre(places.region(view)))
    yield from _go(OTHER)
    yield from hand.press("V", ctrl=True)
    _assert_seen(seen)
    yield from hand.press("Z", ctrl=True)


def _apply(hand: Hand) -> Steps[None]:
    """Ctrl A, Apply Visual Transform to Pose; and a key of it."""
    seen = yield from _go(BETWEEN)
    yield from hand.search("Apply Visual Transform to Pose")
    _assert_seen(seen)
    yield from hand.press("I")
    yield from hand.wait_until(lambda: BETWEEN in key_frames(), "the pose is keyed")
    _assert_seen(seen)
    yield from hand.picture("applied")
    for _ in range(2):
        yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: BETWEEN not in key_frames(), "the key is undone")


def _clear(hand: Hand) -> Steps[None]:
    """Pose > Animation > Clear Keyframes."""
    seen = yield from _go(BETWEEN)
    yield from hand.search("Clear Keyframes")
    yield 0.3
    yield from hand.press("RET")
    yield from hand.wait_until(
        lambda: not any("Rigid" in constraint.name for constraint in hand_bone().constraints), "it is cleared"
    )
    _assert_seen(seen)
    yield from hand.picture("cleared")
    yield from _go(OTHER)
    _assert_seen(seen)
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: hand_bone().constraints, "the keys are back")


def _unlink(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """The cross beside the Action's name in the Action Editor."""
    seen = yield from _go(BETWEEN)
    sheet = hand.area("DOPESHEET_EDITOR")
    sheet.spaces.active.mode = "ACTION"
    yield
    place = yield from hand.find_button(sheet, "HEADER", "action.unlink")
    yield from hand.click(place)
    yield from hand.wait_until(lambda: rig().animation_data.action is None, "the Action is unlinked")
    _assert_seen(seen)
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.picture("unlinked")
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: rig().animation_data.action is not None, "the Action is back")
    _assert_seen(seen)


def _bake(hand: Hand) -> Steps[None]:
    """Pose > Animation > Bake Action, as its dialog comes."""
    yield from _go(BETWEEN)
    before, bpy.context.scene.frame_end = shown(), 45
    yield from hand.search("Bake Action")
    yield 0.5
    yield from hand.picture("bake-dialog")
    yield from hand.press("RET")
    yield from hand.wait_until(lambda: len(key_frames()) == 45, "Blender bakes")
    np.testing.assert_allclose(shown(), before, atol=ALIKE)
    yield from hand.picture("baked")
