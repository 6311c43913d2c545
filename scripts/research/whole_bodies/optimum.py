"""The fewest key poses there can be, by exact dynamic programmes that try every frame as the next key, however late."""

from __future__ import annotations

import math

import numpy as np

from rigid_motion.motion import MODES, Poses, interpolate, shell_error

from .bodies import RADIUS, Body

GLANCES = (0.5, 0.25, 0.75, 0.125, 0.375, 0.625, 0.875)
"""Where between two keys it is seen first that they will not do."""

BATCH = 2**11
"""Choices of keys looked at in one go."""


def optimum(body: Body, mode: str, tolerance: float) -> int:
    """Under a mode by which what is between two keys depends on no others."""
    if MODES[mode].is_smooth:
        raise ValueError(f"between two keys, {mode} depends on others as well")
    fewest = np.full(body.frames, math.inf)
    fewest[0] = 1
    for start in range(body.frames - 1):
        ends = np.arange(start + 1, body.frames)
        keys = np.stack((np.full(len(ends), start), ends), axis=-1)
        ends = ends[_keep_to(body, mode, tolerance, keys, 0)]
        fewest[ends] = np.minimum(fewest[ends], fewest[start] + 1)
    return int(fewest[-1])


def optimum_of_four(body: Body, mode: str, tolerance: float) -> int:
    """Under a mode by which it depends on these two and the keys next to them.

    `fewest[i, j, k]` is how many keys end with i, j and k, where all is well before j; i is -1 where j is the first.
    """
    if (MODES[mode].behind, MODES[mode].ahead) != (1, 1):
        raise ValueError(f"between two keys, {mode} does not depend on four")
    n = body.frames
    fewest = np.full((n, n, n), math.inf)
    fewest[-1, 0, 1:] = 2  # Row -1 is the last, which no other choice ends with.
    best = math.inf
    for start in range(n - 1):
        befores = np.arange(start) if start else np.array((-1,))
        for end in range(start + 1, n):
            possible = befores[np.isfinite(fewest[befores, start, end])]
            if not len(possible):
                continue
            afters = np.arange(end + 1, n) if end < n - 1 else np.array((n,))
            choices = np.stack(np.meshgrid(possible, (start,), (end,), afters, indexing="ij"), axis=-1).reshape(-1, 4)
            inside = [column for column in range(4) if 0 <= choices[0, column] < n]
            well = _keep_to(body, mode, tolerance, choices[:, inside], inside.index(1))
            before, after = choices[well, 0], choices[well, 3]
            so_far = fewest[before, start, end]
            if end == n - 1:
                best = min(best, so_far.min(initial=math.inf))
            else:
                np.minimum.at(fewest, (start, end, after), so_far + 1)
    return int(best)


def _keep_to(body: Body, mode: str, tolerance: float, keys: np.ndarray, at: int) -> np.ndarray:
    """Which choices of keys (m, k) leave what is from the one in a column to the next within the tolerance."""
    good = np.arange(len(keys))
    starts, ends = keys[:, at], keys[:, at + 1]
    for glance in GLANCES:
        samples = starts[good] + ((ends[good] - starts[good]) * glance).astype(np.int64)
        good = good[_errors(body, mode, keys[good], samples) <= tolerance]
    counts = (ends - starts)[good]
    rows = good.repeat(counts)
    samples = starts[rows] + np.arange(len(rows)) - (np.cumsum(counts) - counts).repeat(counts)
    wrong = np.zeros(len(keys), dtype=bool)
    wrong[rows[_errors(body, mode, keys[rows], samples) > tolerance]] = True
    well = np.zeros(len(keys), dtype=bool)
    well[good] = True
    return well & ~wrong


def _errors(body: Body, mode: str, keys: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """The largest error of any joint at a sample (m,) by a choice of keys (m, k)."""
    found = np.empty(len(samples))
    for first in range(0, len(samples), BATCH):
        some = slice(first, first + BATCH)
        shape = (len(body.joints), *samples[some].shape)
        filled = interpolate(
            np.broadcast_to(body.times[keys[some]], (*shape, keys.shape[1])),
            body.poses[:, keys[some]],
            np.broadcast_to(body.times[samples[some], None], (*shape, 1)),
            mode,
        )
        shown = body.skeleton.in_root_space(Poses(filled.positions[:, :, 0], filled.quaternions[:, :, 0]))
        found[some] = shell_error(shown, body.truth[:, samples[some]], RADIUS).max(axis=0)
    return found
