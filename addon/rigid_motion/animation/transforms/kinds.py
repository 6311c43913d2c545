"""The kinds of what is moved: objects and pose bones."""

from __future__ import annotations

import re
from functools import lru_cache

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...motion.eulers import ORDERS, quaternions_from_extrinsic_eulers
from ..evaluation.components import LOCATION, REST, ROTATION, ROWS, SCALE
from .transform import LINKED, OWN_WORDS, Transform

_BONE = re.compile(r'pose\.bones\["((?:[^"\\]|\\.)*)"\]\.')


class BoneTransform(Transform):
    """A pose bone."""

    is_part = True
    label = n_("Bone", OWN_WORDS)
    plural = "bones"
    linked_text = n_(
        "{name} is linked from another file: make an override of it first (Object > Library Override > Make)"
    )
    differing_text = n_(
        "{name} moves by the same Action slot as {leader}, but has another rotation mode, driver or Local Location; "
        "the in-betweens are those of {leader}: give it an Action of its own (Object > Relations > Make Single User)"
    )

    def __init__(self, bone: bpy.types.PoseBone) -> None:
        self.animated, self.carrier, self.prefix = bone.id_data, bone, prefix_of(bone.name)

    @property
    def name(self) -> str:
        return f"{self.animated.name}/{self.carrier.name}"

    @property
    def location_axes(self) -> np.ndarray | None:
        """Without *Local Location* a bone is moved along the axes of its parent, and still turns about its own."""
        bone = self.carrier.bone
        # What was just made in Edit Mode has no bone before that is left.
        if bone is None or bone.use_local_location:
            return None
        axes = bone.matrix_local.to_3x3().transposed()
        return np.array(axes @ bone.parent.matrix_local.to_3x3() if bone.parent else axes)


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
    reference = rig.override_library.reference
    for bone in () if reference is None or reference.pose is None else reference.pose.bones:
        bone.rigid_motion  # noqa: B018


class ObjectTransform(Transform):
    """An object. Its delta transforms come on top of what its channels have."""

    is_part = False
    label = n_("Object", OWN_WORDS)
    plural = "objects"
    linked_text = LINKED
    differing_text = n_(
        "{name} moves by the same Action slot as {leader}, but has another rotation mode, driver or delta transform; "
        "the in-betweens are those of {leader}: give it an Action of its own (Object > Relations > Make Single User)"
    )

    def __init__(self, obj: bpy.types.Object) -> None:
        self.animated = self.carrier = obj

    def original(self) -> np.ndarray:
        obj, result = self.carrier, REST.copy()
        result[ROWS[LOCATION]], result[ROWS[SCALE]] = obj.delta_location, obj.delta_scale
        if obj.rotation_mode in ORDERS:
            angles = np.array([obj.delta_rotation_euler])
            result[ROWS[ROTATION]] = quaternions_from_extrinsic_eulers(angles, obj.rotation_mode)[0]
        elif obj.rotation_mode == "QUATERNION" and any(obj.delta_rotation_quaternion):
            result[ROWS[ROTATION]] = obj.delta_rotation_quaternion.normalized()
        return result


def transform_of(carrier: bpy.types.Object | bpy.types.PoseBone | Transform) -> Transform:
    """Return the transform of something that Blender has, where it is none already."""
    if isinstance(carrier, Transform):
        return carrier
    if isinstance(carrier, bpy.types.PoseBone):
        return BoneTransform(carrier)
    if isinstance(carrier, bpy.types.Object):
        return ObjectTransform(carrier)
    raise TypeError(f"neither an object nor a pose bone: {carrier!r}")


def transform_in(obj: bpy.types.Object, prefix: str) -> Transform | None:
    """Return what data paths that begin so lead to in an object, None where it has no such thing."""
    if not prefix:
        return transform_of(obj)
    bone = None if obj.pose is None else obj.pose.bones.get(bone_name(prefix))
    return None if bone is None else BoneTransform(bone)


def is_part(prefix: str) -> bool:
    """Return whether data paths that begin so lead to a part of a data-block."""
    return bool(bone_name(prefix))
