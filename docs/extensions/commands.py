"""The directive `command`: the description and options of a command, taken from its --help."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

READER = Path(__file__).with_name("help_of.py")

TITLE = re.compile(r"(?m)^(\w[\w ,-]*):\n(?=  )")
"""The start of a section of an epilog: a title of a few words on its own line, followed by indented lines."""


class Command(SphinxDirective):
    """The help of a script or package: `{command} scripts/stream.py send`, `{command} rigid_motion_batch tasks`."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        asked, *subcommands = self.arguments[0].split()
        root = Path(self.config.root_of_project)
        if asked.endswith(".py"):
            self.env.note_dependency(str(root / asked))
        told = help_of(root, asked, *subcommands)
        name = "-".join([*([Path(asked).stem] if asked.endswith(".py") else []), *subcommands])
        usage = re.sub(r"\n\s+", "\n    ", told["usage"])
        result = [*prose(told["description"]), nodes.literal_block(usage, usage, language="text")]
        result += [option_list(name, group["options"]) for group in told["groups"]]
        return result + epilog(told["epilog"])


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_config_value("root_of_project", "", "env")
    app.add_directive("command", Command)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def help_of(root: Path, asked: str, *subcommands: str) -> dict:
    """Return the output of `help_of.py` for a script or package of the checkout at `root`."""
    environment = {**os.environ, "COLUMNS": "80", "NO_COLOR": "1", "PYTHONPATH": str(root / "scripts")}
    run = [sys.executable, str(READER), str(root / asked) if asked.endswith(".py") else asked, *subcommands]
    done = subprocess.run(run, capture_output=True, text=True, encoding="utf-8", env=environment)
    if done.returncode != 0:
        raise ExtensionError(f"{asked} has no help to give:\n{done.stderr}")
    return json.loads(done.stdout.splitlines()[-1])  # Blender may have printed lines before it.


def option_list(name: str, options: list[dict[str, str]]) -> nodes.definition_list:
    """Return a list of options with their help, each with an anchor such as `#compare-rates`."""
    listed = nodes.definition_list(classes=["options"])
    for option in options:
        term = nodes.term("", "", nodes.literal(option["written"], option["written"]))
        longest = max(re.findall(r"--?[\w-]+", option["written"]), default=option["written"], key=len)
        term["ids"] = [f"{name}-{nodes.make_id(longest)}"]
        meaning = nodes.definition("", nodes.paragraph("", "", *inline_code(option["help"])))
        listed += nodes.definition_list_item("", term, meaning)
    return listed


def epilog(text: str) -> list[nodes.Node]:
    """Return the sections of an epilog with their titles: examples as literal blocks, everything else as text."""
    first, *parts = TITLE.split(text.strip("\n"))
    result = prose(first)
    for title, body in zip(parts[::2], parts[1::2], strict=True):
        indented = re.match(r"(?:  .*\n?|\n)*", body).group()
        result.append(nodes.rubric(title, title[0].upper() + title[1:]))
        result += prose(textwrap.dedent(indented)) + prose(body[len(indented) :])
    return result


def prose(text: str) -> list[nodes.Node]:
    """Return paragraphs; indented text, typed commands and columns become literal blocks."""
    result: list[nodes.Node] = []
    for block in re.split(r"\n\s*\n", text.strip("\n")):
        if not block.strip():
            continue
        if re.search(r"(?m)^(\s|python |blender )|\S   +\S", block):
            lines = textwrap.dedent(block)
            result.append(nodes.literal_block(lines, lines, language="text"))
        else:
            result.append(nodes.paragraph("", "", *inline_code(block)))
    return result


def inline_code(text: str) -> list[nodes.Node]:
    """Return text whose parts in backquotes are code."""
    parts = text.split("`")
    return [nodes.literal(part, part) if i % 2 else nodes.Text(part) for i, part in enumerate(parts) if part]
