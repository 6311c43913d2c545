"""The pose that is seen, in the channels: for what of Blender reads properties, which have its own in-betweens.

Nothing is to be seen of it: the differences are hidden meanwhile. Both last until Blender evaluates the animation anew,
on another frame or after an edit of the Action.

*Bake Action* goes through the frames of the scene and reads properties on each, unless it keys visually.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from contextlib import suppress

from bpy_extras.anim_utils import bake_action_objects_iter

from ..actions.slots import slot_transforms_of
from ..queries.visible_pose import shown_components
from ..transforms import Refused, Transform
from ..writers.table import shown_differences, writer_of


def show_in_channels(transforms: Iterable[Transform]) -> list[Transform]:
    """Give the properties of these the pose that is seen, with no difference on top; and say which had one."""
    seen = {}
    for transform in transforms:
        with suppress(Refused):
            differences = shown_differences(transform)
            if differences and transform.animated.is_editable:
                seen[transform] = shown_components(transform), set().union(*(parts for _, parts in differences))
    for place in slot_transforms_of(seen):
        for user in place.users:
            if user in seen:
                writer_of(place).hide(place, user)
    for transform, (components, parts) in seen.items():
        transform.set_components(components, parts)
    return list(seen)


def is_baking() -> bool:
    """Whether it is Blender's *Bake Action*, or an add-on by way of it, that has set the frame."""
    caller = inspect.currentframe()
    while caller is not None:
        if caller.f_code is bake_action_objects_iter.__code__:
            return True
        caller = caller.f_back
    return False
