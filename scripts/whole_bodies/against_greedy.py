"""Key poses beside those of greedy insertion, and beside the fewest there can be."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from addon.motion import Poses, interpolate, reduce_skeleton_keys, shell_error
from addon.motion.modes import MODES

from .bodies import RADIUS, Body
from .goals import verdict

COMPARED = ("lerp_slerp", "dq_sclerp", "motor_spline")

GOAL = 0.85
"""The most keys, in multiples of those of greedy insertion."""

GLANCES = (0.5, 0.25, 0.75, 0.125, 0.375, 0.625, 0.875)
"""Where between two keys it is seen first that they will not do."""


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


def optimum(body: Body, mode: str, tolerance: float) -> int:
    """The fewest key poses there can be, where what is between two keys depends on no others.

    An exact dynamic programme: from each frame on, all frames are tried that could be the next key, however late.
    """
    if MODES[mode].behind or MODES[mode].ahead:
        raise ValueError(f"between two keys, {mode} depends on others as well")
    fewest = np.full(body.frames, math.inf)
    fewest[0] = 1
    for start in range(body.frames - 1):
        ends = np.array(list(_reachable(body, mode, tolerance, start)))
        fewest[ends] = np.minimum(fewest[ends], fewest[start] + 1)
    return int(fewest[-1])


def _reachable(body: Body, mode: str, tolerance: float, start: int) -> Iterator[int]:
    """The later frames that, as the next key, leave everything between within the tolerance."""
    ends = np.arange(start + 1, body.frames)
    for glance in GLANCES:
        samples = start + ((ends - start) * glance).astype(np.int64)
        ends = ends[_errors_between(body, mode, start, ends, samples) <= tolerance]
    for end in ends.tolist():
        samples = np.arange(start + 1, end)
        if np.all(_errors_between(body, mode, start, np.full(len(samples), end), samples) <= tolerance):
            yield end


def _errors_between(body: Body, mode: str, start: int, ends: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """The largest error of any joint at a sample (m,) between a key at the start and one at an end (m,)."""
    if not len(samples):
        return np.zeros(0)
    pairs = np.stack((np.full(len(ends), start), ends), axis=-1)
    shares = np.broadcast_to(((samples - start) / (ends - start))[:, None], (len(body.joints), len(ends), 1))
    filled = interpolate((0.0, 1.0), body.poses[:, pairs], shares, mode)
    shown = body.skeleton.in_root_space(Poses(filled.positions[:, :, 0], filled.quaternions[:, :, 0]))
    return shell_error(shown, body.truth[:, samples], RADIUS).max(axis=0)


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
            best = "" if MODES[mode].is_smooth else str(optimum(body, mode, tolerance))
            ratio = len(keys) / theirs
            yield (
                f"| {body.name} | `{mode}` | {theirs} | {len(keys)} | {ratio:.2f} | {verdict(ratio <= GOAL)} | {best} |"
            )
