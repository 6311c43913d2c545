"""The pose that is seen, given to properties: where nothing animates them any more, and for what of Blender reads them.

Blender takes an Action away (*Unlink*, *Clear Keyframes*, `animation_data_clear()`, channels that are deleted), and the
properties keep the values of the frame that was shown: those of its own in-between. The difference that was on top goes
as well, so the properties get the pose that was seen. A property that was set in the same go is as it was set. Where
`matrix_world` was, Blender has taken the difference off.

What reads properties, as *Bake Action* does on each frame unless it keys visually, would read Blender's own in-betweens
as well. Nothing is to be seen of it where they get the pose: the differences are hidden meanwhile. Both last until
Blender evaluates the animation anew, on another frame or after an edit of the Action.
"""

from __future__ import annotations

import inspect
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple

import bpy
import numpy as np
from bpy_extras.anim_utils import bake_action_objects_iter

from ..actions.slots import Binding, actions_of, bindings_for, bindings_of
from ..compute.components import PART_OF
from ..transforms import Refused, Transform, shows_differences, transform_in, transform_of
from ..writers.table import shown_components, writer_of
from .edited import BlockKey, key_of, objects_of
from .snapshots import property_bits

Assigned = dict[Transform, tuple[Any, set[str]]]
"""Transforms as they were evaluated last, and the parts of location, rotation and scale that were set since."""


class LeftInPlace:
    """Keeps transforms where they are seen, for the edits of one file."""

    def __init__(self) -> None:
        self._set: dict[Transform, set[str]] = {}
        """The parts of location, rotation and scale that were set and are not evaluated yet."""

    def notice_assignments(self, assigned: Assigned) -> None:
        """Keep what was set property by property since it was evaluated."""
        for transform, (evaluated, parts) in assigned.items():
            if transform.is_part or transform.carrier.matrix_world == evaluated.matrix_world:
                self._set[transform] = parts

    def keep_without_action(self, obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> None:
        """Keep an object and its bones in place whose Action was deleted: what was evaluated last has it still."""
        before = obj.evaluated_get(depsgraph)
        bones = zip(obj.pose.bones, before.pose.bones, strict=False) if obj.rigid_motion.has_bones else ()
        for carrier, evaluated in ((obj, before), *bones):
            if any(shows_differences(item) and item.action is None for item in carrier.constraints):
                transform, seen = transform_of(carrier), transform_of(evaluated)
                with suppress(Refused):
                    parts = writer_of(seen).shown_parts(seen) - self._set.get(transform, set())
                    transform.set_components(shown_components(seen), parts)

    def forget_assignments(self) -> None:
        """Forget the assignments: they are evaluated by now."""
        self._set.clear()

    @contextmanager
    def keep(self, transforms: Iterable[Transform] = (), bindings: Iterable[Binding] = ()) -> Iterator[None]:
        """Keep these, which nothing moves, and the users of these bindings where they are seen, whatever goes."""
        animated: defaultdict[Transform, set[str]] = defaultdict(set, {transform: set() for transform in transforms})
        for binding in bindings:
            for user in binding.users:
                with suppress(Refused):
                    animated[user] |= _animated_parts(user, binding)
        left = {}
        for transform, parts in animated.items():
            with suppress(Refused):
                loose = writer_of(transform).shown_parts(transform) - parts
                if loose and transform.animated.is_editable:
                    loose -= set().union(*(_animated_parts(transform, binding) for binding in bindings_for(transform)))
                    left[transform] = loose, shown_components(transform)
        yield
        for transform, (loose, seen) in left.items():
            with suppress(Refused):
                transform.set_components(
                    seen, loose - writer_of(transform).shown_parts(transform) - self._set.get(transform, set())
                )


def _animated_parts(user: Transform, binding: Binding) -> set[str]:
    """Return which of location, rotation and scale a binding animates."""
    return {
        PART_OF[row]
        for row, channel in user.channels.items()
        if (fcurve := binding.curves.get(channel)) is not None and not (fcurve.mute or fcurve.is_empty)
    }


def assigned_to(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Assigned:
    """Return what was set of an object and its bones since they were evaluated."""
    evaluated = obj.evaluated_get(depsgraph)
    pairs: list[tuple[Any, Any]] = [(obj, evaluated)]
    if obj.pose is not None and obj.rigid_motion.has_bones and len(evaluated.pose.bones) == len(obj.pose.bones):
        numbers = np.flatnonzero((property_bits(obj) != property_bits(evaluated)).any(axis=1)).tolist()
        pairs += [(obj.pose.bones[number], evaluated.pose.bones[number]) for number in numbers]
    result: Assigned = {}
    for carrier, before in pairs:
        transform = transform_of(carrier)
        with suppress(Refused):
            properties = transform.properties.items()
            parts = {part for part, prop in properties if tuple(getattr(carrier, prop)) != tuple(getattr(before, prop))}
            result[transform] = before, parts
    return result


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
                differences = writer_of(transform).shown_differences(transform)
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
            elif obj is not None and (transform := transform_in(obj, shown.prefix)) is not None:
                with suppress(Refused):
                    is_same = transform.rotation == shown.rotation
                    if (
                        is_same
                        and np.array_equal(transform.components(), shown.after)
                        and writer_of(transform).shown_differences(transform)
                    ):
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
