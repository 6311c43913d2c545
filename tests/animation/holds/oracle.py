"""Oracle for held props: their world matrices from Blender's displayed holders and raw keys.

It uses no code of the program. Matrices are (m, 4, 4); frames are the scene's, not seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from mathutils import Matrix

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


def mixed(one: np.ndarray, other: np.ndarray, share: float) -> np.ndarray:
    """Interpolate locations and scales linearly, and rotations the shortest way at constant speed."""
    (place, turn, size), (there, next_turn, next_size) = Matrix(one).decompose(), Matrix(other).decompose()
    next_turn.make_compatible(turn)
    return np.array(
        Matrix.LocRotScale(place.lerp(there, share), turn.slerp(next_turn, share), size.lerp(next_size, share))
    )


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
            result[on] = [mixed(*each) for each in zip(*both, u * u * (3.0 - 2.0 * u), strict=True)]
    return result
