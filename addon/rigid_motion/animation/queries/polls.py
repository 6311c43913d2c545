"""Fast checks of many transforms on every redraw: which of them have modes, in-betweens, holders, keys.

They read as little as possible, as if nothing else used the same Actions, and yield results one by one.
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
    """Yield the transforms whose keys have a mode in one of their slots, or that store a mode for future keys.

    If any key of a transform has a mode, all keys have, so checking the first channel of each is enough.
    """
    transforms = list(transforms)
    yield from (transform for transform in transforms if transform.motion.awaited != "BLENDER")
    keyed = (transform for transform in transforms if transform.motion.awaited == "BLENDER")
    yield from _with_passing_channel(keyed, has_marks, by_first=True)


def with_in_betweens(transforms: Iterable[Transform]) -> Iterator[Transform]:
    """Yield the transforms with in-betweens other than Blender's own."""
    return _with_passing_channel(transforms, has_terms)


def with_holders(transforms: Iterable[Transform]) -> Iterator[Transform]:
    """Yield the transforms with present or past holders."""
    return (transform for transform in transforms if any(map(is_ours, transform.carrier.constraints)))


def with_more_keys_than(transforms: Iterable[Transform], count: int) -> Iterator[Transform]:
    """Yield the transforms with more than `count` keys in a channel of location, rotation or scale."""
    return _with_passing_channel(transforms, lambda fcurve: len(fcurve.keyframe_points) > count)


def _with_passing_channel(
    transforms: Iterable[Transform], passes: Callable[[bpy.types.FCurve], bool], *, by_first: bool = False
) -> Iterator[Transform]:
    """Yield the transforms with a channel of location, rotation or scale that passes; in each slot, check channels with
    keys, or only the first of them.
    """
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
