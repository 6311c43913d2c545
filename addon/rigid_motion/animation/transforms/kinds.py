"""The kinds of what is moved: objects and pose bones. Each is a class, and a row in `writers.table`.

What the in-betweens of objects differ in goes into delta transforms, or is put on top of them by a constraint. An
object may have delta transforms of its own: those it had before any in-betweens are its *original* ones. They are
written down on the object, component by component, before in-betweens take their place, and given back when these go.

A bone has no delta transforms: an Action constraint, first in its stack, adds the difference to the location, the
rotation and the scale that its channels give it. It has nothing of its own that the difference could overwrite.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from functools import cache, lru_cache

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...motion.eulers import ORDERS, quaternions_from_extrinsic_eulers
from ..compute.components import REST, ROTATION, ROWS
from .transform import LINKED, OWN_WORDS, Channel, Transform, channels_under

CONSTRAINT = "Rigid Motion"
"""The name of the constraint, and the beginning of its name where Actions of one rig need one each."""

NEAR = 1e-4
"""Matrices of bones that differ by less are the same, in single precision by way of the rig."""

_BONE = re.compile(r'pose\.bones\["((?:[^"\\]|\\.)*)"\]\.')

GROUP = "Rigid Motion"
"""The group of F-curves that an object's mode channel and its differences are in."""

ORIGINALS = {
    "delta_location": "own_location",
    "delta_rotation_quaternion": "own_quaternion",
    "delta_rotation_euler": "own_euler",
    "delta_scale": "own_scale",
}
"""Where an object's original of each delta transform is written down."""

_CHANNELS = [(path, index) for path in ORIGINALS for index in range(4 if path.endswith("quaternion") else 3)]
"""The components of the delta transforms, in the order of `filled`."""


class BoneTransform(Transform):
    """A pose bone. The difference is put on top of it by a constraint."""

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

    def __init__(self, bone: bpy.types.PoseBone) -> None:
        self.animated, self.carrier, self.prefix = bone.id_data, bone, prefix_of(bone.name)

    @classmethod
    def difference_group(cls, prefix: str) -> str:
        return bone_name(prefix)

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

    def differences_for(self, rotation: str) -> dict[int, Channel]:
        return channels_under(self.prefix, rotation)

    def original(self) -> np.ndarray:
        return REST.copy()

    def is_as_seen(self, evaluated: bpy.types.PoseBone) -> bool:
        bone = self.carrier
        seen = self.animated.convert_space(pose_bone=bone, matrix=evaluated.matrix, from_space="POSE", to_space="LOCAL")
        return np.allclose(seen, bone.matrix_basis, rtol=NEAR, atol=NEAR)


def shows_differences(constraint: bpy.types.Constraint) -> bool:
    """Return whether a constraint is one that differences are shown by."""
    return constraint.type == "ACTION" and constraint.name.startswith(CONSTRAINT) and constraint.use_eval_time


def difference_constraints(rig: bpy.types.Object) -> Iterator[bpy.types.Constraint]:
    """Yield the constraints on bones that differences are shown by."""
    bones = () if rig.pose is None else rig.pose.bones
    return (constraint for bone in bones for constraint in bone.constraints if shows_differences(constraint))


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


class ObjectTransform(Transform):
    """An object. The difference goes into its delta transforms."""

    is_part = False
    has_difference_slot = False
    label = n_("Object", OWN_WORDS)
    plural = "objects"
    linked_text = LINKED
    differing_text = n_(
        "{name} moves by the same Action slot as {leader}, but has another rotation mode, driver or delta transform; "
        "the in-betweens are those of {leader}: give it an Action of its own (Object > Relations > Make Single User)"
    )
    placed_by = ("TRANSFORM_OT_", "VIEW3D_OT_snap_", "OBJECT_OT_align")
    stored_by = ()

    def __init__(self, obj: bpy.types.Object) -> None:
        self.animated = self.carrier = obj

    @classmethod
    def together(cls, users: tuple[Transform, ...]) -> tuple[Transform, ...]:
        if any(user.has_difference_slot for user in users):
            return tuple(ExactObjectTransform(user.carrier) for user in users)
        return users

    @classmethod
    def difference_group(cls, prefix: str) -> str:
        return GROUP

    def differences_for(self, rotation: str) -> dict[int, Channel]:
        return channels_under("delta_", rotation)

    def original_values(self, path: str) -> Sequence[float]:
        """Return what one of its delta properties has without in-betweens."""
        noted = self._recorded
        return self._noted_values(path, noted) if noted else getattr(self.carrier, path)[:]

    def _noted_values(self, path: str, noted: Collection[Channel]) -> list[float]:
        """Return what is written down in these components of a delta property, and in the others what it has."""
        now, then = getattr(self.carrier, path), getattr(self.motion, ORIGINALS[path])
        return [then[i] if (path, i) in noted else value for i, value in enumerate(now)]

    def original(self) -> np.ndarray:
        values = self.original_values
        rotation = REST[ROWS[ROTATION]]
        if self.carrier.rotation_mode in ORDERS:
            angles = values("delta_rotation_euler")
            if any(angles):
                rotation = quaternions_from_extrinsic_eulers(np.array((angles,)), self.carrier.rotation_mode)[0]
        else:
            quaternion = values("delta_rotation_quaternion")
            if length := math.hypot(*quaternion):
                rotation = [component / length for component in quaternion]
        return np.array((*values("delta_location"), *rotation, *values("delta_scale")))

    def is_recorded(self, filled: Iterable[Channel]) -> bool:
        """Return whether the original values of these channels are written down."""
        return self._recorded.issuperset(channel for channel in filled if channel[0] in ORIGINALS)

    def is_more_noted(self, filled: Iterable[Channel]) -> bool:
        """Return whether the original values of channels other than these are written down."""
        return not self._recorded <= set(filled)

    def note_original(self, filled: Iterable[Channel], *, overwritten: bool = False) -> None:
        """Write the original values of these channels down, which in-betweens are about to take the place of.

        `overwritten`: they have done so already, and it has none.
        """
        noted = self._recorded
        added = set(_CHANNELS).intersection(filled) - noted
        for path in {path for path, _ in added}:
            now, then = getattr(self.carrier, path), list(getattr(self.motion, ORIGINALS[path]))
            for i, value in enumerate(now):
                if (path, i) in added and overwritten:
                    then[i] = default_of(path)[i]
                elif (path, i) not in noted:
                    then[i] = value
            _set_if_other(self.motion, ORIGINALS[path], then)
        self._keep(noted | added)

    def follow_original(self) -> None:
        """Show an edit of what is written down in all components that in-betweens are not in."""
        self._show(set(_CHANNELS) - self._recorded)

    def show_original(self) -> None:
        """Set the delta transforms to what is written down, for as long as Blender leaves them so."""
        self._show(self._recorded)

    def restore_original(self, filled: Iterable[Channel]) -> None:
        """Give the original values back, but for these channels, which are animated still."""
        noted = self._recorded
        if gone := noted.difference(filled):
            self._show(gone)
            self._keep(noted - gone)

    def _show(self, channels: Collection[Channel]) -> None:
        """Set these components of delta transforms of which any is written down to that."""
        for path in {path for path, _ in self._recorded}:
            _set_if_other(self.carrier, path, self._noted_values(path, channels))

    @property
    def _recorded(self) -> frozenset[Channel]:
        """The components that are written down."""
        return frozenset(itertools.compress(_CHANNELS, self.motion.filled))

    def _keep(self, noted: Collection[Channel]) -> None:
        _set_if_other(self.motion, "filled", [channel in noted for channel in _CHANNELS])


class ExactObjectTransform(ObjectTransform):
    """An object that is to be exact between frames. The difference is put on top of it by a constraint, as on bones:
    samples of delta transforms lie on whole frames.
    """

    has_difference_slot = True

    def differences_for(self, rotation: str) -> dict[int, Channel]:
        return channels_under("", rotation)

    @property
    def constraint_settings(self) -> dict[str, object]:
        # Without a parent, an object's local axes are those that it has been turned to.
        space = "WORLD" if self.carrier.parent is None else "LOCAL"
        return super().constraint_settings | {"owner_space": space}


def _set_if_other(owner: bpy.types.bpy_struct, name: str, values: Iterable[float]) -> None:
    """Set a property where it is not that already: to set it costs an update of the object."""
    values = tuple(values)
    if tuple(getattr(owner, name)) != values:
        setattr(owner, name, values)


@cache
def default_of(path: str) -> tuple[float, ...]:
    """Return what a delta transform is where an object has none of its own."""
    return tuple(bpy.types.Object.bl_rna.properties[path].default_array)


def transform_of(carrier: bpy.types.Object | bpy.types.PoseBone | Transform) -> Transform:
    """Return the transform of something that Blender has, where it is none already."""
    if isinstance(carrier, Transform):
        return carrier
    if isinstance(carrier, bpy.types.PoseBone):
        return BoneTransform(carrier)
    if isinstance(carrier, bpy.types.Object):
        return ExactObjectTransform(carrier) if carrier.rigid_motion.is_exact else ObjectTransform(carrier)
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
