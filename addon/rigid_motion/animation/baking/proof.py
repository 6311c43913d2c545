"""The proof that bones with fewer keys keep to a tolerance: at all moments, with what Blender shows between frames.

Of a long recording no more is looked at at once than a stretch of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ..actions.slots import Binding
from ..compute.sample_rates import sampled
from ..compute.sources import Source
from ..writers.filling import need_of
from .fewer_keys import moments
from .motions import RigMotion

AT_ONCE = 2**20
"""Bones times moments that are looked at in one go."""

NEAR = 3
"""Keys beside a stretch that have a say in it, on either side."""

Mend = Callable[[list[tuple[float, int, int]], RigMotion], set[int]]
"""Changes what is shown of bones, after what is over the tolerance (see `RigMotion.over`). Returns their numbers."""


class Proof:
    """All moments of a rig, and how far its bones are off at these.

    Parameters
    ----------
    motion : RigMotion
        The rig on the frames that keys may be on, and all whole ones.
    bindings, sources : mapping
        Of the bones that may have fewer keys, by their numbers.
    weights : array, shape (bones, m)
        How many times errors count on these frames. Between them it is the smaller one of both sides.
    """

    def __init__(
        self, motion: RigMotion, bindings: Mapping[int, Binding], sources: Mapping[int, Source], weights: np.ndarray
    ) -> None:
        self.rig, self.bindings = motion, bindings
        every, step = moments(motion.frames, list(sources.values())), max(1, AT_ONCE // len(motion.bones))
        self._stretches = [every[first : first + step] for first in range(0, len(every), step)]
        behind = np.searchsorted(motion.frames, every)
        before = np.searchsorted(motion.frames, every, side="right") - 1
        weights = np.minimum(weights[:, before], weights[:, behind])
        self._weights = [weights[:, first : first + step] for first in range(0, len(every), step)]
        self._proven: dict[int, list[bytes]] = {}
        self._errors = np.zeros((len(self._stretches), len(motion.bones)))
        self._looked_at: tuple[int, RigMotion] | None = None
        self._rates: dict[Source, int] = {}

    def largest_errors(self) -> np.ndarray:
        """Return the largest displacement of any point in each bone's ball, as was proven last, shape (bones,)."""
        return self._errors.max(axis=0)

    def keep_to(self, allowed: float, fewer: dict[int, Source], mend: Mend) -> None:
        """Have `fewer`, which is shown of bones in place of what they had, mended until it is as is allowed."""
        while unproven := [
            number for number in range(len(self._stretches)) if self._proven.get(number) != self._near(number, fewer)
        ]:
            for number in unproven:
                motion, weights = self._at(number), self._weights[number]
                motion.show({bone: fewer.get(bone) for bone in self.bindings})
                # At first without the samples that differences are written as: they take longer, and matter little.
                rates: dict[int, int] = {}
                for is_written in (False, True):
                    if is_written:
                        rates = {bone: self._rate(bone, source) for bone, source in fewer.items()}
                        motion.show(fewer, rates)
                    while over := motion.over(allowed, weights):
                        changed = mend(over, motion)
                        if is_written:
                            rates |= {bone: self._rate(bone, fewer[bone]) for bone in changed if bone in fewer}
                        motion.show({bone: fewer.get(bone) for bone in changed}, rates)
                self._proven[number] = self._near(number, fewer)
                self._errors[number] = motion.largest_errors()

    def _at(self, number: int) -> RigMotion:
        if self._looked_at is None or self._looked_at[0] != number:
            self._looked_at = number, self.rig.at(self._stretches[number])
        return self._looked_at[1]

    def _near(self, number: int, fewer: Mapping[int, Source]) -> list[bytes]:
        """Return what tells apart whether bones are shown otherwise in a stretch."""
        ends, result = self._stretches[number][[0, -1]], []
        for bone, source in fewer.items():
            keys = source.keyed_frames
            first, last = np.searchsorted(keys, ends)
            near = keys if source.goes_on else keys[max(first - NEAR, 0) : last + NEAR]
            result.append(b"%d" % bone + near.tobytes() + source.modes_at(near).tobytes())
        return result

    def _rate(self, bone: int, source: Source) -> int:
        """Return how many samples a frame the differences of a bone are going to have."""
        if source not in self._rates:
            need, once = need_of(self.bindings[bone], source, {}), replace(source, seen=None)
            self._rates[source] = sampled([once if source.repeats else source], [need])[0].rate
        return self._rates[source]
