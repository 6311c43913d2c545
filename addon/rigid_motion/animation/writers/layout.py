"""How the samples of in-betweens lie in an F-curve.

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

from ..compute.sources import Source
from ..curves import Cycles, Stepped
from ..transforms import Channel

ENDLESS = 2.0**20
"""A step, in frames, that ends behind whatever Blender can show."""


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
    """The number of frames that the samples lie later than they are seen,
    where they are looked up by a time of their own."""

    is_apart: bool = False
    """True if they are: it is that which repeats and holds, then."""

    steps: tuple[Stepped, ...] = ()
    """The frames that the channels hold, and the differences with them."""

    rate: int = 1
    """The number of samples in a frame, where they are apart: then the F-curve is as many times as long."""

    @classmethod
    def of(cls, source: Source) -> Layout:
        """Return the layout in an F-curve that is read as the frames pass."""
        first, last = source.frame_range
        cycles = source.cyclic.cycles if source.repeats else None
        return cls(first, last, _ends(source, first, last), cycles, first < 0 and cycles is None, steps=source.steps)

    @classmethod
    def apart(cls, source: Source, rate: int) -> Layout:
        """Return the layout in an F-curve that is looked up by a time of its own,
        which goes round where the channels do.
        """
        first, last = source.sample_range(rate)
        cycles = source.cyclic.cycles if source.repeats else None
        shift, steps = max(0, -source.frame_range[0]), source.steps
        ends = _ends(source, first / rate, last / rate)
        return cls(first, last, ends, cycles, shift=shift, is_apart=True, steps=steps, rate=rate)

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
            # The difference repeats as it is also where the channels go on from where they have come.
            before, after = (mode.removesuffix("_OFFSET") for mode in (self.cycles.before, self.cycles.after))
            settings = {"mode_before": before, "mode_after": after}
            counts = {"cycles_before": self.cycles.before_count, "cycles_after": self.cycles.after_count}
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
