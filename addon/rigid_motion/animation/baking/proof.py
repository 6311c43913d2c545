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
"""Changes what is shown of bones, after what is over the tolerance (see `RigMotion.over`).

Returns their numbers, and none where nothing is left to be changed.
"""


class Proof:
    """All moments of a rig, and how far its bones are off at these.

    Parameters
    ----------
    motion : RigMotion
        The rig on the frames that keys may be on, and all whole ones.
    bindings, sources : mapping
        Of the bones that may have fewer keys, by their numbers.
    weights : array, shape (bones, m)
        How many times errors count on these frames. Between two of them it is the smaller one.
    """

    def __init__(
        self, motion: RigMotion, bindings: Mapping[int, Binding], sources: Mapping[int, Source], weights: np.ndarray
    ) -> None:
        self.rig, self.bindings, self.sources, self.weights = motion, bindings, sources, weights
        every, step = moments(motion.frames, list(sources.values())), max(1, AT_ONCE // len(motion.bones))
        self._stretches = [every[first : first + step] for first in range(0, len(every), step)]
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
                # At first without the samples that differences are written as: they take longer, and matter little.
                self._is_mended(number, allowed, fewer, mend, as_written=False)
                while self._is_mended(number, allowed, fewer, mend, as_written=True):
                    pass
                self._proven[number] = self._near(number, fewer)

    def _is_mended(
        self, number: int, allowed: float, fewer: dict[int, Source], mend: Mend, *, as_written: bool
    ) -> bool:
        """Return whether anything was mended in a stretch. After that only what it touches is looked at."""
        if self._looked_at is None or self._looked_at[0] != number:
            self._looked_at = number, self.rig.at(self._stretches[number])
        stretch = part = self._looked_at[1]
        over, before = self._over(stretch, allowed, fewer, as_written=as_written), dict(fewer)
        is_mended = False
        while over and (changed := mend(over, part)):
            is_mended = True
            part = stretch.among(self._touched(stretch.frames, changed, before, fewer))
            over, before = self._over(part, allowed, fewer, as_written=as_written), dict(fewer)
        if as_written and not is_mended:
            self._errors[number] = stretch.largest_errors()
        return is_mended

    def _over(
        self, motion: RigMotion, allowed: float, fewer: Mapping[int, Source], *, as_written: bool
    ) -> list[tuple[float, int, int]]:
        rates = {bone: self._rate(bone, source) for bone, source in fewer.items()} if as_written else {}
        motion.show({bone: fewer.get(bone) for bone in self.bindings}, rates)
        before = np.searchsorted(self.rig.frames, motion.frames, side="right") - 1
        weights = np.minimum(self.weights[:, before], self.weights[:, np.searchsorted(self.rig.frames, motion.frames)])
        return motion.over(allowed, weights)

    def _touched(
        self, stretch: np.ndarray, changed: set[int], before: Mapping[int, Source], fewer: Mapping[int, Source]
    ) -> np.ndarray:
        """Return at which moments of a stretch (m,) bones may be shown otherwise than before, shape (m,)."""
        touched = np.zeros(len(stretch) + 1)
        for bone in changed:
            old, new = (sources.get(bone, self.sources[bone]) for sources in (before, fewer))
            keys = np.union1d(old.keyed_frames, new.keyed_frames)
            differ = np.searchsorted(keys, np.setxor1d(old.keyed_frames, new.keyed_frames))
            if not len(differ) or new.goes_on:
                return np.ones(len(stretch), dtype=bool)
            first, last = keys[np.maximum(differ - NEAR, 0)], keys[np.minimum(differ + NEAR, len(keys) - 1)]
            np.add.at(touched, np.searchsorted(stretch, first), 1)
            np.add.at(touched, np.searchsorted(stretch, last, side="right"), -1)
        return np.cumsum(touched[:-1]) > 0

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
