"""Keys of whole bodies beside figures that others have published."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rigid_motion.motion import Poses, reduce_skeleton_keys

from .against_greedy import COMPARED
from .bodies import RADIUS, Body, Keys
from .goals import verdict

OZZ_BODY = "pab_walk"
"""The file that both were measured on."""

OZZ_KEYS, OZZ_BEFORE, OZZ_LARGEST, OZZ_RADIUS = 901, 8241, 0.00225, 0.1
"""What its optimizer leaves there, and of how many; the largest error and the distance that it is of, in metres."""

OZZ_GOAL = 0.5
"""The most track keys, in multiples of those."""

NOISE = 0.01
"""Of the tolerance: what changes by less is kept constant first."""

SALIENT_POSES = {0.80: (2.8, 0.64), 0.90: (12.6, 3.0), 0.95: (59.0, 19.0)}
"""By the part of the poses that is removed: the largest and the mean error in millimetres, medians of 20 clips."""


def track_keys(body: Body, keys: Keys) -> tuple[int, int]:
    """Of translations and rotations as tracks of their own: of those that vary; and with one for each that does not.

    A track that stays at its identity needs no key. No scale varies here, and all stay at theirs.
    """
    varying, constant = 0, 0
    origin = np.abs(body.poses.positions[:, 0]).max(axis=1) < 1e-6
    upright = np.abs(body.poses.quaternions[:, 0, 1:]).max(axis=1) < 1e-6
    for channels, at_identity in ((body.moving, origin), (body.turning, upright)):
        for own, count, identity in zip(keys, channels.tolist(), at_identity.tolist(), strict=True):
            if count:
                varying += len(own)
            else:
                constant += not identity
    return varying, varying + constant


def without_noise(body: Body, least: float) -> Body:
    """The same with locations that do not change, of joints where they change by less than so much."""
    still = np.ptp(body.poses.positions, axis=1).max(axis=1) < least
    positions = np.where(still[:, None, None], body.poses.positions[:, :1], body.poses.positions)
    return replace(body, poses=Poses(positions, body.poses.quaternions), moving=np.where(still, 0, body.moving))


def ozz(body: Body) -> Iterator[str]:
    """A row for each mode, each joint with keys of its own; the body is of its own size, in metres."""
    yield "| | largest error, mm | track keys | of ozz-animation's | goal | of tracks that vary |"
    yield "|---|---:|---:|---:|---|---:|"
    yield f"| ozz-animation, as published | {1e3 * OZZ_LARGEST:.2f} | {OZZ_KEYS} | 1.00 | | |"
    cleaned = without_noise(body, NOISE * OZZ_LARGEST)
    for mode in COMPARED:
        keys = reduce_skeleton_keys(
            cleaned.times, cleaned.poses, cleaned.parents, mode, tolerance=OZZ_LARGEST, radius=OZZ_RADIUS
        )
        largest = body.errors(cleaned.shown(keys, mode), OZZ_RADIUS).max()
        varying, everything = track_keys(cleaned, keys)
        yield (
            f"| `{mode}` | {1e3 * largest:.2f} | {everything} | {everything / OZZ_KEYS:.2f} "
            f"| {verdict(everything <= OZZ_GOAL * OZZ_KEYS)} | {varying} |"
        )


def salient_poses(bodies: list[Body], mode: str) -> Iterator[str]:
    """A row for each body and part of its poses that is removed, and the medians beside the published ones."""
    yield "| removed | body | key poses | largest, mm | mean, mm |"
    yield "|---:|---|---:|---:|---:|"
    for part, (their_largest, their_mean) in SALIENT_POSES.items():
        rows = []
        for body in bodies:
            budget = round((1.0 - part) * body.frames)
            if budget < 2:
                continue
            keys = reduce_skeleton_keys(
                body.times, body.poses, body.parents, mode, budget=budget, radius=RADIUS, shared=True
            )[0]
            offsets = body.shown_by_key_poses(keys, mode).positions - body.truth.positions
            away = 1e3 * np.linalg.norm(offsets, axis=-1)
            rows.append((away.max(), away.mean()))
            yield f"| {part:.0%} | {body.name} | {len(keys)} | {away.max():.1f} | {away.mean():.2f} |"
        if rows:
            largest, mean = np.median(rows, axis=0)
            yield f"| {part:.0%} | *median of {len(rows)}* | | {largest:.1f} | {mean:.2f} |"
        yield f"| {part:.0%} | *Salient Poses, median of 20 clips* | | {their_largest:.1f} | {their_mean:.2f} |"
