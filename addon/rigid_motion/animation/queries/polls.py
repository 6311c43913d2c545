"""What is asked of many transforms on every redraw: which of them have modes, in-betweens, keys.

As little is read as can be, as if nothing else used the same Actions, and the answers come one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import bpy

from ..actions.marks import has_marks
from ..actions.modifiers import has_terms
from ..actions.slots import slots_alone
from ..holds.holders import is_ours
from ..transforms import WIDTHS, Transform, split_path


def with_modes(transforms: Iterable[Transform]) -> Iterator[Transform]:
    """Yield those whose keys say a mode, in one of their slots; and those that wait with one for keys.

    All keys of a transform have a mode where any has, so the first channel of each is enough.
    """
    transforms = list(transforms)
    yield from (transform for transform in transforms if transform.motion.awaited != "BLENDER")
    keyed = (transform for transform in transforms if transform.motion.awaited == "BLENDER")
    yield from _with(keyed, has_marks, by_first=True)


def with_in_betweens(transforms: Iterable[Transform]) -> Iterator[Transform]:
    """Yield those with in-betweens that are not Blender's own."""
    return _with(transforms, has_terms)


def with_holders(transforms: Iterable[Transform]) -> Iterator[Transform]:
    """Yield those that something holds, or has held."""
    return (transform for transform in transforms if any(map(is_ours, transform.carrier.constraints)))


def with_more_keys_than(transforms: Iterable[Transform], count: int) -> Iterator[Transform]:
    """Yield those of which a channel of location, rotation or scale has more keys than this."""
    return _with(transforms, lambda fcurve: len(fcurve.keyframe_points) > count)


def _with(
    transforms: Iterable[Transform], passes: Callable[[bpy.types.FCurve], bool], *, by_first: bool = False
) -> Iterator[Transform]:
    """Yield those of which a channel of location, rotation or scale passes, or the first one in a slot with keys."""
    by_data_block: dict[bpy.types.Object, dict[str, Transform]] = {}
    for transform in transforms:
        by_data_block.setdefault(transform.animated, {})[transform.prefix] = transform
    for animated, moved in by_data_block.items():
        for slot in slots_alone(animated):
            left = set(moved)
            for fcurve in slot.fcurves:
                prefix, prop = split_path(fcurve.data_path)
                if prefix in left and prop in WIDTHS and fcurve.keyframe_points:
                    if is_one := passes(fcurve):
                        yield moved.pop(prefix)
                    if is_one or by_first:
                        left.remove(prefix)
