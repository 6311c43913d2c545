"""The dancer of the film in the docs: it stands on the ground, and few key poses tell its dance."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from tests.rigs.dance_plan import BONES
from tests.rigs.dancer import FPS, FRAMES, dancer

LAST = 60.0


@pytest.fixture
def followed(empty_file: bpy.types.Context) -> Iterator[None]:
    """A new file, edits followed."""
    bpy.context.scene.render.fps = FPS
    animation.register()
    yield
    animation.unregister()


def ends_of_bones(rig: bpy.types.Object, frames: np.ndarray) -> np.ndarray:
    """Where all bones begin and end, shape (frames, bones, 2, 3)."""
    result = []
    for frame in frames:
        bpy.context.scene.frame_set(int(frame))
        result.append([(bone.head.copy(), bone.tail.copy()) for bone in rig.pose.bones])
    return np.array(result)


def test_key_poses_keep_to_the_tolerance(followed):
    recorded, reduced = dancer(last=LAST), dancer(last=LAST)
    bones = list(reduced.pose.bones)
    animation.reduce_keys_of(bones, "motor_spline", 0.01, 0.03, shared=True)
    done = animation.total_reduction(bones)
    assert done.before == len(BONES) * LAST
    assert done.after <= done.before / 3
    assert done.after == len(BONES) * done.rig.frames
    assert done.largest_error <= 0.01
    frames = FRAMES[LAST >= FRAMES]
    off = np.linalg.norm(ends_of_bones(reduced, frames) - ends_of_bones(recorded, frames), axis=-1)
    # The shell that the tolerance is of is around the joint; the tip of a bone of more than 3 cm may be further off.
    assert off[..., 0].max() <= 0.01


def test_the_dancer_stays_on_the_ground(followed):
    rig = dancer()
    ends = ends_of_bones(rig, FRAMES[::5])
    feet = ends[:, [rig.pose.bones.find(f"DEF-toe.{side}") for side in "LR"], :, 2]
    assert feet.min() > 0.0
    assert feet.min(axis=(1, 2)).max() < 0.06
