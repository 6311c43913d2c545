"""The report: numbers of a run to a page, one file that needs no network. It measures nothing.

- `write_report` writes a page on some clips (at most `ON_ONE_PAGE` are wanted on one): the verdict, the viewer linked
  with the chart of the error over time, one table, the films, and the rest folded. A page of one clip among many is
  the same, with a way back to the overview.
- `write_overview` writes the page of many clips, sorted by what matters, that leads to theirs.
- `verdict` is the sentence alone, of `Gathering.numbers()`, for the terminal.

What is shown comes as `ClipResult` (analysis); clips are gone through once, one in memory at a time. A colour is in
`palette` or `templates/page.css`, a chart in `charts`, the sentence in `verdict`, the viewer in `viewer/`.
"""

from __future__ import annotations

from .mesh import Mesh
from .numbers import Gathering, Numbers
from .pages import ON_ONE_PAGE, Films, Settings, write_overview, write_report
from .verdict import Verdict, verdict

__all__ = [
    "ON_ONE_PAGE",
    "Films",
    "Gathering",
    "Mesh",
    "Numbers",
    "Settings",
    "Verdict",
    "verdict",
    "write_overview",
    "write_report",
]
