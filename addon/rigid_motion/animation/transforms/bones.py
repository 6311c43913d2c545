"""Pose bones as transforms. What their in-betweens differ in is put on top of them by a constraint.

A bone has no delta transforms: an Action constraint, first in its stack, adds the difference to the location, the
rotation and the scale that its channels give it. It has nothing of its own that the difference could overwrite.
"""

from __future__ import annotations

import re
from functools import lru_cache

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ..compute.components import REST
from .transform import OWN_WORDS, Channel, Transform, channels_under

CONSTRAINT = "Rigid Motion"
"""The name of the constraint, and the beginning of its name where Actions of one rig need one each."""

NEAR = 1e-4
"""Matrices of bones that differ by less are the same,
having been through the space of the rig in single precision."""

_BONE = re.compile(r'pose\.bones\["((?:[^"\\]|\\.)*)"\]\.')


class BoneTransform(Transform):
    """A pose bone. The difference is put on top of it by a constraint."""

    carrier_type = bpy.types.PoseBone
    is_part = True
    has_difference_slot = True
    label = n_("Bone", OWN_WORDS)
    plural = "bones"
    linked_text = n_(
        "{name} is linked from another file: make an override of it first (Object > Library Override > Make)"
    )
    differing_text = n_(
        "{name} moves by the same Action slot as {leader}, but has another rotation mode, driver or Local Location; "
        "the in-betweens are those of {leader}: give it an Action of its own (Object > Relations > Make Single User)"
    )
    placed_by = ("TRANSFORM_OT_",)
    stored_by = (
        "POSE_OT_paste",
        "POSELIB_OT_",
        "POSE_OT_visual_transform_apply",
        "POSE_OT_transforms_clear",
        "POSE_OT_rigify_",
        "RIGID_MOTION_OT_switch_parent",
    )
    matrix_lacks_difference = False

    def __init__(self, bone: bpy.types.PoseBone) -> None:
        self.animated, self.carrier, self.prefix = bone.id_data, bone, prefix_of(bone.name)

    @classmethod
    def has_prefix(cls, prefix: str) -> bool:
        return bool(bone_name(prefix))

    @classmethod
    def in_object(cls, obj: bpy.types.Object, prefix: str) -> BoneTransform | None:
        bone = None if obj.pose is None else obj.pose.bones.get(bone_name(prefix))
        return None if bone is None else cls(bone)

    @classmethod
    def difference_group(cls, prefix: str) -> str:
        return bone_name(prefix)

    @property
    def name(self) -> str:
        return f"{self.animated.name}/{self.carrier.name}"

    @property
    def group(self) -> str:
        return self.carrier.name

    @property
    def location_axes(self) -> np.ndarray | None:
        """Without *Local Location* a bone is moved along the axes of its parent, and still turns about its own."""
        bone = self.carrier.bone
        # What was just made in Edit Mode has no bone before that is left.
        if bone is None or bone.use_local_location:
            return None
        axes = bone.matrix_local.to_3x3().transposed()
        return np.array(axes @ bone.parent.matrix_local.to_3x3() if bone.parent else axes)

    def differences_for(self, rotation: str) -> dict[int, Channel]:
        return channels_under(self.prefix, rotation)

    def original(self) -> np.ndarray:
        return REST.copy()

    def evaluated(self, depsgraph: bpy.types.Depsgraph) -> bpy.types.PoseBone | None:
        return self.animated.evaluated_get(depsgraph).pose.bones.get(self.carrier.name)

    def is_as_seen(self, evaluated: bpy.types.PoseBone) -> bool:
        bone = self.carrier
        seen = self.animated.convert_space(pose_bone=bone, matrix=evaluated.matrix, from_space="POSE", to_space="LOCAL")
        return np.allclose(seen, bone.matrix_basis, rtol=NEAR, atol=NEAR)


def shows_differences(constraint: bpy.types.Constraint) -> bool:
    """Return whether a constraint is one that differences are shown by."""
    return constraint.type == "ACTION" and constraint.name.startswith(CONSTRAINT) and constraint.use_eval_time


@lru_cache(maxsize=65536)
def prefix_of(name: str) -> str:
    """Return how the data paths of a bone's properties begin, from its object."""
    return f'pose.bones["{bpy.utils.escape_identifier(name)}"].'


@lru_cache(maxsize=65536)
def split_path(path: str) -> tuple[str, str]:
    """Return the prefix of a data path, "" where it is not that of a bone's property, and the rest of it."""
    result = _BONE.match(path)
    return (result[0], path[result.end() :]) if result else ("", path)


@lru_cache(maxsize=65536)
def bone_name(prefix: str) -> str:
    """Return the name of the bone that data paths which begin so speak of."""
    result = _BONE.fullmatch(prefix)
    return "" if result is None else bpy.utils.unescape_identifier(result[1])


def let_override_be_read(rig: bpy.types.Object) -> None:
    """Have what an override keeps on bones be there when its file is opened again.

    Blender 5 does not read it where the library has nothing of the kind on the bone, not even what is made when it is
    asked for.
    """
    override = rig.override_library
    if override is not None and override.reference is not None:
        for bone in override.reference.pose.bones:
            bone.rigid_motion  # noqa: B018
