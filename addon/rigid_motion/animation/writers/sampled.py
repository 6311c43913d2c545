"""Sampled F-curves: values on whole frames and no keys, out of the animator's way; and how samples lie in them.

Blender reads a sampled curve between two whole frames below zero one frame late. The samples of a range that begins
there go round in a ring behind frame 0 instead.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import bpy
import numpy as np

from ..actions.channels import ensure_group
from ..actions.records import recorded_rows
from ..actions.slots import Binding, Curves
from ..compute.sources import Source
from ..curves.keys import Cycles, Stepped
from ..transforms import Channel

ENDLESS = 2.0**20
"""A step, in frames, that ends behind whatever Blender can show."""

FARTHEST = 1_000_000
"""Frames from 0 up to which Blender can show any."""


class Piece(NamedTuple):
    """A straight line that is added to an F-curve in a range of its frames."""

    first: float
    last: float
    start: float
    slope: float

    @property
    def modifier(self) -> Modifier:
        settings = {
            "use_additive": True,
            "poly_order": 1,
            "coefficients": _single(self.start, self.slope),
            "use_restricted_range": True,
        }
        first, last = _single(self.first, self.last)
        return "GENERATOR", settings | {"frame_end": last, "frame_start": first}


Pieces = Mapping[Channel, Sequence[Piece]]
"""The pieces that are added to the samples of each channel."""

Modifier = tuple[str, dict[str, object]]
"""The type of an F-curve modifier, and its settings."""


def _single(*values: float) -> tuple[float, ...]:
    """Return numbers as Blender keeps them."""
    return tuple(np.float32(values).tolist())


@dataclass(frozen=True)
class Layout:
    """How the samples of a range lie in an F-curve.

    A range of n frames that begins below zero lies in a ring: frame f on f modulo n, and what is asked for below zero
    is looked up a number of rounds later, by a Cycles modifier. Two Stepped modifiers hold the outermost frames.
    """

    first: int
    last: int
    """The first and the last sample, counted from frame 0."""

    ends: tuple[float, float]
    """The frames of the outermost samples: not outside of the keys."""

    cycles: Cycles | None = None
    """The cycles by which the channels repeat, and the differences with them."""

    is_ring: bool = False

    shift: int = 0
    """The frames by which samples lie later than they are seen, where a time of their own looks them up."""

    is_apart: bool = False
    """True if they are: it is that which repeats and holds, then."""

    steps: tuple[Stepped, ...] = ()
    """The frames that the channels hold, and the differences with them."""

    rate: int = 1
    """The number of samples in a frame, where they are apart: then the F-curve is as many times as long."""

    @classmethod
    def of(cls, source: Source, rate: int = 1, *, is_apart: bool = False) -> Layout:
        """Return the layout in an F-curve that is read as the frames pass, or that a time of its own looks up."""
        first, last = source.sample_range(rate)
        cycles = source.cyclic.cycles if source.repeats else None
        is_ring, shift = first < 0 and cycles is None, max(0, -source.frame_range[0])
        ends = _ends(source, first / rate, last / rate)
        return cls(
            first, last, ends, cycles, is_ring and not is_apart, shift if is_apart else 0, is_apart, source.steps, rate
        )

    @property
    def frames(self) -> tuple[int, int]:
        """The whole frames that no sample is outside of."""
        return self.first // self.rate, -(-self.last // self.rate)

    @cached_property
    def count(self) -> int:
        """The number of samples in the F-curve."""
        return self.last - self.first + (2 if self.is_ring else 1)

    @cached_property
    def outermost(self) -> tuple[float, float]:
        """The frames of the F-curve that the first and the last sample lie on."""
        if self.is_ring:
            return 0.0, float(self.count - 1)
        return tuple(float(np.float32((end + self.shift) * self.rate)) for end in self.ends)

    @cached_property
    def _order(self) -> np.ndarray:
        """Return which sample of the range lies on each place of the ring."""
        period = self.count - 1
        return (np.arange(self.count) - self.first) % period

    def points(self, samples: np.ndarray) -> np.ndarray:
        """Return frame and value of every sample in the F-curve, alternately."""
        points = samples.reshape(-1, 2)
        if self.is_ring:
            points = points[self._order]
            points[:, 0] = np.arange(self.count)
        else:
            if self.shift:
                points[:, 0] += self.shift
            if self.rate > 1:
                points[:, 0] *= self.rate
            points[0, 0], points[-1, 0] = self.outermost
        return points.ravel()

    def fits(self, fcurve: bpy.types.FCurve) -> bool:
        """Return whether an F-curve has its samples so, and repeats them so."""
        return (
            len(fcurve.sampled_points) == self.count
            and tuple(fcurve.range()) == self.outermost
            and self._has_modifiers(fcurve)
        )

    def _has_modifiers(self, fcurve: bpy.types.FCurve) -> bool:
        """Return whether it has those that all have; whatever is added to it may have to be something else by now."""
        modifiers = fcurve.modifiers[:]
        if not (modifiers or self._modifiers):
            return True
        count = len(self._modifiers)
        return _are(modifiers[:count], self._modifiers) and all(
            modifier.type == "GENERATOR" and modifier.use_restricted_range and not modifier.mute
            for modifier in modifiers[count:]
        )

    def modify(self, fcurve: bpy.types.FCurve, pieces: Sequence[Piece] = ()) -> None:
        """Give an F-curve the modifiers that it needs, in place of those it has, and add these to it."""
        present = fcurve.modifiers[:]
        desired = self._modifiers + [piece.modifier for piece in pieces]
        if not (present or desired) or _are(present, desired):
            return
        for modifier in present:
            fcurve.modifiers.remove(modifier)
        add_modifiers(fcurve, desired)

    @cached_property
    def _modifiers(self) -> list[Modifier]:
        """Types and settings. Blender asks the last one first."""
        return [] if self.is_apart else [*self._repeating, *self.stepping]

    @property
    def stepping(self) -> list[Modifier]:
        """Types and settings of those that hold frames."""
        result = []
        for step in self.steps:
            settings: dict[str, object] = {"frame_step": step.step, "frame_offset": step.offset}
            for name, end in (("start", step.start), ("end", step.end)):
                settings[f"use_frame_{name}"] = math.isfinite(end)
                if math.isfinite(end):
                    settings[f"frame_{name}"] = end
            result.append(("STEPPED", settings))
        return result

    @property
    def _repeating(self) -> list[Modifier]:
        if self.cycles is not None:
            cycles = self.cycles.without_offset
            settings = {"mode_before": cycles.before, "mode_after": cycles.after}
            counts = {"cycles_before": cycles.before_count, "cycles_after": cycles.after_count}
            return [("CYCLES", settings | counts)]
        if not self.is_ring:
            return []
        first, last = float(self.first), float(self.last)
        return [
            ("CYCLES", {"mode_before": "REPEAT", "mode_after": "NONE", "cycles_before": 0}),
            ("STEPPED", {"frame_step": ENDLESS, "frame_offset": first, "use_frame_end": True, "frame_end": first}),
            ("STEPPED", {"frame_step": ENDLESS, "frame_offset": last, "use_frame_start": True, "frame_start": last}),
        ]


def add_modifiers(fcurve: bpy.types.FCurve, modifiers: Sequence[Modifier]) -> None:
    """Give an F-curve modifiers of these types and settings, behind those that it has."""
    for kind, settings in modifiers:
        modifier = fcurve.modifiers.new(kind)
        for name, value in settings.items():
            setattr(modifier, name, value)


def _are(modifiers: Sequence[bpy.types.FModifier], desired: Sequence[Modifier]) -> bool:
    """Return whether modifiers are of these types, with these settings."""
    return [modifier.type for modifier in modifiers] == [kind for kind, _ in desired] and all(
        (tuple(result) if isinstance(value, tuple) else result) == value
        for modifier, (_, settings) in zip(modifiers, desired, strict=True)
        for name, value in settings.items()
        for result in (getattr(modifier, name),)
    )


def _ends(source: Source, first: float, last: float) -> tuple[float, float]:
    """Return the frames on which the outermost samples of a source lie, which are for these."""
    if source.goes_on and not source.repeats:
        return first, last
    begin, end = source.keyed_range
    return max(first, begin), min(last, end)


def replace_samples(
    binding: Binding, points: Mapping[Channel, np.ndarray], layout: Layout | None, pieces: Pieces
) -> list[Channel]:
    """Have the in-betweens of a binding be these samples, frame and value of each alternately, and no others.

    Parameters
    ----------
    binding
    points
        The samples of each channel.
    layout
        How they lie, None where there are none.
    pieces
        What is added to them between samples.

    Returns
    -------
    list
        The channels of the F-curves that were taken out.
    """
    curves: Curves = {}
    channelbag, present = binding.home, binding.filled
    # Blender goes through all groups for a name.
    home = ensure_group(channelbag, binding.group) if points.keys() - present.keys() else None
    for channel, samples in points.items():
        fcurve = present.get(channel)
        if fcurve is None:
            fcurve = _new(channelbag, home, channel, layout.count)
        elif len(fcurve.sampled_points) != layout.count:
            _resize(fcurve, layout.count)
        fcurve.sampled_points.foreach_set("co", samples)
        layout.modify(fcurve, pieces.get(channel, ()))
        curves[channel] = fcurve
    gone = [channel for channel in present if channel not in points]
    for channel in gone:
        channelbag.fcurves.remove(present[channel])
    if gone:
        remove_if_empty(channelbag, binding.group)
    binding.has_filled(curves)
    return gone


def hold_constants(binding: Binding, held: Mapping[Channel, float]) -> bool:
    """Have the in-betweens of a binding hold these values, and nothing else. Whether they did not already."""
    present = binding.filled
    values = {channel: next((point.co[1] for point in item.sampled_points), None) for channel, item in present.items()}
    if held == values:
        return False
    # Where its own keys begin, for the Action to be no longer than it was. A damaged file may have them anywhere.
    starts = [start for fcurve in binding.curves.values() if abs(start := fcurve.range()[0]) < FARTHEST]
    first = math.floor(min(starts, default=0.0))
    points = {channel: np.array((first, value, first + 1, value), dtype=np.float32) for channel, value in held.items()}
    for channel in present:
        binding.curves.pop(channel, None)
    replace_samples(binding, points, Layout(first, first + 1, (first, first + 1)), {})
    binding.curves.update(binding.filled)
    return True


def hide_fcurve(fcurve: bpy.types.FCurve, group: bpy.types.ActionGroup) -> None:
    """Take an F-curve out of the animator's way: into a group, locked, and hidden in the Graph Editor."""
    fcurve.group = group
    fcurve.lock = fcurve.hide = True
    fcurve.select = False


def regroup(binding: Binding) -> None:
    """Take F-curves with in-betweens back that have been put into another group, or into none."""
    rows = recorded_rows(binding)
    if len(binding.filled) >= len(rows):
        return
    channelbag = binding.home
    if channelbag is None:
        return
    rotations = ("rotation_quaternion", "rotation_euler")
    channels = [binding.users[0].differences_for(rotation) for rotation in rotations]
    for channel in {of_rotation[row] for of_rotation in channels for row in rows if row in of_rotation}:
        fcurve = channelbag.fcurves.find(channel[0], index=channel[1])
        if fcurve is not None and channel not in binding.filled and not fcurve.keyframe_points:
            hide_fcurve(fcurve, ensure_group(channelbag, binding.group))
            binding.has_filled({**binding.filled, channel: fcurve})


def remove_if_empty(channelbag: bpy.types.ActionChannelbag, group: str) -> None:
    """Take out a group that nothing is left in."""
    result = channelbag.groups.get(group)
    if result is not None and not result.channels:
        channelbag.groups.remove(result)


def _new(
    channelbag: bpy.types.ActionChannelbag, group: bpy.types.ActionGroup, channel: Channel, count: int
) -> bpy.types.FCurve:
    path, index = channel
    fcurve = channelbag.fcurves.new(path, index=index)
    hide_fcurve(fcurve, group)
    fcurve.keyframe_points.add(1)
    fcurve.convert_to_samples(0, count)
    return fcurve


def _resize(fcurve: bpy.types.FCurve, count: int) -> None:
    """Give a sampled F-curve room for so many samples."""
    if len(fcurve.sampled_points):
        fcurve.convert_to_keyframes(0, 1)
    else:
        fcurve.keyframe_points.add(1)
    fcurve.convert_to_samples(0, count)
