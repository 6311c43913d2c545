"""What is moved: one small interface for whatever has location, rotation and scale, and the object's version of it.

components  the rows of arrays                          transform   the interface: channels, and where differences go
objects     objects, by their delta transforms

A transform knows whose Action animates it, on which property its channels are, and where the difference between
Blender's in-betweens and the wanted ones goes. A new kind, such as pose bones, is one new file, and a line in
`transform_of`.
"""

from __future__ import annotations

import bpy

from .components import LOCATION, PART_OF, REST, ROTATION, ROWS, SCALE
from .objects import ORIGINALS, ObjectTransform, default_of
from .transform import MODE_PROPERTY, WIDTHS, Channel, Refused, Transform, properties_for

__all__ = [
    "LOCATION",
    "MODE_PROPERTY",
    "ORIGINALS",
    "PART_OF",
    "REST",
    "ROTATION",
    "ROWS",
    "SCALE",
    "WIDTHS",
    "Channel",
    "ObjectTransform",
    "Refused",
    "Transform",
    "default_of",
    "properties_for",
    "transform_of",
]


def transform_of(carrier: bpy.types.Object | Transform) -> Transform:
    """The transform of something that Blender has, where it is none already."""
    return carrier if isinstance(carrier, Transform) else ObjectTransform(carrier)
