"""Scenes of Rigify's human, some suited to screw motion and some not, with the error to measure in each.

Each scene keys controls as an animator would, with Blender's default keys. It names the controls that get a screw mode,
and the point of the body that should stay in place. The human looks along -Y; units are metres and frames.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import bpy
from mathutils import Matrix, Quaternion, Vector

GRIP = Vector((0.034, 0.088, 0.0))
"""The middle of a fist, in the space of the left hand's bone."""

HANDSHAKE = Matrix(((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)))
"""Axes of a left hand that reaches forward, its thumb on top: palm (X), fingers (Y), thumb (Z)."""

CURL = {"01": 70.0, "02": 85.0, "03": 55.0}
"""Degrees by which the three parts of a finger bend in a fist."""

PIVOT, LEVER = Vector((0.27, -0.20, 0.80)), 0.50
"""The pivot of a lever, and the distance from there to the middle of the fist that holds it."""

ARM, WRIST = 0.985, 35.0
"""The fraction to which an arm is stretched, and the degrees by which its fist bends forward."""

FRAMES = (1, 31, 61)
"""The frames of the first pose, the pose at the other end, and the return."""


@dataclass(frozen=True)
class Scene:
    """A rig with its keys.

    Attributes
    ----------
    controls
        The bones that get a mode.
    strays
        Given a frame, returns how far, in metres, points that should stay together are apart, as Blender evaluates it.
    """

    rig: bpy.types.Object
    controls: list[bpy.types.PoseBone]
    strays: Callable[[int], float]

    def farthest(self) -> float:
        """Return the largest straying on any frame, in metres."""
        return max(self.strays(frame) for frame in range(FRAMES[0], FRAMES[-1] + 1))


def pull_a_lever(rig: bpy.types.Object, lever: bpy.types.Object) -> Scene:
    """The left hand moves a lever from one end to the other and back. `lever` turns about its origin.

    The fist must stay on the handle.
    """
    make_fist(rig, "L")
    hand, chest, torso = (rig.pose.bones[name] for name in ("hand_ik.L", "chest", "torso"))
    lever.parent, lever.location, lever.rotation_mode = rig, PIVOT, "XYZ"
    upright, leaning = chest.matrix.copy(), torso.matrix.copy()
    for frame, degrees, lean in zip(FRAMES, (50.0, -45.0, 50.0), (22.0, -4.0, 22.0), strict=True):
        turn = turned(degrees, "X")
        lever.rotation_euler.x = math.radians(degrees)
        lever.keyframe_insert("rotation_euler", index=0, frame=frame)
        moved = Matrix.Translation((0.0, -0.0015 * lean, 0.0)) @ leaning
        key(torso, frame, moved)
        key(chest, frame, about(moved.translation, turned(lean, "X")) @ upright)
        fist = PIVOT + turn.to_3x3() @ Vector((0.0, 0.0, LEVER))
        key(hand, frame, grasp(fist, turn.to_3x3() @ HANDSHAKE))

    def strays(frame: int) -> float:
        bones = shown(rig, frame)
        handle = Matrix.Rotation(lever.rotation_euler.x, 3, "X") @ Vector((0.0, 0.0, LEVER)) + PIVOT
        return (bones["DEF-hand.L"].matrix @ GRIP - handle).length

    return Scene(rig, [hand], strays)


def twist(rig: bpy.types.Object, degrees: float = 50.0) -> Scene:
    """Both feet turn on their balls, heels from side to side. The balls must stay in place on the floor."""
    feet = [rig.pose.bones[f"foot_ik.{side}"] for side in "LR"]
    torso = rig.pose.bones["torso"]
    rest = {bone.name: bone.matrix.copy() for bone in (*feet, torso)}
    balls = [rig.pose.bones[f"DEF-toe.{foot.name[-1]}"].head.copy() for foot in feet]
    for frame, angle in zip(FRAMES, (degrees, -degrees, degrees), strict=True):
        for foot, ball in zip(feet, balls, strict=True):
            key(foot, frame, about(ball, turned(angle, "Z")) @ rest[foot.name])
        hips = about(rest[torso.name].translation, turned(0.5 * angle, "Z")) @ rest[torso.name]
        key(torso, frame, Matrix.Translation((0.0, -0.03, -0.05)) @ hips)

    def strays(frame: int) -> float:
        bones = shown(rig, frame)
        toes = (bones[f"DEF-toe.{foot.name[-1]}"].head for foot in feet)
        return max((toe - ball).length for toe, ball in zip(toes, balls, strict=True))

    return Scene(rig, feet, strays)


def cut(rig: bpy.types.Object) -> Scene:
    """The left hand swings from overhead to below with a stretched arm, moved by the hand's control.

    The wrist must keep the distance from the shoulder that it has on the keys.
    """
    make_fist(rig, "L")
    hand = rig.pose.bones["hand_ik.L"]
    shoulder, reach = rig.pose.bones["ORG-upper_arm.L"].head.copy(), ARM * arm_length(rig)
    for frame, degrees in zip(FRAMES, (-70.0, 50.0, -70.0), strict=True):
        swing = turned(degrees, "X").to_3x3()
        wrist = shoulder + swing @ Vector((0.0, -reach, 0.0))
        key(hand, frame, posed(wrist, swing @ turned(WRIST, "X").to_3x3() @ HANDSHAKE))

    def strays(frame: int) -> float:
        return abs((shown(rig, frame)["DEF-hand.L"].head - shoulder).length - reach)

    return Scene(rig, [hand], strays)


def cut_by_joints(rig: bpy.types.Object, rotation_mode: str = "QUATERNION") -> Scene:
    """The left arm swings from overhead across the body by FK: only rotation keys of the upper arm.

    The wrist must stay on the circle of the single turn from key to key.
    """
    make_fist(rig, "L")
    rig.pose.bones["upper_arm_parent.L"]["IK_FK"] = 1.0
    rig.update_tag()
    bpy.context.view_layer.update()
    arm = rig.pose.bones["upper_arm_fk.L"]
    arm.rotation_mode = rotation_mode
    shoulder, rest = arm.head.copy(), arm.matrix.copy()
    raised, lowered = (
        about(shoulder, turned(yaw, "Z") @ turned(pitch, "X")) @ rest for pitch, yaw in ((-110.0, -10.0), (35.0, -80.0))
    )
    for frame, pose in zip(FRAMES, (raised, lowered, raised), strict=True):
        key(arm, frame, pose)
    axis = Vector((lowered @ raised.inverted()).to_quaternion().axis)
    first = shown(rig, 1)["DEF-hand.L"].head - shoulder
    height, radius = first.dot(axis), first.cross(axis).length

    def strays(frame: int) -> float:
        wrist = shown(rig, frame)["DEF-hand.L"].head - shoulder
        return math.hypot(wrist.dot(axis) - height, wrist.cross(axis).length - radius)

    return Scene(rig, [arm], strays)


# Building blocks


def key(bone: bpy.types.PoseBone, frame: int, pose: Matrix) -> None:
    """Key location and rotation so that a bone has this pose in armature space."""
    bpy.context.scene.frame_set(frame)
    path = "rotation_quaternion" if bone.rotation_mode == "QUATERNION" else "rotation_euler"
    before = getattr(bone, path).copy()
    bone.matrix = pose
    bpy.context.view_layer.update()
    if path == "rotation_quaternion" and before.dot(bone.rotation_quaternion) < 0.0:
        bone.rotation_quaternion.negate()
    for channel in ("location", path):
        if channel != "location" or not all(bone.lock_location):
            bone.keyframe_insert(channel, frame=frame)


def make_fist(rig: bpy.types.Object, side: str) -> None:
    """Close a hand."""
    for finger in ("f_index", "f_middle", "f_ring", "f_pinky"):
        for part, degrees in CURL.items():
            rig.pose.bones[f"{finger}.{part}.{side}"].rotation_quaternion = bent(degrees)
    for part, degrees in (("01", 10.0), ("02", 40.0), ("03", 45.0)):
        rig.pose.bones[f"thumb.{part}.{side}"].rotation_quaternion = bent(degrees)
    bpy.context.view_layer.update()


def grasp(fist: Vector, axes: Matrix) -> Matrix:
    """Return the pose of a hand whose fist has its middle here."""
    return posed(fist - axes @ GRIP, axes)


def posed(place: Vector, axes: Matrix) -> Matrix:
    return Matrix.Translation(place) @ axes.to_4x4()


def turned(degrees: float, axis: str) -> Matrix:
    return Matrix.Rotation(math.radians(degrees), 4, axis)


def bent(degrees: float) -> Quaternion:
    return Quaternion((1.0, 0.0, 0.0), math.radians(degrees))


def about(place: Vector, turn: Matrix) -> Matrix:
    """Return a rotation about a point instead of the origin."""
    return Matrix.Translation(place) @ turn @ Matrix.Translation(-place)


def arm_length(rig: bpy.types.Object) -> float:
    """Return the distance from shoulder to wrist of a stretched arm."""
    return sum(rig.data.bones[f"ORG-{name}.L"].length for name in ("upper_arm", "forearm"))


def shown(rig: bpy.types.Object, frame: int) -> bpy.types.bpy_prop_collection:
    """Return the evaluated bones on a frame, in armature space."""
    bpy.context.scene.frame_set(frame)
    return rig.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones
