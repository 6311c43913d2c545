"""What writes the differences of each kind of transform."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import replace

from ..actions.slots import Binding, Slot
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


def writer_of(moved: Binding | Transform) -> Writer:
    """Return where the differences of a transform go."""
    return WRITERS[moved.kind]


def leave_other_way(binding: Binding) -> None:
    """Take the in-betweens of an object out of where they are not to be any more: it came to share a slot, or an Action
    came to it, and so it is exact between frames, or is so no more.
    """
    if binding.kind.is_part:
        return
    kind = ObjectTransform if binding.kind is ExactObjectTransform else ExactObjectTransform
    other = replace(binding, users=tuple(kind(user.carrier) for user in binding.users))
    if other.filled:
        WRITERS[kind].write(other, {}, None, {})
    editable = [user for user in binding.users if user.animated.is_editable]
    if kind is ObjectTransform:
        WRITERS[kind].release(kind(user.carrier) for user in editable)
    for user in editable:
        if user.motion.is_exact != user.has_difference_slot:
            user.motion.is_exact = user.has_difference_slot


def release(transforms: Iterable[Transform]) -> None:
    """Take off these what was put on them for slots that do not move them any more."""
    by_kind: defaultdict[type[Transform], list[Transform]] = defaultdict(list)
    for transform in transforms:
        by_kind[transform.kind].append(transform)
    for kind, same in by_kind.items():
        WRITERS[kind].release(same)


def remove_orphans(bindings: Iterable[Binding]) -> None:
    """Take out of the slots of these what is left in them of parts that none of their users has any more."""
    slots: dict[tuple[Slot, Writer], None] = {(binding.slot, writer_of(binding)): None for binding in bindings}
    for slot, writer in slots:
        writer.remove_orphans(slot)
