"""What is asked of many transforms on every redraw: which of them have modes, in-betweens, keys.

There is one look at the Actions that move them, as if nothing else used these, and no channel is read. The answers come
one by one: who needs no more than the first does not wait for the rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from ..actions.slots import uses_of
from ..transforms import MODE_PROPERTY, WIDTHS, Transform, split_path

_Moved = dict[str, Transform]
"""Transforms of one data-block, by their prefixes."""


def with_modes(transforms: Iterable[Transform]) -> Iterator[Transform]:
    """Yield those for which another mode than Blender's own was chosen, in their slots or before they had any."""
    for moved, uses in _by_carrier(transforms):
        result = {prefix for prefix, one in moved.items() if one.motion.awaited != "BLENDER"}
        yield from (moved[prefix] for prefix in result)
        for record in _records(uses):
            if record.prefix in moved and record.prefix not in result and (record.digest or record.mode != "BLENDER"):
                result.add(record.prefix)
                yield moved[record.prefix]
        for path, _ in _curves(uses):
            if path.endswith(MODE_PROPERTY):
                prefix, prop = split_path(path)
                if prop == MODE_PROPERTY and prefix in moved and prefix not in result:
                    result.add(prefix)
                    yield moved[prefix]


def with_in_betweens(transforms: Iterable[Transform]) -> Iterator[Transform]:
    """Yield those for which in-betweens were filled in."""
    for moved, uses in _by_carrier(transforms):
        result = {record.prefix: None for record in _records(uses) if record.digest and record.prefix in moved}
        yield from (moved[prefix] for prefix in result)


def with_more_keys_than(transforms: Iterable[Transform], count: int) -> Iterator[Transform]:
    """Yield those of which a channel of location, rotation or scale has more keys than this."""
    for moved, uses in _by_carrier(transforms):
        result = set()
        for path, fcurve in _curves(uses):
            prefix, prop = split_path(path)
            if prefix in moved and prefix not in result and prop in WIDTHS and len(fcurve.keyframe_points) > count:
                result.add(prefix)
                yield moved[prefix]


_Slots = list[tuple[bpy.types.Action, int]]


def _by_carrier(transforms: Iterable[Transform]) -> Iterator[tuple[_Moved, _Slots]]:
    """Yield the transforms of each data-block together, and the slots that move it."""
    result: dict[bpy.types.Object, _Moved] = {}
    for transform in transforms:
        result.setdefault(transform.animated, {})[transform.prefix] = transform
    for animated, moved in result.items():
        yield moved, [(action, handle) for action, handle, _ in uses_of(animated).values()]


def _records(slots: _Slots) -> Iterator[bpy.types.PropertyGroup]:
    for action, handle in slots:
        yield from (record for record in action.rigid_motion.slots if record.handle == handle)


def _curves(slots: _Slots) -> Iterator[tuple[str, bpy.types.FCurve]]:
    """Yield the F-curves of slots, and their data paths."""
    for action, handle in slots:
        slot = next((slot for slot in action.slots if slot.handle == handle), None)
        channelbag = None if slot is None else action_get_channelbag_for_slot(action, slot)
        for fcurve in () if channelbag is None else channelbag.fcurves:
            yield fcurve.data_path, fcurve
