"""Progress of a command: a bar drawn by rich on a terminal; elsewhere, as in a log, a plain line now and then.

Blender's own Python lacks rich, and prints plain lines on a terminal too. Times are in seconds.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Self, TextIO, cast

from rigid_motion_batch.command_line import printable

FARM_VARIABLE = "RIGID_MOTION_PROGRESS"
"""Environment variable: "openjd" if a render farm reads the progress lines of Open Job Description."""

BAR_COLUMNS = 24

LINE_INTERVAL_S = 10.0
"""Seconds between two plain lines."""


class Stage:
    """A part of the work, of `total` steps. Created by `Progress.stage`."""

    def __init__(self, title: str, total: float, redraw: Callable[[], None]) -> None:
        self.title, self.total = title, total
        self.doing = ""
        self.done = 0.0
        self._redraw = redraw

    @property
    def fraction(self) -> float:
        """Fraction that is done, 0 to 1."""
        return min(self.done / self.total, 1.0) if self.total else 1.0

    def advance(self, steps: float = 1.0, doing: str | None = None) -> None:
        """Count steps as done, and show what comes next."""
        self.reach(self.done + steps, doing)

    def reach(self, done: float, doing: str | None = None) -> None:
        """Set the number of steps done, also to fewer than before if work was lost and is done again."""
        self.done = min(done, self.total)
        self.say(self.doing if doing is None else doing)

    def say(self, doing: str) -> None:
        """Show what is being done within the stage: "frame 17 of 120"."""
        self.doing = doing
        self._redraw()


class Progress:
    """The progress bar, as a context: `with Progress() as progress, progress.stage("Rendering", 120) as stage: ...`.

    The bar disappears when a stage ends, so that final messages stand alone; after Ctrl-C it stays as it was.

    Parameters
    ----------
    stream : text stream, optional
        Standard error by default. If Python has none, as in a windowed program, nothing is shown.
    quiet : bool
        Whether to show only lines with a style: warnings and errors.
    program : str
        The start of lines about errors.
    clock : callable
        Monotonic seconds.
    """

    def __init__(
        self,
        stream: TextIO | None = None,
        *,
        quiet: bool = False,
        program: str = "",
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._program = program
        self._on_farm = os.environ.get(FARM_VARIABLE) == "openjd"
        self._quiet = quiet or self._stream is None
        self._clock = clock
        self._stage: Stage | None = None
        self._bar: Any = None
        self._started = self._shown_at = 0.0
        self._shown: float | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    @contextmanager
    def stage(self, title: str, total: float) -> Iterator[Stage]:
        """Open a stage of `total` steps."""
        self._started = self._shown_at = self._clock()
        self._shown = None
        self._stage = stage = Stage(title, total, self._redraw)
        if total and not self._quiet and not self._on_farm:
            self._bar = _bar(self._stream, self._line)
            if self._bar:
                self._bar.start()
        try:
            yield stage
            stage.done, stage.doing = stage.total, ""
            self._redraw(now=self._shown not in (None, 1.0))
        except KeyboardInterrupt:
            if self._bar:
                self._bar.live.transient = False
            raise
        finally:
            if self._bar:
                self._bar.stop()
            self._bar = self._stage = None

    def note(self, text: str, style: str = "") -> None:
        """Write a line above the bar; on a terminal in a style of rich, such as "red"."""
        if self._quiet and not style:
            return
        if self._bar:
            self._bar.console.print(_escaped_line(text, self._stream), markup=False, style=style)
        elif self._stream is not None:
            self._stream.write(_escaped_line(text, self._stream) + "\n")
            self._stream.flush()

    def error(self, text: str) -> None:
        """Write an error message in one line."""
        self.note(": ".join(filter(None, (self._program, text))), "red")

    def _redraw(self, now: bool = False) -> None:
        stage = cast(Stage, self._stage)
        if self._bar:
            self._bar.update(self._bar.task_ids[0], completed=stage.fraction)
        elif self._on_farm:
            done, words = 100.0 * stage.fraction, stage.doing or stage.title
            self._stream.write(f"openjd_progress: {done:.1f}\nopenjd_status: {_escaped_line(words, self._stream)}\n")
            self._stream.flush()
        elif not self._quiet and (now or self._clock() - self._shown_at >= LINE_INTERVAL_S):
            self._shown_at, self._shown = self._clock(), stage.fraction
            self._stream.write(f"{stage.fraction:4.0%}  {self._line()}\n")
            self._stream.flush()

    def _line(self) -> str:
        """Return the elapsed and remaining time, and the current work."""
        stage = self._stage
        if stage is None:
            return ""
        elapsed, fraction = self._clock() - self._started, stage.fraction
        words = ", ".join(filter(None, (stage.title, stage.doing)))
        if fraction >= 1.0:
            times = f"done in {duration(elapsed)}"
        elif fraction <= 0.0:
            times = duration(elapsed)
        else:
            times = f"{duration(elapsed)}, {duration(elapsed / fraction - elapsed)} left"
        return f"{times}  {_escaped_line(words, self._stream)}"


def duration(seconds: float) -> str:
    """Return a time in clock format: "1:05" for a minute and five seconds."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"


def _bar(stream: TextIO, line: Callable[[], str]) -> Any:
    """Return a rich progress bar followed by a line; None if the stream is no terminal that can show it."""
    if not stream.isatty() or os.environ.get("TERM") == "dumb":
        return None
    try:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, ProgressColumn, TaskProgressColumn
        from rich.table import Column
        from rich.text import Text
    except ImportError:
        return None

    class Line(ProgressColumn):
        """The line after the bar, made anew at each redraw so that the clock continues."""

        max_refresh = 0.5

        def render(self, task: object) -> Text:  # noqa: ARG002 - Rich gives it
            return Text(line(), overflow="crop", no_wrap=True)

    console = Console(file=stream, soft_wrap=True, highlight=False)
    # Leave room for the terminal's echo of Ctrl-C, which would wrap after the last column.
    most = max(1, console.width - BAR_COLUMNS - 10)
    columns = (TaskProgressColumn(), BarColumn(BAR_COLUMNS), Line(Column(no_wrap=True, max_width=most)))
    bar = Progress(
        *columns,
        console=console,
        transient=True,
        # Printed text appears above the bar, unless it goes elsewhere.
        redirect_stdout=sys.stdout is not None and sys.stdout.isatty(),
        redirect_stderr=sys.stderr is stream,
    )
    bar.add_task("", total=1.0)
    return bar


def _escaped_line(text: str, stream: TextIO) -> str:
    """Return the text in one line; escape control characters, and characters that the stream cannot encode."""
    encoding = getattr(stream, "encoding", None) or "ascii"
    return printable(text).encode(encoding, "backslashreplace").decode(encoding)
