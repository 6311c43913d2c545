"""What nothing animates any more stays where it is seen, as Blender leaves it.

Blender takes an Action away (*Unlink*, *Clear Keyframes*, `animation_data_clear()`, channels that are deleted), and the
properties keep the values of the frame that was shown: those of its own in-between. The difference that was on top goes
as well, so the properties get the pose that was seen.

A property that was set in the same go is as it was set. Where `matrix_world` was, Blender has taken the difference off.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress

import bpy
import numpy as np

from ..actions.slots import Binding, bindings_for
from ..compute.components import PART_OF
from ..queries.visible_pose import shown_components
from ..transforms import WIDTHS, Refused, Transform, transform_of
from ..writers.table import shown_parts


class LeftInPlace:
    """Keeps transforms where they are seen, for the edits of one file."""

    def __init__(self) -> None:
        self._set: dict[Transform, set[str]] = {}
        """The parts of location, rotation and scale that were set and are not evaluated yet."""

    def notice_assignments(self, obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> None:
        """Keep what was set of an object and its bones since it was evaluated."""
        evaluated = obj.evaluated_get(depsgraph)
        if (any(obj.rigid_motion.filled) or obj.rigid_motion.is_exact) and obj.matrix_world == evaluated.matrix_world:
            self._notice(transform_of(obj), evaluated)
        if obj.pose is not None and obj.rigid_motion.has_bones:
            for number in _set_bones(obj, evaluated):
                bone = obj.pose.bones[number]
                self._notice(transform_of(bone), evaluated.pose.bones[number])

    def _notice(self, transform: Transform, evaluated: bpy.types.Object | bpy.types.PoseBone) -> None:
        with suppress(Refused):
            self._set[transform] = {
                part
                for part, prop in transform.properties.items()
                if tuple(getattr(transform.carrier, prop)) != tuple(getattr(evaluated, prop))
            }

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
                loose = shown_parts(transform) - parts
                if loose and transform.animated.is_editable:
                    loose -= set().union(*(_animated_parts(transform, binding) for binding in bindings_for(transform)))
                    left[transform] = loose, shown_components(transform)
        yield
        for transform, (loose, seen) in left.items():
            with suppress(Refused):
                transform.set_components(seen, loose - shown_parts(transform) - self._set.get(transform, set()))


def _animated_parts(user: Transform, binding: Binding) -> set[str]:
    """Return which of location, rotation and scale a binding animates."""
    return {
        PART_OF[row]
        for row, channel in user.channels.items()
        if (fcurve := binding.curves.get(channel)) is not None and not (fcurve.mute or fcurve.is_empty)
    }


def _set_bones(rig: bpy.types.Object, evaluated: bpy.types.Object) -> list[int]:
    """Return the numbers of the bones of which a property is not as it was evaluated."""
    count = len(rig.pose.bones)
    if len(evaluated.pose.bones) != count:
        return []
    other = np.zeros(count, dtype=bool)
    for prop, width in WIDTHS.items():
        now, then = np.empty((count, width), np.float32), np.empty((count, width), np.float32)
        rig.pose.bones.foreach_get(prop, now.ravel())
        evaluated.pose.bones.foreach_get(prop, then.ravel())
        other |= (now != then).any(axis=1)
    return np.flatnonzero(other).tolist()
