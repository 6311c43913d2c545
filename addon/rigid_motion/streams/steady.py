"""Jitter removal for shown streams, using the samples that have already arrived after the shown moment.

Finds the likeliest motion through the last samples and the next ones, with a jerk as large as around them. For values y
with noise s and third derivatives j it minimises the sum of (x - y)^2 / s^2 and h j^2 / J^2, with the density J^2 found
as in `motion.corrections`. This adds no delay.
"""

from __future__ import annotations

import numpy as np

from ..motion import Poses
from ..motion.differences import coefficients
from ..motion.jitter import jitter
from ..motion.poses import joined
from ..motion.quaternions import turned, turns_between
from .paths import KnotPath

MIN_NOISE_SAMPLES, MAX_NOISE_SAMPLES, SAMPLES_PER_LOOK = 60, 240, 4
"""The fewest and the most samples for measuring the noise; and the number of shown poses after which the next joint is
measured, as this is slow."""

SAMPLES_BEFORE, SAMPLES_AFTER, MIN_SAMPLES = 12, 8, 12
"""Samples before and after the shown moment that count, and the fewest of both together."""

MIN_KEY_GAP_S = 0.04
"""Seconds: samples farther apart count as keys, not as all captured samples; keys have no jitter."""

JERK_ORDER, JERK_REACH_SAMPLES, JERK_ROUNDS = 3, 3, 10
"""Order of the derivative that is kept small; samples on either side that share its density; rounds to find it."""

MIN_JERK_RATIO = 1e-9
"""Fraction of the jerk caused by noise that is always allowed."""

MAX_TURN_RAD, FAR_TURN_WEIGHT = 2.0, 1e-4
"""Radians: rotations farther from the shown one get this small weight."""


class Steady:
    """Recent samples of a stream's joints, and the noise of each joint."""

    def __init__(self) -> None:
        self._times = np.empty(0)
        self._poses: Poses = Poses(np.empty((0, 0, 3)), np.empty((0, 0, 4)))
        self._holders = np.empty((0, 0), dtype=np.int16)
        self._noise = np.empty((2, 0))
        """Noise of positions and rotations, as standard deviations along an axis; shape (2, joints)."""
        self._shown, self._settled = 0, np.inf

    def __call__(self, path: KnotPath, moment: float, settled: float) -> Poses:
        """Return the poses (joints,) at a moment of a path that will not change before `settled`."""
        poses, count = path.pose(moment), path.poses.shape[0]
        if self._poses.shape[0] != count or (len(self._times) and path.moments[0] > self._times[-1]):
            self._times, self._poses = np.empty(0), path.poses[:, :0]
            self._holders = np.empty((count, 0), dtype=np.int16)
            self._noise = np.zeros((2, count)) if self._noise.shape[1] != count else self._noise
        self._store_samples(path, settled)
        at = int(np.searchsorted(self._times, moment)) - 1
        window = slice(max(at - SAMPLES_BEFORE, 0), at + 1 + SAMPLES_AFTER)
        times = self._times[window]
        if at < 0 or len(times) < MIN_SAMPLES or np.median(np.diff(times)) > MIN_KEY_GAP_S:
            return poses
        if self._shown % SAMPLES_PER_LOOK == 0 and len(self._times) >= MIN_NOISE_SAMPLES:
            joint = self._shown // SAMPLES_PER_LOOK % count
            self._noise[:, joint] = jitter(self._times, self._poses[joint])[:2]
        self._shown += 1
        holders = self._holders[:, window]
        joints = np.flatnonzero(self._noise.any(axis=0) & (holders == holders[:, :1]).all(axis=1))
        if not len(joints):
            return poses
        first = at - window.start
        seen = self._poses[joints, window]
        turns = turns_between(seen.quaternions[:, first, None], seen.quaternions)
        values = np.concatenate((seen.positions - seen.positions[:, first, None], turns))
        noise = self._noise[:, joints].ravel()
        near = np.concatenate((np.ones(turns.shape[:2]), np.linalg.norm(turns, axis=-1) < MAX_TURN_RAD))
        moving = noise > 0.0
        corrections = np.zeros(values.shape)
        corrections[moving] = steadied(times, values[moving], noise[moving], near[moving]) - values[moving]
        second = min(first + 1, len(times) - 1)
        share = (moment - times[first]) / ((times[second] - times[first]) or 1.0)
        slides, turns = np.split(corrections[:, first] * (1.0 - share) + corrections[:, second] * share, 2)
        positions, quaternions = poses.positions.copy(), poses.quaternions.copy()
        positions[joints] += slides
        quaternions[joints] = turned(quaternions[joints], turns)
        return Poses(positions, quaternions)

    def _store_samples(self, path: KnotPath, settled: float) -> None:
        """Store new samples, one per moment, and replace samples that may have changed."""
        stop = int(np.searchsorted(self._times, self._settled, side="right"))
        kept, last = slice(max(stop - MAX_NOISE_SAMPLES, 0), stop), self._times[stop - 1] if stop else -np.inf
        is_new = (path.moments > last) & (np.diff(path.moments, append=np.inf) > 0.0)
        holders = np.broadcast_to(path.holders, (len(self._holders), len(is_new)))[:, is_new]
        self._times = np.append(self._times[kept], path.moments[is_new])
        self._poses = joined((self._poses[:, kept], path.poses[:, is_new]), axis=1)
        self._holders = np.concatenate((self._holders[:, kept], holders), axis=1)
        self._settled = settled


def steadied(times: np.ndarray, values: np.ndarray, noise: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Return the likeliest values (channels, n, 3) at times (n,), given noise (channels,); samples that are not `near`
    (channels, n) hardly count.
    """
    c, count = coefficients(times, JERK_ORDER), len(times)
    rows = np.arange(count - JERK_ORDER)
    around = (np.abs(rows[:, None] - rows) <= JERK_REACH_SAMPLES).astype(float)
    around /= around.sum(axis=0)
    derivative = np.zeros((len(rows), count))
    for column in range(JERK_ORDER + 1):
        derivative[rows, rows + column] = c[:, column]
    steps = (times[JERK_ORDER:] - times[:-JERK_ORDER]) / JERK_ORDER
    least = MIN_JERK_RATIO * steps * np.einsum("nk,nk->n", c, c) * noise[:, None] ** 2
    precisions = np.where(near, 1.0, FAR_TURN_WEIGHT) / noise[:, None] ** 2

    def density(found: np.ndarray, determined: np.ndarray | float) -> np.ndarray:
        squares = steps * ((derivative @ found) ** 2).sum(axis=-1) / 3.0
        return np.maximum(squares @ around / determined, least)

    densities, found = density(values, 1.0), values
    for _ in range(JERK_ROUNDS):
        weights = steps / densities
        matrix = (derivative.T * weights[:, None]) @ derivative
        matrix[:, np.arange(count), np.arange(count)] += precisions
        inverse = np.linalg.inv(matrix)
        found = inverse @ (precisions[..., None] * values)
        spread = (derivative @ inverse * derivative).sum(axis=-1)
        determined = np.maximum(np.maximum(1.0 - spread * weights, 0.0) @ around, 1e-9)
        densities = density(found, determined)
    return found
