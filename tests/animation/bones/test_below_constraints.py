"""Other constraints, IK and drivers go on from a bone's mode as they would from real keys on every frame."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion.animation import problem_of, set_mode, write_channel
from tests.animation.bones.poses import assert_same_poses, shown_poses
from tests.animation.bones.rigs import FRAMES, ORDERS, PLAYED, in_turn, key_all, key_desired, new_rig, twin_of
from tests.animation.keyed import curves_of
from tests.animation.scenes import key, new_object

Constrain = Callable[[bpy.types.Object, bpy.types.Object], None]
"""Adds constraints to a rig, which may aim at an object that moves."""


def on(bone: str, kind: str, bone_aimed_at: str | None = None, **settings: object) -> Constrain:
    """A constraint on this bone that aims at a bone of the rig, or else at the object."""

    def add(rig: bpy.types.Object, target: bpy.types.Object) -> None:
        constraint = rig.pose.bones[bone].constraints.new(kind)
        if hasattr(constraint, "target"):
            constraint.target = rig if bone_aimed_at else target
            if bone_aimed_at:
                constraint.subtarget = bone_aimed_at
        for name, value in settings.items():
            setattr(constraint, name, value)

    return add


def ik(**settings: object) -> Constrain:
    return on("Hand", "IK", chain_count=3, iterations=200, **settings)


def action_of_the_animators(rig: bpy.types.Object, target: bpy.types.Object) -> None:
    spare = new_rig("Spare")
    key_all(spare, (1.0, 21.0), seed=9)
    action, slot = spare.animation_data.action, spare.animation_data.action_slot
    bpy.data.objects.remove(spare)
    constraint = rig.pose.bones["Hand"].constraints.new("ACTION")
    constraint.action, constraint.action_slot = action, slot
    constraint.use_eval_time, constraint.eval_time = True, 0.35
    constraint.frame_start, constraint.frame_end = 1, 21


CONSTRAINTS: dict[str, Constrain] = {
    "Copy Location": on("Hand", "COPY_LOCATION", "Body", use_offset=True),
    "Copy Rotation": on("Hand", "COPY_ROTATION", "Body", influence=0.6),
    "Copy Transforms, local": on(
        *("Hand", "COPY_TRANSFORMS", "Body"), mix_mode="AFTER_FULL", owner_space="LOCAL", target_space="LOCAL"
    ),
    "Damped Track": on("Hand", "DAMPED_TRACK", track_axis="TRACK_Y"),
    "Stretch To": on("Hand", "STRETCH_TO", rest_length=0.2),
    "Child Of": on("Hand", "CHILD_OF"),
    "Child Of a bone": on("Hand", "CHILD_OF", "Upper", influence=0.7),
    "IK": ik(),
    "IK with a pole": ik(pole_subtarget="Body"),
    "an Action": action_of_the_animators,
}
"""What hangs below the modes of bones."""


def far_target() -> bpy.types.Object:
    """An object that moves and turns where no bone comes near it, from which directions would be told badly."""
    target = key(new_object("Target"), seed=3)
    for point in curves_of(target)["location", 2].keyframe_points:
        point.co_ui.y += 8.0
    return target


def within_reach(target: bpy.types.Object) -> None:
    """Let the target move about where the hand rests.

    For what a limb cannot reach, and from poses turned every which way, Blender's solver itself makes up to 0.02 of the
    reach out of two units in the last place of the keys, and no two rigs could be told to be alike.
    """
    around = np.random.default_rng(5).normal(size=(len(FRAMES), 3))
    write_channel(target, "location", np.array(FRAMES), (0.75, 0.3, 1.15) + 0.06 * around, interpolation="BEZIER")
    turned = (1.0, 0.0, 0.0, 0.0) + 0.1 * np.pad(around, ((0, 0), (1, 0)))
    write_channel(target, "rotation_quaternion", np.array(FRAMES), turned, interpolation="BEZIER")


def two_alike(order: str, constrain: Constrain, mode: str) -> tuple[bpy.types.Object, bpy.types.Object]:
    """A rig that moves in a mode and one with real keys on every frame, with these constraints."""
    target = far_target()
    rig = new_rig(rotation_mode=order)
    constrain(rig, target)
    solved = [constraint for constraint in rig.pose.bones["Hand"].constraints if constraint.type == "IK"]
    key_all(rig, scale="even", amount=0.1 if solved else 1.0)
    for constraint in solved:
        within_reach(target)
        constraint.pole_target = rig if constraint.pole_subtarget else None
    set_mode(list(rig.pose.bones), mode)
    twin = twin_of(rig)
    key_desired(twin, rig, PLAYED)
    return rig, twin


@pytest.mark.parametrize(("name", "order"), in_turn(CONSTRAINTS, ORDERS))
def test_other_constraints_follow_the_mode_as_they_follow_real_keys(live_file, name, order):
    rig, twin = two_alike(order, CONSTRAINTS[name], "dq_sclerp")
    assert [bone.constraints[0].name for bone in rig.pose.bones] == ["Rigid Motion"] * 4, "at the top of every stack"
    assert {problem_of(pose_bone) for pose_bone in rig.pose.bones} == {""}
    shown, expected = shown_poses([rig, twin], PLAYED)
    assert_same_poses(rig, PLAYED, shown, expected)
