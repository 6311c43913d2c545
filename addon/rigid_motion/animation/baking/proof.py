"""The proof that bones with fewer keys keep to a tolerance, at all moments.

Of a long recording no more is looked at at once than a stretch of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from ..evaluation.sources import Source
from .fewer_keys import moments
from .motions import RigMotion

AT_ONCE = 2**20
"""Bones times moments that are looked at in one go."""

NEAR = 3
"""Keys on either side of one beyond which it has no say."""

Mend = Callable[[list[tuple[float, int, int]], RigMotion], set[int]]
"""Changes what is shown of bones, after what is over the tolerance (see `RigMotion.over`).

Returns their numbers, and none where nothing is left to be changed.
"""


class Proof:
    """All moments of a rig, and how far its bones are off at these.

    Parameters
    ----------
    motion : RigMotion
        The rig on the frames that keys may be on, and all whole ones.
    sources : mapping
        Of the bones that may have fewer keys, by their numbers.
    weights : array, shape (bones, m)
        How many times errors count on these frames. Between two of them it is the smaller one.
    """

    def __init__(self, motion: RigMotion, sources: Mapping[int, Source], weights: np.ndarray) -> None:
        self.rig, self.sources, self.weights = motion, sources, weights
        every, step = moments(motion.frames, list(sources.values())), max(1, AT_ONCE // len(motion.bones))
        self._stretches = [every[first : first + step] for first in range(0, len(every), step)]
        self._errors = np.zeros((len(self._stretches), len(motion.bones)))
        self._looked_at: tuple[int, RigMotion] | None = None

    def largest_errors(self) -> np.ndarray:
        """Return the largest displacement of any point in each bone's ball, as was proven last, shape (bones,)."""
        return self._errors.max(axis=0)

    def keep_to(self, allowed: float, fewer: dict[int, Source], mend: Mend) -> None:
        """Have `fewer`, which is shown of bones in place of what they had, mended until it is as is allowed."""
        unproven = set(range(len(self._stretches)))
        while unproven:
            number = min(unproven)
            unproven = (unproven | self._mend(number, allowed, fewer, mend)) - {number}

    def _mend(self, number: int, allowed: float, fewer: dict[int, Source], mend: Mend) -> set[int]:
        """Have a stretch mended, and return which ones have changed by that.

        After the first look only what was touched is looked at, until nothing is over.
        """
        if self._looked_at is None or self._looked_at[0] != number:
            self._looked_at = number, self.rig.at(self._stretches[number])
        stretch = part = self._looked_at[1]
        changed: set[int] = set()
        while True:
            over, before = self._over(part, allowed, fewer), dict(fewer)
            if over and (bones := mend(over, part)):
                firsts, lasts = self._touched(bones, before, fewer)
                begins, ends = np.searchsorted(firsts, stretch.frames, "right"), np.searchsorted(lasts, stretch.frames)
                part = stretch.among(begins > ends)
                changed |= {n for n, at in enumerate(self._stretches) if np.any((firsts <= at[-1]) & (lasts >= at[0]))}
            elif part is stretch:
                break
            else:
                part = stretch
        self._errors[number] = stretch.largest_errors()
        return changed

    def _over(self, motion: RigMotion, allowed: float, fewer: Mapping[int, Source]) -> list[tuple[float, int, int]]:
        motion.show({bone: fewer.get(bone) for bone in self.sources})
        before = np.searchsorted(self.rig.frames, motion.frames, side="right") - 1
        weights = np.minimum(self.weights[:, before], self.weights[:, np.searchsorted(self.rig.frames, motion.frames)])
        return motion.over(allowed, weights)

    def _touched(
        self, changed: set[int], before: Mapping[int, Source], fewer: Mapping[int, Source]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the first and the last frames (k,) between which bones may be shown otherwise than before."""
        spans = [np.empty((2, 0))]
        for bone in changed:
            old, new = (sources.get(bone, self.sources[bone]) for sources in (before, fewer))
            keys = np.union1d(old.keyed_frames, new.keyed_frames)
            differ = np.searchsorted(keys, np.setxor1d(old.keyed_frames, new.keyed_frames))
            if not len(differ) or new.goes_on:
                return np.array((-np.inf,)), np.array((np.inf,))
            spans.append(keys[[np.maximum(differ - NEAR, 0), np.minimum(differ + NEAR, len(keys) - 1)]])
        firsts, lasts = np.concatenate(spans, axis=1)
        return np.sort(firsts), np.sort(lasts)
