"""What is moved: one small interface for whatever has location, rotation and scale, and the kinds that have it.

A transform knows whose Action animates it, on which property its channels are, and where the difference between
Blender's in-betweens and the desired ones goes.

transform  the interface: channels, and where differences go
objects    objects, by their delta transforms, or by a constraint where they are to be exact between frames
bones      pose bones, by a constraint
kinds      the table of both
reaches    how far things reach
posing     where the poses of bones put them

Each module imports only those above it.
"""

from __future__ import annotations

from .bones import CONSTRAINT, BoneTransform, bone_name, let_override_be_read, prefix_of, shows_differences, split_path
from .kinds import KINDS, is_part, kind_of, transform_of
from .objects import GROUP, ORIGINALS, ExactObjectTransform, ObjectTransform, default_of
from .transform import (
    LINKED,
    MODE_PROPERTY,
    OWN_WORDS,
    SEGMENT_PROPERTIES,
    WIDTHS,
    Channel,
    Refused,
    Transform,
    properties_for,
)

__all__ = [
    "CONSTRAINT",
    "GROUP",
    "KINDS",
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
    "is_part",
    "kind_of",
    "let_override_be_read",
    "prefix_of",
    "properties_for",
    "shows_differences",
    "split_path",
    "transform_of",
]
