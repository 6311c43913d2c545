"""Channels: the F-curves of one data-block's slot in its Action, written, and read as arrays.

Frames are Blender's, sub-frames included; values are in the channel's own units. Blender keeps both in single
precision.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import bpy
import numpy as np
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from ...motion import Poses
from ..fcurves.keys import AUTO, BEZIER, CODE, CONSTANT, EASINGS, INTERPOLATIONS, LARGEST, LINEAR, Cycles, Keys
from .marks import marks_of
from .modifiers import is_term, read_cycles

KEY_FIELDS = {
    "co": (2, np.float32),
    "handle_left": (2, np.float32),
    "handle_right": (2, np.float32),
    **dict.fromkeys(("handle_left_type", "handle_right_type", "interpolation", "easing", "type"), (1, np.int32)),
    **dict.fromkeys(("back", "amplitude", "period"), (1, np.float32)),
    **dict.fromkeys(("select_control_point", "select_left_handle", "select_right_handle"), (1, np.bool_)),
}
"""All there is to a key: how many numbers, and of which type."""

KeyFields = dict[str, np.ndarray]
"""All there is to n keys, each field of shape (n, width)."""

BREAKDOWN = bpy.types.Keyframe.bl_rna.properties["type"].enum_items["BREAKDOWN"].value
"""The code of this type of keys."""


def channelbag_of(animated: bpy.types.ID) -> bpy.types.ActionChannelbag:
    """Return the channels of `animated` in its Action; make what is missing of Action, slot, layer and strip."""
    data = animated.animation_data or animated.animation_data_create()
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
    return strip.channelbag(data.action_slot, ensure=True)


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
    """Replace a property's channels by keys of these values.

    Parameters
    ----------
    animated : bpy.types.ID
        The owner of the property.
    data_path : str
        The property, from `animated` on: "location".
    frames : array, shape (n,)
        Rising. They need not be whole.
    values : array, shape (n,) or (n, channels)
        One channel for a single number, one for each component of a vector.
    key_type, interpolation : str
        What every key gets; the names are those of `bpy.types.Keyframe`.
    group : str
        Where the Dope Sheet lists the channels. Empty for none.
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
    key_type: str = "KEYFRAME",
    handle_type: str | None = None,
    selected: np.ndarray | None = None,
) -> None:
    """Give an F-curve these keys in place of those it has.

    Parameters
    ----------
    fcurve : bpy.types.FCurve
    frames, values : array, shape (n,)
        Frames rise. They need not be whole.
    interpolation, key_type, handle_type : str
        What every key gets; the names are those of `bpy.types.Keyframe`. Handles are Blender's default without. Codes
        are each key's own interpolation, shape (n,).
    selected : array of bool, shape (n,), optional
        Which keys are selected; Blender's default, otherwise.
    """
    points = np.empty((len(frames), 2), dtype=np.float32)
    points[:, 0], points[:, 1] = frames, values
    keys = fcurve.keyframe_points
    keys.clear()
    keys.add(len(frames))
    keys.foreach_set("co", points.ravel())
    codes = {"interpolation": interpolation, "type": key_type}
    if handle_type is not None:
        codes |= {"handle_left_type": handle_type, "handle_right_type": handle_type}
    for name, value in codes.items():
        codes_of_keys = code_of(name, value) if isinstance(value, str) else value
        keys.foreach_set(name, np.full(len(frames), codes_of_keys, dtype=np.int32))
    if selected is not None:
        for part in ("select_control_point", "select_left_handle", "select_right_handle"):
            keys.foreach_set(part, selected)
    fcurve.update()


def empty_key_fields(count: int) -> KeyFields:
    """Return all there is to so many keys, zero."""
    return {name: np.zeros((count, width), kind) for name, (width, kind) in KEY_FIELDS.items()}


def key_fields(keys: bpy.types.bpy_prop_collection) -> KeyFields:
    """Return all there is to the `keyframe_points` of an F-curve."""
    fields = empty_key_fields(len(keys))
    for name, numbers in fields.items():
        keys.foreach_get(name, numbers.ravel())
    return fields


def set_key_fields(fcurve: bpy.types.FCurve, fields: KeyFields) -> None:
    """Give an F-curve these keys in place of those it has."""
    keys = fcurve.keyframe_points
    keys.clear()
    keys.add(len(fields["co"]))
    for name, numbers in fields.items():
        keys.foreach_set(name, numbers.ravel())
    fcurve.update()


def key_points(fcurve: bpy.types.FCurve, name: str = "co") -> np.ndarray:
    """Return frame and value of the keys of an F-curve, or of their handles on one side, shape (n, 2)."""
    points = np.empty((len(fcurve.keyframe_points), 2), np.float32)
    fcurve.keyframe_points.foreach_get(name, points.ravel())
    return points


def selected_keys(fcurve: bpy.types.FCurve) -> np.ndarray:
    """Return which keys of an F-curve are selected, shape (n,)."""
    selected = np.empty(len(fcurve.keyframe_points), bool)
    fcurve.keyframe_points.foreach_get("select_control_point", selected)
    return selected


def ensure_group(channelbag: bpy.types.ActionChannelbag, name: str) -> bpy.types.ActionGroup:
    """Return the group of this name, made where there is none yet."""
    return channelbag.groups.get(name) or channelbag.groups.new(name)


def copy_fcurve(fcurve: bpy.types.FCurve, channelbag: bpy.types.ActionChannelbag, path: str) -> bpy.types.FCurve:
    """Return a copy of an F-curve for this data path, in place of what another slot has there.

    A new one is in a group of the same name. Terms are left out: they are planned from the keys.
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
        _copy_settings(modifier, copied := copy.modifiers.new(modifier.type))
        if modifier.type == "ENVELOPE":
            for point in modifier.control_points:
                _copy_settings(point, copied.control_points.add(point.frame))
    _copy_settings(fcurve, copy)
    copy.data_path = path
    return copy


def _copy_settings(source: bpy.types.bpy_struct, target: bpy.types.bpy_struct) -> None:
    """Set all plain properties of one as another of the same type has them."""
    for prop in source.bl_rna.properties:
        if not prop.is_readonly and prop.type not in ("POINTER", "COLLECTION"):
            value = getattr(source, prop.identifier)
            is_array = getattr(prop, "is_array", False)
            setattr(target, prop.identifier, tuple(value) if is_array else value)


def code_of(name: str, value: str) -> int:
    """Return the number that stands for a value of one of the enumerations of `bpy.types.Keyframe`."""
    return bpy.types.Keyframe.bl_rna.properties[name].enum_items[value].value


def read_poses(obj: bpy.types.Object, frames: np.ndarray) -> Poses:
    """Return the world poses of `obj` as the scene evaluates them: parents, constraints, drivers, deltas and all.

    The scene steps through `frames` (shape (n,), sub-frames allowed) and returns to the frame it was on. Scales are
    kept where the object is not of its own size; they are the mean of the three axes.
    """
    scene = bpy.context.scene
    depsgraph = bpy.context.evaluated_depsgraph_get()
    before, subframe = scene.frame_current, scene.frame_subframe
    positions, quaternions = np.empty((len(frames), 3)), np.empty((len(frames), 4))
    scales = np.empty(len(frames))
    try:
        for row, frame in enumerate(frames):
            whole = int(np.floor(frame))
            scene.frame_set(whole, subframe=float(frame - whole))
            location, rotation, scale = obj.evaluated_get(depsgraph).matrix_world.decompose()
            positions[row], quaternions[row], scales[row] = location, rotation, sum(scale) / 3.0
    finally:
        scene.frame_set(before, subframe=subframe)
    return Poses(positions, quaternions, None if np.allclose(scales, 1.0, atol=1e-6) else scales)


class Read(NamedTuple):
    """Channels of one owner that are keyed together."""

    numbers: list[int]
    """Their numbers in the sequence of the owner's channels."""

    keys: Keys

    marks: np.ndarray
    """The marks of the keys, shape (n,): see `marks`."""


def read_keys(fcurves: Sequence[Sequence[bpy.types.FCurve]]) -> list[list[Read]]:
    """Return the keys of F-curves, and the Cycles modifier that each begins with; none of their other modifiers.

    Parameters
    ----------
    fcurves : sequence of sequences of bpy.types.FCurve
        Those of each owner, with keys: of a sampled curve there are none. Many owners are read quicker at once.

    Returns
    -------
    list of lists of Read
        For each owner those together that are keyed together.
    """
    batches: dict[tuple, list[tuple]] = {}
    for owner, curves in enumerate(fcurves):
        for index, fcurve in enumerate(curves):
            keys = fcurve.keyframe_points
            cycles = read_cycles(fcurve)
            batches.setdefault((len(keys), fcurve.extrapolation, cycles), []).append((owner, index, keys))
    result: list[list[Read]] = [[] for _ in fcurves]
    for (_, extrapolation, cycles), batch in batches.items():
        owners, indices, channels = zip(*batch, strict=True)
        for rows, keys, marks in _read_batch(owners, channels, extrapolation == "LINEAR", cycles):
            result[owners[rows[0]]].append(Read([indices[row] for row in rows], keys, marks))
    for reads in result:
        reads.sort(key=lambda read: read.numbers)
    return result


def _read_batch(
    owners: Sequence[int], channels: Sequence, linear: bool, cycles: Cycles | None
) -> Iterator[tuple[list[int], Keys, np.ndarray]]:
    """Yield the rows of channels that are keyed together, of such with equally many `keyframe_points` each, and what
    `Read` has of them.
    """
    points = _read_property("co", channels, np.float32, 2)
    groups = _keyed_together(owners, points[..., 0])
    order = [row for rows in groups for row in rows]
    if order != list(range(len(order))):
        channels, points = [channels[row] for row in order], points[order]
    sizes = np.array([len(rows) for rows in groups])
    bounds = np.concatenate(((0,), np.cumsum(sizes)))

    def any_in_group(of_keys: np.ndarray) -> np.ndarray:
        return np.logical_or.reduceat(of_keys.any(axis=1), bounds[:-1])

    interpolation = _read_property("interpolation", channels, CODE)
    _replace_unknown(interpolation, INTERPOLATIONS, CONSTANT)
    bezier = interpolation == BEZIER
    eased = any_in_group(~(bezier | (interpolation == LINEAR) | (interpolation == CONSTANT)))
    curved = any_in_group(bezier) | (eased & linear)
    rows = np.flatnonzero(curved.repeat(sizes)).tolist()
    left, right = (_read_property(name, channels, np.float32, 2, rows=rows) for name in ("handle_left", "handle_right"))
    rows = np.flatnonzero(eased.repeat(sizes)).tolist()
    easing = _read_property("easing", channels, CODE, rows=rows)
    _replace_unknown(easing, EASINGS, AUTO)
    back, amplitude = (_read_property(name, channels, np.float32) for name in ("back", "amplitude"))
    settings = [back, amplitude, _read_property("period", channels, np.float32, rows=rows)]
    marks = marks_of(back, amplitude)
    # A key that is no breakdown in the first of the channels that are keyed together is none.
    breakdowns = _read_property("type", channels, CODE, rows=bounds[:-1].tolist()) == BREAKDOWN
    rows = np.flatnonzero(any_in_group(breakdowns).repeat(sizes)).tolist()
    breakdowns = _read_property("type", channels, CODE, rows=rows) == BREAKDOWN
    numbers = np.concatenate([array.reshape(len(points), -1) for array in (points, left, right, *settings)], axis=1)
    # What is no number is not smaller, either.
    sound = ~any_in_group(~(np.abs(numbers) < LARGEST)) & ~any_in_group(~(points[:, 1:, 0] >= points[:, :-1, 0]))
    slices = itertools.starmap(slice, itertools.pairwise(bounds))
    for number, (rows, at) in enumerate(zip(groups, slices, strict=True)):
        handles = (left[at], right[at]) if curved[number] else (None, None)
        easings = (easing[at], np.stack([values[at] for values in settings])) if eased[number] else (None, None)
        marked = breakdowns[at].all(axis=0)
        marked = marked if marked.any() else None
        others = {"linear": linear, "cycles": cycles, "breakdowns": marked, "is_sound": bool(sound[number])}
        yield rows, Keys(points[at], interpolation[at], *handles, *easings, **others), marks[at].max(axis=0)


def _keyed_together(owners: Sequence[int], frames: np.ndarray) -> list[list[int]]:
    """Return the rows of channels with keys on these frames (c, n), those together that one owner keys together."""
    raw, width = frames.tobytes(), frames.shape[1] * frames.itemsize
    groups: dict[tuple[int, bytes], list[int]] = {}
    for row, owner in enumerate(owners):
        groups.setdefault((owner, raw[row * width : (row + 1) * width]), []).append(row)
    return list(groups.values())


def _read_property(
    name: str, channels: Sequence, dtype: type, *width: int, rows: Sequence[int] | None = None
) -> np.ndarray:
    """Return a property of the n keys of each of c channels, (c, n) or (c, n, width); zero but for these rows."""
    values = np.zeros((len(channels), len(channels[0]) * math.prod(width)), dtype)
    read_all = rows is None or len(rows) == len(channels)
    pairs = zip(channels, values, strict=True) if read_all else ((channels[row], values[row]) for row in rows)
    for keys, buffer in pairs:
        keys.foreach_get(name, buffer)
    return values.reshape(len(values), -1, *width) if width else values


def _replace_unknown(codes: np.ndarray, names: dict[int, str], replacement: int) -> None:
    """Treat codes without a meaning, in a damaged file, as Blender does. Those with a meaning have no gaps."""
    codes[(codes < min(names)) | (codes > max(names))] = replacement
