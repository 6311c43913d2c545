"""The segments of smooth modes whose keys are passed at speeds of their own, from their formula."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigid_motion.motion import Poses, interpolate, twists
from rigid_motion.motion.quaternions import multiply, rotate
from tests.animation.spin_oracle import Spin


def with_tangents(
    times: np.ndarray,
    keys: Poses,
    segment: int,
    u: np.ndarray,
    tangents: tuple[float, float],
    spins: Sequence[Spin],
    rests: Sequence[bool],
) -> Poses:
    """The segment between keys whose tangents are so many times as long as those of the mode, without its own spin.

    Keys at which the body rests have none.
    """
    screws = twists.between(keys.positions[:-1], keys.quaternions[:-1], keys.positions[1:], keys.quaternions[1:])
    growths = np.zeros(len(times) - 1) if keys.scales is None else np.diff(np.log(keys.scales))
    durations = np.diff(times)
    leaving, arriving = (
        np.vstack((screws, growths)).T
        + [spin.twist(quaternion) for spin, quaternion in zip(spins, keys.quaternions[at], strict=True)]
        for at in (slice(None, -1), slice(1, None))
    )
    bends = []
    for key, tangent, is_at_rest in zip((segment, segment + 1), tangents, rests, strict=True):
        if 0 < key < len(durations):
            part = share_of(*durations[key - 1 : key + 1])
            rate = part * arriving[key - 1] / durations[key - 1] + (1.0 - part) * leaving[key] / durations[key]
            rate = 0.0 * rate if is_at_rest else rate
        else:
            rate = (leaving if key == segment else arriving)[segment] / durations[segment]
        bends.append(tangent * durations[segment] * rate - (leaving if key == segment else arriving)[segment])
    first = np.where(u < 0.0, u, np.where(u > 1.0, 0.0, u * (1.0 - u) ** 2))
    second = np.where(u < 0.0, 0.0, np.where(u > 1.0, u - 1.0, -(u**2) * (1.0 - u)))
    added = np.outer(bends[0], first) + np.outer(bends[1], second)
    screw = interpolate((0.0, 1.0), keys[segment : segment + 2], u, "cga_slerp", extrapolate=True)
    if keys.scales is not None:
        rigid = Poses(keys.positions, keys.quaternions)[segment : segment + 2]
        screw = Poses(*_parts(interpolate((0.0, 1.0), rigid, u, "dq_sclerp", extrapolate=True)), screw.scales)
    turns, advances = twists.exponential(added[:6])
    return Poses(
        screw.positions + rotate(screw.quaternions, advances.T),
        multiply(screw.quaternions, turns.T),
        None if keys.scales is None else screw.scales * np.exp(added[6]),
    )


def _parts(poses: Poses) -> tuple[np.ndarray, np.ndarray]:
    return poses.positions, poses.quaternions


def share_of(before: float, after: float) -> float:
    """Of the twist before a key in that of the key."""
    if max(before, after) >= 16.0 * min(before, after):
        return float(before > after)
    return min(max(after / (before + after), 1.0 - after / before), before / after)
