"""Colours: one for each mode wherever it is shown, and those of the stage around it. sRGB, as in a web page.

The modes have the colours of Okabe and Ito (Color Universal Design, 2008), which people with any of the common forms
of colour blindness can tell apart, but for a lighter blue, and a leaf green beside them that keeps apart from all: each
reaches a contrast of 3 on the stage. Nothing here needs Blender.
"""

from __future__ import annotations

import zlib

MODE_COLOURS: dict[str, str] = {
    "lerp_slerp": "#D55E00",
    "dq_sclerp": "#56B4E9",
    "pga_lerp": "#E69F00",
    "pga_slerp": "#009E73",
    "cga_lerp": "#CC79A7",
    "cga_slerp": "#4C72E0",
    "motor_spline": "#88BB66",
    "motor_spline_causal": "#F0E442",
    "best_of": "#963CFF",
}
"""Mode id to colour."""

OTHER_COLOURS = ("#B3B3B3", "#A98467", "#B7E4C7")
"""For modes that have no colour of their own yet."""

BACKGROUND = "#14171C"
CARD = "#242932"
TRACK = "#3A424E"
FAINT = "#9AA4B2"
INK = "#EEF1F5"
GHOST = "#C9D3E0"


def colour_of(mode: str) -> str:
    """The colour of a mode, the same in every run, also for a mode that the table does not know."""
    return MODE_COLOURS.get(mode) or OTHER_COLOURS[zlib.crc32(mode.encode()) % len(OTHER_COLOURS)]


def linear(colour: str) -> tuple[float, float, float]:
    """The linear RGB, 0 to 1, that Blender computes in, of an sRGB colour such as "#56B4E9"."""
    encoded = (int(colour[start : start + 2], 16) / 255.0 for start in (1, 3, 5))
    red, green, blue = (v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in encoded)
    return red, green, blue
