"""What is moved: one small interface for whatever has location, rotation and scale, and the kinds that have it.

A transform knows whose Action animates it, on which property its channels are, and where the difference between
Blender's in-betweens and the desired ones goes.

transform  the interface: channels, and where differences go
kinds      objects, by their delta transforms, or by a constraint where they are to be exact between frames; bones
sizes      how large things are, and how far they reach
posing     where the poses of bones put them

Each module imports only those above it.
"""

from __future__ import annotations

from .kinds import (
    CONSTRAINT,
    GROUP,
    ORIGINALS,
    BoneTransform,
    ExactObjectTransform,
    ObjectTransform,
    bone_name,
    default_of,
    difference_constraints,
    is_part,
    let_override_be_read,
    prefix_of,
    shows_differences,
    split_path,
    transform_in,
    transform_of,
)
from .transform import (
    LINKED,
    MODE_PROPERTY,
    OWN_WORDS,
    SEGMENT_PROPERTIES,
    WIDTHS,
    Channel,
    Refused,
    Transform,
    rotation_of,
    set_rotation,
    visible_components,
)

__all__ = [
    "CONSTRAINT",
    "GROUP",
    "LINKED",
    "MODE_PROPERTY",
    "ORIGINALS",
    "OWN_WORDS",
    "SEGMENT_PROPERTIES",
    "WIDTHS",
    "BoneTransform",
    "Channel",
    "ExactObjectTransform",
    "ObjectTransform",
    "Refused",
    "Transform",
    "bone_name",
    "default_of",
    "difference_constraints",
    "is_part",
    "let_override_be_read",
    "prefix_of",
    "rotation_of",
    "set_rotation",
    "shows_differences",
    "split_path",
    "transform_in",
    "transform_of",
    "visible_components",
]
