"""The figure of the shell error: a body as it was recorded and as a mode shows it, and the point that is off the most.

SVG, its ink and paper light or dark as whoever looks has it. Lengths are in metres, and every number in it is measured.
"""

from __future__ import annotations

import numpy as np

from research.markup import Content, Markup, element
from rigid_motion.motion import Poses, shell_error
from rigid_motion.motion.quaternions import rotate

from .table import RADIUS

TITLE = "The shell error: the farthest that any point in a ball around the origin is off"

WIDTH, HEIGHT = 760, 300
SCALE = 1100.0
"""Pixels to a metre."""

PLACE = np.array((150.0, 165.0))
"""Where the recorded origin is, in pixels."""

OFFSET = np.array((0.042, 0.014))
TURN = np.radians(26.0)
"""What the shown body is off by."""

POINTS = 24
"""Of the shell, whose ways are drawn."""

TOOL = 1e-3 * np.array(
    (
        *((-62, -16), (20, -16), (28, -6), (85, -6), (85, 6), (28, 6), (20, 16)),
        *((-28, 16), (-40, 66), (-68, 60), (-62, 16)),
    )
)
"""A drill, seen from the side, upside down as pixels are."""

STYLE = """
.paper{fill:#fff}.ink{fill:#1b2026}.soft{fill:#58626e}
.recorded{stroke:#6b7580;fill:none;stroke-width:1.5}.recorded.solid{fill:#c9ced4}.recorded-words{fill:#58626e}
.shown{stroke:#1f6fb2;fill:none;stroke-width:1.5}.shown.solid{fill:#1f6fb2;fill-opacity:.3}.shown-words{fill:#1f6fb2}
.dash{stroke-dasharray:5 4}.way{stroke:#8b95a1;stroke-width:1}.origin{stroke:#1b2026;stroke-width:2.5}
.farthest{stroke:#c8322b;stroke-width:4}.farthest-words{fill:#c8322b}.dot{fill:#c8322b}
text{font:15px system-ui,"Segoe UI",Roboto,"Liberation Sans",sans-serif}.bold{font-weight:600}
@media(prefers-color-scheme:dark){.paper{fill:#14181d}.ink{fill:#e6eaee}.soft,.recorded-words{fill:#a3aebb}
.recorded{stroke:#9aa5b2}.recorded.solid{fill:#434b55}.shown{stroke:#62b0f0}.shown.solid{fill:#62b0f0}
.shown-words{fill:#62b0f0}.way{stroke:#727d8a}.origin{stroke:#e6eaee}
.farthest{stroke:#ff7a70}.farthest-words{fill:#ff7a70}.dot{fill:#ff7a70}}
"""


def poses() -> tuple[Poses, Poses]:
    """As recorded, and as shown: one of each."""
    half = 0.5 * TURN
    turned = np.array(((np.cos(half), 0.0, 0.0, np.sin(half)),))
    recorded = Poses(np.zeros((1, 3)), np.array(((1.0, 0.0, 0.0, 0.0),)))
    return recorded, Poses(np.append(OFFSET, 0.0)[None], turned)


def error() -> float:
    """The shell error between them."""
    recorded, shown = poses()
    return float(shell_error(shown, recorded, RADIUS)[0])


def farthest() -> np.ndarray:
    """The point of the shell that is off the most: in the body's own axes, shape (2,).

    All points of the shell are off by the origin's way and a chord of their own, which goes into every direction: at
    one of them it goes where the origin went.
    """
    chord = np.arctan2(OFFSET[1], OFFSET[0]) - 0.5 * (np.pi + TURN)
    return RADIUS * np.array((np.cos(chord), np.sin(chord)))


def draw() -> str:
    """The figure."""
    recorded, shown = poses()
    angles = 2.0 * np.pi * np.arange(POINTS) / POINTS + np.arctan2(farthest()[1], farthest()[0])
    shell = RADIUS * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    ways = [_line(a, b, "way") for a, b in zip(_at(recorded, shell), _at(shown, shell), strict=True)]
    first, last = (_at(pose, farthest()[None])[0] for pose in (recorded, shown))
    origins = [_at(pose, np.zeros((1, 2)))[0] for pose in (recorded, shown)]
    parts: list[Content] = [
        element("title", TITLE),
        element("style", Markup(STYLE)),
        element("rect", width=WIDTH, height=HEIGHT, class_="paper"),
        *(_body(pose, name) for pose, name in ((recorded, "recorded"), (shown, "shown"))),
        *ways,
        _line(*origins, "origin"),
        _line(first, last, "farthest"),
        *(element("circle", cx=f"{x:.1f}", cy=f"{y:.1f}", r=4, class_="dot") for x, y in (first, last)),
        *_words(),
    ]
    size = {"viewBox": f"0 0 {WIDTH} {HEIGHT}", "width": WIDTH, "height": HEIGHT}
    return element("svg", *parts, xmlns="http://www.w3.org/2000/svg", role="img", **size) + "\n"


def _words() -> list[Markup]:
    origin, turn = float(np.linalg.norm(OFFSET)), 2.0 * RADIUS * np.sin(0.5 * TURN)
    lines = (
        ("recorded-words", "Grey: the body as it was recorded"),
        ("shown-words", "Blue: the same moment as a mode shows it"),
        ("soft", f"Circles: all within {_mm(RADIUS)} of its origin (--radius)"),
        ("soft", "Thin lines: how far points of it are off"),
        ("ink", f"Thick line: its origin, {_mm(origin)}"),
        ("farthest-words bold", f"Red line: the point off the most, {_mm(error())}"),
        ("farthest-words bold", "That is the shell error."),
        ("soft", f"{_mm(origin)} by its place and {_mm(turn)} by its turn"),
    )
    return [
        element("text", words, x=345, y=44 + 30 * number, class_=name) for number, (name, words) in enumerate(lines)
    ]


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.0f} mm"


def _body(pose: Poses, name: str) -> list[Markup]:
    outline = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in _at(pose, TOOL)) + "Z"
    ((x, y),) = _at(pose, np.zeros((1, 2)))
    return [
        element("path", d=outline, class_=f"{name} solid"),
        element("circle", cx=f"{x:.1f}", cy=f"{y:.1f}", r=f"{RADIUS * SCALE:.1f}", class_=f"{name} dash"),
    ]


def _line(start: np.ndarray, end: np.ndarray, name: str) -> Markup:
    ends = dict(zip(("x1", "y1", "x2", "y2"), (f"{value:.1f}" for value in (*start, *end)), strict=True))
    return element("line", **ends, class_=name)


def _at(pose: Poses, points: np.ndarray) -> np.ndarray:
    """Where points of the body (n, 2) are, in pixels."""
    solid = np.column_stack((points, np.zeros(len(points))))
    moved = pose.positions + rotate(np.broadcast_to(pose.quaternions, (len(points), 4)), solid)
    return PLACE + SCALE * moved[:, :2]
