"""From Blender's F-curves to `Keys`, those of many owners at once."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence

import bpy
import numpy as np

from ..curves.keys import AUTO, BEZIER, CODE, CONSTANT, EASINGS, INTERPOLATIONS, LARGEST, LINEAR, Cycles, Keys
from ..curves.steps import Stepped

BREAKDOWN = bpy.types.Keyframe.bl_rna.properties["type"].enum_items["BREAKDOWN"].value
"""The code of this type of keys."""


def read_keys(fcurves: Sequence[Sequence[bpy.types.FCurve]]) -> list[list[tuple[list[int], Keys]]]:
    """Return the keys of F-curves, the first Cycles modifier and the Stepped ones of each;
    none of their other modifiers.

    Parameters
    ----------
    fcurves : sequence of sequences of bpy.types.FCurve
        Those of each owner, with keys: of a sampled curve there are none. Many owners are read quicker at once.

    Returns
    -------
    list of lists of (list of int, Keys)
        For each owner those together that are keyed together: their indices in its sequence, and their keys.
    """
    batches: dict[tuple, list[tuple]] = {}
    for owner, curves in enumerate(fcurves):
        for index, fcurve in enumerate(curves):
            keys = fcurve.keyframe_points
            modifiers = fcurve.modifiers
            cycles, steps = (_read_cycles(modifiers), read_steps(modifiers)) if modifiers else (None, ())
            batches.setdefault((len(keys), fcurve.extrapolation, cycles, steps), []).append((owner, index, keys))
    result: list[list[tuple[list[int], Keys]]] = [[] for _ in fcurves]
    for (_, extrapolation, cycles, steps), batch in batches.items():
        owners, indices, channels = zip(*batch, strict=True)
        for rows, keys in _read_batch(owners, channels, extrapolation == "LINEAR", cycles, steps):
            result[owners[rows[0]]].append(([indices[row] for row in rows], keys))
    for keys_of_owner in result:
        keys_of_owner.sort(key=lambda pair: pair[0])
    return result


def _read_batch(
    owners: Sequence[int], channels: Sequence, linear: bool, cycles: Cycles | None, steps: tuple[Stepped, ...]
) -> Iterator[tuple[list[int], Keys]]:
    """Yield the keys of channels, from their `keyframe_points` with equally many each:
    the rows of those keyed together.
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
    settings = [_read_property(name, channels, np.float32, rows=rows) for name in ("back", "amplitude", "period")]
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
        others = (linear, cycles, steps, marked, bool(sound[number]))
        yield rows, Keys(points[at], interpolation[at], *handles, *easings, *others)


def _keyed_together(owners: Sequence[int], frames: np.ndarray) -> list[list[int]]:
    """Return the rows of channels with keys on these frames (c, n),
    those together of one owner and on the same frames.
    """
    raw, width = frames.tobytes(), frames.shape[1] * frames.itemsize
    groups: dict[tuple[int, bytes], list[int]] = {}
    for row, owner in enumerate(owners):
        groups.setdefault((owner, raw[row * width : (row + 1) * width]), []).append(row)
    return list(groups.values())


def _read_property(
    name: str, channels: Sequence, dtype: type, *width: int, rows: Sequence[int] | None = None
) -> np.ndarray:
    """Return a property of the n keys of each of c channels, (c, n) or (c, n, width);
    read for these rows, else zero.
    """
    values = np.zeros((len(channels), len(channels[0]) * math.prod(width)), dtype)
    read_all = rows is None or len(rows) == len(channels)
    pairs = zip(channels, values, strict=True) if read_all else ((channels[row], values[row]) for row in rows)
    for keys, buffer in pairs:
        keys.foreach_get(name, buffer)
    return values.reshape(len(values), -1, *width) if width else values


def _replace_unknown(codes: np.ndarray, names: dict[int, str], replacement: int) -> None:
    """Treat codes without a meaning, in a damaged file, as Blender does. Those with a meaning have no gaps."""
    codes[(codes < min(names)) | (codes > max(names))] = replacement


def _read_cycles(modifiers: Iterable[bpy.types.FModifier]) -> Cycles | None:
    for modifier in modifiers:
        if modifier.type == "CYCLES" and not modifier.mute:
            return Cycles(modifier.mode_before, modifier.mode_after, modifier.cycles_before, modifier.cycles_after)
    return None


def read_steps(modifiers: Iterable[bpy.types.FModifier]) -> tuple[Stepped, ...]:
    """Return the Stepped modifiers of an F-curve that are not muted, first to last."""
    return tuple(
        Stepped(
            modifier.frame_step,
            modifier.frame_offset,
            modifier.frame_start if modifier.use_frame_start else -np.inf,
            modifier.frame_end if modifier.use_frame_end else np.inf,
        )
        for modifier in modifiers
        if modifier.type == "STEPPED" and not modifier.mute
    )
