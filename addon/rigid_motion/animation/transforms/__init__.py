"""What is moved: one small interface for whatever has location, rotation and scale: objects and pose bones.

A transform knows whose Action animates it, and on which property its channels are.

transform  the interface
sizes      how large things are, and how far they reach
posing     where the poses of bones put them

Each module imports only those above it.
"""

from __future__ import annotations

from .transform import (
    GROUP_NAME,
    LINKED_REFUSAL,
    MOTION_PROPERTY,
    OWN_WORDS,
    TURNS_PROPERTY,
    WIDTHS,
    Channel,
    Note,
    Refused,
    Transform,
    bone_name,
    let_override_be_read,
    prefix_of,
    split_path,
    transform_in,
    transform_of,
)

__all__ = [
    "GROUP_NAME",
    "LINKED_REFUSAL",
    "MOTION_PROPERTY",
    "OWN_WORDS",
    "TURNS_PROPERTY",
    "WIDTHS",
    "Channel",
    "Note",
    "Refused",
    "Transform",
    "bone_name",
    "let_override_be_read",
    "prefix_of",
    "split_path",
    "transform_in",
    "transform_of",
]
