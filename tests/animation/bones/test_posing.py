"""Blender's rule of what bones inherit, in NumPy: beside Blender's own pose matrices."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import numpy as np
from hypothesis import HealthCheck, given, settings

from rigid_motion.animation.baking.motions import evaluated
from rigid_motion.animation.transforms import transform_of
from rigid_motion.animation.transforms.posing import Hierarchy
from rigid_motion.motion.affine import AffineMaps
from tests.animation.bones.random_rigs import LAST, RIGS, build
from tests.animation.keyed import curves_of
from tests.blank import blank
from tests.thoroughness import tried

FRAMES = np.arange(1.0, LAST + 1.0, 3.0)


def channel_maps(rig: bpy.types.Object) -> AffineMaps:
    """The matrices of all bones' channels, by Blender's own F-curves, shape (bones, n)."""
    curves = curves_of(rig) if rig.animation_data and rig.animation_data.action else {}
    maps = [evaluated(transform_of(bone), curves, FRAMES)[1] for bone in rig.pose.bones]
    return AffineMaps(np.stack([item.axes for item in maps]), np.stack([item.origins for item in maps]))


def posed_by_blender(rig: bpy.types.Object) -> np.ndarray:
    """Matrices of all bones in the space of the rig (bones, n, 4, 4)."""
    played = []
    for frame in FRAMES:
        bpy.context.scene.frame_set(int(frame))
        shown = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
        played.append([np.array(bone.matrix) for bone in shown.pose.bones])
    return np.array(played).swapaxes(0, 1)


@settings(max_examples=tried(120), suppress_health_check=[HealthCheck.too_slow])
@given(case=RIGS)
def test_bones_are_where_blender_poses_them(case: SimpleNamespace):
    blank()
    for bone in case.bones:
        bone.follows = ""
    case.strip = 0.0
    rig = build(case)
    posed, truth = Hierarchy(rig.pose.bones).posed(channel_maps(rig)), posed_by_blender(rig)
    size = max(1.0, np.abs(truth).max())
    np.testing.assert_allclose(posed.origins, truth[..., :3, 3], rtol=0.0, atol=1e-5 * size)
    np.testing.assert_allclose(posed.axes, truth[..., :3, :3], rtol=0.0, atol=1e-5 * size)
