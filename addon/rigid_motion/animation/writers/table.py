"""What writes the differences of each kind of transform."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

import numpy as np

from ..actions.slots import Slot, SlotTransform
from ..transforms import BoneTransform, ObjectTransform, Transform
from .constraints import ConstraintWriter
from .deltas import DeltaWriter
from .writer import Writer

WRITERS: dict[type[Transform], Writer] = {BoneTransform: ConstraintWriter(), ObjectTransform: DeltaWriter()}
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


def shown_differences(user: Transform) -> list[tuple[np.ndarray, set[str]]]:
    """What is on top of a transform as it is shown now: see `Writer.shown_differences`."""
    return WRITERS[user.kind].shown_differences(user)


def remove_orphans(places: Iterable[SlotTransform]) -> None:
    """Take out of the slots of these what is left in them of parts that none of their users has any more."""
    slots: dict[tuple[Slot, Writer], None] = {(place.slot, writer_of(place)): None for place in places}
    for slot, writer in slots:
        writer.remove_orphans(slot)
