"""How many samples a frame a motion needs for what is between them to be right as well."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from .differences import differences
from .samples import MOST_SAMPLES, Samples
from .sources import Source


class Need(NamedTuple):
    """How exact a motion is to be between its samples."""

    tolerance: float
    """The largest error allowed, in the units of its channels; infinite where that does not matter."""

    reach: float
    """The distance that the body reaches from its origin, in the same units."""

    most: int = MOST_SAMPLES
    """The largest number of samples a frame."""


def sampled(sources: Sequence[Source], needs: Sequence[Need]) -> list[Samples]:
    """Return the differences of each source, with as few samples a frame as it needs, and the error that is left
    between them.
    """
    if all(math.isinf(need.tolerance) for need in needs):
        return differences(sources)
    result = differences(sources, reaches=[need.reach for need in needs])
    coarser: dict[int, Samples] = {}
    while pending := [number for number, need in enumerate(needs) if _is_open(result[number], need)]:
        rates = [_next_rate(result[number], needs[number]) for number in pending]
        reaches = [needs[number].reach for number in pending]
        finer_samples = differences([sources[number] for number in pending], rates, reaches)
        for number, finer in zip(pending, finer_samples, strict=True):
            before, result[number] = result[number], finer
            if math.isinf(before.error):
                # There were too few to tell: half as far apart, a curve is four times as near to the line.
                first = coarser.setdefault(number, before)
                guess = finer.error * (finer.rate / first.rate) ** 2
                if guess <= needs[number].tolerance or (math.isfinite(guess) and first.rate >= needs[number].most):
                    first.error, result[number] = guess, first
    return result


def _is_open(samples: Samples, need: Need) -> bool:
    """Return whether more samples may do better, or tell how far off it is."""
    if math.isinf(samples.error):
        return math.isfinite(need.tolerance)
    return samples.error > need.tolerance and samples.rate < need.most


def _next_rate(samples: Samples, need: Need) -> int:
    if math.isinf(samples.error):
        return 2 * samples.rate
    fit = math.ceil(math.log2(samples.error / need.tolerance) / 2.0)
    return min(samples.rate << max(fit, 1), need.most)
