"""Differences for an NLA strip that has less than full influence, with nothing below it.

Blender blends each property with its default by itself: the channels that are keyed, and the delta transforms beside
them. Both together are then not what the same strip would show with real keys. So delta transforms get those values
that, blended likewise, are what is lacking.
"""

from __future__ import annotations

import numpy as np

from ...motion.eulers import extrinsic_eulers_from_quaternions, quaternions_from_extrinsic_eulers
from ...motion.quaternions import conjugate, multiply, normalise
from .components import REST, ROTATION, ROWS, SCALE
from .sources import Source

LEAST = 1e-3
"""The influence below which nothing is to be seen of a strip, and that is not made up for."""


def influence_at(source: Source, frames: np.ndarray) -> np.ndarray:
    """Return the influence of the strip on frames (m,) of the Action."""
    at, values = np.array(source.influence).T
    return np.interp(frames, at, values)


def blended(source: Source, frames: np.ndarray, native: np.ndarray, delta: np.ndarray) -> None:
    """Turn differences (., m), rotations as quaternions, into those that hold where a strip has its influence.

    For Euler angles they are what `undo_blending` takes afterwards. `native` is what the channels have, shape (., m).
    """
    influence = influence_at(source, frames)
    some = (influence > LEAST) & (influence < 1.0)
    if not some.any():
        return
    # What is blended has a sign that counts.
    delta[ROWS[ROTATION]] *= np.where(delta[ROWS[ROTATION].start] < 0.0, -1.0, 1.0)
    v, turns = influence[some], delta[ROWS[ROTATION]][:, some].T
    if source.order is None:
        channels = native[ROWS[ROTATION]][:, some].T
        desired = multiply(turns, normalise(channels))
        desired = np.where(np.einsum("mi,mi->m", desired, channels)[:, None] < 0.0, -desired, desired)
        lacking = multiply(normalise(_mixed(desired, v)), conjugate(normalise(_mixed(channels, v))))
        lacking = np.where(lacking[:, :1] < 0.0, -lacking, lacking)
        size = np.linalg.norm(_mixed(turns, v), axis=1)[:, None]
        delta[ROWS[ROTATION], some] = ((size * lacking - _mixed(0.0 * turns, v)) / v[:, None]).T
    else:
        angles = native[3:6][:, some].T
        desired = multiply(turns, quaternions_from_extrinsic_eulers(angles, source.order))
        desired = _near(angles, extrinsic_eulers_from_quaternions(desired, source.order), source.order)
        now = quaternions_from_extrinsic_eulers(v[:, None] * angles, source.order)
        desired = quaternions_from_extrinsic_eulers(v[:, None] * desired, source.order)
        delta[ROWS[ROTATION], some] = multiply(desired, conjugate(now)).T
    if len(delta) > ROWS[SCALE].start:
        channels = native[ROWS[SCALE]][:, some]
        now, desired = 1.0 - v + v * channels, 1.0 - v + v * channels * delta[ROWS[SCALE]][:, some]
        delta[ROWS[SCALE], some] = (desired / np.where(now == 0.0, 1.0, now) - 1.0 + v) / v


def undo_blending(source: Source, frames: np.ndarray, angles: np.ndarray) -> None:
    """Make delta angles (3, m) larger by as much as the influence of the strip makes them smaller."""
    influence = influence_at(source, frames)
    angles /= np.where((influence > LEAST) & (influence < 1.0), influence, 1.0)


def _mixed(quaternions: np.ndarray, influence: np.ndarray) -> np.ndarray:
    """Return what Blender makes of quaternions (m, 4) over no rotation."""
    return (1.0 - influence[:, None]) * REST[ROWS[ROTATION]] + influence[:, None] * quaternions


def _near(angles: np.ndarray, others: np.ndarray, order: str) -> np.ndarray:
    """Return the same turns as the other angles (m, 3), as near to these as may be."""
    middle = "XYZ".index(order[1])
    flipped = others + np.pi
    flipped[:, middle] = np.pi - others[:, middle]
    both = np.stack([turned + 2.0 * np.pi * np.rint((angles - turned) / (2.0 * np.pi)) for turned in (others, flipped)])
    best = np.abs(both - angles).sum(axis=2).argmin(axis=0)
    return both[best, np.arange(len(angles))]
