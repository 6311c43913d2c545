"""Tests of progress: the bar on a terminal, and plain lines in a log."""

import contextlib
import io
import sys

import pytest

from rigid_motion_batch.progress import FARM_VARIABLE, Progress


class Clock:
    now = 50.0

    def __call__(self) -> float:
        return self.now


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    encoding = "utf-8"

    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal of 100 columns, without colours."""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setenv("NO_COLOR", "1")


def interrupted(parts: int, doing: str) -> list[str]:
    """Return the last two lines drawn when Ctrl-C ends a stage after half a minute."""
    clock, terminal = Clock(), Terminal()
    begun = Progress(terminal, clock=clock)
    with contextlib.suppress(KeyboardInterrupt), begun as progress, progress.stage("Rendering", parts) as stage:
        clock.now += 30.0
        stage.advance(1, doing)
        raise KeyboardInterrupt
    return terminal.getvalue().split("\r")[-1].replace("\x1b[2K", "").split("\n")


def test_the_line_on_a_terminal_says_how_far_how_long_and_what() -> None:
    line, below = interrupted(4, "frame 1 of 4")
    assert line.startswith(" 25% ━━━━━━")
    assert "0:30, 1:30 left  Rendering, frame 1 of 4" in line
    assert "━" not in below


def test_the_time_that_is_left_is_reckoned_from_the_stage_and_not_from_what_came_before() -> None:
    clock, log = Clock(), io.StringIO()
    with Progress(log, clock=clock) as progress:
        with progress.stage("Reading", 1):
            clock.now += 100.0
        with progress.stage("Rendering", 4) as stage:
            clock.now += 10.0
            stage.advance(1)
            assert log.getvalue().splitlines()[-1] == " 25%  0:10, 0:30 left  Rendering"


def test_a_log_gets_a_plain_line_every_ten_seconds_at_most() -> None:
    clock, log = Clock(), io.StringIO()
    with Progress(log, clock=clock) as progress, progress.stage("Rendering", 100) as stage:
        for frame in range(100):
            clock.now += 0.3
            stage.advance(1, f"frame {frame + 1}")
    lines = log.getvalue().splitlines()
    assert [line[:4] for line in lines] == [" 34%", " 68%", "100%"]
    assert lines[0] == " 34%  0:10, 0:20 left  Rendering, frame 34"
    assert lines[-1] == "100%  done in 0:30  Rendering"
    assert "\r" not in log.getvalue()
    assert "\x1b" not in log.getvalue()


def test_blenders_own_python_has_no_rich_and_shows_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rich.console", None)
    clock, terminal = Clock(), Terminal()
    with Progress(terminal, clock=clock) as progress, progress.stage("Baking", 2) as stage:
        clock.now += 20.0
        stage.advance()
    assert terminal.getvalue() == " 50%  0:20, 0:20 left  Baking\n100%  done in 0:20  Baking\n"


def test_a_note_stands_above_the_bar_in_one_line_as_it_is() -> None:
    terminal = Terminal()
    note = f"[red]reach.csv: {'a long name ' * 20}: dropped 1 row"
    with Progress(terminal) as progress, progress.stage("Rendering", 2):
        progress.note(note)
    assert f"{note}\n" in terminal.getvalue()


def test_a_console_that_cannot_show_every_letter_gets_ascii() -> None:
    terminal = Terminal()
    terminal.encoding = "cp1252"
    with Progress(terminal) as progress, progress.stage("Rendering 手術", 2) as stage:
        stage.advance()
    assert "Rendering \\u624b\\u8853" in terminal.getvalue()
    terminal.getvalue().encode("cp1252")


@pytest.mark.parametrize("columns", [20, 40, 80])
@pytest.mark.parametrize("doing", ["a clip with a very long name " * 5, "手術室の録画" * 20])
def test_the_line_never_breaks(columns: int, doing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    line, _ = interrupted(2, doing)
    assert sum(2 if ord(c) > 0x2FFF else 1 for c in line) <= columns


def test_control_characters_in_names_reach_no_terminal() -> None:
    terminal = Terminal()
    with Progress(terminal) as progress, progress.stage("evil\x1b[2J\nname", 1):
        pass
    assert "evil\\x1b[2J\\nname" in terminal.getvalue()


def test_where_nothing_is_to_be_shown_errors_are() -> None:
    log = io.StringIO()
    with Progress(log, quiet=True, program="compare.py") as progress, progress.stage("Rendering", 2) as stage:
        stage.advance()
        progress.note("reach.csv: dropped 1 row")
        progress.error("hand.csv: no such file")
    assert log.getvalue() == "compare.py: hand.csv: no such file\n"


def test_progress_is_said_as_farms_hear_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FARM_VARIABLE, "openjd")
    stream = io.StringIO()
    with Progress(stream) as progress, progress.stage("Measuring", 8.0) as stage:
        stage.reach(2.0, "toss at 5 keys/s, frame 3 of 12")
    said = stream.getvalue()
    assert said.startswith("openjd_progress: 25.0\nopenjd_status: toss at 5 keys/s, frame 3 of 12\n")
