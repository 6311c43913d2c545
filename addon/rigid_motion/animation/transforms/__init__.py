"""What is moved: one small interface for whatever has location, rotation and scale, and the two kinds that have it.

components  the rows of arrays                          transform   the interface: channels, and where differences go
objects     objects, by their delta transforms          bones       pose bones, by a constraint
posing      where the poses of bones put them

A transform knows whose Action animates it, on which property its channels are, and where the difference between
Blender's in-betweens and the wanted ones goes.
"""

from __future__ import annotations

import bpy

from .bones import CONSTRAINT, BoneTransform, bone_name, is_ours, let_override_be_read, prefix_of, split_path
from .components import LOCATION, PART_OF, REST, ROTATION, ROWS, SCALE
from .objects import GROUP, ORIGINALS, ObjectTransform, default_of
from .transform import MODE_PROPERTY, WIDTHS, Channel, Refused, Transform, properties_for

__all__ = [
    "CONSTRAINT",
    "GROUP",
    "LOCATION",
    "MODE_PROPERTY",
    "ORIGINALS",
    "PART_OF",
    "REST",
    "ROTATION",
    "ROWS",
    "SCALE",
    "WIDTHS",
    "BoneTransform",
    "Channel",
    "ObjectTransform",
    "Refused",
    "Transform",
    "bone_name",
    "default_of",
    "is_ours",
    "let_override_be_read",
    "prefix_of",
    "properties_for",
    "split_path",
    "transform_of",
]


def transform_of(carrier: bpy.types.Object | bpy.types.PoseBone | Transform) -> Transform:
    """The transform of something that Blender has, where it is none already."""
    if isinstance(carrier, Transform):
        return carrier
    return BoneTransform(carrier) if isinstance(carrier, bpy.types.PoseBone) else ObjectTransform(carrier)
