"""Rigs in Pose Mode with keyed bones, for tests of the interface."""

from __future__ import annotations

import bpy
import numpy as np

from tests.animation.bones import rigs
from tests.animation.bones.rigs import Rest, select_bones
from tests.animation.scenes import key

FRAMES = np.array((1.0, 11.0, 21.0, 41.0))
CHAIN = (
    Rest("Hip", (0.0, 0.0, 0.0), (0.0, 0.3, 0.8), roll=0.3),
    Rest("Arm", (0.1, 0.0, 1.0), (0.1, 0.3, 1.8), "Hip", 0.3),
    Rest("Hand", (0.2, 0.0, 2.0), (0.2, 0.3, 2.8), "Arm", 0.3),
)


def new_rig(name: str = "Rig", **settings: object) -> bpy.types.Object:
    """Return a tilted armature in Pose Mode with no bone selected. `settings` are properties of its hand."""
    rig = rigs.new_rig(name, CHAIN, **settings)
    rig.rotation_mode, rig.location, rig.rotation_quaternion = "QUATERNION", (1.0, 2.0, 3.0), (0.8, 0.0, 0.6, 0.0)
    rigs.pose_mode(rig)
    select_bones(rig)
    return rig


def key_bone(bone: bpy.types.PoseBone, **how: object) -> bpy.types.PoseBone:
    """Key a bone of this rig at random, turning by less than half a turn from key to key."""
    return key(bone, FRAMES, seed=1743, **how)


def keyed_rig(name: str = "Rig") -> bpy.types.Object:
    """Return a rig with keys on all bones. All but the hip are selected; the hand is the active bone."""
    rig = new_rig(name)
    for bone in rig.pose.bones:
        key_bone(bone)
    select_bones(rig, "Hand", "Arm")
    return rig
