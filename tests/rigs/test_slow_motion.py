"""A hand of Rigify's human and a thing beside it, swung and slowed down fourfold: exact between frames, as motion blur
and slow motion look at them.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from tests.animation.scenes import push_down
from tests.rigs import scenes

PROMISE = 1e-4
"""Metres."""

SLOWER = 4
EIGHTHS = np.arange(8.0, 8.0 * (1.0 + SLOWER * 12.0) + 1.0) / 8.0
"""Of the scene's frames, from the first key to the last."""

POINTS = np.array([[0.0, 0.0, 0.0, 1.0], [0.1, 0.0, 0.0, 1.0], [0.0, 0.1, 0.0, 1.0], [0.0, 0.0, 0.1, 1.0]])
"""In the space of the bone and of the thing; metres."""


def swung(rig: bpy.types.Object, thing: bpy.types.Object) -> bpy.types.PoseBone:
    """Keys of the left hand and the thing, 120 degrees in six frames and back."""
    scenes.make_fist(rig, "L")
    hand = rig.pose.bones["hand_ik.L"]
    shoulder, reach = rig.pose.bones["ORG-upper_arm.L"].head.copy(), scenes.ARM * scenes.arm_length(rig)
    thing.rotation_mode = "QUATERNION"
    for frame, degrees in ((1, -70.0), (7, 50.0), (13, -70.0)):
        swing = scenes.turned(degrees, "X").to_3x3()
        scenes.key(hand, frame, scenes.posed(shoulder + swing @ scenes.Vector((0.0, -reach, 0.0)), swing))
        thing.location, thing.rotation_quaternion = hand.matrix.translation, swing.to_quaternion()
        thing.keyframe_insert("location", frame=frame)
        thing.keyframe_insert("rotation_quaternion", frame=frame)
    return hand


def shown(rig: bpy.types.Object, thing: bpy.types.Object) -> np.ndarray:
    """Where points of the hand's control, its deforming bone and the thing are at every eighth of a frame."""
    result = []
    for frame in EIGHTHS:
        bpy.context.scene.frame_set(int(frame), subframe=frame % 1.0)
        matrices = [rig.pose.bones["hand_ik.L"].matrix, rig.pose.bones["DEF-hand.L"].matrix, thing.matrix_world]
        result.append([POINTS @ np.array(matrix)[:3].T for matrix in matrices])
    return np.array(result)


@pytest.mark.slow
def test_slowed_down_it_is_where_a_bake_at_eighths_is(rig):
    thing = bpy.data.objects.new("Thing", None)
    bpy.context.scene.collection.objects.link(thing)
    hand = swung(rig, thing)
    animation.set_mode([thing, hand], "dq_sclerp")
    animation.set_exact(thing)
    strips = [push_down(obj, scale=float(SLOWER)) for obj in (rig, thing)]
    by_mode = shown(rig, thing)
    for obj, strip in zip((rig, thing), strips, strict=True):
        obj.animation_data.action, obj.animation_data.action_slot = strip.action, strip.action_slot
        obj.animation_data.nla_tracks.remove(obj.animation_data.nla_tracks[0])
    animation.bake([thing, hand], step=1.0 / (8 * SLOWER))
    for obj in (rig, thing):
        push_down(obj, scale=float(SLOWER))
    errors = np.linalg.norm(shown(rig, thing) - by_mode, axis=-1).max(axis=(0, 2))
    assert np.ptp(by_mode, axis=0).max() > 0.5
    assert errors.max() < PROMISE, errors
