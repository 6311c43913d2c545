"""Draw the path and speed of a body in each mode, with the same keys, for the reference page of the modes.

python docs/draw_modes.py

This writes docs/modes/MODE.svg. The body turns by 150 degrees, then back by 120 while growing by half.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("", "addon", "scripts")]

from docs.drawing import bars, drawing, element, polyline, poses_of
from rigid_motion.motion import MODES, Poses, interpolate
from rigid_motion_batch.files import write_text
from rigid_motion_batch.palette import THEMES, colour_of, colour_on

TIMES = np.array((0.0, 1.0, 2.0))
POINTS = np.array(((0.0, 0.0), (1.0, 0.35), (2.0, 0.0)))
DEGREES = np.array((0.0, 150.0, 30.0))
SIZES = np.array((1.0, 1.0, 1.5))

STEPS = 12
"""Bodies and dots drawn per segment."""

FINE = 120
"""Samples per segment for the lines."""

HALF = 0.16
"""Half the length of the bar that represents the body, in metres."""

WIDTH, HEIGHT = 720, 270
SCALE = 160.0
"""Pixels per metre."""

LEFT, BASE = 40.0, 180.0
"""Position of the first key, in pixels."""

GRAPH = (460.0, 60.0, 240.0, 170.0)
"""Left, top, width and height of the speed graph, in pixels."""

FASTEST = 3.0
"""The speed at the top of the graph, in metres per unit of time."""

STYLE = """
.mode{stroke:LIGHT;fill:none}.dot{fill:LIGHT}.faint{stroke:#9aa4b2;fill:none}.key{stroke:#1b2026;stroke-width:4}
.words{fill:#1b2026}.path{stroke-width:2.5}.body{stroke-width:1.5;opacity:.55}
text{font:14px system-ui,"Segoe UI",Roboto,"Liberation Sans",sans-serif}
@media(prefers-color-scheme:dark){.mode{stroke:DARK}.dot{fill:DARK}.key{stroke:#e6eaee}.words{fill:#e6eaee}
.faint{stroke:#58626e}}
"""


def main() -> None:
    """Write a picture for each mode."""
    for mode in MODES:
        style = STYLE.replace("LIGHT", colour_on(THEMES["light"], mode)).replace("DARK", colour_of(mode))
        parts = *path_of(mode), *speed_of(mode)
        picture = drawing(f"{MODES[mode].label}: path and speed", style, WIDTH, HEIGHT, *parts)
        write_text(DOCS / "modes" / f"{mode}.svg", picture)


def keys() -> Poses:
    """Return the three keys of `POINTS`, `DEGREES` and `SIZES`, in a plane."""
    return poses_of(POINTS, DEGREES, SIZES)


def path_of(mode: str) -> list[str]:
    """Return the path of the body's middle, and the body at even times, with thick bars at the keys."""
    way = interpolate(TIMES, keys(), moments(FINE), mode)
    bodies = interpolate(TIMES, keys(), moments(STEPS), mode)
    dots = [
        element("circle", cx=x, cy=y, r=2.5, class_="dot") for x, y in _on_paper(bodies.positions).round(1).tolist()
    ]
    return [
        element("path", d=strokes(bodies), class_="mode body"),
        element("path", d=polyline(_on_paper(way.positions)), class_="mode path"),
        *dots,
        element("path", d=strokes(keys()), class_="key"),
        element("text", "path; a bar is the body, at even times", x=20, y=28, class_="words"),
    ]


def speed_of(mode: str) -> list[str]:
    """Return a graph of the speed of the body's middle over time."""
    times = moments(FINE)
    positions = interpolate(TIMES, keys(), times, mode).positions
    speeds = np.linalg.norm(np.diff(positions, axis=0), axis=1) / np.diff(times)
    left, top, width, height = GRAPH
    across = left + width * 0.5 * (times[1:] + times[:-1]) / TIMES[-1]
    up = top + height * (1.0 - speeds / FASTEST)
    pieces = np.split(np.stack((across, up), axis=1), [FINE])
    ticks = [f"M{left + width * time / TIMES[-1]:.1f} {top}v{height}" for time in TIMES.tolist()]
    return [
        element("path", d=f"M{left} {top + height}h{width}" + "".join(ticks), class_="faint"),
        element("path", d="".join(map(polyline, pieces)), class_="mode path"),
        element("text", "speed of the middle", x=left, y=28, class_="words"),
        element("text", "time", x=left + width, y=top + height + 22, class_="words", text_anchor="end"),
        element("text", "0", x=left - 14, y=top + height + 5, class_="words"),
    ]


def moments(count: int) -> np.ndarray:
    """Return the times of `count` even steps in each segment."""
    return np.linspace(TIMES[0], TIMES[-1], count * (len(TIMES) - 1) + 1)


def strokes(poses: Poses) -> str:
    """Return the bars of bodies as an SVG path."""
    return "".join(map(polyline, _on_paper(bars(poses, HALF))))


def _on_paper(points: np.ndarray) -> np.ndarray:
    return np.stack((LEFT + SCALE * points[..., 0], BASE - SCALE * points[..., 1]), axis=-1)


if __name__ == "__main__":
    main()
