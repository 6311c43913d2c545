"""Roles and hooks that render the project's docstrings, which are written for people who read the source.

`names` in single backquotes are code, and links if the site documents them. Bars mean lengths of vectors.
"""

from __future__ import annotations

import re
import sys

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.pycode import ModuleAnalyzer
from sphinx.roles import XRefRole

CODE = re.compile(r"(`[^`]*`)")
PAGE = re.compile(r"docs/([\w/]+)\.md")


class NameRole(XRefRole):
    """A reference that may have no target: docstrings also name parameters and private functions."""

    def process_link(
        self, env: BuildEnvironment, refnode: nodes.Element, has_explicit_title: bool, title: str, target: str
    ) -> tuple[str, str]:
        page = PAGE.fullmatch(target)
        if page and page[1] in env.found_docs:  # Other programs have files of the same names.
            refnode["refdomain"], refnode["reftype"], refnode["refexplicit"] = "std", "doc", True
            return title, f"/{page[1]}"
        refnode["refdomain"], refnode["reftype"], refnode["optional"] = "py", "obj", True
        refnode["py:module"], refnode["py:class"] = env.ref_context.get("py:module"), env.ref_context.get("py:class")
        refnode["refspecific"] = True
        return title, target.removesuffix("()")


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_role("name", NameRole())
    app.connect("missing-reference", leave_as_code)
    app.connect("autodoc-process-docstring", document_data, priority=100)
    app.connect("autodoc-process-docstring", keep_bars, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def leave_as_code(
    app: Sphinx, env: BuildEnvironment, node: addnodes.pending_xref, content: nodes.Element
) -> nodes.Element | None:
    """Keep names without a target as plain code, without a warning."""
    return content if node.get("optional") else None


def document_data(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Document data that a package imports by the string below it in its module, not by its type's docstring."""
    package, _, attribute = name.rpartition(".")
    modules = [module for module in sys.modules if module.startswith(f"{package}.")] if what == "data" else []
    for module in modules:
        documented = ModuleAnalyzer.for_module(module).find_attr_docs()
        if result := documented.get(("", attribute)):
            lines[:] = result
            return


def keep_bars(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Escape bars: |v| stays |v|, and is not read as a substitution."""
    for number, line in enumerate(lines):
        if not line.lstrip().startswith(">>>"):
            parts = CODE.split(line)
            lines[number] = "".join(part if i % 2 else part.replace("|", r"\|") for i, part in enumerate(parts))
