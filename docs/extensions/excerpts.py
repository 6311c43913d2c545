"""Search excerpts for a site opened from a folder, where browsers do not let one page read another.

The text of all pages is written to a script that only the search page loads (static/site.js).
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from sphinx.application import Sphinx

MAIN = re.compile(r'<article role="main".*?</article>', re.S)
"""The part of a page from which Sphinx's own search takes excerpts."""

WITHOUT_TEXT = re.compile(
    r'<(svg|script|style)\b.*?</\1>|<a class="headerlink".*?</a>'
    r"|<(?![^>]*\sid=|/?(?:section|article|dt|dd|dl|p)\b)[^>]*>",
    re.S,
)
"""Elements and tags that an excerpt does not need, neither for its text nor for its anchors."""


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("build-finished", write_texts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def write_texts(app: Sphinx, exception: Exception | None) -> None:
    """Write `_static/texts.js`, which maps the address of each page to its main content."""
    if exception is not None or app.builder.name != "html":
        return
    texts = {}
    for document in sorted(app.env.found_docs):
        uri = app.builder.get_target_uri(document)
        main = MAIN.search((Path(app.outdir) / uri).read_text(encoding="utf-8"))
        texts[uri] = WITHOUT_TEXT.sub("", main[0])
    script = f"const PAGE_TEXTS = {json.dumps(texts, ensure_ascii=False)};\n"
    (Path(app.outdir) / "_static" / "texts.js").write_text(script, encoding="utf-8")
