"""Tests of modes on all controls of Rigify's human at once."""

from __future__ import annotations

import numpy as np

from rigid_motion.animation import bake, problem_of, set_mode, unbake
from tests.rigs.human import controls
from tests.rigs.poses import ends_of_bones, key_at_random


def test_all_of_its_controls_take_a_mode_and_everything_that_hangs_on_them_follows_as_it_follows_real_keys(rig):
    posed = controls(rig)[::4]
    key_at_random(posed)
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
