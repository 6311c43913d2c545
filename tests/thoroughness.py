"""How much is tried by tests that try many cases: a fair sample by default, all of them in continuous integration."""

import itertools
import math
import os
from collections.abc import Sequence
from typing import TypeVar

from hypothesis import settings

Case = TypeVar("Case")

THOROUGH = bool(os.environ.get("RIGID_MOTION_THOROUGH"))

SHARE = 40 if os.environ.get("RIGID_MOTION_QUICK") else 4
"""Of so many cases one is tried by default, and in a quick run."""


def tried(cases: int) -> int:
    """How many of these cases to try."""
    return cases if THOROUGH else math.ceil(cases / SHARE)


def sample(cases: Sequence[Case]) -> Sequence[Case]:
    """Those of these cases to try, from the first to the last."""
    return cases if THOROUGH else cases[::SHARE]


def combined(*choices: Sequence) -> list[tuple]:
    """Combinations of these choices to try, in which each value of each choice is."""
    if THOROUGH:
        return list(itertools.product(*choices))
    return [tuple(choice[row % len(choice)] for choice in choices) for row in range(max(map(len, choices)))]


settings.register_profile("thorough", deadline=None)
settings.register_profile("quick", deadline=None, max_examples=tried(settings.default.max_examples))
settings.load_profile("thorough" if THOROUGH else "quick")
