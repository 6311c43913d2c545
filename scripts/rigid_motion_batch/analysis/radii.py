"""Radii: how large the balls are in which no point is off by more than the shell error; in metres."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np

from rigid_motion_batch.recordings.clips import Clip

from .choices import METRES

RIGID, JOINT = 0.1, 0.03
"""Of what a hand holds, and of what is around a joint of a body."""


@dataclass(frozen=True)
class Radii:
    """Plain data, as parameters of tasks."""

    rigid: float = RIGID
    """Of a single rigid body."""

    joint: float = JOINT
    """Of every joint of a whole body."""

    def of(self, clip: Clip) -> np.ndarray:
        """Return the radii of the joints of a clip, shape (joints,); a rigid body has one."""
        return np.full(clip.joints, self.joint if clip.rest_body else self.rigid)


EVERYWHERE = Radii()


def read_radii(text: str) -> Radii:
    """Return a radius for everything. Raises ValueError where it is none."""
    radius = radius_in_metres(text)
    return Radii(radius, radius)


def radius_in_metres(text: str) -> float:
    """Return a radius as it is written: 3cm, 30mm, 0.03m, or 0.03. Raises ValueError where it is none above 0."""
    parts = re.fullmatch(rf"(.*?)\s*({'|'.join(METRES)})?\s*", text, re.DOTALL)
    assert parts is not None  # which any text fits
    number, unit = parts.groups()
    try:
        radius = float(number) * METRES[unit or "m"]
    except ValueError:
        radius = math.nan
    if not 0.0 < radius < math.inf:
        raise ValueError(f"{text!r} is not a length above 0, such as 3cm or 0.03")
    return radius
