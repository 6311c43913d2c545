"""What writes the differences of each kind of transform, and how it is seen with them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ..actions.slots import Binding
from ..transforms import BoneTransform, ExactObjectTransform, ObjectTransform, Transform, visible_components
from .constraints import ConstraintWriter
from .deltas import DeltaWriter

Writer = ConstraintWriter | DeltaWriter

WRITERS: dict[type[Transform], Writer] = {
    BoneTransform: ConstraintWriter(),
    ObjectTransform: DeltaWriter(),
    ExactObjectTransform: ConstraintWriter(),
}
"""A row for each of the `transforms.KINDS`."""


def writer_of(moved: Binding | Transform) -> Writer:
    """Return where the differences of a transform go."""
    return WRITERS[moved.kind if isinstance(moved, Binding) else type(moved)]


def leave_other_way(binding: Binding) -> None:
    """Take the in-betweens of an object out of the other kind's place: it came to be exact, or is so no more."""
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
        by_kind[type(transform)].append(transform)
    for kind, same in by_kind.items():
        WRITERS[kind].release(same)


def shown_components(transform: Transform) -> np.ndarray | None:
    """Return how a transform is seen now, in the terms of what an animator keys.

    Returns
    -------
    array, shape (10,), or None
        What its properties would have to be for it to look as it does with its original difference alone: location,
        rotation as it turns (quaternion or Euler angles), scale. None where nothing is on top of them.

    Raises
    ------
    Refused
        Where it turns by axis and angle.
    """
    differences = writer_of(transform).shown_differences(transform)
    if not differences:
        return None
    seen = transform.components()
    for difference, parts in differences:
        seen = visible_components(seen, transform.original(), difference, transform.order, parts)
    return seen
