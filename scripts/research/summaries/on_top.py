"""Where a summary goes on a page, and how it is put together and worded."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Sequence

BEGIN, END = "<!-- summary -->", "<!-- end of summary -->"

WIDTH = 120
"""Of a page's lines."""

Fact = Callable[[str], str]
"""A sentence or a few about a page. It raises LookupError where the page has not got the table."""


def with_summary(page: str, lines: Sequence[str]) -> str:
    """A page with these lines below its title, in place of the summary that it had."""
    title, _, rest = page.partition("\n")
    before, found, after = rest.partition(BEGIN)
    if found:
        rest = before + after.partition(END)[2]
    block = "\n".join((BEGIN, "", *lines, "", END))
    return f"{title}\n\n{block}\n\n{rest.lstrip()}" if lines else f"{title}\n\n{rest.lstrip()}"


def facts(page: str, facts: Iterable[Fact]) -> list[str]:
    found = []
    for fact in facts:
        try:
            said = fact(page)
        except LookupError:
            continue
        found += textwrap.wrap(
            f"- {said}", WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
        )
    return found


def span(values: Sequence[float], decimals: int = 1) -> str:
    low, high = f"{min(values):.{decimals}f}", f"{max(values):.{decimals}f}"
    return low if low == high else f"{low} to {high}"


def percent_more(ratio: float, less: str = "less") -> str:
    return f"{abs(ratio - 1.0):.0%} {'more' if ratio >= 1.0 else less}"
