"""The sequence diagram of the engines: what happens to an update, from the sender to the frame, in each algebra.

Drawn from the table of modes: every algebra that a mode is written out in (`Mode.reference`) is an alternative, and
names its modes. SVG, sized for a column: 480 units are 8.5 cm, so letters of 12 are 6 points. Ink and paper are light
or dark as whoever looks has it.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

from research.markup import Markup, element
from rigid_motion.motion import MODES
from rigid_motion_batch.palette import colour_of

from .streaming import PACKINGS

WIDTH = 480
LINE = 15
LETTERS = 66
"""Of a line of small print."""

SENDER, RECEIVER, DISPLAY = 52, 240, 428
"""Where the lifelines stand."""

STYLE = """
.paper{fill:#fff}.ink{fill:#1b2026}.soft{fill:#58626e}.line{stroke:#58626e;stroke-width:1;fill:none}
.box{fill:#f5f6f8;stroke:#58626e}.tab{fill:#e3e7ec;stroke:#58626e}.head{fill:#1b2026}
text{font:12px system-ui,"Segoe UI",Roboto,"Liberation Sans",sans-serif}
.small{font-size:11px}.halo{paint-order:stroke;stroke:#fff;stroke-width:5}.bold{font-weight:600}
.code{font-family:ui-monospace,Consolas,"Liberation Mono",monospace;font-size:11px}
@media(prefers-color-scheme:dark){
.paper{fill:#14171c}.ink,.head{fill:#e6eaf0}.soft{fill:#a3aebb}.line,.box,.tab{stroke:#9aa5b2}
.box{fill:#1d2128}.tab{fill:#303742}.halo{stroke:#14171c}}
"""


@dataclass(frozen=True)
class Engine:
    """What the paper's receiver does in one algebra, step by step."""

    title: str
    encode: str
    extract: str


ENGINES = {
    "vector_quaternion": Engine("Vector + quaternion (state of the art)", "v and q as sent", "v and q as they are"),
    "dual_quaternions": Engine(
        "Dual quaternions", "d = A + εB with A = q, B = v q / 2", "q = A, v the vector part of 2 B A*"
    ),
    "pga": Engine(
        "Multivectors, 3D PGA", "M = T R with T = 1 - e0 v / 2", "R from e0 M = e0 R, then T = M R⁻¹, v and q from them"
    ),
    "cga": Engine(
        "Multivectors, 3D CGA",
        "M = T R S with T = 1 - v (e4 + e5) / 2",
        "R and S from their blades, T = M (R S)⁻¹, v and q from them",
    ),
}
"""Module of `rigid_motion.motion.algebras` to its engine."""


def engines() -> dict[str, tuple[str, ...]]:
    """The algebras in the order of the table of modes, each with its modes."""
    found: dict[str, list[str]] = {}
    for mode, row in MODES.items():
        found.setdefault(row.reference.__module__.rpartition(".")[2], []).append(mode)
    return {algebra: tuple(modes) for algebra, modes in found.items()}


def draw() -> str:
    """The diagram as the text of an SVG file."""
    diagram = _Diagram()
    diagram.gap(18)
    diagram.message(SENDER, RECEIVER, f"update: v, q ({PACKINGS['double'].size} bytes)")
    diagram.note("so many times a second; each waits until its segment is shown")
    diagram.gap(6)
    diagram.note("at every frame, with u from 0 to 1 between two updates, one of:")
    for number, (algebra, modes) in enumerate(engines().items()):
        engine = ENGINES.get(algebra) or Engine(algebra, "as the algebra has it", "v and q")
        diagram.alternative(engine, modes, first=number == 0)
    diagram.close()
    diagram.message(RECEIVER, DISPLAY, "frame: v, q")
    diagram.gap(10)
    return diagram.svg()


class _Diagram:
    """Draws downwards."""

    def __init__(self) -> None:
        self.parts: list[Markup] = []
        self.y = 52.0
        self.frame_top = 0.0

    def gap(self, height: float) -> None:
        self.y += height

    def message(self, start: float, end: float, text: str) -> None:
        """An arrow from one lifeline to one on its right."""
        self.y += LINE
        self.parts.append(self._words((start + end) / 2, self.y - 5, text, "ink", anchor="middle"))
        self.parts.append(element("path", d=f"M{start} {self.y}H{end - 7}", class_="line"))
        self.parts.append(element("path", d=f"M{end} {self.y}L{end - 7} {self.y - 4}V{self.y + 4}z", class_="head"))
        self.y += 6

    def note(self, text: str) -> None:
        """Small print below a message."""
        self.y += LINE
        self.parts.append(self._words(WIDTH / 2, self.y, text, "soft small halo", anchor="middle"))

    def alternative(self, engine: Engine, modes: tuple[str, ...], *, first: bool) -> None:
        """What one engine does."""
        if first:
            self.y += 10
            self.frame_top = self.y
        top = self.y
        lines: list[Markup] = []
        if not first:
            lines.append(element("path", d=f"M8 {top}H{WIDTH - 8}", class_="line", stroke_dasharray="5 4"))
        if first:
            lines.append(element("path", d=f"M8 {top}h34v14l-8 8h-26z", class_="tab"))
            lines.append(self._words(15, top + 15, "alt", "ink bold"))
        self.y += 17
        lines.append(self._words(52, self.y, f"[{engine.title}]", "ink bold"))
        for label, text in (("encode", engine.encode), ("extract", engine.extract)):
            if label == "extract":
                for mode in modes:
                    lines += self._mode(mode)
            self.y += LINE + 3
            lines.append(self._words(20, self.y, label, "ink"))
            lines.append(self._words(72, self.y, text, "ink"))
        self.y += 9
        self.parts += lines

    def close(self) -> None:
        """The frame around the alternatives, beneath them."""
        frame = element(
            "rect", x=8, y=self.frame_top, width=WIDTH - 16, height=self.y - self.frame_top, rx=2, class_="box"
        )
        self.parts.insert(0, frame)
        self.gap(6)

    def svg(self) -> str:
        height = round(self.y + 12)
        lifelines = [
            element("path", d=f"M{x} 40V{height - 6}", class_="line", stroke_dasharray="3 3")
            for x in (SENDER, RECEIVER, DISPLAY)
        ]
        heads = [
            [
                element("rect", x=x - 46, y=12, width=92, height=28, rx=4, class_="tab"),
                self._words(x, 30, name, "ink bold", anchor="middle"),
            ]
            for x, name in ((SENDER, "Sender"), (RECEIVER, "Receiver"), (DISPLAY, "Display"))
        ]
        return element(
            "svg",
            element("title", "Sequence diagram of the engines"),
            element("style", Markup(STYLE)),
            element("rect", width=WIDTH, height=height, class_="paper"),
            lifelines,
            heads,
            self.parts,
            xmlns="http://www.w3.org/2000/svg",
            viewBox=f"0 0 {WIDTH} {height}",
            width=WIDTH,
            height=height,
            role="img",
        )

    def _mode(self, mode: str) -> list[Markup]:
        row = MODES[mode]
        self.y += LINE + 4
        said = row.description
        if row.is_smooth:
            said += f". Takes the {row.behind} before the two as well, and the {row.ahead} after them"
        lines = [
            element("rect", x=20, y=self.y - 9, width=9, height=9, rx=2, fill=colour_of(mode)),
            self._words(36, self.y, [element("tspan", mode, class_="code bold"), f"  {row.label}"], "ink"),
        ]
        for line in textwrap.wrap(said, LETTERS):
            self.y += LINE - 1
            lines.append(self._words(36, self.y, line, "soft small"))
        return lines

    @staticmethod
    def _words(x: float, y: float, content: str | list, class_: str, anchor: str = "start") -> Markup:
        return element("text", content, x=x, y=y, class_=class_, text_anchor=None if anchor == "start" else anchor)
