"""Deviations: by how much what is shown is off from the recording, and the same drawn larger where it is small."""

from __future__ import annotations

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import multiply, rotate
from rigid_motion.motion.twists import between, exponential

from . import layout

SHARE = 0.25
"""The most of the object's size that the largest deviation is shown at, where it is magnified."""

STEPS = (1.0, 2.0, 5.0)
"""Magnifications are these, times a power of ten."""


def largest_deviation(shown: Poses, recording: Poses, outline: np.ndarray) -> float:
    """Return the farthest that any of the points (m, 3) of the object is off between poses (n,), in metres."""
    apart = layout.swept_points(shown, outline) - layout.swept_points(recording, outline)
    return float(np.linalg.norm(apart, axis=-1).max())


def magnification(deviation: float, size: float) -> float:
    """Return how many times larger deviations up to this are shown on an object of this size;
    1 where they are seen anyway.

    A round number.
    """
    most = SHARE * size / deviation if deviation > 1e-6 * size else 1.0
    power = 10.0 ** np.floor(np.log10(max(most, 1.0)))
    return float(max(step * power for step in STEPS if step * power <= max(most, 1.0)))


def magnified(shown: Poses, recording: Poses, factor: float, middle: np.ndarray) -> Poses:
    """Return poses (n,) so many times as far off from the recording: the middle, shape (3,), of the object,
    and the turn.

    A point of the object is displaced by the factor times what it is, but for what large turns bend; no turn is
    magnified beyond half a turn.
    """
    if factor == 1.0:
        return shown
    places, truth = (layout.swept_points(poses, middle[None]) for poses in (shown, recording))
    still = np.zeros_like(places)
    turns = between(still, recording.quaternions, still, shown.quaternions)
    angles = np.maximum(np.linalg.norm(turns, axis=0), 1e-12)
    turns *= np.minimum(factor, np.maximum(angles, np.pi) / angles)
    quaternions = multiply(recording.quaternions, exponential(turns)[0].T)
    places = truth + factor * (places - truth)
    arms = np.tile(middle, (len(places), 1)) * (1.0 if shown.scales is None else shown.scales[:, None])
    return Poses(places - rotate(quaternions, arms), quaternions, shown.scales)
