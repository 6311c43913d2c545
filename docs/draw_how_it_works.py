"""Draw the four steps from keys through a mode to Blender's playback: a hammer that a hand holds by its grip.

python docs/draw_how_it_works.py
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("", "addon", "scripts")]

from docs.drawing import bars, drawing, element, polyline, poses_of
from rigid_motion.motion import Poses, interpolate
from rigid_motion_batch.files import write_text

FRAMES = np.array((1.0, 9.0))
DEGREES = np.array((65.0, -65.0))
HALF = 0.5
"""Half the length of the hammer, in metres. Its origin is in the middle, the hand at its lower end."""

PANEL = np.array((300.0, 250.0))
"""Width and height of each of the four panels, in pixels."""

SCALE, BASE = 105.0, np.array((150.0, 185.0))
"""Pixels per metre, and the position of the hand in a panel, in pixels."""

STYLE = """
.paper{fill:#fff}.ink{fill:#1b2026}.frame{fill:none;stroke:#1b2026;opacity:.25}
.key{stroke:#1b2026;fill:none;stroke-width:4}.dot{fill:#1b2026}
.native{stroke:#8a94a3;fill:none;stroke-width:2}.mode{stroke:#1f6fb2;fill:none;stroke-width:2.5}
.added{fill:#1f6fb2;opacity:.15}.mode-words{fill:#1f6fb2}.native-words{fill:#77818f}
text{font:17px system-ui,"Segoe UI",Roboto,"Liberation Sans",sans-serif}.title{font-weight:600}
@media(prefers-color-scheme:dark){.paper{fill:#14181d}.ink,.dot{fill:#e6eaee}.key,.frame{stroke:#e6eaee}
.mode{stroke:#62b0f0}.added,.mode-words{fill:#62b0f0}.native-words{fill:#a3adba}}
"""


def main() -> None:
    """Write docs/how_it_works.svg."""
    angles = np.radians(DEGREES)
    keys = poses_of(HALF * np.stack((-np.sin(angles), np.cos(angles)), axis=1), DEGREES)
    native, screw = (_in_betweens(keys, mode, 7) for mode in ("bezier", "dq_sclerp"))
    hand = element("circle", cx=BASE[0], cy=BASE[1], r=7, class_="dot")
    width, height = (2 * PANEL).tolist()
    picture = drawing(
        "Two keys, a mode between them, the curve that it becomes, and what plays that curve",
        STYLE,
        round(width),
        round(height),
        element("rect", width=width, height=height, class_="paper"),
        _panel(0, "1 Keys", _hammers(keys, "key") + hand + _words("You set two poses.", 225, "ink")),
        _panel(
            1,
            "2 Mode",
            _hammers(native, "native")
            + _hammers(screw, "mode")
            + hand
            + _words("Screw: the grip stays", 62, "mode-words"),
        ),
        _panel(2, "3 Curve", _graph(keys)),
        _panel(3, "4 Blender", "".join(_words(text, 62 + 30 * i, "ink") for i, text in enumerate(PLAYERS))),
    )
    write_text(DOCS / "how_it_works.svg", picture)


PLAYERS = (
    "plays the curve anywhere:",
    "viewport and renders",
    "Graph Editor, drivers, NLA",
    "exporters and farms",
    "without the extension",
)


def _in_betweens(keys: Poses, mode: str, count: int) -> Poses:
    return interpolate(FRAMES, keys, np.linspace(*FRAMES, count), mode)


def _hammers(poses: Poses, class_: str) -> str:
    """Return the outlines of hammers: a handle from grip to head, with the head across it."""
    handles = bars(poses, HALF)
    along = handles[:, 1] - handles[:, 0]
    across = 0.16 * np.stack((-along[:, 1], along[:, 0]), axis=1)
    heads = np.stack((handles[:, 1] - across, handles[:, 1] + across), axis=1)
    lines = "".join(polyline(BASE + SCALE * line * (1, -1)) for line in (*handles, *heads))
    return element("path", d=lines, class_=class_)


def _graph(keys: Poses) -> str:
    """Return a graph of the Z Location F-curve as Blender interpolates it and by the mode, the difference shaded."""
    frames = 30.0 + np.linspace(0.0, 240.0, 60)
    native, mode = (
        np.stack((frames, 235.0 - 240.0 * _in_betweens(keys, name, 60).positions[:, 1]), axis=1)
        for name in ("bezier", "dq_sclerp")
    )
    ends = "".join(element("circle", cx=x, cy=round(y, 1), r=5, class_="dot") for x, y in (native[0], native[-1]))
    return (
        element("path", d=polyline(np.concatenate((native, mode[::-1]))), class_="added")
        + element("path", d=polyline(native), class_="native")
        + element("path", d=polyline(mode), class_="mode")
        + ends
        + _words("Z Location by Screw", 62, "mode-words")
        + _words("what the mode adds", 164, "mode-words")
        + _words("Blender's in-betweens", 212, "native-words")
    )


def _words(text: str, y: float, class_: str) -> str:
    return element("text", text, x=150, y=y, class_=class_, text_anchor="middle")


def _panel(number: int, title: str, content: str) -> str:
    x, y = (PANEL * (number % 2, number // 2)).tolist()
    frame = element("rect", x=5, y=5, width=PANEL[0] - 10, height=PANEL[1] - 10, rx=8, class_="frame")
    heading = element("text", title, x=18, y=30, class_="ink title")
    return element("g", frame, heading, content, transform=f"translate({x:.0f} {y:.0f})")


if __name__ == "__main__":
    main()
