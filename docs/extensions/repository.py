"""Pages made from files elsewhere in the checkout, such as CHANGELOG.md, and links between them and docs/."""

from __future__ import annotations

import posixpath
import re
from pathlib import Path, PurePosixPath

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

HOME = {"README.md": "index"}
"""Files that the site replaces by another page, and the page."""

EXAMPLES = "lid", "sword", "hand", "dancer", "camera", "farm"

SHOWN = {
    "CONTRIBUTING.md": "contributing",
    "CHANGELOG.md": "changelog",
    "assets/README.md": "assets",
    "examples/README.md": "examples",
    **{f"examples/{name}/README.md": f"examples/{name}" for name in EXAMPLES},
    "examples/modes_in_python/README.md": "notebook",
}
"""Files and the pages of the site that show them. A page's own text in docs/ is only for people who read it there."""

PAGES = HOME | SHOWN

LINK = re.compile(r"(?<=\]\()(?![a-z]+:|#)([^)\s]+)")
"""The path in a link or picture of a Markdown file."""


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", read_elsewhere)
    app.connect("doctree-read", lead_to_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def read_elsewhere(app: Sphinx, page: str, source: list[str]) -> None:
    """Replace the text of a page by its file, with links made relative to docs/."""
    for name, shown_as in SHOWN.items():
        if shown_as == page:
            file = Path(app.srcdir).parent / name
            app.env.note_dependency(str(file), docname=page)
            source[0] = as_in_docs(file.read_text(encoding="utf-8"), posixpath.dirname(name), page)


def as_in_docs(text: str, folder: str, page: str) -> str:
    """Return the text of a file in a folder of the checkout, with links that work from the page's place in docs/."""
    place = posixpath.join("docs", posixpath.dirname(page))
    return LINK.sub(lambda link: posixpath.relpath(posixpath.join(folder, link[1]), place), text)


def lead_to_pages(app: Sphinx, doctree: nodes.document) -> None:
    """Turn links to files that the site shows as pages into links to these pages."""
    root = Path(app.srcdir).parent
    for link in [*doctree.findall(addnodes.download_reference), *doctree.findall(leads_outside)]:
        if isinstance(link, addnodes.pending_xref):
            path, anchor = f"{link['reftarget']}.md", link["reftargetid"]
        else:
            target, _, anchor = link["reftarget"].partition("#")
            _, path = app.env.relfn2path(target, app.env.docname)
        file = Path(path).resolve()
        name = str(PurePosixPath(*file.relative_to(root).parts)) if file.is_relative_to(root) else ""
        if name in PAGES:
            uri = app.builder.get_relative_uri(app.env.docname, PAGES[name]) + (f"#{anchor}" if anchor else "")
            link.replace_self(nodes.reference("", "", *link.children, refuri=uri, internal=True))


def leads_outside(node: nodes.Node) -> bool:
    """Return whether a node links to a Markdown file outside docs/, which MyST gives an absolute path and no page."""
    return (
        isinstance(node, addnodes.pending_xref)
        and node.get("refdomain") == "doc"
        and PurePosixPath(node["reftarget"]).is_absolute()
    )
