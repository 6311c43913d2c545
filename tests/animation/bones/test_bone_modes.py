"""Every mode on pose bones and every frame, against matrices worked out apart and the same rig with real keys."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import problem_of, set_mode
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.poses import assert_posed, assert_same_poses, expected_poses, shown_poses
from tests.animation.bones.rigs import (
    INHERIT_SCALES,
    ORDERS,
    PLAYED,
    Rest,
    in_turn,
    key_all,
    key_bone,
    key_desired,
    moving_rig,
    new_rig,
    twin_of,
)
from tests.animation.keyed import curves_of, snapshot
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
def test_every_mode_is_exact_in_every_setting_on_every_frame(live_file, order, setting):
    rig = pairs(order, "even", setting)
    keys = [snapshot(pose_bone) for pose_bone in rig.pose.bones]
    assert {problem_of(pose_bone) for pose_bone in rig.pose.bones} == {""}
    assert_posed(rig, PLAYED)
    assert [snapshot(pose_bone) for pose_bone in rig.pose.bones] == keys, "keys of the animator are left alone"


@pytest.mark.parametrize(
    ("setting", "order"), in_turn(sample(["plain", *(name for name in SETTINGS if "inherits scale" in name)]), ORDERS)
)
def test_below_parents_that_are_scaled_unevenly_bones_move_as_with_real_keys(live_file, order, setting):
    rig = pairs(order, "uneven", setting)
    twin = twin_of(rig)
    key_desired(twin, rig, PLAYED)
    shown, expected = shown_poses([rig, twin], PLAYED)
    assert_same_poses(rig, PLAYED, shown, expected)


KEYED = {
    "no rotation": lambda path, index: not path.startswith("rotation"),
    "one of location": lambda path, index: path != "location" or index == 1,
    "one angle": lambda path, index: not path.startswith("rotation") or index == 2,
    "no scale along Z": lambda path, index: (path, index) != ("scale", 2),
}
"""Which channels have keys."""


@pytest.mark.parametrize(("kept", "mode"), in_turn(KEYED, MODES))
@pytest.mark.parametrize("order", ["QUATERNION", "YZX"])
def test_channels_without_keys_count_as_they_are(live_file, mode, kept, order):
    rig = key_all(new_rig(rotation_mode=order), scale="even")
    for pose_bone in rig.pose.bones:
        pose_bone.location, pose_bone.rotation_euler, pose_bone.scale = (0.1, -0.2, 0.3), (0.4, 0.5, -0.6), (1.2,) * 3
        pose_bone.rotation_quaternion = (0.8, 0.0, 0.36, 0.48)
        for (path, index), fcurve in curves_of(pose_bone).items():
            if not KEYED[kept](path, index):
                rig.animation_data.action.layers[0].strips[0].channelbags[0].fcurves.remove(fcurve)
    set_mode(list(rig.pose.bones), mode)
    assert_posed(rig, PLAYED)


@pytest.mark.parametrize("kind", ["REPEAT_OFFSET", "MIRROR"])
@pytest.mark.parametrize("order", ["QUATERNION", "YXZ"])
def test_bones_repeat_the_motion_of_their_mode_with_cycles(live_file, order, kind):
    rig = key_all(new_rig(rotation_mode=order), (31.0, 35.0, 42.0), interpolation="LINEAR")
    for fcurve in curves_of(rig).values():
        modifier = fcurve.modifiers.new("CYCLES")
        modifier.mode_before, modifier.mode_after = "REPEAT", kind
        # It ends as it began, so that offsets are none.
        fcurve.keyframe_points[-1].co_ui.y = fcurve.keyframe_points[0].co_ui.y
    live_file.scene.frame_start, live_file.scene.frame_end = 0, 75
    set_mode(list(rig.pose.bones), "dq_sclerp")
    first = np.arange(32.0, 42.0)
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
