from __future__ import annotations

import io

import pytest

from rigid_motion_batch.progress import Progress


class Clock:
    now = 50.0

    def __call__(self) -> float:
        return self.now


class Terminal(io.StringIO):
    """A stream that is a terminal, and can tell what is to be read on its lines."""

    def __init__(self, encoding: str = "utf-8") -> None:
        super().__init__()
        self._encoding = encoding

    @property
    def encoding(self) -> str:
        return self._encoding

    def isatty(self) -> bool:
        return True

    def lines(self) -> list[str]:
        shown = []
        for line in self.getvalue().split("\n"):
            cells: list[str] = []
            for part in line.split("\r"):
                cells[: len(part)] = part
            shown.append("".join(cells).rstrip())
        return shown


PLAIN = {"NO_COLOR": "1", "COLUMNS": "100"}


def test_the_line_on_a_terminal_says_how_far_how_long_and_what() -> None:
    clock, terminal = Clock(), Terminal()
    with Progress(terminal, clock=clock, environ=PLAIN) as progress, progress.stage("Rendering", 4) as stage:
        clock.now += 30.0
        stage.advance(1, "frame 1 of 4")
        (line,) = terminal.lines()
    assert line.startswith(" 25% ▕██████ ")
    assert line.endswith("▏  0:30, 1:30 left  Rendering, frame 1 of 4")


def test_a_shorter_line_leaves_nothing_of_the_longer_one_before_it() -> None:
    clock, terminal = Clock(), Terminal()
    with Progress(terminal, clock=clock, environ=PLAIN) as progress, progress.stage("Rendering", 4) as stage:
        for doing in ("a description that takes a lot of room", "short"):
            clock.now += 1.0
            stage.advance(1, doing)
        assert terminal.lines()[0].endswith("Rendering, short")


def test_a_stage_within_a_stage_is_one_step_of_it_or_as_many_as_it_weighs() -> None:
    progress = Progress(Terminal(), environ=PLAIN)
    with progress, progress.stage("All", 10) as whole:
        with progress.stage("Reading", 2) as reading:
            reading.advance()
            assert progress.fraction == pytest.approx(0.05)
        assert progress.fraction == pytest.approx(0.1)
        with progress.stage("Rendering", 100, weight=9) as rendering:
            rendering.advance(50)
            assert progress.fraction == pytest.approx(0.55)
        assert whole.done == 10
        assert progress.fraction == 1.0


def test_work_that_many_do_is_counted_as_a_whole_and_may_be_lost_again() -> None:
    progress = Progress(Terminal(), environ=PLAIN)
    with progress, progress.stage("Rendering", 4) as stage:
        stage.reach(2.5, "two at once")
        assert progress.fraction == pytest.approx(0.625)
        stage.reach(2.0)
        assert progress.fraction == pytest.approx(0.5)
        assert stage.doing == "two at once"
        stage.reach(9.0)
        assert progress.fraction == 1.0


def test_the_time_that_is_left_is_reckoned_from_the_stage_and_not_from_what_came_before() -> None:
    clock, terminal = Clock(), Terminal()
    with Progress(terminal, clock=clock, environ=PLAIN) as progress:
        with progress.stage("Reading", 1):
            clock.now += 100.0
        with progress.stage("Rendering", 4) as stage:
            clock.now += 10.0
            stage.advance(1)
            assert "1:50, 0:30 left  Rendering" in terminal.lines()[-1]


def test_a_log_gets_a_plain_line_every_ten_seconds_at_most() -> None:
    clock, log = Clock(), io.StringIO()
    with Progress(log, clock=clock, environ={}) as progress, progress.stage("Rendering", 100) as stage:
        for frame in range(100):
            clock.now += 0.3
            stage.advance(1, f"frame {frame + 1}")
    lines = log.getvalue().splitlines()
    assert [line[:4] for line in lines] == ["  0%", " 34%", " 68%", "100%"]
    assert lines[1] == " 34%  0:10, 0:20 left  Rendering, frame 34"
    assert lines[-1] == "100%  done in 0:30  Rendering"
    assert "\r" not in log.getvalue()
    assert "\x1b" not in log.getvalue()


def test_a_terminal_is_not_redrawn_faster_than_an_eye_can_follow() -> None:
    clock, terminal = Clock(), Terminal()
    with Progress(terminal, clock=clock, environ=PLAIN) as progress, progress.stage("Rendering", 10000) as stage:
        for _ in range(10000):
            clock.now += 0.001
            stage.advance()
    assert terminal.getvalue().count("\r") <= 102


def test_ctrl_c_leaves_the_line_as_it_was_and_the_cursor_below_it() -> None:
    clock, terminal = Clock(), Terminal()

    def work() -> None:
        with Progress(terminal, clock=clock, environ=PLAIN) as progress, progress.stage("Rendering", 2) as stage:
            clock.now += 1.0
            stage.advance(1, "frame 1")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work()
    line, below = terminal.lines()
    assert line.startswith(" 50% ")
    assert below == ""


def test_a_note_stands_above_the_bar() -> None:
    terminal = Terminal()
    with Progress(terminal, environ=PLAIN) as progress, progress.stage("Rendering", 2):
        progress.note("reach.csv: dropped 1 row")
        above, bar = terminal.lines()
    assert above == "reach.csv: dropped 1 row"
    assert bar.endswith("Rendering")


def test_a_console_that_cannot_show_blocks_gets_ascii() -> None:
    clock, terminal = Clock(), Terminal("cp1252")
    with Progress(terminal, clock=clock, environ=PLAIN) as progress, progress.stage("Rendering 手術", 2) as stage:
        clock.now += 1.0
        stage.advance()
        assert " 50% [############------------]  0:01, 0:01 left  Rendering \\u624b\\u8853" in terminal.lines()
    terminal.getvalue().encode("cp1252")


def test_colour_is_for_terminals_that_did_not_say_no(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.name", "posix")
    written = []
    for environ in ({}, {"NO_COLOR": "1"}, {"NO_COLOR": ""}, {"TERM": "dumb"}):
        terminal = Terminal()
        with Progress(terminal, environ=environ) as progress, progress.stage("Rendering", 2):
            written.append("\x1b[" in terminal.getvalue())
    assert written == [True, False, True, False]


@pytest.mark.parametrize("columns", [20, 40, 80])
@pytest.mark.parametrize("doing", ["a clip with a very long name " * 5, "手術室の録画" * 20])
def test_the_line_never_reaches_the_last_column(columns: int, doing: str) -> None:
    clock, terminal = Clock(), Terminal()
    environ = PLAIN | {"COLUMNS": str(columns)}
    with Progress(terminal, clock=clock, environ=environ) as progress, progress.stage("Rendering", 2) as stage:
        clock.now += 1.0
        stage.advance(1, doing)
        wide = sum(2 if ord(c) > 0x2FFF else 1 for c in terminal.lines()[0])
    assert wide <= columns - 1


def test_control_characters_in_names_reach_no_terminal() -> None:
    terminal = Terminal()
    with Progress(terminal, environ=PLAIN) as progress, progress.stage("evil\x1b[2J\nname", 1):
        assert terminal.lines()[0].endswith("evil\\x1b[2J\\nname")


def test_work_of_no_steps_is_done_at_once() -> None:
    with Progress(io.StringIO(), environ={}) as progress, progress.stage("Nothing", 0):
        assert progress.fraction == 1.0


def test_a_program_without_a_standard_error_shows_nothing_and_works(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr", None)
    with Progress(environ={}) as progress, progress.stage("Rendering", 2) as stage:
        stage.advance()
        progress.note("unheard")
        assert progress.fraction == 0.5
