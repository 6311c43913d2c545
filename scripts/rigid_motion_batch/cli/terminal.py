"""The result of a comparison in a terminal: a table of modes and errors, one sentence, the path of the report.

The numbers are those of the report. In a pipe the table is plain text without colours; `--json` prints it as data.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.report.numbers import MEASURES, RMS_IS, Numbers, digits, listed, who_else

RMS, WORST, KEYS = "rms_shell_m", "max_shell_m", "keys_per_s"
"""The measures in the table."""

PLACES = {measure.metric: place for place, measure in enumerate(MEASURES)}
"""Index of each measure in the numbers."""

DEFAULT_COLUMNS = 120
"""Width of output that is not a terminal, in characters."""


@dataclass(frozen=True)
class Line:
    """A line of the table: a motion under a choice of keys."""

    choice: str
    """The choice as a heading: "5 keys/s"."""

    modes: tuple[str, ...]
    """The ids of the modes that give this motion."""

    name: str
    """The name of the first of these modes."""

    rms_mm: float
    """The RMS shell error; over several clips their geometric mean."""

    worst_mm: float
    """The largest error of all clips."""

    keys_per_s: float | None
    """None for a motion from --against: its keys are unknown."""

    best: bool
    """Whether no other motion has a smaller error, or fewer keys if the choice is a tolerance."""


def lines_of(numbers: Numbers) -> list[Line]:
    """Return the lines of the table: choices from the fewest keys to the most, motions in the order of the modes."""
    mean, groups = numbers.mean(), numbers.groups()
    columns = [numbers.modes.index(group[0]) for group in groups]
    worst = np.nanmax(np.where(np.isnan(numbers.values[PLACES[WORST]]), -np.inf, numbers.values[PLACES[WORST]]), axis=0)
    lines = []
    for row, choice in enumerate(numbers.choices):
        rms, keys = mean[PLACES[RMS], row, columns], mean[PLACES[KEYS], row, columns]
        decide = keys if isinstance(choice, Tolerance) else rms
        # Values that are shown as equal are equally good.
        shown = [digits(value) for value in decide.tolist()]
        least = shown[int(np.nanargmin(decide))]
        lines += [
            Line(
                choice.title,
                group,
                numbers.label(group[0]),
                float(rms[place]),
                float(worst[row, columns[place]]),
                float(keys[place]) if np.isfinite(keys[place]) else None,
                len(groups) > 1 and shown[place] == least,
            )
            for place, group in enumerate(groups)
        ]
    return lines


def notes_below(numbers: Numbers) -> list[str]:
    """Return notes below the table: modes that are one motion, modes that go straight, and what the numbers mean."""
    groups = [[numbers.label(mode) for mode in group] for group in numbers.groups()]
    result = [f"{first} is also the motion of {listed(others)}." for first, *others in groups if others]
    return [*result, *filter(None, [who_else(numbers)]), RMS_IS]


def table_of(lines: Sequence[Line]) -> Table:
    """Return the table for a terminal; the best of each choice is marked with a star."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("Keys")
    table.add_column("Mode", overflow="fold")
    for name in ("RMS, mm", "worst, mm", "keys/s"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("")
    for place, line in enumerate(lines):
        first = place == 0 or lines[place - 1].choice != line.choice
        last = place + 1 == len(lines) or lines[place + 1].choice != line.choice
        table.add_row(
            line.choice if first else "",
            Text(line.name),
            digits(line.rms_mm),
            digits(line.worst_mm),
            digits(line.keys_per_s),
            "*" if line.best else "",
            style="bold green" if line.best else "",
            end_section=last,
        )
    return table


def show(*what: Table | str) -> None:
    """Print tables and lines; without colours if the stream is no terminal, or NO_COLOR is set."""
    stream = sys.stdout
    console = Console(file=stream, highlight=False, width=None if stream.isatty() else DEFAULT_COLUMNS)
    with console.capture() as captured:
        for item in what:
            console.print(item, markup=False, soft_wrap=isinstance(item, str) and not stream.isatty())
    print(*(line.rstrip() for line in captured.get().splitlines()), sep="\n", file=stream, flush=True)
