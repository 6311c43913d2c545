"""The summaries on top of the pages of figures: what was measured, what came out, and where it hurts.

Every number and every word that depends on one is taken from the tables of the page itself, so that a summary can be
made of a page that is there as well as of one that is being written. Where a page was made in parts, its summary is
about these.
"""

from __future__ import annotations

from collections.abc import Callable

from .in_blender import of_live, of_reduction, of_sub_frames
from .on_top import with_summary
from .paper import of_paper
from .speed import of_batch, of_speed

__all__ = [
    "SUMMARIES",
    "of_batch",
    "of_live",
    "of_paper",
    "of_reduction",
    "of_speed",
    "of_sub_frames",
    "with_summary",
]

SUMMARIES: dict[str, Callable[[str], list[str]]] = {"paper.md": of_paper}
"""By the page in docs/ that it is on top of."""
