"""A large rig is edited in draft: it is exact between frames for whoever looks there, in its file, and in a render."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from tests.animation.keyed import key_frames
from tests.animation.oracle import expected_bases
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import FRAMES, hand_bone, now, pose_the_rig, rig
from tests.gui.scenarios.bones_by_hand import assert_as_keyed

MORE_BONES, LAST = 40, 400
BETWEEN = np.arange(1.125, 40.0, 0.25)

PROMISED = 1e-4
"""Metres. Turns count for less than that much from a bone's own head."""


def scenario(hand: Hand) -> Steps[None]:
    """An animator chooses a mode for many bones, keys them, saves and renders, and takes some of it back."""
    yield from pose_the_rig(hand)
    enlarge()
    bpy.ops.ed.undo_push(message="Large")
    yield from hand.press("A")
    yield from hand.pie("T", "E", alt=True)
    assert_in_draft(*FRAMES)

    yield from key_all(hand, 10)
    assert_in_draft(1, 10, 20, 40)
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(bpy.app.tempdir) / "drafts.blend"))
    assert_finished()
    yield from key_all(hand, 30)
    assert_in_draft(1, 10, 20, 30, 40)
    yield from hand.press("S", ctrl=True)
    yield from hand.wait_until(lambda: not bpy.data.is_dirty, "the file is saved")
    assert_finished()

    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: 30.0 not in key_frames(hand_bone()), "the key is undone")
    assert_as_keyed(1, 10, 20, 40)
    yield from hand.press("Z", ctrl=True, shift=True)
    yield from hand.wait_until(lambda: 30.0 in key_frames(hand_bone()), "the key is redone")
    assert_as_keyed(1, 10, 20, 30, 40)

    yield from key_all(hand, 15)
    assert_in_draft(1, 10, 15, 20, 30, 40)
    yield from rendered(hand)
    assert_finished()
    assert_exact()


def enlarge() -> None:
    """Give the rig bones enough for it to be a large one, keyed for long."""
    bpy.ops.object.mode_set(mode="EDIT")
    for number in range(MORE_BONES):
        bone = rig().data.edit_bones.new(f"Bone {number}")
        bone.head, bone.tail = (2, 0.1 * number, 0), (2, 0.1 * number, 0.1)
    bpy.ops.object.mode_set(mode="POSE")
    for number in range(MORE_BONES):
        bone = rig().pose.bones[f"Bone {number}"]
        for frame, x in zip((*FRAMES, LAST), (0, 1, 0, 1), strict=True):
            bone.location, bone.rotation_quaternion = (x, 0, 0), (1 - x, x, 0, 0.2)
            bone.keyframe_insert("location", frame=frame)
            bone.keyframe_insert("rotation_quaternion", frame=frame)


def key_all(hand: Hand, frame: int) -> Steps[None]:
    """Press I on a frame."""
    bpy.context.scene.frame_set(frame)
    yield
    yield from hand.press("I")
    yield from hand.wait_until(lambda: frame in key_frames(hand_bone()), f"all bones have a key on frame {frame}")


def rendered(hand: Hand) -> Steps[None]:
    """Render the frame, on a thread of its own."""
    scene, done = bpy.context.scene, []
    scene.render.engine, scene.render.resolution_percentage = "BLENDER_WORKBENCH", 10
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)

    def after(*_: object) -> None:
        done.append(is_draft())

    bpy.app.handlers.render_pre.append(after)
    bpy.context.preferences.view.render_display_type = "NONE"
    yield from hand.press("F12")
    yield from hand.wait_until(lambda: done and not bpy.app.is_job_running("RENDER"), "a frame is rendered", 60.0)
    bpy.app.handlers.render_pre.remove(after)
    assert done == [False], "rendered in draft"


def is_draft() -> bool:
    return rig().animation_data.action.rigid_motion.is_draft


def rates() -> set[int]:
    return {record.rate for record in rig().animation_data.action.rigid_motion.slots}


def assert_in_draft(*frames: float) -> None:
    """One sample a frame, and right on whole frames. The hand has keys on these frames."""
    assert is_draft()
    assert rates() == {1}, rates()
    assert_as_keyed(*frames)
    assert is_draft()


def assert_finished() -> None:
    assert not is_draft()
    assert max(rates()) > 1, rates()


def assert_exact() -> None:
    """The hand is where its mode has it between frames."""
    for frame, expected in zip(BETWEEN, expected_bases(hand_bone(), BETWEEN), strict=True):
        bpy.context.scene.frame_set(int(frame), subframe=frame % 1)
        np.testing.assert_allclose(now()[:3], expected[:3], rtol=0, atol=PROMISED)
