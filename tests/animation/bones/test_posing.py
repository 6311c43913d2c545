"""Bone inheritance in NumPy, compared with Blender's own pose matrices."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from hypothesis import HealthCheck, given, settings

from rigid_motion.animation.transforms.posing import Hierarchy
from rigid_motion.motion.affine import AffineMaps
from tests.animation.bones.poses import shown_poses
from tests.animation.bones.random_rigs import LAST, RIGS, build
from tests.animation.oracle import expected_bases
from tests.blank import blank
from tests.thoroughness import tried

FRAMES = np.arange(1.0, LAST + 1.0, 3.0)


@settings(max_examples=tried(80), suppress_health_check=[HealthCheck.too_slow])
@given(case=RIGS)
def test_bones_are_where_blender_poses_them(case: SimpleNamespace):
    blank()
    for bone in case.bones:
        bone.follows = ""
    case.strip = 0.0
    rig = build(case)
    maps = np.stack([expected_bases(bone, FRAMES) for bone in rig.pose.bones])
    channels = AffineMaps(maps[..., :3, :3], maps[..., :3, 3])
    Hierarchy(rig.pose.bones).pose(range(len(maps)), channels, posed := channels.copy())
    truth = np.stack([*shown_poses([rig], FRAMES)[0].values()])
    size = max(1.0, np.abs(truth).max())
    np.testing.assert_allclose(posed.origins, truth[..., :3, 3], rtol=0.0, atol=1e-5 * size)
    np.testing.assert_allclose(posed.axes, truth[..., :3, :3], rtol=0.0, atol=1e-5 * size)
