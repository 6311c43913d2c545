"""The writer of each kind of transform."""

from __future__ import annotations

from collections.abc import Iterable

from ..actions.slots import SlotTransform
from ..transforms import BoneTransform, Transform
from .constraints import Constraints
from .deltas import Deltas
from .outlet import Outlet

_DELTAS, _CONSTRAINTS = Deltas(), Constraints()


def outlet_of(place: SlotTransform) -> Outlet:
    """Where the differences of a transform go."""
    return _CONSTRAINTS if place.prefix else _DELTAS


def release(transforms: Iterable[Transform]) -> None:
    """Take off these what was put on them for slots that do not move them any more."""
    bones, objects = [], []
    for transform in transforms:
        (bones if isinstance(transform, BoneTransform) else objects).append(transform)
    _DELTAS.release(objects)
    _CONSTRAINTS.release(bones)
