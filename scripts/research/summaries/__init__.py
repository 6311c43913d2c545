"""The summary on top of the paper's page: every number in it is taken from the tables of the page itself."""

from __future__ import annotations

from collections.abc import Callable

from .on_top import with_summary
from .paper import of_paper

__all__ = ["SUMMARIES", "of_paper", "with_summary"]

SUMMARIES: dict[str, Callable[[str], list[str]]] = {"paper.md": of_paper}
"""By the page in docs/ that it is on top of."""
