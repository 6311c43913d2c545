"""Thoroughness of tests with many cases: a fair sample by default, all cases in continuous integration."""

import itertools
import math
import os
from collections.abc import Sequence
from typing import TypeVar

from hypothesis import settings

Case = TypeVar("Case")

THOROUGH = bool(os.environ.get("RIGID_MOTION_THOROUGH"))

SHARE = 40 if os.environ.get("RIGID_MOTION_QUICK") else 4
"""One in this many cases is tried, by default and in a quick run."""


def tried(cases: int) -> int:
    """Return how many of this number of cases to try."""
    return cases if THOROUGH else math.ceil(cases / SHARE)


def sample(cases: Sequence[Case]) -> Sequence[Case]:
    """Return the cases to try, from the first to the last."""
    return cases if THOROUGH else cases[::SHARE]


def combined(*choices: Sequence) -> list[tuple]:
    """Return the combinations of choices to try; each value of each choice occurs."""
    if THOROUGH:
        return list(itertools.product(*choices))
    return [tuple(choice[row % len(choice)] for choice in choices) for row in range(max(map(len, choices)))]


settings.register_profile("thorough", deadline=None)
settings.register_profile("quick", deadline=None, max_examples=tried(settings.default.max_examples))
settings.load_profile("thorough" if THOROUGH else "quick")
