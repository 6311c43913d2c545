"""Colours of the modes on the page, the same in every run: as text they have a contrast of 4.5 or more (WCAG 2.2)."""

from __future__ import annotations

import zlib

MODE_COLOURS: dict[str, tuple[str, str]] = {
    "lerp_slerp": ("#c2410c", "#ff8552"),
    "dq_sclerp": ("#0369a1", "#58b5ff"),
    "pga_lerp": ("#86369f", "#d693f2"),
    "pga_slerp": ("#0e7490", "#2dd4e6"),
    "cga_lerp": ("#be185d", "#f88cc0"),
    "cga_slerp": ("#4338ca", "#a5b4fc"),
    "motor_spline": ("#0b7a53", "#3fd39c"),
    "motor_spline_causal": ("#4d7c0f", "#a3e635"),
    "best_of": ("#8a5a00", "#f5c542"),
}
"""Mode id to its colour on a light page and on a dark one."""

OTHER_COLOURS = (("#57534e", "#cfcac5"), ("#7c4a32", "#d9a488"), ("#3f6470", "#9fc4d0"))
"""For modes that have none of their own, such as somebody else's motion."""

BACKGROUNDS = ("#ffffff", "#0e1115")
"""Of the light page and the dark one."""

ERROR_COLOURS = ("#5b7fb0", "#c9b98a", "#f08a24", "#c4162a")
"""What an error looks like where it is a colour, evenly from none to the largest. They differ in lightness as well."""


def colours_of(mode: str) -> tuple[str, str]:
    """The colours of a mode, light page and dark."""
    return MODE_COLOURS.get(mode) or OTHER_COLOURS[zlib.crc32(mode.encode()) % len(OTHER_COLOURS)]


def error_rgb(share: float) -> tuple[int, int, int]:
    """The colour of an error by its share of the largest, 0 to 1."""
    place = min(max(share, 0.0), 1.0) * (len(ERROR_COLOURS) - 1)
    first = min(int(place), len(ERROR_COLOURS) - 2)
    low, high = (
        [int(colour[start : start + 2], 16) for start in (1, 3, 5)] for colour in ERROR_COLOURS[first : first + 2]
    )
    red, green, blue = (round(a + (place - first) * (b - a)) for a, b in zip(low, high, strict=True))
    return red, green, blue
