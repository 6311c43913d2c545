"""A progress bar of the standard library alone, since Blender's own Python has no packages.

On a terminal it is one line that is written over; elsewhere (a log) it is a plain line now and then. Work is a tree:
a stage that is opened inside another is one step of it, so that the bar and the time that is left are always those of
the whole. Seconds throughout.
"""

from __future__ import annotations

import os
import sys
import time
import unicodedata
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Self, TextIO

from rigid_motion_batch.command_line import printable

BAR_COLUMNS = 24
TERMINAL_INTERVAL = 0.1
LOG_INTERVAL = 10.0


class Stage:
    """A part of the work, of `total` steps. Made by `Progress.stage`."""

    def __init__(self, title: str, total: float, redraw: Callable[[], None]) -> None:
        self.title = title
        self.doing = ""
        self.total = total
        self.done = 0.0
        self._redraw = redraw

    def advance(self, steps: float = 1.0, doing: str | None = None) -> None:
        """Count steps as done, and say what comes next."""
        self.done = min(self.done + steps, self.total)
        self.say(self.doing if doing is None else doing)

    def reach(self, done: float, doing: str | None = None) -> None:
        """Count so many steps as done in all, also fewer than before: work was lost, and is done again."""
        self.done = min(done, self.total)
        self.say(self.doing if doing is None else doing)

    def say(self, doing: str) -> None:
        """Say what is being done within the stage: "frame 17 of 120"."""
        self.doing = doing
        self._redraw()


class Progress:
    """The bar, as a context: `with Progress() as progress, progress.stage("Rendering", 120) as stage: ...`.

    Parameters
    ----------
    stream : text stream, optional
        The standard error unless given. Where Python has none, as in a windowed program, nothing is shown.
    clock : callable
        Seconds that never run backwards.
    environ : mapping
        Of it, NO_COLOR (https://no-color.org), TERM and COLUMNS are heeded.
    """

    def __init__(
        self,
        stream: TextIO | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
        environ: Mapping[str, str] = os.environ,
    ) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._clock = clock
        self._environ = environ
        self._live = self._stream is not None and self._stream.isatty() and environ.get("TERM") != "dumb"
        self._coloured = self._live and not environ.get("NO_COLOR") and (os.name != "nt" or "WT_SESSION" in environ)
        self._blocks = _encodes(self._stream, "▕█▉▊▋▌▍▎▏")
        self._stages: list[tuple[Stage, float]] = []
        self._started = self._stage_started = self._clock()
        self._shown_at: float | None = None
        self._shown_columns = 0

    def __enter__(self) -> Self:
        self._started = self._clock()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # After Ctrl-C or an error the line stays as it was, so that one sees how far the work had come.
        if self._live and self._shown_columns:
            self._write("\n")
            self._shown_columns = 0

    @contextmanager
    def stage(self, title: str, total: float, *, weight: float = 1.0) -> Iterator[Stage]:
        """Open a stage of `total` steps. Inside another stage it makes up `weight` of that one's steps."""
        stage = Stage(title, total, self._redraw)
        if not self._stages:
            self._stage_started = self._clock()
        self._stages.append((stage, weight))
        if total:
            self._redraw(now=len(self._stages) == 1)
        try:
            yield stage
            stage.done = total
            if len(self._stages) == 1:
                stage.doing = ""
                self._redraw(now=True)
        finally:
            self._stages.pop()
        if self._stages:
            self._stages[-1][0].advance(weight, "")

    def note(self, text: str) -> None:
        """Write a line of its own, above the bar."""
        self._clear()
        self._write(_fitting(text, self._stream) + "\n")
        if self._live and self._stages:
            self._redraw(now=True)

    @property
    def fraction(self) -> float:
        """How much of the outermost stage is done, 0 to 1."""
        fraction, share = 0.0, 0.0
        for stage, weight in reversed(self._stages):
            fraction = min((stage.done + share) / stage.total, 1.0) if stage.total else 1.0
            share = fraction * weight
        return fraction

    def _redraw(self, now: bool = False) -> None:
        interval = TERMINAL_INTERVAL if self._live else LOG_INTERVAL
        if not now and self._shown_at is not None and self._clock() - self._shown_at < interval:
            return
        self._shown_at = self._clock()
        if self._live:
            self._draw_line()
        else:
            self._write(f"{self.fraction:4.0%}  {self._times()}  {self._doing()}\n")

    def _draw_line(self) -> None:
        columns = self._terminal_columns() - 1  # A Windows console wraps after its last column.
        head, tail = f"{self.fraction:4.0%} ", f"  {self._times()}  {self._doing()}"
        bar = _bar(self.fraction, min(BAR_COLUMNS, max(columns // 4, 4)), self._blocks)
        tail = _cut(tail, columns - len(head) - len(bar))
        width = len(head) + len(bar) + _columns_of(tail)
        shown = f"\x1b[36m{bar}\x1b[0m" if self._coloured else bar
        self._write(f"\r{head}{shown}{tail}" + " " * (self._shown_columns - width))
        self._shown_columns = width

    def _terminal_columns(self) -> int:
        if self._environ.get("COLUMNS", "").isdecimal():
            return int(self._environ["COLUMNS"])
        try:
            return os.get_terminal_size(self._stream.fileno()).columns
        except OSError:
            return 80

    def _times(self) -> str:
        now, fraction = self._clock(), self.fraction
        elapsed, in_stage = now - self._started, now - self._stage_started
        if fraction >= 1.0:
            return f"done in {_duration(elapsed)}"
        if fraction <= 0.0:
            return _duration(elapsed)
        return f"{_duration(elapsed)}, {_duration(in_stage / fraction - in_stage)} left"

    def _doing(self) -> str:
        words = [word for stage, _ in self._stages for word in (stage.title, stage.doing) if word]
        return _fitting(", ".join(words), self._stream)

    def _clear(self) -> None:
        if self._live and self._shown_columns:
            self._write("\r" + " " * self._shown_columns + "\r")
            self._shown_columns = 0

    def _write(self, text: str) -> None:
        if self._stream is not None:
            self._stream.write(text)
            self._stream.flush()


def _bar(fraction: float, columns: int, blocks: bool) -> str:
    if not blocks:
        full = int(fraction * columns)
        return "[" + "#" * full + "-" * (columns - full) + "]"
    eighths = int(fraction * columns * 8)
    bar = "█" * (eighths // 8) + " ▏▎▍▌▋▊▉"[eighths % 8]
    return "▕" + bar[:columns].ljust(columns) + "▏"


def _duration(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"


def _encodes(stream: TextIO | None, text: str) -> bool:
    try:
        text.encode(getattr(stream, "encoding", None) or "ascii")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


def _fitting(text: str, stream: TextIO | None) -> str:
    """The text in one line, with what a terminal must not get or cannot show escaped."""
    encoding = getattr(stream, "encoding", None) or "ascii"
    return printable(text).encode(encoding, "backslashreplace").decode(encoding)


def _columns_of(text: str) -> int:
    return sum(2 if unicodedata.east_asian_width(c) in "WF" else not unicodedata.combining(c) for c in text)


def _cut(text: str, columns: int) -> str:
    if _columns_of(text) <= columns:
        return text
    while text and _columns_of(text) > columns - 2:
        text = text[:-1]
    return text + ".." if columns >= 2 else ""
