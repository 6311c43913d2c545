"""What is asked of many transforms on every redraw: which of them have modes, in-betweens, keys.

There is one look at the Actions that move them, as if nothing else used these, and no channel is read. The answers come
one by one: who needs no more than the first does not wait for the rest.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

import bpy

from ..actions.slots import Slot, slots_alone
from ..transforms import MODE_PROPERTY, WIDTHS, Transform, split_path


def with_modes(transforms: Iterable[Transform]) -> Iterator[Transform]:
    """Yield those for which another mode than Blender's own was chosen, in their slots or before they had any."""
    for moved, slots in _by_data_block(transforms):
        waiting = (prefix for prefix, one in moved.items() if one.motion.awaited != "BLENDER")
        recorded = (record.prefix for record in _records(slots) if record.digest or record.mode != "BLENDER")
        # To take a path apart takes longest.
        paths = (split_path(path) for path, _ in _curves(slots) if path.endswith(MODE_PROPERTY))
        keyed = (prefix for prefix, prop in paths if prop == MODE_PROPERTY)
        yield from _each_once(moved, itertools.chain(waiting, recorded, keyed))


def with_in_betweens(transforms: Iterable[Transform]) -> Iterator[Transform]:
    """Yield those for which in-betweens were filled in."""
    for moved, slots in _by_data_block(transforms):
        yield from _each_once(moved, (record.prefix for record in _records(slots) if record.digest))


def with_more_keys_than(transforms: Iterable[Transform], count: int) -> Iterator[Transform]:
    """Yield those of which a channel of location, rotation or scale has more keys than this."""
    for moved, slots in _by_data_block(transforms):
        keyed = ((*split_path(path), fcurve) for path, fcurve in _curves(slots))
        has_more = (name for name, prop, curve in keyed if prop in WIDTHS and len(curve.keyframe_points) > count)
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


def _records(slots: Iterable[Slot]) -> Iterator[bpy.types.PropertyGroup]:
    return (record for slot in slots for record in slot.records)


def _curves(slots: Iterable[Slot]) -> Iterator[tuple[str, bpy.types.FCurve]]:
    """Yield the F-curves of slots, and their data paths."""
    return ((fcurve.data_path, fcurve) for slot in slots for fcurve in slot.fcurves)
