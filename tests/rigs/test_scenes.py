"""Tests of the documentation's claims on Rigify's human: where a screw helps, and where nothing goes wrong anyway."""

from __future__ import annotations

import bpy
import pytest

from rigid_motion import animation
from tests.rigs import scenes

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
