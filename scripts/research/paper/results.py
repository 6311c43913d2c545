"""The results of a run, as its files hold them: what the page is written from."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rigid_motion_batch.rows import read_rows

from . import claims, strips, triangle
from .bandwidths import Bandwidth
from .bodies_section import BodyResults
from .bows import Bow
from .catching import View
from .motions import ASSETS, RECORDINGS, Motion
from .sending import SentNeeded
from .table import UNIFORM, YARDSTICKS, LookAhead, Needed
from .timing import Timing


@dataclass(frozen=True, eq=False)
class Results:
    """What the files of a run hold."""

    run: dict[str, Any]
    motions: list[Motion]
    needed: list[Needed]
    look_ahead: list[LookAhead]
    bows: list[Bow]
    timings: list[Timing]
    bandwidths: list[Bandwidth]
    views: list[View]
    steps: list[triangle.Step]
    instants: list[strips.Instant]
    pictures: frozenset[str]
    """Those that there are, as paths below the folder."""

    of_bodies: BodyResults = field(default_factory=BodyResults)
    sending: list[SentNeeded] = field(default_factory=list)

    @classmethod
    def read(cls, reads: Callable[[str], Path], there: Iterable[str]) -> Results:
        """Read the files of a run, of which these are there; `reads` takes a name to where the file is."""
        files = frozenset(there)

        def rows(name: str, kind: type) -> list:
            return read_rows(reads(name), kind) if name in files else []

        return cls(
            run=json.loads(reads("run.json").read_text(encoding="utf-8")) if "run.json" in files else {},
            motions=rows("clips.csv", Motion),
            needed=rows("table.csv", Needed),
            look_ahead=rows("look_ahead.csv", LookAhead),
            bows=rows("bows.csv", Bow),
            timings=rows("timing.csv", Timing),
            bandwidths=rows("bandwidth.csv", Bandwidth),
            views=rows("catching.csv", View),
            steps=rows("triangle.csv", triangle.Step),
            instants=rows("strips.csv", strips.Instant),
            pictures=frozenset(name for name in files if name.endswith((".png", ".svg", ".mp4"))),
            of_bodies=BodyResults.read(reads, files),
            sending=rows("sending.csv", SentNeeded),
        )

    @property
    def sets(self) -> list[str]:
        """The sets of clips that count, the telling one first: other people's recordings, where there are any."""
        counted = {motion.of for motion in self.motions if not motion.left_out}
        return [one for one in (RECORDINGS, ASSETS) if one in counted]

    def cell(self, clips: str, updates: int, mode: str, decimation: str, yardstick: str) -> Needed | None:
        """A cell of the table."""
        key = (clips, updates, mode, decimation, yardstick)
        return next(
            (one for one in self.needed if (one.clips, one.updates, one.mode, one.decimation, one.yardstick) == key),
            None,
        )

    def saved(self, mode: str, decimation: str = UNIFORM) -> list[float]:
        """What a mode saves of the bandwidth, row by row of the paper's table: the telling set, the first yardstick."""
        first = next(iter(YARDSTICKS))
        cells = [self.cell(self.sets[0], row.state_of_the_art, mode, decimation, first) for row in claims.TABLE]
        return [cell.saved if cell else float("nan") for cell in cells]

    def timing(self, reading: str, pace: str, mode: str, row: claims.Row = claims.TABLE[0]) -> Timing | None:
        """One engine in one race, in a row of the paper's table."""
        key = (reading, pace, mode, row.state_of_the_art)
        return next(
            (one for one in self.timings if (one.reading, one.pace, one.mode, one.reference_updates) == key), None
        )
