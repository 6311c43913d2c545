"""What writes the differences of each kind of transform."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from ..actions.slots import Slot, SlotTransform
from ..transforms import BoneTransform, ObjectTransform, Transform
from .constraints import Constraints
from .deltas import Deltas
from .outlet import Outlet

OUTLETS: dict[type[Transform], Outlet] = {BoneTransform: Constraints(), ObjectTransform: Deltas()}
"""A row for each of the `transforms.KINDS`."""


def outlet_of(place: SlotTransform) -> Outlet:
    """Where the differences of a transform go."""
    return OUTLETS[place.kind]


def release(transforms: Iterable[Transform]) -> None:
    """Take off these what was put on them for slots that do not move them any more."""
    by_kind: defaultdict[type[Transform], list[Transform]] = defaultdict(list)
    for transform in transforms:
        by_kind[transform.kind].append(transform)
    for kind, same in by_kind.items():
        OUTLETS[kind].release(same)


def remove_orphans(places: Iterable[SlotTransform]) -> None:
    """Take out of the slots of these what is left in them of parts that none of their users has any more."""
    slots: dict[tuple[Slot, Outlet], None] = {(place.slot, outlet_of(place)): None for place in places}
    for slot, outlet in slots:
        outlet.remove_orphans(slot)
