"""What is promised of reduced rigs and what is not: constraints, drivers, scale, bones without keys, and sizes."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation import is_reduced, reduce_keys_of, total_reduction, write_channel
from rigid_motion.animation.baking.motions import not_promised
from rigid_motion.animation.transforms import transform_of
from rigid_motion.animation.transforms.sizes import first_tolerance, reaches_of, rig_size
from tests.animation.bones.rigs import Rest, new_rig
from tests.animation.bones.test_rig_reducing import RADIUS, TOLERANCE, bones, errors, matrices
from tests.animation.scenes import new_object
from tests.rigs.recorded import FRAMES, NAMES, recorded_rig

# Constraints and drivers


@pytest.mark.parametrize("kind", ["DAMPED_TRACK", "LIMIT_ROTATION"])
def test_what_follows_a_constraint_is_named_and_what_hangs_on_it(live_file, kind):
    rig = recorded_rig()
    rig.pose.bones["Arm.L"].constraints.new(kind)
    result = not_promised(rig)
    assert (result.followers, result.below) == (("Arm.L",), ("Hand.L",))
    reduce_keys_of(bones(rig), "motor_spline", TOLERANCE, RADIUS)
    assert total_reduction(bones(rig)).rig.not_promised == result


@pytest.mark.parametrize("switched_off", ["mute", "influence"])
def test_a_constraint_that_is_switched_off_counts_for_nothing_until_that_is_animated(live_file, switched_off):
    rig = recorded_rig(still=("Head",))
    constraint = rig.pose.bones["Arm.L"].constraints.new("COPY_ROTATION")
    setattr(constraint, switched_off, {"mute": True, "influence": 0.0}[switched_off])
    driver = rig.pose.bones["Head"].driver_add("rotation_quaternion", 1)
    driver.mute = True
    assert not not_promised(rig)
    constraint.keyframe_insert("influence")
    assert not_promised(rig).followers == ("Arm.L",)
    driver.mute = False
    assert not_promised(rig).followers == ("Head", "Arm.L")


@pytest.mark.parametrize(("count", "moved"), [(2, ("Arm.L", "Hand.L")), (0, ("Root", "Spine", "Arm.L", "Hand.L"))])
def test_inverse_kinematics_move_all_bones_of_their_chain(live_file, count, moved):
    rig = recorded_rig()
    rig.pose.bones["Hand.L"].constraints.new("IK").chain_count = count
    assert not_promised(rig).followers == moved


# What is reported


def test_the_largest_error_is_that_of_a_bone_without_keys_where_that_is_off_the_most(live_file):
    rig = recorded_rig(still=("Hand.L", "Hand.R", "Head"))
    truth = matrices(rig)
    reduce_keys_of(bones(rig, *NAMES[:2], "Arm.L", "Arm.R"), "motor_spline", TOLERANCE, RADIUS)
    off, report = errors(rig, truth), total_reduction(bones(rig))
    assert max(off, key=off.get) in ("Hand.L", "Hand.R", "Head")
    assert report.largest_error == pytest.approx(max(off.values()), abs=2e-6)


# Scale


def test_a_bone_whose_scale_has_keys_on_every_frame_and_is_uneven_is_left_alone_and_says_why(live_file):
    rig = recorded_rig()
    uneven = 1.0 + 0.3 * np.sin(0.1 * FRAMES[:, None] * (1.0, 1.3, 1.7))
    write_channel(rig, 'pose.bones["Spine"].scale', FRAMES, uneven)
    refused = []
    reduce_keys_of(bones(rig), "motor_spline", TOLERANCE, RADIUS, refused=refused)
    assert "its scale changes differently along its axes" in str(refused[0])
    assert not is_reduced(rig.pose.bones["Spine"])
    assert total_reduction(bones(rig)).after < (len(NAMES) - 1) * len(FRAMES)


# How large things are


def test_a_bone_reaches_all_that_it_deforms_or_carries_and_three_centimetres_of_a_grown_up(live_file):
    rests = [Rest("Hips", (0.0, 0.0, 0.0), (0.0, 0.0, 0.9)), Rest("Spine", (0.0, 0.0, 0.9), (0.0, 0.0, 1.69), "Hips")]
    tiny = [Rest(name, (0.0, 0.0, 1.7), (0.0, 0.0, 1.701), "Spine") for name in ("Hand", "Finger")]
    rig = new_rig(bones=(*rests, *tiny))
    rig.scale = (0.5, 0.5, 0.5)
    bpy.context.view_layer.update()
    least = 0.03
    assert reaches_of(rig) == pytest.approx({"Hips": 0.9, "Spine": 0.79, "Hand": least, "Finger": least})
    mesh = bpy.data.meshes.new("Skin")
    mesh.from_pydata([(0.0, 0.0, 1.7), (0.0, 5.0, 1.7), (0.0, 3.0, 1.7), (9.0, 0.0, 0.0)], [], [])
    skin = new_object("Skin", data=mesh)
    skin.matrix_world = rig.matrix_world
    for name, vertices in (("Hand", (0, 1, 2)), ("Spine", (0,)), ("Else", (3,))):
        skin.vertex_groups.new(name=name).add(vertices, 0.2, "REPLACE")
    skin.vertex_groups["Hand"].add((1,), 0.0, "REPLACE")
    assert reaches_of(rig)["Hand"] == pytest.approx(least)
    skin.modifiers.new("Armature", "ARMATURE").object = rig
    sword = new_object("Sword")
    sword.parent, sword.parent_type, sword.parent_bone = rig, "BONE", "Finger"
    sword.location = (0.0, 0.0, 0.8)
    rig.pose.bones["Spine"].rotation_quaternion = (0.6, 0.8, 0.0, 0.0)
    bpy.context.view_layer.update()
    expected = {"Hips": 0.9, "Spine": 0.8, "Hand": 3.0, "Finger": 0.8}
    assert reaches_of(rig) == pytest.approx(expected, abs=1e-5)


def test_made_up_lengths_of_the_last_bones_are_no_part_of_the_size_of_a_rig(live_file):
    hips, spine = (
        Rest("Hips", (0.0, 0.0, 0.0), (0.0, 0.0, 0.8)),
        Rest("Spine", (0.0, 0.0, 0.8), (0.0, 0.0, 1.6), "Hips"),
    )
    rig = new_rig(bones=(hips, spine, Rest("HeadTop", (0.0, 0.0, 1.6), (0.0, 0.0, 58.6), "Spine")))
    rig.scale = (2.0, 2.0, 2.0)
    bpy.context.view_layer.update()
    assert rig_size(rig) == pytest.approx(3.2)
    assert first_tolerance(bpy.context.scene, [transform_of(bone) for bone in rig.pose.bones]) == pytest.approx(9.6e-3)
    assert reaches_of(rig)["HeadTop"] == pytest.approx(0.8)
    assert animation.radius_of(rig.pose.bones["HeadTop"]) == pytest.approx(1.6)
    assert animation.radius_of(rig) == pytest.approx(2.0 * (1.6 + 0.8))
