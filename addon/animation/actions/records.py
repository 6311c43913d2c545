"""What an Action keeps about each transform in each of its slots: its mode, and what its in-betweens were made from.

It goes where the Action goes: to another object, into another file, into a strip. The mode of a transform is in its
mode channel where there is one with keys, and in its record otherwise; nowhere else.
"""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from .slots import SlotTransform
from .sources import MODE_NAMES, MODE_NUMBERS, UNKNOWN


def recorded_digest(place: SlotTransform) -> str:
    """The digest of the source that a transform was filled in from, "" where it was not."""
    record = record_of(place)
    return "" if record is None else record.digest


def recorded_rows(place: SlotTransform) -> list[int]:
    """The rows of the components that in-betweens were written for."""
    record = record_of(place)
    return [] if record is None else [int(row, 16) for row in record.rows]


def recorded_mode(place: SlotTransform) -> int:
    """The number of the mode that a transform has throughout, `UNKNOWN` where it is none that is known."""
    record = record_of(place)
    if record is not None and record.is_property_set("mode"):
        # A number that is no mode, from a damaged file or a later version, reads as an empty name.
        return MODE_NUMBERS.get(record.mode, UNKNOWN)
    return 0


def has_mode(place: SlotTransform) -> bool:
    """Whether a mode other than Blender's was chosen for all segments of a transform in this slot."""
    record = record_of(place)
    return record is not None and record.is_property_set("mode")


def has_in_betweens(place: SlotTransform) -> bool:
    """Whether a transform was filled in, by whichever version; constants that are held beside strips are none."""
    return bool(recorded_digest(place)) or any(len(fcurve.sampled_points) > 2 for fcurve in place.filled.values())


def record_mode(place: SlotTransform, number: int) -> None:
    """Keep the mode that a transform has throughout, and have its users show it."""
    mode = MODE_NAMES[number]
    record = record_of(place)
    if number == 0:
        if record is not None:
            record.property_unset("mode")
            _tidy(place)
    else:
        record = ensure_record(place)
        if record.mode != mode:
            record.mode = mode
    for user in place.users:
        if user.motion.mode != mode and user.animated.is_editable:
            user.motion.mode = mode


def record_in_betweens(place: SlotTransform, digest: str, rows: Iterable[int]) -> None:
    """Keep what in-betweens were made from, and which components they are in."""
    record = record_of(place)
    if digest:
        record = ensure_record(place)
        record.digest, record.rows = digest, "".join(f"{row:x}" for row in sorted(rows))
    elif record is not None and record.digest:
        record.digest = record.rows = ""
        _tidy(place)


def record_of(place: SlotTransform) -> bpy.types.PropertyGroup | None:
    records, key = place.slot.action.rigid_motion.slots, _key_of(place)
    number = _numbers.get(key, -1)
    if not (0 <= number < len(records) and records[number].name == key):
        number = records.find(key)
        if number < 0 and not place.prefix:
            # Those of versions without bones have no name to be found by.
            handle = place.slot.handle
            old = (n for n, one in enumerate(records) if one.handle == handle and not (one.prefix or one.name))
            number = next(old, -1)
        _numbers[key] = number
    return records[number] if number >= 0 else None


_numbers: dict[str, int] = {}
"""Where records were found last, by their names: a rig has many, and Blender goes through all of them for a name."""


def _key_of(place: SlotTransform) -> str:
    """The name that a record is found by."""
    return f"{place.slot.handle} {place.prefix}"


def ensure_record(place: SlotTransform) -> bpy.types.PropertyGroup:
    """The record of a transform in a slot, made where there is none yet."""
    record = record_of(place)
    if record is not None:
        return record
    record = place.slot.action.rigid_motion.slots.add()
    record.name, record.handle, record.prefix = _key_of(place), place.slot.handle, place.prefix
    return record


def _tidy(place: SlotTransform) -> None:
    """Take out a record that says nothing."""
    record = record_of(place)
    if record is not None and not record.digest and not record.is_property_set("mode"):
        records = place.slot.action.rigid_motion.slots
        records.remove(next(number for number, one in enumerate(records) if one == record))
