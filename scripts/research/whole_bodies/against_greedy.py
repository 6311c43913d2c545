"""Key poses beside those of greedy insertion, and beside the fewest there can be."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rigid_motion.motion import MODES, reduce_skeleton_keys

from .bodies import RADIUS, Body
from .goals import verdict
from .optimum import optimum, optimum_of_four

COMPARED = ("lerp_slerp", "dq_sclerp", "motor_spline")

GOAL = 0.85
"""The most keys, in multiples of those of greedy insertion."""

SHORT = 100
"""Frames. The optimum of a longer body takes too long where what is between two keys depends on two more."""


def greedy(body: Body, mode: str, tolerance: float, radius: float = RADIUS) -> np.ndarray:
    """One key at a time where the error is largest, until it is small enough; then each goes, in turn, that can."""

    def errors(keys: np.ndarray) -> np.ndarray:
        return body.errors(body.shown_by_key_poses(keys, mode), radius).max(axis=0)

    keys = np.array((0, body.frames - 1))
    while (found := errors(keys)).max() > tolerance:
        keys = np.union1d(keys, [np.argmax(found)])
    for key in keys[1:-1]:
        fewer = keys[keys != key]
        if errors(fewer).max() <= tolerance:
            keys = fewer
    return keys


def report(bodies: list[Body], tolerance: float) -> Iterator[str]:
    """A row for each body and mode."""
    yield "| body | mode | greedy | Rigid Motion | ratio | goal | optimum |"
    yield "|---|---|---:|---:|---:|---|---:|"
    for body in bodies:
        for mode in COMPARED:
            theirs = len(greedy(body, mode, tolerance))
            keys = reduce_skeleton_keys(
                body.times, body.poses, body.parents, mode, tolerance=tolerance, radius=RADIUS, shared=True
            )[0]
            if MODES[mode].is_smooth:
                best = str(optimum_of_four(body, mode, tolerance)) if body.frames <= SHORT else ""
            else:
                best = str(optimum(body, mode, tolerance))
            ratio = len(keys) / theirs
            yield (
                f"| {body.name} | `{mode}` | {theirs} | {len(keys)} | {ratio:.2f} | {verdict(ratio <= GOAL)} | {best} |"
            )
