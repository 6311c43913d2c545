"""Retargeting live bodies to objects and rigs: converts joint poses to channel values, and sets these in Blender.

A joint moves a bone of the same name or humanoid role. The poses are corrected for the difference between the rest
poses of the stream's skeleton and of the rig. Poses of roots are in metres, in Blender's axes.

Between two ticks only names are kept, because an undo invalidates every reference to Blender's data. The axes of
streams are the world's. An armature is driven in the space of its parent, regardless of its own location, so its
location can place it and a parent can turn it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, cast

import bpy
import numpy as np
from mathutils import Quaternion

from ..animation.holds.holders import is_ours
from ..animation.holds.placing import world_of
from ..blender import armature, pose_bones, scene, view_layer
from ..motion import Poses
from ..motion.eulers import ORDERS
from ..motion.humanoid import SPINE, alignments, humanoid_bones, plain_name, relative_to_followed
from ..motion.poses import inverse, placed
from ..motion.quaternions import conjugate, from_matrices, multiply, rotate
from ..streams import StreamBody

DRIVEN_MARK = "rigid_motion_live"
"""The custom property of an object created for a body. Its value is the body's label."""

AXES_LENGTH_M = 0.1
"""The length, in metres, of the axes that show a rigid body, and of bones without a known end."""

TRIAL_TURN_RAD = 0.5
"""The angle, in radians, by which a control is turned to find the bones that follow it."""

MIN_FOLLOWING_RAD = 1e-3
"""A bone that turns by more than this angle, in radians, follows the control."""

RIG_SWITCHES = ("IK_FK", "neck_follow", "head_follow")
"""Custom properties of Rigify's rigs. At 1, limbs follow their FK controls, and neck and head follow their parents
completely."""


def matched(sources: Sequence[str], targets: Sequence[str]) -> dict[str, str]:
    """Match source joints to the target bones that they move. If the target has all source names, names decide. Else
    a joint matches the same humanoid bone, or else the same name, ignoring case, namespace and spelling of sides.
    """
    if set(sources) <= set(targets):
        return {name: name for name in sources}
    ours, theirs = humanoid_bones(sources), humanoid_bones(targets)
    # Spines with different numbers of bones are matched from the top down.
    spines = [[bone for bone in SPINE if bone in bones][::-1] for bones in (ours, theirs)]
    same = {bone: bone for bone in ours if bone in theirs and bone not in SPINE} | dict(zip(*spines, strict=False))
    pairs = {sources[ours[bone]]: targets[theirs[other]] for bone, other in same.items()}
    plain = {plain_name(name): name for name in reversed(targets)}
    for name in sources:
        target = name if name in targets else plain.get(plain_name(name))
        if target is not None and name not in pairs and target not in pairs.values():
            pairs[name] = target
    return {name: pairs[name] for name in sources if name in pairs}


class Retargeting:
    """Converts poses of a source's joints to poses of a target's joints, pair by pair.

    Parameters
    ----------
    source, target : Poses, shape (joints,)
        The rest poses, each in the space of its root.
    pairs : array of int, shape (pairs, 2)
        The indices of the source joint and of the target joint, parents before their children.
    parents : array of int, shape (pairs,)
        The pair of each pair's parent in the source, -1 for none.
    bones : dict
        The pair of each humanoid bone.
    sliding : array of bool, shape (pairs,)
        True for pairs whose joints also move in their parent's space.
    """

    def __init__(
        self,
        source: Poses,
        target: Poses,
        pairs: np.ndarray,
        parents: np.ndarray,
        bones: dict[str, int],
        sliding: np.ndarray,
    ) -> None:
        self.sources, self.sliding = pairs[:, 0], sliding
        source, target = source[pairs[:, 0]], target[pairs[:, 1]]
        arms = [
            np.where(sliding[parents] | (parents < 0), 0.0, _arm_lengths(rest, parents)) for rest in (source, target)
        ]
        both = (arms[0] > 1e-6) & (arms[1] > 1e-6)
        self.has_places = bool(np.any(_arm_lengths(source, parents) > 1e-6)) or len(pairs) == 1
        legs = [row for bone, row in bones.items() if bone.endswith(("LowerLeg", "Foot")) and both[row]]
        self.scale = float(np.median(arms[1][both] / arms[0][both])) if both.any() else 1.0
        if legs:
            # Scaled by the legs, the feet of both are on the same ground.
            self.scale = float(np.sum(arms[1][legs]) / np.sum(arms[0][legs]))
        hips = [row for bone, row in bones.items() if bone.endswith("UpperLeg")]
        aligned = alignments(bones, target.positions, source.positions) if self.has_places else {}
        turns = target.quaternions.copy()
        for bone, turn in aligned.items():
            turns[bones[bone]] = multiply(turn, turns[bones[bone]])
        self._target_in_source = Poses(np.zeros((len(pairs), 3)), multiply(conjugate(source.quaternions), turns))
        """The pose of each target joint in the space of its source joint. At rest the children of both coincide."""
        for pair in np.flatnonzero(sliding):
            children = np.flatnonzero(parents == pair)
            if len(children):
                of_hips = [child for child in children.tolist() if child in hips]
                children = np.array(of_hips) if of_hips else children
                theirs = (source.positions[children] - source.positions[pair]).mean(axis=0)
                ours = (target.positions[children] - target.positions[pair]).mean(axis=0)
                arm = rotate(conjugate(source.quaternions[pair]), self.scale * theirs - ours)
                self._target_in_source.positions[pair] = arm

    @property
    def seen(self) -> Poses:
        """The pose of each source joint in the space of its target joint, in the target's size, shape (pairs,)."""
        return inverse(self._target_in_source)

    def __call__(self, poses: Poses) -> Poses:
        """Return the poses (pairs, n) of the target for poses (joints, n) of the source."""
        poses = poses[self.sources]
        return placed(Poses(self.scale * poses.positions, poses.quaternions), self._target_in_source[:, None])


def _arm_lengths(rest: Poses, parents: np.ndarray) -> np.ndarray:
    return np.linalg.norm(rest.positions - rest.positions[parents], axis=1)


Hand = tuple[str, str]
"""A holder: the names of an object and of one of its bones, "" for none."""


class Driver:
    """Shows a rigid body on one object, by the object's own channels."""

    prefixes: Sequence[str] = ("",)
    """Data path prefixes of the channels. Location and rotation are relative to the unkeyed pose."""

    has_location, follows, ends = np.ones(1, dtype=bool), np.full(1, -1), np.zeros(1)
    """For each channel: whether it has a location, the index of the channel that it follows, -1 for the world, and its
    bone's length if no other bone follows that bone. Shape (channels,)."""

    unit = 1.0
    """Metres per unit of `locals` and `ends`."""

    def __init__(self, obj: bpy.types.Object, body: StreamBody) -> None:
        self.name, self.body = obj.name, body

    @property
    def object(self) -> bpy.types.Object | None:
        """The object, None if it no longer exists."""
        return bpy.data.objects.get((self.name, None))

    def show(self, poses: Poses) -> bool:
        """Show poses (joints,), and turn off constraints that hold the object. Return False if the object is gone."""
        obj = self.object
        if obj is None:
            return False
        if obj.is_editable:
            values = self.values(poses[:, None])[:, 0]
            rows = values.positions.tolist(), values.quaternions.tolist(), self.has_location.tolist()
            for owner, place, rotation, has_location in zip(self.owners(obj), *rows, strict=True):
                if owner is not None:
                    for constraint in filter(is_ours, owner.constraints):
                        constraint.influence = 0.0
                    _set_channels(owner, place if has_location else None, rotation)
        return True

    def values(self, poses: Poses) -> Poses:
        """Return the channel values (channels, n) for poses (joints, n)."""
        return poses[:1]

    def owners(self, obj: bpy.types.Object) -> Iterable[bpy.types.Object | bpy.types.PoseBone | None]:
        """Return the object or the pose bone of each channel; None for a bone that is gone."""
        return (obj,)

    def locals(self, values: Poses) -> Poses:
        """Return the poses (channels, n) for channel values, each in the space of the channel that it follows."""
        return values

    def hand(self, _joint: str) -> tuple[Hand, Poses] | None:
        """Return the holder that stands for a joint, and the joint's pose () in its space; None if there is none."""
        return (self.name, ""), Poses(np.zeros(3), [1.0, 0.0, 0.0, 0.0])


class RigDriver(Driver):
    """Shows a skeleton on the bones of an armature.

    Parameters
    ----------
    obj
        The armature. The transforms of the driven bones are reset.
    pairs
        The bone that each joint moves.
    """

    def __init__(self, obj: bpy.types.Object, body: StreamBody, pairs: Mapping[str, str]) -> None:
        super().__init__(obj, body)
        bones = pose_bones(obj)
        joints = [joint for joint in body.joints if pairs.get(joint, "") in bones]
        self.bones = [pairs[joint] for joint in joints]
        self.prefixes = [f'pose.bones["{bpy.utils.escape_identifier(name)}"].' for name in self.bones]
        in_space, self.follows = _rest_and_follows(obj, self.bones)
        lengths = np.array([bones[name].bone.length for name in self.bones])
        # Bones longer than the whole body get their length from an importer.
        are_free = lengths <= np.abs(in_space.positions).max(initial=0.0)
        are_free[self.follows[self.follows >= 0]] = False
        self.ends = np.where(are_free, lengths, 0.0)
        self._offsets = relative_to_followed(in_space, self.follows)[:, None]
        """The unkeyed pose of each bone, in the space of the bone that it follows, or of the armature."""
        _, turn, scale = obj.matrix_basis.decompose()
        self._turn, self.unit = np.array(turn), max(sum(map(abs, scale[:])) / 3.0, 1e-9)
        numbers = np.array([body.joints.index(joint) for joint in joints], dtype=np.int64)
        named, sliding = humanoid_bones(body.joints), cast(np.ndarray, body.sliding)[numbers]
        rows = {joint: row for row, joint in enumerate(numbers.tolist())}
        self._retarget = Retargeting(
            body.in_root_space(body.rest),
            Poses(self.unit * rotate(self._turn, in_space.positions), multiply(self._turn, in_space.quaternions)),
            np.stack((numbers, np.arange(len(numbers))), axis=1),
            np.array([self._parent_row(joint, rows) for joint in numbers.tolist()], dtype=np.int64),
            {bone: rows[joint] for bone, joint in named.items() if joint in rows},
            sliding,
        )
        connected = np.array([bones[name].bone.use_connect for name in self.bones], dtype=bool)
        self.has_location = sliding & ~connected & self._retarget.has_places
        # A Rigify control moves a limb by FK only. The ORG bone follows the limb by FK and by IK.
        hands = [f"ORG-{name.replace('_fk', '')}" for name in self.bones]
        hands = [hand if hand in bones else name for hand, name in zip(hands, self.bones, strict=True)]
        moved = placed(inverse(in_space), _bone_poses(obj, hands))
        seen = placed(inverse(Poses(self.unit * moved.positions, moved.quaternions)), self._retarget.seen)
        self._hands = {joint: ((obj.name, hand), pose) for joint, hand, pose in zip(joints, hands, seen, strict=True)}

    def hand(self, joint: str) -> tuple[Hand, Poses] | None:
        hand = self._hands.get(joint)
        return hand if hand and holder_of(hand[0]) else None

    def _parent_row(self, joint: int, rows: Mapping[int, int]) -> int:
        while (joint := int(self.body.parents[joint])) >= 0 and joint not in rows:
            pass
        return rows.get(joint, -1)

    def values(self, poses: Poses) -> Poses:
        target, back = self._retarget(self.body.skeleton.in_root_space(poses)), conjugate(self._turn)
        there = Poses(rotate(back, target.positions) / self.unit, multiply(back, target.quaternions))
        return placed(inverse(self._offsets), relative_to_followed(there, self.follows))

    def owners(self, obj: bpy.types.Object) -> Iterable[bpy.types.PoseBone | None]:
        return [obj.pose.bones.get(name) if obj.pose else None for name in self.bones]

    def locals(self, values: Poses) -> Poses:
        slides = np.where(self.has_location[:, None, None], values.positions, 0.0)
        return placed(self._offsets, Poses(slides, values.quaternions))


def object_of(label: str, body: StreamBody) -> bpy.types.Object | None:
    """Return the object that shows a body, and create a missing one; None while it cannot be created."""
    for obj in scene().objects:
        if obj.get(DRIVEN_MARK) == label and (obj.type == "ARMATURE") == (len(body.joints) > 1):
            return obj
    if len(body.joints) > 1:
        return _new_armature(label, body)
    obj = bpy.data.objects.new(label, None)
    obj.empty_display_type, obj.empty_display_size = "ARROWS", AXES_LENGTH_M
    return _link_to_scene(obj, label)


def _link_to_scene(obj: bpy.types.Object, label: str) -> bpy.types.Object:
    obj[DRIVEN_MARK] = label
    obj.rotation_mode = "QUATERNION"
    scene().collection.objects.link(obj)
    return obj


def _new_armature(label: str, body: StreamBody) -> bpy.types.Object | None:
    """Return an armature with a bone for each joint, in the joint's rest pose. Return None outside of Object Mode:
    creating bones needs Edit Mode.
    """
    if bpy.context.mode != "OBJECT":
        return None
    rest = body.in_root_space(body.rest)
    obj = _link_to_scene(bpy.data.objects.new(label, bpy.data.armatures.new(label)), label)
    active = view_layer().objects.active
    selected = bpy.context.selected_objects
    view_layer().objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    bones = [armature(obj).edit_bones.new(name) for name in body.joints]
    for joint, (bone, place, parent) in enumerate(zip(bones, rest.positions, body.parents.tolist(), strict=True)):
        children = rest.positions[body.parents == joint]
        reach = children.mean(axis=0) - place if len(children) else np.zeros(3)
        if np.linalg.norm(reach) < 1e-4:
            reach = (place - rest.positions[parent]) * 0.5 if parent >= 0 else np.zeros(3)
        bone.head, bone.tail = place, place + (reach if np.linalg.norm(reach) > 1e-4 else (0.0, 0.0, AXES_LENGTH_M))
        bone.parent = bones[parent] if parent >= 0 else None
    bpy.ops.object.mode_set(mode="OBJECT")
    armature(obj).display_type = "STICK"
    for other in bpy.context.selected_objects:
        other.select_set(other in selected)
    view_layer().objects.active = active
    return obj


def clear(obj: bpy.types.Object, bones: Iterable[str]) -> None:
    """Reset the transforms of these bones of a rig, and set its switches so that it follows them."""
    for bone in pose_bones(obj):
        for switch in RIG_SWITCHES:
            if bone.get(switch) is not None:
                bone[switch] = 1.0
    for name in bones:
        if (driven := pose_bones(obj).get(name)) is not None:
            if driven.rotation_mode == "AXIS_ANGLE":
                driven.rotation_mode = "QUATERNION"
            driven.matrix_basis.identity()
            driven.location, driven.scale = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
            _set_channels(driven, None, (1.0, 0.0, 0.0, 0.0))
    obj.update_tag()
    view_layer().update()


def _rest_and_follows(obj: bpy.types.Object, bones: list[str]) -> tuple[Poses, np.ndarray]:
    """Reset bones. Return their poses in the armature, and the index of the bone that each follows, -1 for none."""
    clear(obj, bones)
    rows = {name: row for row, name in enumerate(bones)}
    follows, unsure = np.full(len(bones), -1), []
    for row, name in enumerate(bones):
        above = pose_bones(obj)[name].parent
        while above is not None and above.name not in rows and not above.constraints:
            above = above.parent
        if above is not None and above.name not in rows:
            unsure.append(row)
        elif above is not None:
            follows[row] = rows[above.name]
    placed = _bone_poses(obj, bones)
    for row in rows.values() if unsure else ():
        # Turning a control shows which bones follow it through constraints.
        _set_channels(
            pose_bones(obj)[bones[row]], None, (np.cos(TRIAL_TURN_RAD / 2), np.sin(TRIAL_TURN_RAD / 2), 0.0, 0.0)
        )
        view_layer().update()
        turned = _bone_poses(obj, bones).quaternions
        for other in unsure:
            cosine = abs(float(placed.quaternions[other] @ turned[other]))
            if other != row and 2.0 * np.arccos(min(cosine, 1.0)) > MIN_FOLLOWING_RAD:
                follows[other] = row
        _set_channels(pose_bones(obj)[bones[row]], None, (1.0, 0.0, 0.0, 0.0))
    if unsure:
        view_layer().update()
    return placed, follows


def holder_of(hand: Hand) -> tuple[bpy.types.Object, str] | None:
    """Return the object and the bone name of a holder; None if either is gone, or the object is not editable."""
    obj, bone = bpy.data.objects.get((hand[0], None)), hand[1]
    if obj is None or not obj.is_editable or (bone and (obj.pose is None or bone not in obj.pose.bones)):
        return None
    return obj, bone


def seen_hand(hand: Hand) -> Poses:
    """Return the world pose () of an existing holder, as last evaluated."""
    holder = cast(tuple[bpy.types.Object, str], holder_of(hand))
    return unscaled(np.array(world_of(*holder, bpy.context.evaluated_depsgraph_get()), dtype=np.float64))


def _bone_poses(obj: bpy.types.Object, bones: list[str]) -> Poses:
    return unscaled(np.array([pose_bones(obj)[name].matrix for name in bones], dtype=np.float64).reshape(-1, 4, 4))


def unscaled(matrices: np.ndarray) -> Poses:
    """Return matrices (..., 4, 4) as poses, without their scale."""
    axes = matrices[..., :3, :3] / np.linalg.norm(matrices[..., :3, :3], axis=-2, keepdims=True)
    return Poses(matrices[..., :3, 3], from_matrices(axes))


def _set_channels(
    owner: bpy.types.Object | bpy.types.PoseBone, place: list[float] | None, rotation: Sequence[float]
) -> None:
    """Set the location of an object or a bone, if given, and its rotation in its own rotation mode."""
    if place is not None:
        owner.location = place
    if owner.rotation_mode == "QUATERNION":
        owner.rotation_quaternion = rotation
    elif owner.rotation_mode in ORDERS:
        owner.rotation_euler = Quaternion(rotation).to_euler(cast(Any, owner.rotation_mode), owner.rotation_euler)
