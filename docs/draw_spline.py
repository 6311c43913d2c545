"""Draw the effect of the bound on twists at keys: the same unevenly timed keys, without the bound and with it.

python docs/draw_spline.py
"""

from __future__ import annotations

import sys
from pathlib import Path
from unittest import mock

import numpy as np

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("", "addon", "scripts")]

from docs.drawing import bars, drawing, element, polyline, poses_of
from rigid_motion.motion import Poses, curves, interpolate
from rigid_motion_batch.files import write_text

FRAMES = np.array((1.0, 13.0, 14.0, 26.0, 38.0))
POINTS = np.array(((0.0, 0.0), (0.25, 0.16), (0.5, 0.2), (0.75, 0.16), (1.0, 0.0)))
DEGREES = 25.0 - 12.5 * np.arange(5)

WIDTH, HEIGHT = 720, 320
SCALE = 400.0
"""Pixels per metre."""

LEFT, BASE = 160.0, 230.0
"""Position of the first key, in pixels."""

HALF = 0.045
"""Half the length of the bar that represents the body, in metres."""

STYLE = """
.paper{fill:#fff}.ink{fill:#1b2026}.key{stroke:#1b2026;stroke-width:3}
.before{stroke:#c8322b;fill:none}.after{stroke:#1f6fb2;fill:none}.path{stroke-width:2.5}.body{stroke-width:1;opacity:.6}
.before-words{fill:#c8322b}.after-words{fill:#1f6fb2}
text{font:14px system-ui,"Segoe UI",Roboto,"Liberation Sans",sans-serif}
.halo{paint-order:stroke;stroke:#fff;stroke-width:4}
@media(prefers-color-scheme:dark){.paper{fill:#14181d}.ink{fill:#e6eaee}.key{stroke:#e6eaee}.halo{stroke:#14181d}
.before{stroke:#ff7a70}.after{stroke:#62b0f0}.before-words{fill:#ff7a70}.after-words{fill:#62b0f0}}
"""


def keys() -> Poses:
    """Return keys on an arch, at a steady pace except from the second key to the third, which takes one frame."""
    return poses_of(POINTS, DEGREES)


def parabola(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return the weight of the twist before a key, without a bound, from the durations of the segments around it."""
    return after / (before + after)


def main() -> None:
    """Write docs/spline.svg."""
    with mock.patch.object(curves, "twist_shares", parabola):
        before = motion("before")
    marks = [_key(frame, bar) for frame, bar in zip(FRAMES, _on_paper(bars(keys(), HALF)), strict=True)]
    picture = drawing(
        "The same keys with the parabola's twists, which loop out, and with bounded ones",
        STYLE,
        WIDTH,
        HEIGHT,
        element("rect", width=WIDTH, height=HEIGHT, class_="paper"),
        before,
        motion("after"),
        *marks,
        element("text", "before: the twists of the parabola through three keys", x=20, y=28, class_="before-words"),
        element("text", "now: the short segment counts no more than short / long", x=20, y=50, class_="after-words"),
        element("text", "keys at frames 1, 13, 14, 26 and 38; a bar a frame", x=20, y=HEIGHT - 16, class_="ink"),
    )
    write_text(DOCS / "spline.svg", picture)


def motion(name: str) -> str:
    """Return the path of the body's middle, and the body on every frame."""
    fine = interpolate(FRAMES, keys(), np.linspace(FRAMES[0], FRAMES[-1], 600), "motor_spline")
    frames = interpolate(FRAMES, keys(), np.arange(FRAMES[0], FRAMES[-1] + 1.0), "motor_spline")
    bodies = "".join(map(polyline, _on_paper(bars(frames, HALF))))
    path = polyline(_on_paper(fine.positions))
    return element("path", d=bodies, class_=f"{name} body") + element("path", d=path, class_=f"{name} path")


def _key(frame: float, bar: np.ndarray) -> str:
    x0, y0 = bar[0].round(1).tolist()
    words = element("text", f"{frame:.0f}", x=x0, y=y0 + 18, class_="ink halo", text_anchor="middle")
    return element("path", d=polyline(bar), class_="key") + words


def _on_paper(points: np.ndarray) -> np.ndarray:
    return np.stack((LEFT + SCALE * points[..., 0], BASE - SCALE * points[..., 1]), axis=-1)


if __name__ == "__main__":
    main()
