"""Where differences go: into the delta transforms of objects, and on top of pose bones by a constraint.

outlet       the interface                              sampled     F-curves without keys
deltas       objects                                    times       which frame a constraint shows, and how much of it
constraints  pose bones                                 restoring   what may be amiss with a constraint
mounting     constraints on bones
"""

from __future__ import annotations

from collections.abc import Iterable

from ...actions.slots import SlotTransform
from ...transforms import BoneTransform, Transform
from .constraints import Constraints, remove_orphans
from .deltas import Deltas
from .outlet import Outlet
from .sampled import regroup

__all__ = ["Outlet", "outlet_of", "regroup", "release", "remove_orphans"]

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
