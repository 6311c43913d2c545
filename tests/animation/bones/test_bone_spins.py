"""Whole turns of bones, of their angles and of the channel Turns, against matrices worked out apart."""

from __future__ import annotations

from math import tau

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode, set_turns
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.poses import assert_posed
from tests.animation.bones.rigs import FRAMES, PLAYED, in_turn, key_all, moving_rig, new_rig, write_bone

MODES = tuple(KEYFRAME_MODES)


@pytest.mark.parametrize("mode", MODES)
def test_bones_that_turn_by_quaternions_make_turns(live_file, mode):
    rig = moving_rig(mode, interpolation="LINEAR")
    for turns, name in ((2, "Upper"), (-1, "Hand")):
        set_turns(rig.pose.bones[name], turns, [FRAMES[0], FRAMES[2]])
    assert_posed(rig, PLAYED)


@pytest.mark.parametrize(("mode", "order"), in_turn(MODES, ["XYZ", "ZXY"]))
def test_bones_turn_as_far_as_their_angles_say(live_file, mode, order):
    rig = key_all(new_rig(rotation_mode=order), interpolation="LINEAR")
    for number, bone in enumerate(rig.pose.bones):
        angles = 4.0 * np.random.default_rng((number, len(mode))).normal(size=(4, 3))
        write_bone(bone, "rotation_euler", np.array(FRAMES), angles)
    set_mode(list(rig.pose.bones), mode)
    assert_posed(rig, PLAYED)


def test_a_renamed_bone_keeps_its_turns(live_file):
    rig = new_rig()
    hand = rig.pose.bones["Hand"]
    write_bone(hand, "rotation_quaternion", np.array((1.0, 25.0)), np.tile((1.0, 0.0, 0.0, 0.0), (2, 1)))
    set_mode(hand, "dq_sclerp")
    set_turns(hand, 1, [1.0], axis="Y")
    rig.data.bones["Hand"].name = "Palm"
    bpy.context.view_layer.update()
    bpy.context.scene.frame_set(13)
    palm = rig.pose.bones["Palm"]
    assert palm.rigid_motion.turns == 1
    angle = palm.matrix_basis.to_quaternion().angle
    seen = palm.parent.matrix.inverted() @ palm.matrix
    rest = palm.parent.bone.matrix_local.inverted() @ palm.bone.matrix_local
    turned = (rest.inverted() @ seen).to_quaternion()
    assert angle == pytest.approx(0.0, abs=1e-5)
    assert turned.angle == pytest.approx(tau / 2.0, abs=1e-3)
    assert abs(turned.axis.y) == pytest.approx(1.0, abs=1e-5)
