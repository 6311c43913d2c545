"""What is asked of many transforms on every redraw: which of them have modes, in-betweens, keys.

There is one look at the Actions that move them, as if nothing else used these, and as little is read as can be. The
answers come one by one: who needs no more than the first does not wait for the rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy

from ..actions.marks import read_marks
from ..actions.modifiers import has_terms
from ..actions.slots import Slot, slots_alone
from ..transforms import WIDTHS, Transform, split_path


def with_modes(transforms: Iterable[Transform]) -> Iterator[Transform]:
    """Yield those whose keys say a mode, in one of their slots; and those that wait with one for keys.

    All keys of a transform have a mode where any has, so the first channel of each is enough.
    """
    for moved, slots in _by_data_block(transforms):
        waiting = [prefix for prefix, one in moved.items() if one.motion.awaited != "BLENDER"]
        yield from _each_once(moved, (*waiting, *_marked(slots)))


def _marked(slots: Iterable[Slot]) -> Iterator[str]:
    for slot in slots:
        seen: set[str] = set()
        for prefix, fcurve in _moving((slot,)):
            if prefix not in seen and fcurve.keyframe_points:
                seen.add(prefix)
                if read_marks(fcurve).any():
                    yield prefix


def with_in_betweens(transforms: Iterable[Transform]) -> Iterator[Transform]:
    """Yield those with in-betweens that are not Blender's own."""
    for moved, slots in _by_data_block(transforms):
        yield from _each_once(moved, (name for name, fcurve in _moving(slots) if has_terms(fcurve)))


def with_more_keys_than(transforms: Iterable[Transform], count: int) -> Iterator[Transform]:
    """Yield those of which a channel of location, rotation or scale has more keys than this."""
    for moved, slots in _by_data_block(transforms):
        has_more = (name for name, fcurve in _moving(slots) if len(fcurve.keyframe_points) > count)
        yield from _each_once(moved, has_more)


def _each_once(moved: dict[str, Transform], prefixes: Iterable[str]) -> Iterator[Transform]:
    """Yield what these prefixes stand for, each once."""
    left = dict(moved)
    return (left.pop(prefix) for prefix in prefixes if prefix in left)


def _by_data_block(transforms: Iterable[Transform]) -> Iterator[tuple[dict[str, Transform], list[Slot]]]:
    """Yield the transforms of each data-block, by their prefixes, and the slots that move it."""
    result: dict[bpy.types.Object, dict[str, Transform]] = {}
    for transform in transforms:
        result.setdefault(transform.animated, {})[transform.prefix] = transform
    for animated, moved in result.items():
        yield moved, slots_alone(animated)


def _moving(slots: Iterable[Slot]) -> Iterator[tuple[str, bpy.types.FCurve]]:
    """Yield the F-curves of location, rotation and scale in slots, and the prefixes of their data paths."""
    for slot in slots:
        for fcurve in slot.fcurves:
            prefix, prop = split_path(fcurve.data_path)
            if prop in WIDTHS:
                yield prefix, fcurve
