"""What is moved: one small interface for whatever has location, rotation and scale: objects and pose bones.

A transform knows whose Action animates it, and on which property its channels are.

sizes      how large things are, and how far they reach
posing     where the poses of bones put them

Both import what is here.
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
"""The context of words that Blender has another translation for, or one that is too long where they are shown."""

LINKED_REFUSAL = n_(
    "{name} is linked from another file: make it local first (Object > Relations > Make Local), "
    "or override it (Object > Library Override > Make)"
)
"""The reason why a data-block cannot be edited, and the way out."""

MOTION_PROPERTY = "rigid_motion"
"""The name of the properties of this extension on objects and pose bones."""

TURNS_PROPERTY = f"{MOTION_PROPERTY}.turns"
"""The property by whose keys segments make whole turns more."""

GROUP_NAME = "Rigid Motion"
"""The group of F-curves that the channel of turns of an object is in."""

WIDTHS = {LOCATION: 3, "rotation_quaternion": 4, "rotation_euler": 3, "rotation_axis_angle": 4, SCALE: 3}
"""The properties that move something, and how many components each has."""

_ROTATIONS = {None: "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}

_BONE = re.compile(r'pose\.bones\["((?:[^"\\]|\\.)*)"\]\.')

Channel = tuple[str, int]
"""Data path, from what is animated on, and index."""


class Note(Protocol):
    """A note on keys that were changed, see `properties`."""

    kind: str
    changed: bpy.types.Action | None
    handle: int
    original: bpy.types.Action | None
    kept_as: str
    reduction: str


class ObjectMotion(Protocol):
    """What this extension keeps on an object or a pose bone, see `properties`."""

    turns: int
    lead: Sequence[float]
    awaited: str
    base: bpy.types.Object | None
    bakes: bpy.types.bpy_prop_collection_idprop[Note]


class Refused(ValueError):
    """Why rigid motion cannot act on something: names it, and the way out.

    The text is in English, with placeholders for facts; without any of these it stays as it is.
    """

    def __init__(self, text: str, **facts: object) -> None:
        super().__init__(rpt_(text).format(**facts) if facts else text)


class Transform:
    """Something with location, rotation and scale, as its animated data-block's Action moves it.

    What bones differ in from objects is asked of it, never guessed from data paths.
    """

    def __init__(self, carrier: bpy.types.Object | bpy.types.PoseBone) -> None:
        self.carrier = carrier
        """The object or bone that has the properties."""
        self.animated = cast(bpy.types.Object, carrier.id_data)
        """The data-block whose Action it is."""
        self.is_part = isinstance(carrier, bpy.types.PoseBone)
        """True if it is a part of its data-block, with a name that can be changed, and not the data-block itself."""
        self.prefix = prefix_of(carrier.name) if self.is_part else ""
        """From the data-block to the carrier, in data paths."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Transform) and (self.animated, self.prefix) == (other.animated, other.prefix)

    def __hash__(self) -> int:
        return hash((self.animated, self.prefix))

    @property
    def identity(self) -> tuple[int, str]:
        """What it is known by where nothing of Blender's can be kept: its data-block's session id, and its prefix."""
        return self.animated.session_uid, self.prefix

    @property
    def name(self) -> str:
        return f"{self.animated.name}/{self.carrier.name}" if self.is_part else self.carrier.name

    @property
    def label(self) -> str:
        """The name in front of its mode, in English."""
        return n_("Bone", OWN_WORDS) if self.is_part else n_("Object", OWN_WORDS)

    @property
    def group(self) -> str:
        """The group that Blender puts its channels into."""
        return self.carrier.name if self.is_part else "Object Transforms"

    @property
    def location_axes(self) -> np.ndarray | None:
        """The axes that it is moved along, as columns (3, 3) in those that it turns about; None where they are one.

        Without *Local Location* a bone is moved along the axes of its parent, and still turns about its own.
        """
        bone = self.pose_bone.bone if self.is_part else None
        # What was just made in Edit Mode has no bone before that is left.
        if bone is None or bone.use_local_location:
            return None
        axes = bone.matrix_local.to_3x3().transposed()
        return np.array(axes @ bone.parent.matrix_local.to_3x3() if bone.parent else axes)

    @property
    def pose_bone(self) -> bpy.types.PoseBone:
        """The carrier, of what is a part."""
        return cast(bpy.types.PoseBone, self.carrier)

    @property
    def motion(self) -> ObjectMotion:
        """The properties that this extension keeps on it."""
        return getattr(self.carrier, MOTION_PROPERTY)

    @property
    def rotation(self) -> str:
        """The property that turns it."""
        return rotation_by(self.order)

    @property
    def order(self) -> str | None:
        """None where it turns by quaternions, AXIS_ANGLE, or the order of its Euler angles."""
        mode = self.carrier.rotation_mode
        return None if mode == "QUATERNION" else mode

    @property
    def properties(self) -> dict[str, str]:
        """Location, rotation and scale, and which property each of them is."""
        return {LOCATION: "location", ROTATION: self.rotation, SCALE: "scale"}

    @property
    def channels(self) -> dict[int, Channel]:
        """The channel of each of its components, by their rows."""
        return channels_under(self.prefix, self.rotation)

    @property
    def turns_channel(self) -> Channel:
        return self.prefix + TURNS_PROPERTY, 0

    def components(self) -> np.ndarray:
        """Return its properties as they are now, as the ten components of a source."""
        result = REST_COMPONENTS.copy()
        for part, prop in self.properties.items():
            result[ROWS[part].start :][: WIDTHS[prop]] = getattr(self.carrier, prop)
        return result

    def original(self) -> np.ndarray:
        """Return what comes on top of its channels, as components (10,): the delta transforms of an object.

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
    """Return the property that turns something by quaternions, None, AXIS_ANGLE, or Euler angles of an order."""
    return _ROTATIONS.get(order, "rotation_euler")


@cache
def channels_under(prefix: str, rotation: str) -> dict[int, Channel]:
    """Return the channels of a transform's components whose data paths begin so, by their rows."""
    return {
        ROWS[part].start + index: (prefix + prop, index)
        for part, prop in ((LOCATION, "location"), (ROTATION, rotation), (SCALE, "scale"))
        for index in range(WIDTHS[prop])
    }


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


def transform_of(carrier: bpy.types.Object | bpy.types.PoseBone | Transform) -> Transform:
    """Return the transform of something that Blender has, where it is none already."""
    if isinstance(carrier, Transform):
        return carrier
    if not isinstance(carrier, bpy.types.Object | bpy.types.PoseBone):
        raise TypeError(f"neither an object nor a pose bone: {carrier!r}")
    return Transform(carrier)


def transform_in(obj: bpy.types.Object, prefix: str) -> Transform | None:
    """Return what data paths that begin so lead to in an object, None where it has no such thing."""
    if not prefix:
        return Transform(obj)
    bone = None if obj.pose is None else obj.pose.bones.get(bone_name(prefix))
    return None if bone is None else Transform(bone)


def let_override_be_read(rig: bpy.types.Object) -> None:
    """Have what an override keeps on bones be there when its file is opened again.

    Blender 5 does not read it where the library has nothing of the kind on the bone, not even what is made when it is
    asked for.
    """
    reference = existing(rig.override_library).reference
    for bone in reference.pose.bones if isinstance(reference, bpy.types.Object) and reference.pose is not None else ():
        getattr(bone, MOTION_PROPERTY)
