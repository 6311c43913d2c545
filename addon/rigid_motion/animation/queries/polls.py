"""What is asked of many transforms on every redraw: which of them have modes, in-betweens, keys.

There is one look at the Actions that move them, as if nothing else used these, and no channel is read. The answers come
one by one: who needs no more than the first does not wait for the rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy

from ..actions.slots import Slot, slots_alone
from ..transforms import MODE_PROPERTY, WIDTHS, Transform, split_path


def with_modes(transforms: Iterable[Transform]) -> Iterator[Transform]:
    """Yield those for which another mode than Blender's own was chosen, in their slots or before they had any."""
    for moved, slots in _by_data_block(transforms):
        result = {prefix for prefix, one in moved.items() if one.motion.awaited != "BLENDER"}
        yield from (moved[prefix] for prefix in result)
        for record in _records(slots):
            if record.prefix in moved and record.prefix not in result and (record.digest or record.mode != "BLENDER"):
                result.add(record.prefix)
                yield moved[record.prefix]
        for path, _ in _curves(slots):
            if path.endswith(MODE_PROPERTY):
                prefix, prop = split_path(path)
                if prop == MODE_PROPERTY and prefix in moved and prefix not in result:
                    result.add(prefix)
                    yield moved[prefix]


def with_in_betweens(transforms: Iterable[Transform]) -> Iterator[Transform]:
    """Yield those for which in-betweens were filled in."""
    for moved, slots in _by_data_block(transforms):
        result = {record.prefix: None for record in _records(slots) if record.digest and record.prefix in moved}
        yield from (moved[prefix] for prefix in result)


def with_more_keys_than(transforms: Iterable[Transform], count: int) -> Iterator[Transform]:
    """Yield those of which a channel of location, rotation or scale has more keys than this."""
    for moved, slots in _by_data_block(transforms):
        result = set()
        for path, fcurve in _curves(slots):
            prefix, prop = split_path(path)
            if prefix in moved and prefix not in result and prop in WIDTHS and len(fcurve.keyframe_points) > count:
                result.add(prefix)
                yield moved[prefix]


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
