"""Tests of `bezier` against Blender: the same random keys evaluated by Blender itself."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from bpy_extras import anim_utils

from rigid_motion.motion import Poses, interpolate
from rigid_motion.motion.quaternions import align_signs, normalise
from tests.blank import blank

PATHS = {"location": 3, "rotation_quaternion": 4, "scale": 3}

EVERY = 0.125
"""Frames between compared samples: exact in single precision."""


def shown_by_blender(frames: np.ndarray, keys: Poses, at: np.ndarray) -> Poses:
    """Return the poses that Blender shows between keys that are inserted with its defaults."""
    blank()
    obj = bpy.data.objects.new("Tool", None)
    obj.rotation_mode = "QUATERNION"
    bpy.context.scene.collection.objects.link(obj)
    scales = np.ones(len(frames)) if keys.scales is None else keys.scales
    for frame, position, quaternion, scale in zip(frames, keys.positions, keys.quaternions, scales, strict=True):
        obj.location, obj.rotation_quaternion, obj.scale = position, quaternion, [scale] * 3
        for path in PATHS:
            obj.keyframe_insert(path, frame=frame)
    data = obj.animation_data
    curves = anim_utils.action_get_channelbag_for_slot(data.action, data.action_slot).fcurves
    values = [
        np.array([[curves.find(path, index=index).evaluate(frame) for index in range(width)] for frame in at])
        for path, width in PATHS.items()
    ]
    return Poses(values[0], normalise(values[1]), None if keys.scales is None else values[2][:, 0])


@pytest.mark.parametrize("seed", range(16))
def test_random_keys_have_blenders_in_betweens(seed):
    random = np.random.default_rng(seed)
    count = int(random.integers(2, 24))
    # Handles are a third of a segment away; single precision rounds them to less than a millionth of a frame.
    frames = np.cumsum(random.integers(1, 9, count)).astype(float)
    positions = random.normal(size=(count, 3)).round(1 if seed % 3 else 9)
    if seed >= 6:  # Slopes depend on one another as long as values rise.
        positions = np.cumsum(np.abs(positions) ** 3, axis=0)
    quaternions = align_signs(normalise(random.normal(size=(count, 4))))
    scales = np.float32(np.exp(random.normal(size=count))) if seed % 2 else None
    keys = Poses(np.float32(positions), np.float32(quaternions), scales)
    at = np.arange(frames[0], frames[-1] + EVERY, EVERY)
    expected, found = shown_by_blender(frames, keys, at), interpolate(frames, keys, at, "bezier")
    size = max(1.0, np.abs(keys.positions).max())
    assert np.abs(found.positions - expected.positions).max() < 1e-6 * size
    assert np.abs(found.quaternions - expected.quaternions).max() < 1e-6
    if scales is not None:
        assert np.abs(found.scales - expected.scales).max() < 1e-6 * scales.max()
