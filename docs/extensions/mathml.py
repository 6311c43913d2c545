"""Formulas as MathML, converted by docutils: browsers render it without scripts, fonts or network."""

from __future__ import annotations

from itertools import pairwise
from xml.etree import ElementTree

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging

logger = logging.getLogger(__name__)

THIN = "0.167em"
"""The space around the name of a function, as in TeX."""


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (inline, None), (display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def inline(translator: nodes.NodeVisitor, node: nodes.math) -> None:
    """Write a formula within a line."""
    translator.body.append(mathml(node, display=False))
    raise nodes.SkipNode


def display(translator: nodes.NodeVisitor, node: nodes.math_block) -> None:
    """Write a formula in its own block, which scrolls if it is wider than the page."""
    opening = translator.starttag(node, "div", CLASS="math", tabindex="0")
    translator.body.append(f"{opening}{mathml(node, display=True)}</div>\n")
    raise nodes.SkipNode


def mathml(node: nodes.Element, *, display: bool) -> str:
    """Return the MathML of a formula. A formula that cannot be converted causes a warning and is shown as written."""
    try:
        result = tex2mathml(node.astext(), as_block=display)
    except MathError as error:
        logger.warning("formula %r: %s", node.astext(), error, location=node)
        return f"<code>{node.astext()}</code>"
    formula = ElementTree.fromstring(result.replace("<mo>&ApplyFunction;</mo>", ""))
    for element in formula.iter():
        element.tag = element.tag.rpartition("}")[2]
    for element in list(formula.iter()):
        space_names(element)
        close_bars(element)
    if not display:
        formula.attrib.pop("display", None)
    return ElementTree.tostring(formula, encoding="unicode")


def space_names(row: ElementTree.Element) -> None:
    """Put a thin space between the name of a function and its neighbours, which browsers do not do."""
    if row.tag not in ("math", "mrow", "mtd", "mstyle", "msqrt"):
        return
    children = list(row)
    for before, child in reversed(list(pairwise(children))):
        touching = (is_name(child) and ends(before)) or (is_name(before) and child.tag not in ("mo", "mspace"))
        if touching:
            row.insert(list(row).index(child), ElementTree.Element("mspace", width=THIN))


def is_name(element: ElementTree.Element) -> bool:
    """Return whether an element is the name of a function such as sin, or a power of it."""
    if element.tag in ("msup", "msub", "msubsup") and len(element):
        return is_name(element[0])
    return element.tag == "mi" and len(element.text or "") > 1


def ends(element: ElementTree.Element) -> bool:
    """Return whether an element can be a factor before a function's name: a closing bracket, but no sign or space."""
    return element.text == ")" if element.tag == "mo" else element.tag != "mspace"


def close_bars(element: ElementTree.Element) -> None:
    """Remove the space around a bar or slash."""
    if element.tag == "mo" and element.text in ("|", "/"):
        element.attrib |= {"lspace": "0", "rspace": "0"}
