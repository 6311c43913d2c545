"""The directive `module-map`: all packages and modules of the program, with the first sentence of their docstrings."""

from __future__ import annotations

import ast
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

FOLDERS = "addon/rigid_motion", "scripts/rigid_motion_batch", "scripts/research"


class ModuleMap(SphinxDirective):
    """The map of modules; the directive's content is ignored: it is only for people who read the page as a file."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        root = Path(self.config.root_of_project)
        return [nodes.bullet_list("", *(item(root / folder, folder) for folder in FOLDERS))]


def item(path: Path, name: str) -> nodes.list_item:
    """Return an entry for a module, or for a folder and its contents."""
    source = path / "__init__.py" if path.is_dir() else path
    text = nodes.paragraph("", "", nodes.literal("", name), nodes.Text(f": {summary(source)}"))
    inside = [item(below, below.name) for below in sorted(path.iterdir()) if is_shown(below)] if path.is_dir() else []
    return nodes.list_item("", text, *([nodes.bullet_list("", *inside)] if inside else []))


def is_shown(path: Path) -> bool:
    """Return whether the map lists a path: a module or a package."""
    return (path.suffix == ".py" and path.stem != "__init__") or (path / "__init__.py").exists()


def summary(path: Path) -> str:
    """Return the first sentence of a module's docstring."""
    text = " ".join((ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n\n")[0].split())
    return f"{text.partition('. ')[0].rstrip('.')}."


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("module-map", ModuleMap)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
