"""How much is tried by tests that try many cases: a fair sample by default, all of them in continuous integration."""

from __future__ import annotations

import math
import os

from hypothesis import settings

THOROUGH = bool(os.environ.get("RIGID_MOTION_THOROUGH"))

SHARE = 5
"""Of so many cases one is tried by default."""


def tried(cases: int) -> int:
    """How many of these cases to try."""
    return cases if THOROUGH else math.ceil(cases / SHARE)


settings.register_profile("thorough", deadline=None)
settings.register_profile("quick", deadline=None, max_examples=tried(settings.default.max_examples))
settings.load_profile("thorough" if THOROUGH else "quick")
