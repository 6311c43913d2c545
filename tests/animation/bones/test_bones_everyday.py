"""Small cases of everyday edits of bones, each of which went wrong once."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from tests.animation.bones.poses import assert_posed
from tests.animation.bones.rigs import ARM, PLAYED, key_bone, moving_rig, new_rig, own_constraints, write_bone
from tests.animation.keyed import curves_of
from tests.animation.scenes import push_down


def frame_range(bone: bpy.types.PoseBone) -> tuple[float, float]:
    return tuple(bone.id_data.animation_data.action.frame_range)


def test_the_frame_range_of_an_action_is_that_of_its_keys_when_those_that_samples_lay_within_go(live_file):
    rig = new_rig("Rig", ARM[:2])
    body, upper = rig.pose.bones
    key_bone(body, (-19.0, 44.0))
    key_bone(upper, (-19.0, -7.0, 17.0))
    set_mode(upper, "dq_sclerp")
    assert frame_range(body) == (-19.0, 44.0)
    for fcurve in curves_of(body).values():
        fcurve.keyframe_points.remove(fcurve.keyframe_points[-1])
    bpy.context.view_layer.update()
    assert frame_range(body) == (-19.0, 17.0)


def slide(bone: bpy.types.PoseBone) -> None:
    """Key it along a straight line, at an even pace: all modes move it as Blender does."""
    write_bone(bone, "location", np.array((1.0, 21.0, 40.0)), np.array(((0.0,) * 3, (1.0,) * 3, (1.95,) * 3)))


def test_an_action_whose_mode_has_nothing_to_add_takes_the_constraint_of_the_one_before_off(live_file):
    rig = new_rig("Rig", ARM[:1])
    body = rig.pose.bones["Body"]
    slide(body)
    set_mode(body, "dq_sclerp")
    bpy.context.view_layer.update()
    sliding = rig.animation_data.action
    assert len(body.constraints) == 0
    rig.animation_data.action = None
    key_bone(body)
    set_mode(body, "dq_sclerp")
    live_file.scene.frame_set(17)
    assert len(body.constraints) == 1
    rig.animation_data.action = sliding
    bpy.context.view_layer.update()
    assert len(body.constraints) == 0
    assert_posed(rig, PLAYED)


def pushed_down(bone: bpy.types.PoseBone) -> None:
    push_down(bone.id_data)


def turned_by_axis_and_angle_and_back(bone: bpy.types.PoseBone) -> None:
    for mode in ("AXIS_ANGLE", "QUATERNION"):
        bone.rotation_mode = mode
        bpy.context.view_layer.update()


def given_blenders_in_betweens_and_back(bone: bpy.types.PoseBone) -> None:
    for mode in ("BLENDER", "dq_sclerp"):
        set_mode(bone, mode)
        bpy.context.view_layer.update()


@pytest.mark.parametrize(
    "deed",
    [pushed_down, turned_by_axis_and_angle_and_back, given_blenders_in_betweens_and_back],
    ids=lambda deed: deed.__name__,
)
def test_keys_on_the_influence_of_a_constraint_stay_when_its_bone_is(live_file, deed):
    bone = moving_rig().pose.bones["Lower"]
    (constraint,) = own_constraints(bone.id_data)["Lower"]
    for frame, influence in ((1, 0.0), (40, 1.0)):
        constraint.influence = influence
        constraint.keyframe_insert("influence", frame=frame)
    action = bone.id_data.animation_data.action
    deed(bone)
    bpy.context.view_layer.update()
    fcurves = action.layers[0].strips[0].channelbags[0].fcurves
    (influence,) = [fcurve for fcurve in fcurves if fcurve.data_path.endswith("influence")]
    assert [tuple(point.co) for point in influence.keyframe_points] == [(1.0, 0.0), (40.0, 1.0)]
