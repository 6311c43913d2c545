"""Channels: read and write the F-curves of one data-block's slot in its Action as arrays.

Frames are Blender's, sub-frames included. Values are in the channel's own units. Blender stores both in single
precision.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import bpy
import numpy as np
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from ...blender import channelbag_in, enum_value, existing
from ..fcurves.keys import (
    AUTO_EASING,
    BEZIER,
    CODE,
    CONSTANT,
    EASINGS,
    INTERPOLATIONS,
    LINEAR,
    MAX_NUMBER,
    Cycles,
    Keys,
)
from .marks import holds_of, is_any_flagged, marks_of
from .modifiers import copy_modifier, is_term, read_cycles, set_settings, settings_of

KEY_FIELDS = {
    "co": (2, np.float32),
    "handle_left": (2, np.float32),
    "handle_right": (2, np.float32),
    **dict.fromkeys(("handle_left_type", "handle_right_type", "interpolation", "easing", "type"), (1, np.int32)),
    **dict.fromkeys(("back", "amplitude", "period"), (1, np.float32)),
    **dict.fromkeys(("select_control_point", "select_left_handle", "select_right_handle"), (1, np.bool_)),
}
"""All fields of a key: how many numbers each has, and their type."""

KeyFields = dict[str, np.ndarray]
"""All fields of n keys, each of shape (n, width)."""

BREAKDOWN_KEY = enum_value(bpy.types.Keyframe, "type", "BREAKDOWN")
"""The code of the key type Breakdown."""

AUTOMATIC_HANDLES = [enum_value(bpy.types.Keyframe, "handle_left_type", name) for name in ("AUTO", "AUTO_CLAMPED")]
"""The codes of the handle types that Blender computes from the neighbouring keys."""


def channelbag_of(animated: bpy.types.ID) -> bpy.types.ActionChannelbag:
    """Return the channels of `animated` in its Action; create the Action, slot, layer and strip where missing."""
    data = existing(getattr(animated, "animation_data", None) or animated.animation_data_create())
    if data.action is None:
        data.action = bpy.data.actions.new(f"{animated.name}Action")
    action = data.action
    if data.action_slot is None:
        data.action_slot = action.slots.new(animated.id_type, animated.name)
    result = action_get_channelbag_for_slot(action, data.action_slot)
    if result is not None:
        return result
    layer = action.layers[0] if action.layers else action.layers.new("Layer")
    strip = layer.strips[0] if layer.strips else layer.strips.new(type="KEYFRAME")
    return channelbag_in(strip, data.action_slot)


def write_channel(
    animated: bpy.types.ID,
    data_path: str,
    frames: np.ndarray,
    values: np.ndarray,
    *,
    key_type: str = "KEYFRAME",
    interpolation: str = "LINEAR",
    group: str = "",
) -> None:
    """Replace the channels of a property by keys with these values.

    Parameters
    ----------
    animated : bpy.types.ID
        The owner of the property.
    data_path : str
        The data path of the property, relative to `animated`: "location".
    frames : array, shape (n,)
        In rising order. Sub-frames are allowed.
    values : array, shape (n,) or (n, channels)
        One channel for a single number, or one for each component of a vector.
    key_type, interpolation : str
        Used for every key; the names are those of `bpy.types.Keyframe`.
    group : str
        The group that the Dope Sheet lists the channels in. Empty for none.
    """
    channelbag = channelbag_of(animated)
    fcurves = channelbag.fcurves
    for index, column in enumerate(np.asarray(values).reshape(len(frames), -1).T):
        if (old := fcurves.find(data_path, index=index)) is not None:
            fcurves.remove(old)
        fcurve = fcurves.new(data_path, index=index)
        if group:
            fcurve.group = ensure_group(channelbag, group)
        replace_keys(fcurve, frames, column, interpolation=interpolation, key_type=key_type)


def replace_keys(
    fcurve: bpy.types.FCurve,
    frames: np.ndarray,
    values: np.ndarray,
    *,
    interpolation: str | np.ndarray = "LINEAR",
    key_type: str | np.ndarray = "KEYFRAME",
    selected: np.ndarray | bool = True,
) -> None:
    """Replace the keys of an F-curve by new ones: see `new_key_fields`."""
    set_key_fields(fcurve, new_key_fields(frames, values, interpolation, key_type, selected=selected))


def new_key_fields(
    frames: np.ndarray,
    values: np.ndarray | float,
    interpolation: str | np.ndarray | int = "LINEAR",
    key_type: str | np.ndarray = "KEYFRAME",
    *,
    selected: np.ndarray | bool = False,
) -> KeyFields:
    """Return all fields of new keys on rising frames (n,) with these values (n,); Blender computes their handles.

    Interpolation and key type are one name for all keys, see `write_channel`, or one code for each key (n,).
    """
    fields: KeyFields = {name: np.zeros((len(frames), width), kind) for name, (width, kind) in KEY_FIELDS.items()}
    for name in ("co", "handle_left", "handle_right"):
        fields[name][:, 0], fields[name][:, 1] = frames, values
    for name in ("handle_left_type", "handle_right_type"):
        fields[name][:] = code_of(name, "AUTO_CLAMPED")
    for name, codes in (("interpolation", interpolation), ("type", key_type)):
        fields[name][:, 0] = code_of(name, codes) if isinstance(codes, str) else codes
    for name in ("select_control_point", "select_left_handle", "select_right_handle"):
        fields[name][:, 0] = selected
    return fields


def merged_keys(fields: KeyFields, others: KeyFields) -> KeyFields:
    """Return the fields of all keys, plus those of the other keys; both must be on different frames."""
    order = np.argsort(np.append(fields["co"][:, 0], others["co"][:, 0]), kind="stable")
    return {name: np.concatenate((numbers, others[name]))[order] for name, numbers in fields.items()}


def key_fields(keys: bpy.types.bpy_prop_collection) -> KeyFields:
    """Return all fields of the `keyframe_points` of an F-curve."""
    fields: KeyFields = {name: np.empty((len(keys), width), kind) for name, (width, kind) in KEY_FIELDS.items()}
    for name, numbers in fields.items():
        keys.foreach_get(name, numbers.ravel())
    return fields


def set_key_fields(fcurve: bpy.types.FCurve, fields: KeyFields) -> None:
    """Replace the keys of an F-curve by these."""
    keys = fcurve.keyframe_points
    keys.clear()
    keys.add(len(fields["co"]))
    for name, numbers in fields.items():
        keys.foreach_set(name, numbers.ravel())
    fcurve.update()


def key_points(fcurve: bpy.types.FCurve, name: str = "co") -> np.ndarray:
    """Return the frames and values of the keys of an F-curve, or of their handles on one side, shape (n, 2)."""
    points = np.empty((len(fcurve.keyframe_points), 2), np.float32)
    fcurve.keyframe_points.foreach_get(name, points.ravel())
    return points


def selected_keys(fcurve: bpy.types.FCurve) -> np.ndarray:
    """Return which keys of an F-curve are selected, shape (n,)."""
    selected = np.empty(len(fcurve.keyframe_points), bool)
    fcurve.keyframe_points.foreach_get("select_control_point", selected)
    return selected


def ensure_group(channelbag: bpy.types.ActionChannelbag, name: str) -> bpy.types.ActionGroup:
    """Return the group of this name; create it if there is none."""
    return channelbag.groups.get(name) or channelbag.groups.new(name)


def copy_fcurve(fcurve: bpy.types.FCurve, channelbag: bpy.types.ActionChannelbag, path: str) -> bpy.types.FCurve:
    """Return a copy of an F-curve under this data path, replacing the F-curve that another slot has there.

    A new F-curve joins a group of the same name. Terms are not copied: they are planned from the keys.
    """
    index = fcurve.array_index
    copy = channelbag.fcurves.find(path, index=index)
    if copy is None:
        copy = channelbag.fcurves.new(path, index=index)
        if fcurve.group is not None:
            copy.group = ensure_group(channelbag, fcurve.group.name)
    for modifier in list(copy.modifiers):
        copy.modifiers.remove(modifier)
    set_key_fields(copy, key_fields(fcurve.keyframe_points))
    for modifier in itertools.filterfalse(is_term, fcurve.modifiers):
        copy_modifier(modifier, copy)
    set_settings(copy, settings_of(fcurve) | {"data_path": path})
    return copy


def code_of(name: str, value: str) -> int:
    """Return the integer code of a value of one of the enumerations of `bpy.types.Keyframe`."""
    return enum_value(bpy.types.Keyframe, name, value)


class ReadChannels(NamedTuple):
    """Channels of one owner with keys on the same frames."""

    numbers: list[int]
    """Their indices in the sequence of the owner's channels."""

    keys: Keys

    marks: np.ndarray
    """The marks of the keys of each channel, shape (c, n): see `marks`."""

    holds: np.ndarray
    """The holds of the keys of each channel, shape (c, n): see `marks.hold`; -1 for keys that store none."""


def read_keys(fcurves: Sequence[bpy.types.FCurve]) -> list[ReadChannels]:
    """Return the keys of F-curves that have any, with their Cycles modifiers but none of their other modifiers.

    F-curves are read together if they agree in key frames, breakdowns, extrapolation and Cycles.
    """
    points, together = [key_points(fcurve) for fcurve in fcurves], dict[tuple, list[int]]()
    for number, fcurve in enumerate(fcurves):
        # Group by breakdowns, too: a channel that no mode fills must not decide for the others.
        (types,) = _read_property("type", [fcurve.keyframe_points], CODE)
        times, is_breakdown = points[number][:, 0], types == BREAKDOWN_KEY
        key = times.tobytes(), fcurve.extrapolation, read_cycles(fcurve), is_breakdown.tobytes()
        together.setdefault(key, []).append(number)
    result = []
    for (_, extrapolation, cycles, mask), numbers in together.items():
        channels, breakdowns = [fcurves[number].keyframe_points for number in numbers], np.frombuffer(mask, bool)
        stacked, is_linear = np.stack([points[number] for number in numbers]), extrapolation == "LINEAR"
        result.append(ReadChannels(numbers, *_read_together(channels, stacked, is_linear, cycles, breakdowns)))
    if any((read.holds >= 0).any() for read in result):
        # Also for channels that store no holds themselves: the holds of the other channels apply to them, too.
        result = [
            read._replace(keys=replace(read.keys, automatic=_automatic_handles(fcurves, read))) for read in result
        ]
    return result


def _automatic_handles(fcurves: Sequence[bpy.types.FCurve], read: ReadChannels) -> np.ndarray:
    """Return which handles of these channels Blender computes, left and right: (c, n, 2)."""
    channels = [fcurves[number].keyframe_points for number in read.numbers]
    types = [_read_property(f"handle_{side}_type", channels, CODE) for side in ("left", "right")]
    return np.isin(np.stack(types, axis=-1), AUTOMATIC_HANDLES)


def _read_together(
    channels: Sequence, points: np.ndarray, linear: bool, cycles: Cycles | None, breakdowns: np.ndarray
) -> tuple[Keys, np.ndarray, np.ndarray]:
    """Return the keys of several `keyframe_points` with these points (c, n, 2), and their marks and holds (c, n).

    `breakdowns` says which keys are of this type, shape (n,).
    """
    interpolation = _read_property("interpolation", channels, CODE)
    _replace_unknown(interpolation, INTERPOLATIONS, CONSTANT)
    used = set(np.unique(interpolation).tolist())
    is_eased = bool(used - {BEZIER, LINEAR, CONSTANT})
    back, amplitude = (_read_property(name, channels, np.float32) for name in ("back", "amplitude"))
    left = right = easing = settings = None
    if BEZIER in used or (is_eased and linear):
        left, right = (_read_property(name, channels, np.float32, 2) for name in ("handle_left", "handle_right"))
    if is_eased:
        easing = _read_property("easing", channels, CODE)
        _replace_unknown(easing, EASINGS, AUTO_EASING)
        settings = np.stack((back, amplitude, _read_property("period", channels, np.float32)))
    numbers = (np.abs(part).max(initial=0.0) for part in (points, left, right, settings) if part is not None)
    # Comparisons with NaN are false, so NaN counts as unsound, too.
    is_sound = all(number < MAX_NUMBER for number in numbers) and bool(np.all(np.diff(points[0, :, 0]) >= 0.0))
    marked = breakdowns if breakdowns.any() else None
    holds = np.full(points.shape[:2], -1)
    if is_any_flagged(back):
        holds = holds_of(back, amplitude, _read_property("period", channels, np.float32))
    keys = Keys(points, interpolation, left, right, easing, settings, linear, cycles, marked, is_sound=is_sound)
    return keys, marks_of(back, amplitude), holds


def _read_property(name: str, channels: Sequence, dtype: type, *width: int) -> np.ndarray:
    """Return a property of the n keys of each of c channels, shape (c, n) or (c, n, width)."""
    values: np.ndarray = np.empty((len(channels), len(channels[0]), *width), dtype)
    for keys, buffer in zip(channels, values, strict=True):
        keys.foreach_get(name, buffer.ravel())
    return values


def _replace_unknown(codes: np.ndarray, names: dict[int, str], replacement: int) -> None:
    """Replace unknown codes in a damaged file as Blender does. The known codes have no gaps between them."""
    codes[(codes < min(names)) | (codes > max(names))] = replacement
