"""HTML and SVG from Python: `element` escapes every string that is not itself the work of `element`.

So whatever a file, an object or a user is called, it reaches the page as text and never as markup. The output is
well-formed both as HTML and as XML; void elements such as `<br>` are not made here.
"""

from __future__ import annotations

import html
import re

_UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\ufffe\uffff\ud800-\udfff]")


class Markup(str):
    """A string that is markup already, and is put into other markup as it is."""

    __slots__ = ()


Content = str | int | float | None | list["Content"] | tuple["Content", ...]
"""What may stand inside an element. None is nothing at all."""


def escape(text: object) -> Markup:
    """Any text as markup that shows it, in an element as well as in an attribute.

    Control characters, and the halves of characters that stand for undecodable bytes in file names, become U+FFFD:
    they have no place in a page.
    """
    return text if isinstance(text, Markup) else Markup(html.escape(_UNPRINTABLE.sub("\ufffd", str(text))))


def join(content: Content) -> Markup:
    """Content as one piece of markup."""
    if content is None:
        return Markup()
    if isinstance(content, list | tuple):
        return Markup("".join(map(join, content)))
    return escape(content)


def element(name: str, *content: Content, **attributes: Content | bool) -> Markup:
    """An element with its attributes and content.

    Attributes are named as in Python: `class_`, `data_x` and `stroke_width` are class, data-x and stroke-width. One
    that is None or False is left out, one that is True stands alone.
    """
    written = "".join(
        f" {key.rstrip('_').replace('_', '-')}" + ("" if value is True else f'="{join(value)}"')
        for key, value in attributes.items()
        if value is not None and value is not False
    )
    return Markup(f"<{name}{written}>{join(content)}</{name}>")
