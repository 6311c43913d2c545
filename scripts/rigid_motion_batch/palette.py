"""Colours in sRGB: one for each mode in films, on pages and in drawings, and the colours of backgrounds.

The modes have the colours of Okabe and Ito (Color Universal Design, 2008), which people with any of the common forms of
colour blindness can tell apart, except for a lighter blue, and an additional leaf green that differs from all. Each
colour reaches a contrast of 3 on the dark stage. A colour with too little contrast elsewhere is darkened or lightened.
Nothing here needs Blender.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from .analysis.metrics import MAX_ROUNDING_M

MODE_COLOURS: dict[str, str] = {
    "bezier": "#E4FCF0",
    "lerp_slerp": "#D55E00",
    "dq_sclerp": "#56B4E9",
    "pga_lerp": "#E69F00",
    "pga_slerp": "#009E73",
    "cga_lerp": "#CC79A7",
    "cga_slerp": "#4C72E0",
    "motor_spline": "#88BB66",
    "motor_spline_causal": "#F0E442",
}
"""Mode id to colour."""

OTHER_COLOURS = ("#B3B3B3", "#A98467", "#B7E4C7")
"""Colours for modes without a colour of their own, and for motions from --against."""


@dataclass(frozen=True)
class Theme:
    """The colours of a stage."""

    background: str
    card: str
    """The background colour of a lane."""

    track: str
    """The colour of the part of a graph that is still to come."""

    faint: str
    ink: str
    ghost: str
    """The colour of the recording."""


THEMES = {
    "dark": Theme("#14171C", "#242932", "#3A424E", "#9AA4B2", "#EEF1F5", "#C9D3E0"),
    "light": Theme("#E4E7EB", "#FFFFFF", "#D3D9E0", "#58626E", "#14171C", "#5B6572"),
}
DARK = THEMES["dark"]

PAGES = "#ffffff", "#0e1115"
"""Background colours of a report, light and dark."""

ERROR_COLOURS = ("#5B7FB0", "#C9B98A", "#F08A24", "#C4162A")
"""Colours of errors, evenly from none to the largest: calm for small errors, red for large ones. Their lightness
differs too, for people who cannot tell red from green."""

NEARLY_ALL = 0.995
"""The quantile of errors that gets the strongest colour: otherwise a single bad frame would hide all others."""

LEAST_CONTRAST = 3.0
"""The least contrast of a mode's colour with its background (WCAG 2.2, 1.4.11)."""

CONTRAST_OF_WORDS = 4.5
"""The least contrast of a mode's name with the page (WCAG 2.2, 1.4.3)."""


def colour_of(mode: str) -> str:
    """Return the colour of a mode, the same in every run, also for a mode that the table lacks."""
    return MODE_COLOURS.get(mode) or OTHER_COLOURS[zlib.crc32(mode.encode()) % len(OTHER_COLOURS)]


def colour_on(theme: Theme, mode: str) -> str:
    """Return the colour of a mode with enough contrast on a card."""
    return standing_out(colour_of(mode), theme.card, LEAST_CONTRAST)


def colours_on_pages(mode: str) -> list[str]:
    """Return the colours in which a mode's name is written, on a light page and on a dark one."""
    return [standing_out(colour_of(mode), ground, CONTRAST_OF_WORDS) for ground in PAGES]


def standing_out(colour: str, ground: str, contrast: float) -> str:
    """Return a colour, darkened on a light background or lightened on a dark one as far as the contrast requires."""
    behind, own = luminance(ground) + 0.05, luminance(colour)
    light = behind > 0.5
    limit = behind / contrast - 0.05 if light else behind * contrast - 0.05
    if own <= limit if light else own >= limit:
        return colour
    towards = 0.0 if light else 1.0
    share = (limit - own) / (towards - own)
    mixed = (value + share * (towards - value) for value in linear(colour))
    # Round away from the background.
    return "#" + "".join(f"{min(int(255.0 * _srgb_of(value) + towards), 255):02X}" for value in mixed)


def error_hex(share: float) -> str:
    """Return the colour of an error by its fraction of the largest, 0 to 1, interpolated in `ERROR_COLOURS`."""
    place = min(max(share, 0.0), 1.0) * (len(ERROR_COLOURS) - 1)
    first = min(int(place), len(ERROR_COLOURS) - 2)
    low, high = map(_channels, ERROR_COLOURS[first : first + 2])
    mixed = (a + (place - first) * (b - a) for a, b in zip(low, high, strict=True))
    return "#" + "".join(f"{round(255.0 * value):02x}" for value in mixed)


def full_colour(errors: Iterable[np.ndarray]) -> float:
    """Return the error of the strongest colour, one scale for all of these errors: nearly the largest, in metres.

    Errors within rounding get the colour of no error.
    """
    errors = list(errors)
    nearly_all = max(float(np.quantile(some, NEARLY_ALL)) for some in errors)
    largest = max(float(some.max()) for some in errors)
    return next((size for size in (nearly_all, largest) if size > MAX_ROUNDING_M), 1.0)


def luminance(colour: str) -> float:
    """Return the relative luminance of a colour, 0 to 1."""
    red, green, blue = linear(colour)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def linear(colour: str) -> tuple[float, float, float]:
    """Return the linear RGB, 0 to 1, that Blender computes with, for an sRGB colour such as "#56B4E9"."""
    red, green, blue = (v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in _channels(colour))
    return red, green, blue


def _channels(colour: str) -> list[float]:
    """Return red, green and blue of a colour, 0 to 1, in sRGB."""
    return [int(colour[start : start + 2], 16) / 255.0 for start in (1, 3, 5)]


def _srgb_of(value: float) -> float:
    """Return the sRGB value of a linear value."""
    return 12.92 * value if value <= 0.0031308 else 1.055 * value ** (1.0 / 2.4) - 0.055
