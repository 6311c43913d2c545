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


def armature(rig: bpy.types.Object, target: bpy.types.Object) -> None:
    constraint = rig.pose.bones["Hand"].constraints.new("ARMATURE")
    for bone, weight in (("Body", 0.7), ("Upper", 0.4)):
        held = constraint.targets.new()
        held.target, held.subtarget, held.weight = rig, bone, weight


def ik(*, limited: bool = False, **settings: object) -> Constrain:
    def add(rig: bpy.types.Object, target: bpy.types.Object) -> None:
        on("Hand", "IK", chain_count=3, **({"iterations": 200} | settings))(rig, target)
        if settings.get("use_stretch"):
            rig.pose.bones["Lower"].ik_stretch = 0.1
        rig.pose.bones["Upper"].use_ik_limit_x = limited
        rig.pose.bones["Upper"].ik_min_x, rig.pose.bones["Upper"].ik_max_x = -0.5, 0.8

    return add


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
    "Copy Rotation before": on("Hand", "COPY_ROTATION", "Upper", mix_mode="BEFORE"),
    "Copy Rotation, local": on(
        *("Hand", "COPY_ROTATION", "Upper"), mix_mode="ADD", owner_space="LOCAL", target_space="LOCAL", use_y=False
    ),
    "Copy Rotation of what is above it": on("Hand", "COPY_ROTATION", "Lower", target_space="LOCAL_OWNER_ORIENT"),
    "Copy Scale": on("Hand", "COPY_SCALE", "Upper", use_offset=True),
    "Copy Transforms": on("Hand", "COPY_TRANSFORMS", "Upper", mix_mode="BEFORE_SPLIT", influence=0.5),
    "Copy Transforms, local": on(
        *("Hand", "COPY_TRANSFORMS", "Body"), mix_mode="AFTER_FULL", owner_space="LOCAL", target_space="LOCAL"
    ),
    "Limit Distance": on("Hand", "LIMIT_DISTANCE", distance=0.4),
    "Limit Location": on(
        *("Hand", "LIMIT_LOCATION"), owner_space="LOCAL", use_max_x=True, max_x=0.05, use_min_y=True, min_y=-0.1
    ),
    "Limit Rotation": on(
        *("Hand", "LIMIT_ROTATION"), owner_space="LOCAL", use_limit_x=True, min_x=-0.3, max_x=0.4, influence=0.5
    ),
    "Limit Scale": on("Hand", "LIMIT_SCALE", owner_space="LOCAL", use_max_x=True, max_x=0.9),
    "Maintain Volume": on("Hand", "MAINTAIN_VOLUME", owner_space="LOCAL"),
    "Transformation": on(
        *("Hand", "TRANSFORM", "Upper"), map_from="ROTATION", map_to="LOCATION", from_max_x_rot=2.0, to_max_y=0.5
    ),
    "Damped Track": on("Hand", "DAMPED_TRACK", track_axis="TRACK_Y"),
    "Damped Track of another bone": on("Lower", "DAMPED_TRACK", "Body", track_axis="TRACK_Z"),
    "Locked Track": on("Hand", "LOCKED_TRACK", track_axis="TRACK_Y", lock_axis="LOCK_Z"),
    "Stretch To": on("Hand", "STRETCH_TO", rest_length=0.2),
    "Track To": on("Hand", "TRACK_TO", track_axis="TRACK_Y", up_axis="UP_Z"),
    "Child Of": on("Hand", "CHILD_OF"),
    "Child Of a bone": on("Hand", "CHILD_OF", "Upper", influence=0.7),
    "Floor": on("Hand", "FLOOR", offset=0.2),
    "Pivot": on("Hand", "PIVOT", rotation_range="ALWAYS_ACTIVE"),
    "Armature": armature,
    "IK": ik(),
    "IK with limits": ik(limited=True),
    "IK with a pole": ik(pole_subtarget="Body"),
    "IK that stretches": ik(use_stretch=True),
    "IK halfway": ik(influence=0.5),
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


def test_a_rig_that_is_scaled_unevenly_and_moves_has_its_constraints_follow(live_file):
    target = far_target()
    rig = key_all(new_rig())
    rig.scale, rig.location, rig.rotation_euler = (0.5, 2.0, 1.3), (3.0, 1.0, -2.0), (0.4, 0.9, -0.3)
    for name in ("Child Of", "Copy Rotation", "Damped Track"):
        CONSTRAINTS[name](rig, target)
    set_mode(list(rig.pose.bones), "dq_sclerp")
    twin = twin_of(rig)
    key_desired(twin, rig, PLAYED)
    shown, expected = shown_poses([rig, twin], PLAYED)
    assert_same_poses(rig, PLAYED, shown, expected)
