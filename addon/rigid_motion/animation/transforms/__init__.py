"""Transforms: one small interface for objects and pose bones, which have location, rotation and scale.

A transform knows the data-block whose Action animates it, and the data path of its channels.

sizes      the sizes of objects and rigs, and how far bones reach
posing     forward kinematics of bones

Both import this module.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache, lru_cache
from typing import Protocol, cast

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from ...blender import existing
from ...motion.eulers import ORDERS, quaternions_from_extrinsic_eulers
from ..evaluation.components import LOCATION, REST_COMPONENTS, ROTATION, ROWS, SCALE

OWN_WORDS = "Rigid Motion"
"""The translation context for words that Blender translates differently, or too long for where they are shown."""

LINKED_REFUSAL = n_(
    "{name} is linked from another file: make it local first (Object > Relations > Make Local), "
    "or override it (Object > Library Override > Make)"
)
"""The reason why a data-block cannot be edited, and the way out."""

MOTION_PROPERTY = "rigid_motion"
"""The name of this extension's property groups on objects and pose bones."""

TURNS_PROPERTY = f"{MOTION_PROPERTY}.turns"
"""The property whose keys add whole turns to segments."""

GROUP_NAME = "Rigid Motion"
"""The F-curve group for the Turns channel of an object."""

WIDTHS = {LOCATION: 3, "rotation_quaternion": 4, "rotation_euler": 3, "rotation_axis_angle": 4, SCALE: 3}
"""The properties that move an object or bone, and the number of components of each."""

_ROTATIONS = {None: "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}

_BONE = re.compile(r'pose\.bones\["((?:[^"\\]|\\.)*)"\]\.')

Channel = tuple[str, int]
"""Data path, relative to the animated data-block, and array index."""


class Note(Protocol):
    """A record of changed keys, see `properties`."""

    kind: str
    changed: bpy.types.Action | None
    handle: int
    original: bpy.types.Action | None
    kept_as: str
    reduction: str


class ObjectMotion(Protocol):
    """The extension's properties of an object or a pose bone, see `properties`."""

    turns: int
    lead: Sequence[float]
    awaited: str
    base: bpy.types.Object | None
    bakes: bpy.types.bpy_prop_collection_idprop[Note]


class Refused(ValueError):
    """Why rigid motion cannot act on something, with the name of that and the way out.

    The text is in English, with placeholders for facts; without facts it is used unchanged.
    """

    def __init__(self, text: str, **facts: object) -> None:
        super().__init__(rpt_(text).format(**facts) if facts else text)


class Transform:
    """An object or bone with location, rotation and scale, animated by the Action of its data-block.

    Differences between bones and objects are answered here, never guessed from data paths.
    """

    def __init__(self, carrier: bpy.types.Object | bpy.types.PoseBone) -> None:
        self.carrier = carrier
        """The object or bone that owns the properties."""
        self.animated = cast(bpy.types.Object, carrier.id_data)
        """The data-block that owns the Action."""
        self.is_part = isinstance(carrier, bpy.types.PoseBone)
        """True for a bone, a part of its data-block with a name that can change; False for the data-block itself."""
        self.prefix = prefix_of(carrier.name) if self.is_part else ""
        """The data path from the data-block to the carrier."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Transform) and (self.animated, self.prefix) == (other.animated, other.prefix)

    def __hash__(self) -> int:
        return hash((self.animated, self.prefix))

    @property
    def identity(self) -> tuple[int, str]:
        """A key that outlives Blender's references: the data-block's session id, and the prefix."""
        return self.animated.session_uid, self.prefix

    @property
    def name(self) -> str:
        return f"{self.animated.name}/{self.carrier.name}" if self.is_part else self.carrier.name

    @property
    def label(self) -> str:
        """The word in front of its mode, in English."""
        return n_("Bone", OWN_WORDS) if self.is_part else n_("Object", OWN_WORDS)

    @property
    def group(self) -> str:
        """The F-curve group that Blender uses for its channels."""
        return self.carrier.name if self.is_part else "Object Transforms"

    @property
    def location_axes(self) -> np.ndarray | None:
        """The axes that location runs along, as columns (3, 3) in the axes of rotation; None if both are the same.

        Without *Local Location*, a bone moves along the axes of its parent, but rotates about its own.
        """
        bone = self.pose_bone.bone if self.is_part else None
        # A bone just created in Edit Mode has no bone data before leaving that mode.
        if bone is None or bone.use_local_location:
            return None
        axes = bone.matrix_local.to_3x3().transposed()
        return np.array(axes @ bone.parent.matrix_local.to_3x3() if bone.parent else axes)

    @property
    def pose_bone(self) -> bpy.types.PoseBone:
        """The carrier, if it is a bone."""
        return cast(bpy.types.PoseBone, self.carrier)

    @property
    def motion(self) -> ObjectMotion:
        """The extension's properties of the carrier."""
        return getattr(self.carrier, MOTION_PROPERTY)

    @property
    def rotation(self) -> str:
        """The name of the rotation property in use."""
        return rotation_by(self.order)

    @property
    def order(self) -> str | None:
        """None for quaternions, AXIS_ANGLE, or the order of its Euler angles."""
        mode = self.carrier.rotation_mode
        return None if mode == "QUATERNION" else mode

    @property
    def properties(self) -> dict[str, str]:
        """The property for each of location, rotation and scale."""
        return {LOCATION: "location", ROTATION: self.rotation, SCALE: "scale"}

    @property
    def channels(self) -> dict[int, Channel]:
        """The channel of each of its components, by row."""
        return channels_under(self.prefix, self.rotation)

    @property
    def turns_channel(self) -> Channel:
        return self.prefix + TURNS_PROPERTY, 0

    def components(self) -> np.ndarray:
        """Return its current properties as the ten components of a source."""
        result = REST_COMPONENTS.copy()
        for part, prop in self.properties.items():
            result[ROWS[part].start :][: WIDTHS[prop]] = getattr(self.carrier, prop)
        return result

    def original(self) -> np.ndarray:
        """Return the delta transforms of an object, on top of its channels, as components (10,).

        The rotation is a unit quaternion.
        """
        obj, result = self.animated, REST_COMPONENTS.copy()
        if self.is_part:
            return result
        result[ROWS[LOCATION]], result[ROWS[SCALE]] = obj.delta_location, obj.delta_scale
        if obj.rotation_mode in ORDERS:
            angles = np.array([obj.delta_rotation_euler])
            result[ROWS[ROTATION]] = quaternions_from_extrinsic_eulers(angles, obj.rotation_mode)[0]
        elif obj.rotation_mode == "QUATERNION" and any(obj.delta_rotation_quaternion[:]):
            result[ROWS[ROTATION]] = obj.delta_rotation_quaternion.normalized()
        return result


def rotation_by(order: str | None) -> str:
    """Return the rotation property for quaternions (None), AXIS_ANGLE, or an order of Euler angles."""
    return _ROTATIONS.get(order, "rotation_euler")


@cache
def channels_under(prefix: str, rotation: str) -> dict[int, Channel]:
    """Return the channels of a transform's components by row, given the prefix of their data paths."""
    return {
        ROWS[part].start + index: (prefix + prop, index)
        for part, prop in ((LOCATION, "location"), (ROTATION, rotation), (SCALE, "scale"))
        for index in range(WIDTHS[prop])
    }


@lru_cache(maxsize=65536)
def prefix_of(name: str) -> str:
    """Return the prefix of the data paths of a bone's properties, relative to its object."""
    return f'pose.bones["{bpy.utils.escape_identifier(name)}"].'


@lru_cache(maxsize=65536)
def split_path(path: str) -> tuple[str, str]:
    """Return the bone prefix of a data path, "" if the property is not a bone's, and the rest of the path."""
    result = _BONE.match(path)
    return (result[0], path[result.end() :]) if result else ("", path)


@lru_cache(maxsize=65536)
def bone_name(prefix: str) -> str:
    """Return the name of the bone that a data path prefix refers to."""
    result = _BONE.fullmatch(prefix)
    return "" if result is None else bpy.utils.unescape_identifier(result[1])


def transform_of(carrier: bpy.types.Object | bpy.types.PoseBone | Transform) -> Transform:
    """Return the transform of an object or pose bone; a transform is returned unchanged."""
    if isinstance(carrier, Transform):
        return carrier
    if not isinstance(carrier, bpy.types.Object | bpy.types.PoseBone):
        raise TypeError(f"neither an object nor a pose bone: {carrier!r}")
    return Transform(carrier)


def transform_in(obj: bpy.types.Object, prefix: str) -> Transform | None:
    """Return the transform at a data path prefix in an object; None if there is no such bone."""
    if not prefix:
        return Transform(obj)
    bone = None if obj.pose is None else obj.pose.bones.get(bone_name(prefix))
    return None if bone is None else Transform(bone)


def let_override_be_read(rig: bpy.types.Object) -> None:
    """Make sure that properties overridden on bones are restored when the file is opened again.

    Blender 5 does not read them if the library has no such properties on the bone, not even ones created on access.
    """
    reference = existing(rig.override_library).reference
    for bone in reference.pose.bones if isinstance(reference, bpy.types.Object) and reference.pose is not None else ():
        getattr(bone, MOTION_PROPERTY)
