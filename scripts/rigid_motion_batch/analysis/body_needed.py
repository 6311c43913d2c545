"""Key poses needed: how few of them a mode can do with on a whole body to be as good as the reference is with many.

As in `needed`, with the RMS over all samples and joints in the root's space. Those that the motion chooses are the best
of so many that `reduce_skeleton_keys` finds, which keep the largest error small, or evenly spaced ones where these are
better; how many is searched for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from operator import itemgetter
from typing import cast

import numpy as np

from rigid_motion.motion import reduce_skeleton_keys
from rigid_motion_batch.recordings.clips import Clip

from .needed import DECIMATIONS, OfRigidBody, Ways, evenly_spaced, fewest
from .radii import Radii

NEAR = 0.02
"""The search ends where one knows the number of key poses to so much of it: every step reduces keys anew."""


@dataclass(frozen=True)
class OfBody(Ways):
    """Key poses of a whole body: the same samples for all joints."""

    radii: np.ndarray
    """Of the balls at the joints, in metres, shape (joints,)."""

    decimations = DECIMATIONS[:2]

    @property
    def shells(self) -> np.ndarray:
        return self.radii

    def by_motion(self, mode: str, target: float, evenly: int) -> list[tuple[np.ndarray, float]]:
        """Key poses: as many as evenly spaced ones at most, if those of the motion are any better."""
        samples = len(self.clip.times)
        best_of = cache(lambda budget: self._best_of(budget, mode))
        start = min(evenly, samples)
        enough = fewest(lambda budget: best_of(budget)[1] <= target, start, samples, too_few=1, near=NEAR)
        return [best_of(enough)]

    def _best_of(self, budget: int, mode: str) -> tuple[np.ndarray, float]:
        """Return so many key poses at most, and their error."""
        if budget >= len(self.clip.times):
            every = np.arange(len(self.clip.times))
            return every, self.error(every, mode)
        result = reduce_skeleton_keys(
            self.clip.times,
            self.clip.poses,
            self.clip.whole_body.parents,
            mode,
            radius=self.radii / self.clip.metres_per_unit,
            budget=max(budget, 2),
            shared=True,
        )
        keys = max(cast(tuple[np.ndarray, ...], result), key=len)
        # Keys with the smallest largest error may have a larger RMS error than evenly spaced ones.
        evenly = evenly_spaced(self.clip, max(budget, 2) - 1)
        return min(((some, self.error(some, mode)) for some in (keys, evenly)), key=itemgetter(1))


def ways_of(clip: Clip, radii: Radii, *, fit: bool) -> Ways:
    """Return the ways to have fewer keys of a clip, whatever it is of; only those of a rigid body may be fitted."""
    return OfBody(clip, radii.of(clip)) if clip.rest_body else OfRigidBody(clip, radii.rigid, fit=fit)
