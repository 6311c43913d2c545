"""What writes the differences of each kind of transform."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from ..actions.slots import Slot, SlotTransform
from ..transforms import BoneTransform, ExactObjectTransform, ObjectTransform, Transform
from .constraints import ConstraintWriter
from .deltas import DeltaWriter
from .writer import Writer

WRITERS: dict[type[Transform], Writer] = {
    BoneTransform: ConstraintWriter(),
    ObjectTransform: DeltaWriter(),
    ExactObjectTransform: ConstraintWriter(),
}
"""A row for each of the `transforms.KINDS`."""


def writer_of(place: SlotTransform) -> Writer:
    """Where the differences of a transform go."""
    return WRITERS[place.kind]


def release(transforms: Iterable[Transform]) -> None:
    """Take off these what was put on them for slots that do not move them any more."""
    by_kind: defaultdict[type[Transform], list[Transform]] = defaultdict(list)
    for transform in transforms:
        by_kind[transform.kind].append(transform)
    for kind, same in by_kind.items():
        WRITERS[kind].release(same)


def remove_orphans(places: Iterable[SlotTransform]) -> None:
    """Take out of the slots of these what is left in them of parts that none of their users has any more."""
    slots: dict[tuple[Slot, Writer], None] = {(place.slot, writer_of(place)): None for place in places}
    for slot, writer in slots:
        writer.remove_orphans(slot)
