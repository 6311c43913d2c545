"""Oracle for held props, in NumPy alone: their world matrices from Blender's displayed holders and raw keys.

It uses no code of the program. Matrices are (m, 4, 4), in double precision; frames are the scene's, not seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from tests.animation.keyed import Carrier
from tests.animation.oracle import shown_worlds

POINTS = np.array([(x, y, z, 1.0) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * (*3 * (0.1 / 3**0.5,), 1.0)
"""Points on a held prop, 10 cm from its origin."""


class Held(NamedTuple):
    """A hold from one key: from its frame on, the prop is in this holder's space. None is its parent or the world."""

    frame: float
    holder: Carrier | None
    frames: int = 0
    """The number of frames before the key over which the prop passes."""


def rigid(matrices: np.ndarray) -> np.ndarray:
    """Return matrices without their scales."""
    result = np.array(matrices, float)
    result[:, :3, :3] /= np.linalg.norm(result[:, :3, :3], axis=1, keepdims=True)
    return result


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Return the largest distance of any point within 10 cm of a prop between two sets of matrices."""
    return float(np.linalg.norm(((rigid(one) - rigid(other)) @ POINTS.T)[:, :3], axis=1).max(initial=0.0))


def quaternions(matrices: np.ndarray) -> np.ndarray:
    """Return unit quaternions (m, 4), w first, of rotations: by an eigenvector, which needs no special cases."""
    r = np.moveaxis(rigid(matrices)[:, :3, :3], 0, -1)
    k = np.empty((len(matrices), 4, 4))
    k[:, 0, 0] = np.trace(r)
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        k[:, 0, i + 1] = k[:, i + 1, 0] = r[b, a] - r[a, b]
        for j in range(3):
            k[:, i + 1, j + 1] = r[i, j] + r[j, i] - (i == j) * np.trace(r)
    return np.linalg.eigh(k)[1][:, :, -1]


def lerp_slerp(one: np.ndarray, other: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Interpolate locations linearly, and rotations the shortest way at constant speed, at these fractions (m,)."""
    p, q = quaternions(one), quaternions(other)
    q = np.where(np.einsum("mi,mi->m", p, q)[:, None] < 0.0, -q, q)
    half = 2.0 * np.arctan2(np.linalg.norm(p - q, axis=1), np.linalg.norm(p + q, axis=1))
    sine = np.where(half > 1e-9, np.sin(half), 1.0)
    weights = (np.where(half > 1e-9, np.sin(s * half) / sine, s) for s in (1.0 - share, share))
    w, x, y, z = sum(weight[:, None] * turn for weight, turn in zip(weights, (p, q), strict=True)).T
    result = np.zeros((len(share), 4, 4))
    result[:, 3, 3] = 1.0
    result[:, :3, 3] = one[:, :3, 3] + share[:, None] * (other[:, :3, 3] - one[:, :3, 3])
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    result[:, :3, :3] = np.moveaxis(np.array(rows), -1, 0)
    return result


Motion = Callable[[np.ndarray], np.ndarray]
"""Poses in the space of a holder, or of the channels, on frames."""


def carried(
    twin: Carrier, holds: Sequence[Held], motions: Sequence[Motion], frames: np.ndarray, *, soon: float = 1.0 / 64.0
) -> np.ndarray:
    """Return world matrices of a prop on frames (m,), from the holds of its keys and its motion in each holder.

    `twin` is an object with the same parent that rests at the origin of the space of the channels. In every holder,
    channels keep the units that they have at the first key in this holder.
    """
    holders = [twin if hold.holder is None else hold.holder for hold in holds]
    spaces = list(shown_worlds(holders, frames))
    for hold, space in zip(holds, spaces, strict=True):
        if hold.holder is not None:
            first = next(one.frame for one in holds if one.holder == hold.holder)
            at_first, own = (np.linalg.norm(m[0, :3, :3], axis=0) for m in shown_worlds([hold.holder, twin], [first]))
            space[:, :3, :3] *= own / at_first
    number = np.searchsorted([hold.frame for hold in holds], frames, side="right") - 1
    number = np.clip(number, 0, None)
    result = np.empty((len(frames), 4, 4))
    for place, (space, motion) in enumerate(zip(spaces, motions, strict=True)):
        on = number == place
        result[on] = space[on] @ motion(frames[on])
    for place, (hold, before) in enumerate(zip(holds[1:], holds, strict=False)):
        begin = max(hold.frame - hold.frames, before.frame)
        on = (begin <= frames) & (frames < hold.frame)
        if on.any() and begin < hold.frame:
            # It arrives shortly before its key.
            u = np.minimum((frames[on] - begin) / (hold.frame - soon - begin), 1.0)
            both = [spaces[i][on] @ motions[i](frames[on]) for i in (place, place + 1)]
            result[on] = lerp_slerp(*both, u * u * (3.0 - 2.0 * u))
    return result
