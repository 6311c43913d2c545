"""Directives that describe the interpolation modes, all generated from the table `MODES`.

`mode-loops` shows each mode as a film, `mode-details` gives details for programmers, `mode-table` lists all modes.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from rigid_motion.motion import MODES, Mode, Poses, interpolate, shell_error

from .videos import make_video

DETAILS = "reference/modes"
"""The page with `mode-details`."""

LOOPS = "modes"
"""The page with `mode-loops`."""

CONVENTIONS = "conventions"

SAME = 1e-9
"""The largest shell error between two motions that count as the same motion."""


class ModeDirective(SphinxDirective):
    """A directive whose content is ignored: it is only for people who read the page as a file."""

    has_content = True


class ModeLoops(ModeDirective):
    """A section for each mode: its film and its description."""

    def run(self) -> list[nodes.Node]:
        return [self.section(name, mode) for name, mode in MODES.items() if not mode.is_reference]

    def section(self, name: str, mode: Mode) -> nodes.section:
        film = make_video(f"modes/{name}.mp4", f"modes/{name}.png", f"{mode.label}: {mode.description}")
        for_streams = " It is for streams: keys have better modes." if mode.for_streams else ""
        text = nodes.paragraph("", f"{mode.description}.{for_streams} In programs: ")
        text += link(self, f"{DETAILS}#{anchor(name)}", nodes.literal(name, name))
        return nodes.section("", nodes.title("", mode.label), film, text, ids=[f"loop-{anchor(name)}"])


class ModeDetails(ModeDirective):
    """A section for each mode: its name in programs, path and speed, the keys it uses, and related modes."""

    def run(self) -> list[nodes.Node]:
        alike = same_motions(MODES)
        return [self.section(name, mode, alike[name]) for name, mode in MODES.items()]

    def section(self, name: str, mode: Mode, same: list[str]) -> nodes.section:
        title = nodes.title("", "", nodes.literal(name, name))
        label = nodes.paragraph("", "", nodes.strong("", mode.label), nodes.Text(f". {mode.description}."))
        picture = nodes.image(uri=f"/modes/{name}.svg", alt=f"Path and speed of {name} between the same keys")
        facts = nodes.field_list()
        facts += fact("Looks at", nodes.Text(keys_it_looks_at(mode)))
        facts += fact("In files", nodes.literal("", str(mode.number)))
        facts += fact(
            "Fast form", code(mode.curves), nodes.Text("; a pair of poses in its algebra: "), code(mode.reference)
        )
        if same:
            others = joined(link(self, f"{DETAILS}#{anchor(other)}", nodes.literal("", other)) for other in same)
            facts += fact("The same motion", *others, nodes.Text(", without scaling"))
        formula = link(self, f"{CONVENTIONS}#{anchor(name)}", nodes.Text("its formula"))
        film = [link(self, f"{LOOPS}#loop-{anchor(name)}", nodes.Text("as a film")), nodes.Text("; ")]
        others = (other for other in MODES if other != name and other not in same)
        rest = joined(link(self, f"{DETAILS}#{anchor(other)}", nodes.literal("", other)) for other in others)
        facts += fact("See also", formula, nodes.Text(", "), *(() if mode.is_reference else film), *rest)
        return nodes.section("", title, label, picture, facts, ids=[anchor(name)])


class ModeTable(ModeDirective):
    """A table with one row for each mode."""

    def run(self) -> list[nodes.Node]:
        head = ("Mode", "In menus and reports", "What it does")
        rows = [
            (link(self, f"{DETAILS}#{anchor(name)}", nodes.literal("", name)), nodes.Text(mode.label), mode.description)
            for name, mode in MODES.items()
        ]
        return [table(head, rows)]


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("mode-loops", ModeLoops)
    app.add_directive("mode-details", ModeDetails)
    app.add_directive("mode-table", ModeTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def anchor(mode: str) -> str:
    """Return the anchor of a mode on each of the pages."""
    return f"mode-{mode.replace('_', '-')}"


def same_motions(modes: Iterable[str]) -> dict[str, list[str]]:
    """Return, for each mode, the modes with the same motion on random keys without scaling."""
    draw = np.random.default_rng(0)
    keys = Poses(draw.normal(size=(8, 3)), draw.normal(size=(8, 4)))
    times = np.linspace(0.0, 7.0, 141)
    shown = {mode: interpolate(np.arange(8.0), keys, times, mode) for mode in modes}
    return {
        mode: [other for other in shown if other != mode and shell_error(shown[other], poses).max() < SAME]
        for mode, poses in shown.items()
    }


def keys_it_looks_at(mode: Mode) -> str:
    """Return a description of the keys that a mode uses."""
    if mode.is_reference:
        return "all keys of a channel, those far away ever less"
    around = [f"{count} {where}" for count, where in ((mode.behind, "before"), (mode.ahead, "after")) if count]
    return "the two keys of a segment" + (f", {' and '.join(around)}" if around else "")


def link(directive: SphinxDirective, target: str, content: nodes.Node) -> nodes.reference:
    """Return a link to an anchor on another page."""
    page, _, place = target.partition("#")
    uri = directive.env.app.builder.get_relative_uri(directive.env.docname, page)
    return nodes.reference("", "", content, refuri=f"{uri}#{place}", internal=True)


def code(function: object) -> nodes.literal:
    """Return the full name of a function as code."""
    return nodes.literal("", f"{function.__module__}.{function.__qualname__}")


def fact(name: str, *content: nodes.Node) -> nodes.field:
    return nodes.field("", nodes.field_name("", name), nodes.field_body("", nodes.paragraph("", "", *content)))


def joined(links: Iterable[nodes.Node]) -> list[nodes.Node]:
    """Return nodes with commas between them."""
    listed = [node for item in links for node in (nodes.Text(", "), item)]
    return listed[1:]


def table(head: Iterable[str], rows: Iterable[Iterable[nodes.Node | str]]) -> nodes.table:
    """Return a table with this head and these rows."""
    head = tuple(head)
    group = nodes.tgroup(cols=len(head))
    group += [nodes.colspec(colwidth=1) for _ in head]
    group += nodes.thead("", _row(map(nodes.Text, head)))
    group += nodes.tbody("", *map(_row, rows))
    return nodes.table("", group)


def _row(cells: Iterable[nodes.Node | str]) -> nodes.row:
    contents = (nodes.Text(cell) if isinstance(cell, str) else cell for cell in cells)
    return nodes.row("", *(nodes.entry("", nodes.paragraph("", "", content)) for content in contents))
