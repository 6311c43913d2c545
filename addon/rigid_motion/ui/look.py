"""How the overlay looks before anybody has changed the preferences: colours (red, green, blue, alpha, as on the screen)
and widths (pixels at a resolution scale of 1).
"""

from __future__ import annotations

from typing import NamedTuple

Color = tuple[float, float, float, float]


class Look(NamedTuple):
    """The preferences of the overlay. Those of the extension have the same names."""

    native_color: Color = (0.80, 0.80, 0.80, 1.0)
    mode_color: Color = (0.20, 0.72, 1.0, 1.0)
    key_color: Color = (1.0, 0.75, 0.20, 1.0)
    tick_color: Color = (1.0, 1.0, 1.0, 1.0)
    line_width: float = 2.0


DEFAULT_LOOK = Look()
