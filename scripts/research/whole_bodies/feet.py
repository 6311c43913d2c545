"""Feet that stand: how far they slide, in the recording and by few keys."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rigid_motion.motion import reduce_skeleton_keys

from .bodies import RADIUS, Body

FEET = ("foot", "toe")
"""In the names of joints."""

STILL = 0.05
"""Metres a second: a foot that is slower stands."""

LOW = 0.05
"""Metres above the lowest that a foot joint gets: a foot that is higher does not stand."""

SHORTEST = 0.1
"""Seconds that a foot stands at least."""

WEIGHT = 4.0
"""What feet count for, where they have a weight."""


class Contact(NamedTuple):
    """A joint of a foot that stands, from one sample to another."""

    joint: int
    start: int
    end: int


@dataclass(frozen=True)
class Slide:
    """How far feet get, across the ground, from where they began to stand; in metres."""

    largest: float
    total: float
    """The sum of all contacts."""


def foot_joints(body: Body) -> np.ndarray:
    return np.array([any(word in name.lower() for word in FEET) for name in body.joints])


def contacts(body: Body) -> list[Contact]:
    """All of a recording."""
    found = []
    for joint in np.flatnonzero(foot_joints(body)).tolist():
        places = body.truth.positions[joint]
        speed = np.linalg.norm(np.gradient(places, 1.0 / body.rate, axis=0), axis=1)
        stands = (speed < STILL) & (places[:, 2] < places[:, 2].min() + LOW)
        bounds = np.flatnonzero(np.diff(np.concatenate(([False], stands, [False])).astype(np.int8)))
        for start, end in bounds.reshape(-1, 2).tolist():
            if (end - start) / body.rate >= SHORTEST:
                found.append(Contact(joint, start, end))
    return found


def slide(positions: np.ndarray, standing: list[Contact]) -> Slide:
    """Of joints that are at these positions (joints, n, 3)."""
    ways = []
    for joint, start, end in standing:
        across = positions[joint, start:end, :2]
        ways.append(float(np.linalg.norm(across - across[0], axis=1).max()))
    return Slide(max(ways), sum(ways))


def report(bodies: list[Body], mode: str, tolerance: float) -> Iterator[str]:
    """A row for each body that stands, and each way to reduce its keys."""
    yield "| body | keys | how many | largest slide, mm | total, mm | total added, mm |"
    yield "|---|---|---:|---:|---:|---:|"
    for body in bodies:
        standing = contacts(body)
        if not standing:
            yield f"| {body.name}, no contacts | | | | | |"
            continue
        before = slide(body.truth.positions, standing)
        yield (
            f"| {body.name}, {len(standing)} contacts | recording | {body.frames} frames | {1e3 * before.largest:.1f} "
            f"| {1e3 * before.total:.1f} | |"
        )
        weights = np.where(foot_joints(body), WEIGHT, 1.0)
        for shared in (False, True):
            for how, weight in (("", None), (f", feet weigh {WEIGHT:g}", weights)):
                keys = reduce_skeleton_keys(
                    body.times,
                    body.poses,
                    body.parents,
                    mode,
                    tolerance=tolerance,
                    radius=RADIUS,
                    shared=shared,
                    weights=weight,
                )
                after = slide(body.shown(keys, mode).positions, standing)
                count = f"{len(keys[0])} poses" if shared else f"{sum(map(len, keys))} keys"
                yield (
                    f"| | {'key poses' if shared else 'each joint its own'}{how} | {count} | {1e3 * after.largest:.1f} "
                    f"| {1e3 * after.total:.1f} | {1e3 * (after.total - before.total):+.1f} |"
                )
