"""Formulas as MathML, by docutils' own converter: browsers set it by themselves, without scripts, fonts or network."""

from __future__ import annotations

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.math import get_node_equation_number, wrap_displaymath

logger = logging.getLogger(__name__)


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (inline, None), (display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def inline(translator: nodes.NodeVisitor, node: nodes.math) -> None:
    """A formula within a line."""
    translator.body.append(mathml(node, node.astext(), display=False))
    raise nodes.SkipNode


def display(translator: nodes.NodeVisitor, node: nodes.math_block) -> None:
    """A formula of its own, which scrolls where it is wider than the page."""
    text = node.astext()
    # Several lines that end in \\ are aligned, as in LaTeX; of a single one docutils wants no environment.
    if r"\\" in text and r"\begin" not in text:
        text = (
            wrap_displaymath(text, None, False).replace(r"\begin{equation}", "").replace(r"\end{equation}", "").strip()
        )
    number = ""
    if node["number"]:
        number = f'<span class="eqno">({get_node_equation_number(translator, node)})</span>'
    opening = translator.starttag(node, "div", CLASS="math", tabindex="0")
    translator.body.append(f"{opening}{number}{mathml(node, text, display=True)}</div>\n")
    raise nodes.SkipNode


def mathml(node: nodes.Element, text: str, *, display: bool) -> str:
    """The formula for browsers. One that cannot be set is a warning, and stays as it was written."""
    try:
        return tex2mathml(text, as_block=display)
    except MathError as error:
        logger.warning("formula %r: %s", text, error, location=node)
        return f"<code>{nodes.unescape(text)}</code>"
