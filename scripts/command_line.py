"""What command lines have in common, in Python and in Blender."""

from __future__ import annotations

import math
import sys
from pathlib import Path


def own_arguments(script: str) -> list[str]:
    """The arguments that are meant for a script, given its `__file__`.

    In Blender (`blender --background --python SCRIPT -- ARGUMENTS`) what is behind the "--", in Python everything.
    """
    if Path(sys.argv[0]).name == Path(script).name:
        return sys.argv[1:]
    return sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []


def number(text: str) -> float:
    """The number that an option says; NaN, which is within no bounds, where it is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan
