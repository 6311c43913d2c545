"""How the samples of in-betweens lie in an F-curve.

Blender reads a sampled curve between two whole frames below zero one frame late. The samples of a range that begins
there go round in a ring behind frame 0 instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import bpy
import numpy as np

from ..compute.sources import Source
from ..curves import Cycles, Stepped

ENDLESS = 2.0**20
"""A step, in frames, that ends behind whatever Blender can show."""


@dataclass(frozen=True)
class Layout:
    """How the samples on the whole frames of a range lie in an F-curve.

    A range of n frames that begins below zero lies in a ring: frame f on f modulo n, and what is asked for below zero
    is looked up a number of rounds later, by a Cycles modifier. Two Stepped modifiers hold the outermost frames.
    """

    first: int
    last: int

    ends: tuple[float, float]
    """Where the outermost samples lie: not outside of the keys."""

    cycles: Cycles | None = None
    """How the channels repeat, and the differences with them."""

    is_ring: bool = False

    shift: int = 0
    """How many frames later than they are seen the samples lie, where they are looked up by a time of their own."""

    is_apart: bool = False
    """Whether they are: it is that which repeats and holds, then."""

    steps: tuple[Stepped, ...] = ()
    """The frames that the channels hold, and the differences with them."""

    @classmethod
    def of(cls, source: Source) -> Layout:
        """In an F-curve that is read as the frames pass."""
        first, last = source.frame_range
        cycles = source.cyclic.cycles if source.repeats else None
        return cls(first, last, _ends(source), cycles, first < 0 and cycles is None, steps=source.steps)

    @classmethod
    def apart(cls, source: Source) -> Layout:
        """In an F-curve that is looked up by a time of its own, which goes round where the channels do."""
        first, last = source.frame_range
        cycles = source.cyclic.cycles if source.repeats else None
        return cls(first, last, _ends(source), cycles, shift=max(0, -first), is_apart=True, steps=source.steps)

    @cached_property
    def count(self) -> int:
        """How many samples there are in the F-curve."""
        return self.last - self.first + (2 if self.is_ring else 1)

    @cached_property
    def outermost(self) -> tuple[float, float]:
        """The frames that the first and the last sample lie on."""
        return (0.0, float(self.count - 1)) if self.is_ring else tuple(end + self.shift for end in self.ends)

    @cached_property
    def _order(self) -> np.ndarray:
        """Which sample of the range lies on each place of the ring."""
        period = self.count - 1
        return (np.arange(self.count) - self.first) % period

    def points(self, samples: np.ndarray) -> np.ndarray:
        """What goes into the F-curve, from frame and value of every sample by turns."""
        points = samples.reshape(-1, 2)
        if self.is_ring:
            points = points[self._order]
            points[:, 0] = np.arange(self.count)
        else:
            if self.shift:
                points[:, 0] += self.shift
            points[0, 0], points[-1, 0] = self.outermost
        return points.ravel()

    def fits(self, fcurve: bpy.types.FCurve) -> bool:
        """Whether an F-curve has its samples so, and repeats them so."""
        return (
            len(fcurve.sampled_points) == self.count
            and tuple(fcurve.range()) == self.outermost
            and self._has_modifiers(fcurve)
        )

    def _has_modifiers(self, fcurve: bpy.types.FCurve) -> bool:
        if not self._modifiers:
            return not fcurve.modifiers
        modifiers = list(fcurve.modifiers)
        return [modifier.type for modifier in modifiers] == [kind for kind, _ in self._modifiers] and all(
            getattr(modifier, name) == value
            for modifier, (_, settings) in zip(modifiers, self._modifiers, strict=True)
            for name, value in settings.items()
        )

    def modify(self, fcurve: bpy.types.FCurve) -> None:
        """Give an F-curve the modifiers that it needs, in place of those it has."""
        if self._has_modifiers(fcurve):
            return
        for modifier in list(fcurve.modifiers):
            fcurve.modifiers.remove(modifier)
        add_modifiers(fcurve, self._modifiers)

    @cached_property
    def _modifiers(self) -> list[tuple[str, dict[str, object]]]:
        """Types and settings. Blender asks the last one first."""
        return [] if self.is_apart else [*self._repeating, *self.stepping]

    @property
    def stepping(self) -> list[tuple[str, dict[str, object]]]:
        """Types and settings of those that hold frames."""
        found = []
        for one in self.steps:
            settings: dict[str, object] = {"frame_step": one.step, "frame_offset": one.offset}
            for name, end in (("start", one.start), ("end", one.end)):
                settings[f"use_frame_{name}"] = math.isfinite(end)
                if math.isfinite(end):
                    settings[f"frame_{name}"] = end
            found.append(("STEPPED", settings))
        return found

    @property
    def _repeating(self) -> list[tuple[str, dict[str, object]]]:
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


def add_modifiers(fcurve: bpy.types.FCurve, modifiers: list[tuple[str, dict[str, object]]]) -> None:
    """Give an F-curve modifiers of these types and settings, behind those that it has."""
    for kind, settings in modifiers:
        modifier = fcurve.modifiers.new(kind)
        for name, value in settings.items():
            setattr(modifier, name, value)


def _ends(source: Source) -> tuple[float, float]:
    """Where the outermost samples of a source lie."""
    first, last = source.frame_range
    if source.goes_on and not source.repeats:
        return float(first), float(last)
    begin, end = source.keyed_range
    return max(first, begin), min(last, end)
