"""Tests of modes on all controls of Rigify's human at once."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion.animation import bake, problem_of, set_mode, unbake
from tests.animation.scenes import key
from tests.rigs.human import controls


def ends_of_bones(rig: bpy.types.Object) -> np.ndarray:
    """Return the heads and tails of all bones on some frames, in armature space."""
    result = []
    for frame in range(1, 32, 4):
        bpy.context.scene.frame_set(frame)
        result.append([(*bone.head, *bone.tail) for bone in rig.pose.bones])
    return np.array(result)


def test_all_of_its_controls_take_a_mode_and_everything_that_hangs_on_them_follows_as_it_follows_real_keys(rig):
    posed = controls(rig)[::4]
    for control in posed:
        key(control, (1.0, 15.0, 31.0), location=False)
    set_mode(posed, "dq_sclerp")
    assert {problem_of(control) for control in posed[::20]} == {""}
    shown = ends_of_bones(rig)
    bake(posed)
    reach = float(np.ptp(shown.reshape(-1, 3), axis=0).max())
    assert np.abs(ends_of_bones(rig) - shown).max() < 1e-5 * reach
    unbake(posed)
    assert np.array_equal(ends_of_bones(rig), shown)
    set_mode(posed, "BLENDER")
    assert np.abs(ends_of_bones(rig) - shown).max() > 0.001 * reach
    assert not [
        constraint
        for bone in rig.pose.bones
        for constraint in bone.constraints
        if constraint.name.startswith("Rigid Motion")
    ]
