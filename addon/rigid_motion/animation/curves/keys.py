"""F-curves as arrays: their keys, what their codes mean, and their cycles.

Frames and values are Blender's, in its single precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .steps import Stepped

CONSTANT, LINEAR, BEZIER, BACK, BOUNCE, CIRC, CUBIC, ELASTIC, EXPO, QUAD, QUART, QUINT, SINE = range(13)

INTERPOLATIONS = {
    CONSTANT: "CONSTANT",
    LINEAR: "LINEAR",
    BEZIER: "BEZIER",
    BACK: "BACK",
    BOUNCE: "BOUNCE",
    CIRC: "CIRC",
    CUBIC: "CUBIC",
    ELASTIC: "ELASTIC",
    EXPO: "EXPO",
    QUAD: "QUAD",
    QUART: "QUART",
    QUINT: "QUINT",
    SINE: "SINE",
}
"""From the code of `bpy.types.Keyframe.interpolation` to its name."""

AUTO, EASE_IN, EASE_OUT, EASE_IN_OUT = range(4)

EASINGS = {AUTO: "AUTO", EASE_IN: "EASE_IN", EASE_OUT: "EASE_OUT", EASE_IN_OUT: "EASE_IN_OUT"}
"""From the code of `bpy.types.Keyframe.easing` to its name."""

CODE = np.uint8
"""The type that Blender keeps codes in: any other takes longer to read."""

KEY_TOLERANCE = float(np.float32(1e-4))
"""Frames from a key within which Blender takes its value."""

LARGEST = 1e30
"""Frames and values from here on are damage. An infinite one that is typed, or set by a script, becomes 3.4e38."""


@dataclass(frozen=True)
class Cycles:
    """A Cycles modifier. Modes are NONE, REPEAT, REPEAT_OFFSET or MIRROR; a count of 0 is without end."""

    before: str
    after: str
    before_count: int
    after_count: int


@dataclass(frozen=True, eq=False)
class Keys:
    """c F-curves that are keyed together: n keys each, on the same frames, with the same extrapolation and cycles.

    Frames and values are in single precision, codes are `INTERPOLATIONS` and `EASINGS`. What does not bear on the
    values of the curves is None.
    """

    points: np.ndarray
    """Frame and value, shape (c, n, 2)."""

    interpolation: np.ndarray
    """Codes of the segments that the keys begin, shape (c, n)."""

    left: np.ndarray | None = None
    """The handles before the keys, frame and value, shape (c, n, 2)."""

    right: np.ndarray | None = None
    """The handles behind the keys, frame and value, shape (c, n, 2)."""

    easing: np.ndarray | None = None
    """Codes, shape (c, n)."""

    easing_settings: np.ndarray | None = None
    """BACK's overshoot, ELASTIC's amplitude and ELASTIC's period in frames, shape (3, c, n)."""

    linear: bool = False
    """True if the curves go on at their slope outside of the keys, instead of holding their value."""

    cycles: Cycles | None = None

    steps: tuple[Stepped, ...] = ()
    """Stepped modifiers, first to last. The values of curves are worked out without: see `held`."""

    breakdowns: np.ndarray | None = None
    """True for the keys of type *Breakdown*, shape (n,), where any is."""

    is_sound: bool = True
    """True if all numbers that were read are smaller than `LARGEST`, and the keys in the order of their frames."""

    @cached_property
    def times(self) -> np.ndarray:
        """Frames of the keys, shape (n,), double precision."""
        return self.points[0, :, 0].astype(np.float64)

    @property
    def values(self) -> np.ndarray:
        """Values of the keys, shape (c, n)."""
        return self.points[..., 1]

    def only(self, channels: Sequence[int]) -> Keys:
        """Return the keys of these channels alone."""
        return self._part((channels,))

    def at(self, chosen: np.ndarray) -> Keys:
        """Return the chosen ones of the keys, by a mask of shape (n,)."""
        part = self._part((slice(None), chosen))
        return part if self.breakdowns is None else replace(part, breakdowns=self.breakdowns[chosen])

    def _part(self, part: tuple) -> Keys:
        arrays = {name: getattr(self, name) for name in ("points", "interpolation", "left", "right", "easing")}
        parts = {name: array[part] for name, array in arrays.items() if array is not None}
        settings = None if self.easing_settings is None else self.easing_settings[(slice(None), *part)]
        return replace(self, **parts, easing_settings=settings)

    @property
    def raw(self) -> bytes:
        """All of it as bytes, for a digest that tells whether anything has changed."""
        arrays = (self.points, self.interpolation, self.left, self.right, self.easing, self.easing_settings)
        arrays += (self.breakdowns,)
        present = [array for array in arrays if array is not None]
        header = f"{self.points.shape} {len(present)} {self.linear} {self.cycles}{self.steps or ''};"
        return b"".join((header.encode(), *(array.tobytes() for array in present)))
