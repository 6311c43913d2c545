"""Deviations: by how much what is shown is off from the recording, and the same drawn larger where it is small."""

from __future__ import annotations

import numpy as np

from addon.motion import Poses
from addon.motion.quaternions import conjugate, multiply, rotate

from . import layout

SHARE = 0.4
"""Of the object's size: how large the largest deviation is shown at most, where it is magnified."""

STEPS = (1.0, 2.0, 5.0)
"""Magnifications are these, times a power of ten."""


def largest_deviation(shown: Poses, recording: Poses, outline: np.ndarray) -> float:
    """The farthest that any of the points (m, 3) of the object is off between poses (n,), in metres."""
    apart = layout.swept_points(shown, outline) - layout.swept_points(recording, outline)
    return float(np.linalg.norm(apart, axis=-1).max())


def magnification(deviation: float, size: float) -> float:
    """How many times larger deviations up to this are shown on an object of this size; 1 where they are seen anyway.

    A round number.
    """
    most = SHARE * size / deviation if deviation > 1e-6 * size else 1.0
    power = 10.0 ** np.floor(np.log10(max(most, 1.0)))
    return float(max(step * power for step in STEPS if step * power <= max(most, 1.0)))


def magnified(shown: Poses, recording: Poses, factor: float, middle: np.ndarray) -> Poses:
    """Poses (n,) so many times as far off from the recording: the middle, shape (3,), of the object, and the turn.

    A point of the object is displaced by the factor times what it is, but for what large turns bend; no turn is
    magnified beyond half a turn.
    """
    if factor == 1.0:
        return shown
    places, truth = (layout.swept_points(poses, middle[None]) for poses in (shown, recording))
    turns = multiply(shown.quaternions, conjugate(recording.quaternions))
    turns *= np.where(turns[:, :1] < 0.0, -1.0, 1.0)
    sine = np.linalg.norm(turns[:, 1:], axis=-1)
    half = np.arctan2(sine, turns[:, 0])
    wider = np.minimum(factor * half, np.maximum(half, np.pi / 2.0))
    axes = np.divide(turns[:, 1:], sine[:, None], out=np.zeros_like(turns[:, 1:]), where=sine[:, None] > 0.0)
    bent = np.concatenate((np.cos(wider)[:, None], np.sin(wider)[:, None] * axes), axis=-1)
    quaternions = multiply(bent, recording.quaternions)
    places = truth + factor * (places - truth)
    arms = np.tile(middle, (len(places), 1)) * (1.0 if shown.scales is None else shown.scales[:, None])
    return Poses(places - rotate(quaternions, arms), quaternions, shown.scales)
