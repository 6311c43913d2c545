"""Every mode on pose bones at any time, against matrices worked out apart and the same rig with real keys."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import channelbag_of, problem_of, refresh, set_mode, write_channel
from rigid_motion.animation.actions.modifiers import add_cycles
from rigid_motion.animation.fcurves.keys import Cycles
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.poses import assert_posed, assert_same_poses, expected_poses, shown_poses
from tests.animation.bones.rigs import (
    BETWEEN,
    FRAMES,
    INHERIT_SCALES,
    ORDERS,
    PLAYED,
    Rest,
    in_turn,
    key_all,
    key_bone,
    moving_rig,
    new_rig,
    twin_of,
)
from tests.animation.keyed import curves_of, snapshot
from tests.animation.modified import is_term
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import key, new_object
from tests.thoroughness import sample

MODES = tuple(KEYFRAME_MODES)

SETTINGS: dict[str, dict[str, object]] = {
    "plain": {},
    "connected": {"use_connect": True},
    "no local location": {"use_local_location": False},
    "no inherited rotation": {"use_inherit_rotation": False},
    "neither": {"use_local_location": False, "use_inherit_rotation": False},
    "B-bone": {"bbone_segments": 8, "bbone_rollin": 0.4, "bbone_curveinx": 0.05},
    **{f"inherits scale {name}": {"inherit_scale": name} for name in INHERIT_SCALES[1:]},
    **{
        f"inherits scale {name}, no rotation": {"inherit_scale": name, "use_inherit_rotation": False}
        for name in INHERIT_SCALES[1:]
    },
}
"""Properties of `bpy.types.Bone` that say how it hangs on its parent."""


def pairs(order: str, scale: str | None, setting: str) -> bpy.types.Object:
    """For each mode a bone of that mode with these settings, whose parent moves in another mode."""
    settings = tuple(SETTINGS[setting].items())
    bones = []
    for place, mode in enumerate(MODES):
        x = 0.2 * place
        parent = Rest(f"{mode} parent", (x, 0.1, 0.8), (x + 0.1, 0.2, 1.1), roll=0.3 * place)
        head = parent.tail if "use_connect" in SETTINGS[setting] else (x, 0.3, 1.0)
        bones += [parent, Rest(mode, head, (x, 0.4, 1.2), parent.name, roll=1.0 - place, settings=settings)]
    rig = new_rig("Rig", bones, order)
    for pose_bone in rig.pose.bones:
        key_bone(pose_bone, scale=scale, location="use_connect" not in SETTINGS[setting] or pose_bone.parent is None)
    for place, mode in enumerate(MODES):
        other = f"{MODES[(place + 3) % len(MODES)]} parent"
        set_mode([rig.pose.bones[mode], rig.pose.bones[other]], mode)
    return rig


@pytest.mark.parametrize(("setting", "order"), in_turn(SETTINGS, ORDERS))
def test_every_mode_is_exact_in_every_setting_at_any_time(live_file, order, setting):
    rig = pairs(order, "even", setting)
    keys = [snapshot(pose_bone) for pose_bone in rig.pose.bones]
    assert {problem_of(pose_bone) for pose_bone in rig.pose.bones} == {""}
    assert_posed(rig, BETWEEN)
    assert [snapshot(pose_bone) for pose_bone in rig.pose.bones] == keys, "keys of the animator are left alone"


@pytest.mark.parametrize(
    ("setting", "order"), in_turn(sample(["plain", *(name for name in SETTINGS if "inherits scale" in name)]), ORDERS)
)
def test_below_parents_that_are_scaled_unevenly_bones_move_as_with_real_keys(live_file, order, setting):
    rig = pairs(order, "uneven", setting)
    assert_moves_as_with_real_keys(rig)


def assert_moves_as_with_real_keys(rig: bpy.types.Object) -> None:
    shown, expected = shown_poses([rig, twin_of(rig, PLAYED)], PLAYED)
    assert_same_poses(rig, PLAYED, shown, expected)


OFF_WHOLE_FRAMES = (1.3, 10.5, 10.85, 16.4, 40.0)


@pytest.mark.parametrize("order", ["QUATERNION", "XYZ", "AXIS_ANGLE"])
@pytest.mark.parametrize("part", range(len(OFF_WHOLE_FRAMES) - 1))
def test_a_single_segment_with_a_mode_may_begin_and_end_off_whole_frames(live_file, part, order):
    rig = key_all(new_rig(rotation_mode=order), OFF_WHOLE_FRAMES)
    set_mode(list(rig.pose.bones), "dq_sclerp", [OFF_WHOLE_FRAMES[part]])
    assert_posed(rig, np.union1d(BETWEEN, OFF_WHOLE_FRAMES))


KEYED = {
    "no rotation": lambda path, index: not path.startswith("rotation"),
    "one of location": lambda path, index: path != "location" or index == 1,
    "one angle": lambda path, index: not path.startswith("rotation") or index == 2,
    "no scale along Z": lambda path, index: (path, index) != ("scale", 2),
}
"""Which channels have keys."""


@pytest.mark.parametrize(("kept", "mode"), in_turn(KEYED, MODES))
@pytest.mark.parametrize("order", ["QUATERNION", "YZX", "AXIS_ANGLE"])
def test_channels_without_keys_count_as_they_are(live_file, mode, kept, order):
    rig = key_all(new_rig(rotation_mode=order), scale="even")
    for pose_bone in rig.pose.bones:
        pose_bone.location, pose_bone.rotation_euler, pose_bone.scale = (0.1, -0.2, 0.3), (0.4, 0.5, -0.6), (1.2,) * 3
        pose_bone.rotation_quaternion, pose_bone.rotation_axis_angle = (0.8, 0.0, 0.36, 0.48), (0.7, 0.1, 0.9, 0.3)
        for (path, index), fcurve in curves_of(pose_bone).items():
            if not KEYED[kept](path, index):
                channelbag_of(rig).fcurves.remove(fcurve)
    set_mode(list(rig.pose.bones), mode)
    assert_posed(rig, BETWEEN)


@pytest.mark.parametrize("order", ["QUATERNION", "ZXY", "AXIS_ANGLE"])
def test_parts_run_between_keys_of_their_own(live_file, order):
    rig = key_all(new_rig(rotation_mode=order), scale="even")
    for pose_bone in rig.pose.bones:
        pose_bone.keyframe_insert("location", frame=6.0)
        pose_bone.keyframe_insert("scale", frame=30.5)
    set_mode(list(rig.pose.bones), "dq_sclerp")
    keys = [snapshot(pose_bone) for pose_bone in rig.pose.bones]
    assert_posed(rig, BETWEEN)
    assert [snapshot(pose_bone) for pose_bone in rig.pose.bones] == keys


@pytest.mark.parametrize("kind", ["REPEAT_OFFSET", "MIRROR"])
@pytest.mark.parametrize("order", ["QUATERNION", "YXZ", "AXIS_ANGLE"])
def test_bones_repeat_the_motion_of_their_mode_with_cycles(live_file, order, kind):
    rig = key_all(new_rig(rotation_mode=order), (31.0, 35.0, 42.0), interpolation="LINEAR")
    for fcurve in curves_of(rig).values():
        modifier = fcurve.modifiers.new("CYCLES")
        modifier.mode_before, modifier.mode_after = "REPEAT", kind
        # It ends as it began, so that offsets are none.
        fcurve.keyframe_points[-1].co_ui.y = fcurve.keyframe_points[0].co_ui.y
    live_file.scene.frame_start, live_file.scene.frame_end = 0, 75
    set_mode(list(rig.pose.bones), "dq_sclerp")
    first = np.arange(31.125, 42.0, 0.5)
    before, shown, after = (shown_poses([rig], first + shift)[0] for shift in (-11.0, 0.0, 22.0))
    assert_same_poses(rig, first, shown, expected_poses(rig, first))
    for again in (before, after):
        assert_same_poses(rig, first, again, shown)


def test_bones_are_as_exact_where_the_armature_is_scaled_unevenly_moved_and_parented(live_file):
    parent = key(new_object("Ship", "XYZ"))
    set_mode(parent, "pga_slerp")
    rig = key(moving_rig("cga_slerp", scale="even"), scale="uneven")
    rig.parent = parent
    rig.scale, rig.location, rig.delta_scale = (0.3, 2.0, 1.1), (100.0, -20.0, 3.0), (1.5, 1.0, 0.2)
    set_mode(rig, "dq_sclerp")
    assert_posed(rig, PLAYED)
    assert problem_of(rig) == ""


def test_constraints_kinematics_and_drivers_go_on_from_a_mode_as_from_real_keys(live_file):
    rig = key_all(new_rig(), scale="even", amount=0.1)
    upper, hand = rig.pose.bones["Upper"], rig.pose.bones["Hand"]
    target = key(new_object("Target"), seed=3)
    write_channel(target, "location", np.array(FRAMES), np.linspace((0.7, 0.2, 1.1), (0.8, 0.4, 1.2), len(FRAMES)))
    solver, turner = hand.constraints.new("IK"), upper.constraints.new("COPY_ROTATION")
    solver.target, solver.chain_count, solver.iterations = target, 2, 200
    turner.target, turner.subtarget, turner.influence = rig, "Body", 0.6
    set_mode(list(rig.pose.bones), "dq_sclerp")
    twin = twin_of(rig, PLAYED)
    for posed in (rig, twin):
        driver = posed.driver_add("location", 2).driver
        variable = driver.variables.new()
        variable.targets[0].id, variable.targets[0].data_path = posed, 'pose.bones["Body"].location[0]'
        driver.expression = variable.name
    shown, expected = shown_poses([rig, twin], PLAYED)
    assert_same_poses(rig, PLAYED, shown, expected)
    assert np.ptp([world[2, 3] for world in shown_worlds([rig], PLAYED)[0]]) > 0.01
    np.testing.assert_allclose(*shown_worlds([rig, twin], PLAYED), atol=1e-5)


BESIDE_KEYS = {
    "a mute": lambda fcurve: setattr(fcurve, "mute", True),
    "an Envelope": lambda fcurve: fcurve.modifiers.new("ENVELOPE"),
    "Cycles on one channel": lambda fcurve: add_cycles(fcurve, Cycles("REPEAT", "REPEAT", 0, 0)),
}


@pytest.mark.parametrize("what", BESIDE_KEYS)
def test_what_comes_into_the_way_of_one_bone_is_no_matter_to_others_and_goes_again(live_file, what):
    rig = moving_rig()
    lower, others = rig.pose.bones["Lower"], ["Body", "Upper"]
    fcurve = curves_of(lower)["location", 1]
    BESIDE_KEYS[what](fcurve)
    bpy.context.view_layer.update()
    if what != "a mute":
        assert "Lower" in problem_of(lower)
        assert not any(map(is_term, (item for curve in curves_of(lower).values() for item in curve.modifiers)))
    assert_posed(rig, BETWEEN, others)
    fcurve = curves_of(lower)["location", 1]
    fcurve.mute = False
    for added in [modifier for modifier in fcurve.modifiers if not is_term(modifier)]:
        fcurve.modifiers.remove(added)
    bpy.context.view_layer.update()
    assert problem_of(lower) == ""
    assert_posed(rig, BETWEEN)
    assert refresh() == 0
