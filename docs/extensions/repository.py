"""Links from pages to files of the checkout: to the page that a file became, or else to a copy of the file."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

PAGES = {
    "README.md": "index",
    "CONTRIBUTING.md": "contributing",
    "CHANGELOG.md": "changelog",
    "assets/README.md": "assets",
    "examples/modes_in_python/README.md": "notebook",
}
"""Files outside docs/ to the pages of the site that show them."""


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("doctree-read", lead_to_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def lead_to_pages(app: Sphinx, doctree: nodes.document) -> None:
    """Turn links to files that are pages of the site into links to these pages."""
    root = Path(app.srcdir).parent
    for link in list(doctree.findall(addnodes.download_reference)):
        target, _, anchor = link["reftarget"].partition("#")
        _, path = app.env.relfn2path(target, app.env.docname)
        file = Path(path).resolve()
        name = str(PurePosixPath(*file.relative_to(root).parts)) if file.is_relative_to(root) else ""
        if name in PAGES:
            uri = app.builder.get_relative_uri(app.env.docname, PAGES[name]) + (f"#{anchor}" if anchor else "")
            link.replace_self(nodes.reference("", "", *link.children, refuri=uri, internal=True))
