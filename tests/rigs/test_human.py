"""Modes on Rigify's human: all of its controls at once, where the pages say a screw helps, and where nothing strays."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation import bake, problem_of, set_mode, unbake
from tests.animation.scenes import key
from tests.rigs import scenes
from tests.rigs.human import controls


@pytest.fixture
def rig(human: bpy.types.Object, extension: bpy.types.Context) -> bpy.types.Object:
    return human


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


NOTHING = 2e-4
"""An error in metres that counts as none: IK itself leaves the hand 0.1 mm from its control."""


def strays_of(scene: scenes.Scene) -> tuple[float, float]:
    """Return the largest straying in metres, with Blender's in-betweens and with the screw."""
    native = scene.farthest()
    animation.set_mode(scene.controls, "dq_sclerp")
    return native, scene.farthest()


def pull_a_lever(rig: bpy.types.Object) -> scenes.Scene:
    lever = bpy.data.objects.new("Lever", None)
    bpy.context.scene.collection.objects.link(lever)
    return scenes.pull_a_lever(rig, lever)


@pytest.mark.parametrize(("scene", "metres"), [(pull_a_lever, 0.165), (scenes.twist, 0.039), (scenes.cut, 0.272)])
def test_by_the_screw_fists_and_feet_stay_and_an_arm_that_swings_by_ik_stays_stretched(rig, scene, metres):
    native, screw = strays_of(scene(rig))
    assert native == pytest.approx(metres, abs=0.001)
    assert screw < NOTHING


def test_joints_keyed_by_quaternions_need_no_screw(rig):
    native, screw = strays_of(scenes.cut_by_joints(rig))
    assert native < NOTHING
    assert screw < NOTHING


@pytest.mark.parametrize(("order", "centimetres"), [("YXZ", 6.8), ("ZYX", 28.4)])
def test_joints_keyed_by_euler_angles_gain_much(rig, order, centimetres):
    native, screw = strays_of(scenes.cut_by_joints(rig, order))
    assert 100.0 * native == pytest.approx(centimetres, abs=0.1)
    assert screw < NOTHING
