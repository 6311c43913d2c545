"""Native Bezier keys for a motion: few keys on its samples, with fitted handles instead of a mode.

All channels of a part have their keys on the same frames. Handles are a third of the segment long, so values are cubics
in time; or as long as automatic handles without smoothing, if fewer keys are needed then. Handles are Blender's
automatic ones wherever these are as good. Frames are those of the Action.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace

import bpy
import numpy as np

from ...blender import channelbag_in
from ...motion.cubic_keys import (
    CONSTANT_KIND,
    CUBIC_KIND,
    THIRD_RATIO,
    CubicKeys,
    Samples,
    errors_between,
    fitted_together,
    keyed_at,
)
from ..actions.channels import KeyFields, code_of, key_points, new_key_fields, set_key_fields
from ..evaluation.components import LOCATION, PART_OF, ROTATION, ROWS
from ..evaluation.sources import KeyedTransform
from ..fcurves.evaluation import evaluate
from ..fcurves.keys import BEZIER, CODE, Keys
from ..transforms import Transform
from .fewer_keys import is_constant, values_on

NATIVE = "NATIVE_CURVES"
"""Requests native curves in place of a mode."""

UNSMOOTHED_RATIO = 1.0 / 2.5614
"""The length of automatic handles, as a fraction of the segment, if Auto Handle Smoothing is None, as in old files."""

MAX_KEYS_RATIO, MAX_ERROR_RATIO = 0.9, 0.25
"""Unsmoothed handles must leave at most this fraction of the keys, or no more keys with this fraction of the error."""

QUATERNION_LENGTH_WEIGHT = 1e-4
"""The weight of a quaternion's length: handles look as if set by hand, and values between frames stay near."""

FIRST_TRIAL_CURVES = 5
"""The number of joints tried first, to see whether any needs fewer keys with unsmoothed handles."""

MAX_AUTOMATIC_TRIES = 8
"""The most attempts with automatic handles, each on fewer keys than the one before."""

MAX_COLLINEAR_SLOPE_RATIO = 1e-4
"""Two handles count as collinear if their slopes differ by less, relative to the larger slope."""

SLOPE_ROUNDING_RATIO = 3e-3
"""Single-precision rounding relative to the value, divided by `MAX_COLLINEAR_SLOPE_RATIO`."""


class JointCurves:
    """The values and tolerances needed to fit native curves to a joint.

    Parameters
    ----------
    transform : Transform
    source : Source
        The dense keys.
    frames : array, shape (m,)
        The samples that keys may be on.
    reach : float
        The largest distance of anything that the joint rotates.
    allowed : array, shape (m,)
        The allowed error on each frame, in the same unit, which is that of the channels.
    """

    def __init__(
        self, transform: Transform, source: KeyedTransform, frames: np.ndarray, reach: float, allowed: np.ndarray
    ) -> None:
        self.source, self.frames = source, frames
        self.values = values_on(transform, source, frames)
        self.parts: list[tuple[list[int], Samples]] = []
        """The changing rows of each part, and their samples."""
        for part in ROWS:
            rows = [row for row in self.values if PART_OF[row] == part]
            turns = part == ROTATION and source.order is None and len(rows) == 4
            changing = [row for row in rows if not is_constant(self.values[row])]
            if changing:
                rows = rows if turns else changing
                values = np.column_stack([self.values[row] for row in rows])
                by = 1.0 if part == LOCATION else reach
                if turns:
                    # The distance of quaternions is half of their angle.
                    values, by = values / np.linalg.norm(values, axis=1, keepdims=True), 2.0 * reach
                self.parts.append((rows, Samples(values, allowed / by, turns, lengths=QUATERNION_LENGTH_WEIGHT)))

    def scaled(self, scale: float) -> list[Samples]:
        """Return the samples of all parts, with the allowed errors times a scale."""
        return [_scaled(samples, scale) for _, samples in self.parts]

    def with_handles(self, length: float) -> None:
        """Set the length of handles, as a fraction of the segment."""
        self.parts = [(rows, samples._replace(handles=length)) for rows, samples in self.parts]

    def fit(self, length: float) -> tuple[int, float]:
        """Return the number of keys needed with handles of this length, and the median error of segments."""
        self.with_handles(length)
        (keys,) = needed({0: self}, {0: 1.0}, shared=False).values()
        at = np.searchsorted(self.frames, keys)
        errors = np.max([errors_between(self.frames, samples, at) for _, samples in self.parts], axis=0)
        return len(keys), float(np.median(errors))

    def keyed(self, keys: np.ndarray, scale: float) -> KeyedTransform:
        """Return the source with keys on only these frames (k,); channels that do not change have a single key."""
        at = np.searchsorted(self.frames, keys)
        channels = []
        for rows, samples in self.parts:
            curves = keyed_at(self.frames, _scaled(samples, scale), at, steps=True)
            channels.append((rows, self._with_handles(rows, curves, samples.handles)))
        moving = {row for rows, _ in self.parts for row in rows}
        if still := [row for row in self.values if row not in moving]:
            points = np.array([[(self.frames[0], self.values[row][0])] for row in still], np.float32)
            channels.append((still, Keys(points, np.full(points.shape[:2], BEZIER, CODE))))
        for rows, kept in self.source.channels:
            if indices := [index for index, row in enumerate(rows) if row not in self.values]:
                channels.append(([rows[index] for index in indices], kept.only(indices)))
        rest = {row: value for row, value in self.source.rest.items() if row not in self.values}
        return replace(self.source, channels=tuple(channels), rest=rest, mode=0, turns=None)

    def _with_handles(self, rows: Sequence[int], curves: CubicKeys, length: float) -> Keys:
        """Return keys of rows with handles of this length, as a fraction of each segment."""
        lengths, values = np.diff(curves.times)[:, None] * length, curves.values
        before, behind = np.concatenate((lengths[:1], lengths)), np.concatenate((lengths, lengths[-1:]))
        # Linear extrapolation continues with the slope at the first and last key.
        leaving, arriving = curves.leaving.copy(), curves.arriving.copy()
        arriving[0], leaving[-1] = leaving[0], arriving[-1]
        times, kinds = curves.times[:, None], curves.kinds.copy()
        # A segment that stays constant becomes a curve too, so it does not jump if its end is moved later.
        kinds[:-1][(kinds[:-1] == CONSTANT_KIND) & (values[1:] == values[:-1]).all(axis=1)] = CUBIC_KIND
        kinds[-1] = CUBIC_KIND
        points, left, right = (
            np.stack((np.broadcast_to(x, y.shape), y), axis=-1).swapaxes(0, 1).astype(np.float32)
            for x, y in (
                (times, values),
                (times - before, values - before * arriving),
                (times + behind, values + behind * leaving),
            )
        )
        old = next((keys for keyed, keys in self.source.channels if not set(rows).isdisjoint(keyed)), None)
        return Keys(
            points,
            np.tile(kinds.astype(CODE), (len(rows), 1)),
            left,
            right,
            linear=old is not None and old.linear,
            cycles=None if old is None else old.cycles,
        )

    def automatic(self, fewer: KeyedTransform, scale: float, scratch: bpy.types.FCurve) -> KeyedTransform:
        """Return the source with Blender's automatic handles where curves keep to the scaled tolerance with them.

        The scratch F-curve is used to compute the handles.
        """
        channels = list(fewer.channels)
        for number, (_, samples) in enumerate(self.parts):
            rows, keys = channels[number]
            channels[number] = rows, self._with_automatic(keys, _scaled(samples, scale), scratch)
        return replace(fewer, channels=tuple(channels))

    def _with_automatic(self, keys: Keys, samples: Samples, scratch: bpy.types.FCurve) -> Keys:
        begins = np.searchsorted(self.frames, keys.times)
        flags = np.ones(len(begins), dtype=bool)
        for _ in range(MAX_AUTOMATIC_TRIES):
            tried = _with_blender_handles(
                replace(keys, automatic=np.broadcast_to(flags[:, None], (*keys.points.shape[:2], 2))), scratch
            )
            (shown,) = evaluate([tried], [self.frames])
            shown = shown.T / (np.linalg.norm(shown.T, axis=1, keepdims=True) if samples.are_turns else 1.0)
            off = np.linalg.norm(shown - samples.values, axis=1) / samples.allowed
            bad = np.maximum.reduceat(off[:-1], begins[:-1]) > 1.0
            wrong = flags & (np.append(bad, False) | np.append(False, bad))
            if not wrong.any():
                return tried
            flags &= ~wrong
        return keys


def needed(curves: Mapping[int, JointCurves], scales: Mapping[int, float], *, shared: bool) -> dict[int, np.ndarray]:
    """Return the frames of the keys (k,) that joints need: shared by all, or separate for each.

    `scales` multiply the allowed error of each joint.
    """
    result = {number: joint.frames[:1] for number, joint in curves.items()}
    samples = {number: joint.scaled(scales[number]) for number, joint in curves.items() if joint.parts}
    for numbers in [list(samples)] if shared and samples else [[number] for number in samples]:
        groups = [part for number in numbers for part in samples[number]]
        keys = fitted_together(curves[numbers[0]].frames, groups, steps=True)[0].times
        result.update(dict.fromkeys(numbers, keys))
    return result


def choose_handles(curves: Mapping[int, JointCurves]) -> None:
    """Set the handle length of each joint to the one that needs fewer keys."""
    count = len(curves)
    moving = [number for number, joint in curves.items() if joint.parts]
    first = moving[:: max(1, count // FIRST_TRIAL_CURVES)]
    for some in (first, [number for number in moving if number not in first]):
        gained = False
        for joint in map(curves.__getitem__, some):
            (keys, error), (others, less) = joint.fit(THIRD_RATIO), joint.fit(UNSMOOTHED_RATIO)
            gains = others <= MAX_KEYS_RATIO * keys or (others <= keys and less <= MAX_ERROR_RATIO * error)
            joint.with_handles(UNSMOOTHED_RATIO if gains else THIRD_RATIO)
            gained |= gains
        if not gained:
            break


@contextmanager
def scratch_curve() -> Iterator[bpy.types.FCurve]:
    """Provide a temporary F-curve to try keys on, which moves nothing."""
    action = bpy.data.actions.new("Scratch")
    try:
        strip = action.layers.new("Scratch").strips.new(type="KEYFRAME")
        yield channelbag_in(strip, action.slots.new("WORLD", "Scratch")).fcurves.new("scratch")
    finally:
        bpy.data.actions.remove(action)


def _with_blender_handles(keys: Keys, scratch: bpy.types.FCurve) -> Keys:
    """Return keys with their automatic handles as Blender sets them."""
    sides: list[list[np.ndarray]] = [[], []]
    for channel in range(len(keys.points)):
        write_keys(scratch, keys, channel)
        for handles, side in zip(sides, ("left", "right"), strict=True):
            handles.append(key_points(scratch, f"handle_{side}"))
    left, right = map(np.stack, sides)
    return replace(keys, left=left, right=right)


def write_keys(fcurve: bpy.types.FCurve, keys: Keys, channel: int) -> None:
    """Write the keys of a channel to an F-curve, with the types of their handles if they have handles."""
    points = keys.points[channel]
    if keys.automatic is not None and keys.right is not None:
        longest = (keys.right[channel, :-1, 0] - points[:-1, 0]) / np.diff(points[:, 0])
        fcurve.auto_smoothing = "NONE" if np.any(longest > (THIRD_RATIO + UNSMOOTHED_RATIO) / 2.0) else "CONT_ACCEL"
    set_key_fields(fcurve, fields_of(keys, channel))


def fields_of(keys: Keys, channel: int) -> KeyFields:
    """Return all fields of the keys of a channel, with the types of their handles if they have handles."""
    fields = new_key_fields(keys.times, keys.values[channel], keys.interpolation[channel], selected=True)
    return fields | _handles_of(keys, channel)


def _handles_of(keys: Keys, channel: int) -> KeyFields:
    """Return the handles of n keys of a channel and their types, each of shape (n, width); {} without handles."""
    if keys.left is None or keys.right is None:
        return {}
    points, left, right = keys.points[channel], keys.left[channel], keys.right[channel]
    (before, rise), (behind, rest) = (points - left).T.astype(float), (right - points).T.astype(float)
    size = np.maximum(np.abs(rise), np.abs(rest)) + SLOPE_ROUNDING_RATIO * np.abs(points[:, 1])
    straight = np.abs(rise * behind - rest * before) <= MAX_COLLINEAR_SLOPE_RATIO * size * (before + behind)
    aligned, free, automatic = (code_of("handle_left_type", name) for name in ("ALIGNED", "FREE", "AUTO_CLAMPED"))
    types = np.where(straight, aligned, free).astype(np.int32)
    if keys.automatic is not None:
        types[keys.automatic[channel].all(axis=1)] = automatic
    types = types[:, None]
    return {"handle_left": left, "handle_right": right, "handle_left_type": types, "handle_right_type": types}


def _scaled(samples: Samples, scale: float) -> Samples:
    """Return samples with their allowed errors times a scale."""
    return samples._replace(allowed=samples.allowed * scale)
