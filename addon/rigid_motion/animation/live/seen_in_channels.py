"""The pose that is seen, in the channels: for what of Blender reads properties, which have its own in-betweens.

Nothing is to be seen of it: the differences are hidden meanwhile. Both last until Blender evaluates the animation anew,
on another frame or after an edit of the Action.

*Bake Action* goes through the frames of the scene and reads properties on each, unless it keys visually.
"""

from __future__ import annotations

import inspect
from collections.abc import Collection, Iterable
from contextlib import suppress
from typing import NamedTuple

import bpy
import numpy as np
from bpy_extras.anim_utils import bake_action_objects_iter

from ..actions.slots import actions_of, bindings_of
from ..queries.visible_pose import shown_components
from ..transforms import Refused, Transform, kind_of
from ..writers.table import shown_differences, writer_of
from .depsgraphs import BlockKey, key_of, objects_of


class _Shown(NamedTuple):
    """A transform whose properties were given the pose that is seen."""

    key: BlockKey
    """The key of its data-block. Blender may replace bones meanwhile."""

    prefix: str
    rotation: str
    parts: set[str]
    """The parts of location, rotation and scale that were set."""

    before: np.ndarray
    """Values that its properties had, as components (10,)."""

    after: np.ndarray
    """Values that they were given."""


class SeenInChannels:
    """Shows the poses that are seen in the channels of one file."""

    def __init__(self) -> None:
        self._shown: list[_Shown] = []

    def show(self, transforms: Iterable[Transform]) -> list[Transform]:
        """Give the properties of these the pose that is seen, with no difference on top; and say which had one."""
        seen = {}
        for transform in transforms:
            with suppress(Refused):
                differences = shown_differences(transform)
                if differences and transform.animated.is_editable:
                    seen[transform] = shown_components(transform), set().union(*(parts for _, parts in differences))
        for binding in bindings_of(seen):
            for user in binding.users:
                if user in seen:
                    writer_of(binding).hide(binding, user)
        for transform, (components, parts) in seen.items():
            before = transform.components()
            transform.set_components(components, parts)
            key, rotation = key_of(transform.animated), transform.rotation
            self._shown.append(_Shown(key, transform.prefix, rotation, parts, before, transform.components()))
        return list(seen)

    def put_back(self, actions: Collection[bpy.types.Action] | None = None) -> None:
        """Give properties back what they had, before Blender evaluates the animation: what is not keyed, or muted, has
        nothing else to get it from. Those that these Actions move, or all.

        What was set since, or has no differences any more, stays as it is.
        """
        left = []
        for shown in self._shown:
            obj = next(iter(objects_of([shown.key])), None)
            if obj is not None and actions is not None and not set(actions).intersection(actions_of(obj)):
                left.append(shown)
            elif obj is not None and (transform := kind_of(shown.prefix).in_object(obj, shown.prefix)) is not None:
                with suppress(Refused):
                    is_same = transform.rotation == shown.rotation
                    if is_same and np.array_equal(transform.components(), shown.after) and shown_differences(transform):
                        transform.set_components(shown.before, shown.parts)
        self._shown = left

    def forget(self) -> None:
        """Undo, redo or a file has brought other properties."""
        self._shown.clear()


def is_baking() -> bool:
    """Return whether it is Blender's *Bake Action*, or an add-on by way of it, that has set the frame."""
    caller = inspect.currentframe()
    while caller is not None:
        if caller.f_code is bake_action_objects_iter.__code__:
            return True
        caller = caller.f_back
    return False
