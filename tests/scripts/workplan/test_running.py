"""What a run does, whoever does it."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import threading
import time
from pathlib import Path

import pytest

from rigid_motion_batch import files
from rigid_motion_batch.progress import Progress
from rigid_motion_batch.workplan import (
    FolderInUse,
    ManifestError,
    Outcome,
    Plan,
    SerialExecutor,
    State,
    Task,
    Workspace,
    run,
)
from rigid_motion_batch.workplan.hashing import code_version
from tests.scripts.workplan.plans import (
    EXECUTORS,
    STEPS,
    contents,
    done,
    joining,
    run_in,
    states,
    task,
    up_to_date,
)


@pytest.fixture
def output(tmp_path: Path) -> Path:
    return tmp_path / "out"


@pytest.mark.parametrize("executor", EXECUTORS)
def test_tasks_are_done_and_their_outputs_are_in_place(output: Path, executor: str) -> None:
    tasks = [task("a", text="1"), task("b", text="2"), joining("c", "a", "b")]
    outcome = run_in(output, *tasks, executor=EXECUTORS[executor]())
    assert states(outcome) == done("a", "b", "c")
    assert contents(output) == {"a.txt": "1", "b.txt": "2", "c.txt": "12"}
    with Workspace(output, shared=True) as workspace:
        assert workspace.manifest.get("a").facts == {"characters": 1}
    assert str(outcome) == "3 done"


def test_outputs_of_one_name_in_several_folders_do_not_get_in_one_anothers_way(output: Path) -> None:
    texts = {"a/x.txt": "1", "b/x.txt": "2", "b/y.txt": "3", "X.txt": "4"}
    several = Task("several", f"{STEPS}:write_all", {"texts": texts}, outputs=tuple(texts))
    assert states(run_in(output, several)) == done("several")
    assert contents(output) == texts


def test_what_a_task_left_in_its_scratch_folder_is_not_taken_for_an_output_of_the_next(output: Path) -> None:
    untidy = Task("a", f"{STEPS}:write_all", {"texts": {"a.txt": "1"}, "more": "b.txt"}, outputs=("a.txt",))
    forgetful = task("b", "forget")
    outcome = run_in(output, untidy, forgetful)
    assert (outcome.states["a"], outcome.states["b"]) == (State.DONE, State.FAILED)
    assert contents(output) == {"a.txt": "1"}


def test_tasks_that_leave_nothing_behind_use_a_scratch_folder_one_after_the_other(output: Path) -> None:
    with Workspace(output) as workspace, SerialExecutor() as executor:
        run(Plan([task(name) for name in "abcdef"], "1"), workspace, executor)
        assert len(list((output / ".workplan" / "scratch").iterdir())) == 1
    assert not (output / ".workplan" / "scratch").exists()


@pytest.mark.parametrize("executor", EXECUTORS)
def test_a_failure_is_said_and_the_others_go_on(output: Path, executor: str, capsys: pytest.CaptureFixture) -> None:
    tasks = [task("a"), task("bad", "fail"), joining("b", "a"), joining("c", "bad", "a"), joining("d", "c")]
    outcome = run_in(output, *tasks, executor=EXECUTORS[executor]())
    assert states(outcome) == done("a", "b") | {"bad": "failed", "c": "skipped", "d": "skipped"}
    assert "bad.txt: cannot be made; make another" in capsys.readouterr().err
    assert sorted(contents(output)) == ["a.txt", "b.txt"]
    assert str(outcome) == "2 done, 1 failed, 2 skipped"


def test_an_error_that_nobody_foresaw_names_its_task_and_the_manifest_says_where(output: Path) -> None:
    outcome = run_in(output, task("a"), task("bad", "fail", foreseen=False, title="The bad one"))
    assert outcome.failures["bad"] == "The bad one: KeyError: 'bad.txt'"
    failures = json.loads((output / "manifest.json").read_text())["failures"]
    assert "in fail" in failures["bad"]["details"]


@pytest.mark.parametrize("beside", ["", ".123."])
def test_an_error_of_the_system_names_the_output_where_it_would_have_been(output: Path, beside: str) -> None:
    arguments = {"path": "a/b/c.txt", "beside": beside}
    outcome = run_in(output, Task("c", f"{STEPS}:stumble", arguments, outputs=("a/b/c.txt", "d/e.txt")))
    assert outcome.failures["c"].startswith(f"c: {output}/a/b/c.txt: ")


@pytest.mark.parametrize("beside", ["", ".123."])
def test_of_two_outputs_the_name_of_one_of_which_ends_in_the_others_it_names_the_right_one(
    output: Path, beside: str
) -> None:
    outputs = ("keys.csv", "best_of.keys.csv")
    arguments = {"path": "best_of.keys.csv", "beside": beside}
    outcome = run_in(output, Task("c", f"{STEPS}:stumble", arguments, outputs=outputs))
    assert outcome.failures["c"].startswith(f"c: {output}/best_of.keys.csv: ")


def test_a_task_that_does_not_make_what_it_said_has_failed(output: Path) -> None:
    assert "was to be made" in run_in(output, task("a", "forget")).failures["a"]


class Log:
    """Which tasks were begun, between two looks."""

    def __init__(self, folder: Path) -> None:
        self.path = str(folder / "log")
        self.seen = 0

    def new(self) -> list[str]:
        lines = Path(self.path).read_text().split() if Path(self.path).exists() else []
        lines, self.seen = [line.removesuffix(".txt") for line in lines][self.seen :], len(lines)
        return sorted(lines)


@pytest.fixture
def log(tmp_path: Path) -> Log:
    return Log(tmp_path)


def three(log: Log, text: str = "1") -> list[Task]:
    """Two tasks, and one that reads the first of them."""
    return [task("a", text=text, log=log.path), task("b", log=log.path), joining("c", "a", log=log.path)]


def test_a_second_run_does_nothing(output: Path, log: Log) -> None:
    run_in(output, *three(log))
    assert log.new() == ["a", "b", "c"]
    assert states(run_in(output, *three(log))) == up_to_date("a", "b", "c")
    assert log.new() == []


def test_force_does_everything_again(output: Path, log: Log) -> None:
    run_in(output, *three(log))
    log.new()
    assert states(run_in(output, *three(log), force=True)) == done("a", "b", "c")
    assert log.new() == ["a", "b", "c"]


def test_force_does_nothing_twice_that_was_done_since_the_folder_was_opened(output: Path, log: Log) -> None:
    with Workspace(output) as workspace, SerialExecutor() as executor:
        run(Plan(three(log)[:1], "1"), workspace, executor, force=True)
        run(Plan(three(log), "1"), workspace, executor, force=True)
    assert log.new() == ["a", "b", "c"]


def test_a_changed_argument_redoes_its_task_and_those_that_read_it(output: Path, log: Log) -> None:
    run_in(output, *three(log))
    log.new()
    assert states(run_in(output, *three(log, "2"))) == done("a", "c") | up_to_date("b")
    assert log.new() == ["a", "c"]
    assert contents(output)["c.txt"] == "2"


def test_a_changed_input_redoes_its_task_and_those_that_read_it(output: Path, log: Log, tmp_path: Path) -> None:
    source = tmp_path / "in.csv"
    source.write_text("1")
    tasks = [
        task("a", "copy", source=str(source), inputs=(str(source),), log=log.path),
        joining("c", "a", log=log.path),
        task("b", log=log.path),
    ]
    run_in(output, *tasks)
    log.new()
    source.touch()
    run_in(output, *tasks)
    assert log.new() == []
    source.write_text("2")
    run_in(output, *tasks)
    assert log.new() == ["a", "c"]
    assert contents(output)["c.txt"] == "2"


def test_another_version_of_the_program_redoes_everything(output: Path, log: Log) -> None:
    run_in(output, *three(log))
    log.new()
    run_in(output, *three(log), version="2")
    assert log.new() == ["a", "b", "c"]


def test_the_version_is_that_of_the_source_files() -> None:
    plan, more = "rigid_motion_batch/workplan", "rigid_motion_batch/files.py"
    assert code_version(plan) == code_version(plan) != code_version(plan, more)


@pytest.mark.parametrize("damage", ["missing", "cut", "other content", "longer"])
def test_an_output_that_is_not_what_was_made_is_made_again(output: Path, log: Log, damage: str) -> None:
    tasks = [task("a", text="whole", log=log.path), joining("c", "a", log=log.path)]
    run_in(output, *tasks)
    log.new()
    path = output / "a.txt"
    if damage == "missing":
        path.unlink()
    else:
        path.write_text({"cut": "wh", "other content": "WHOLE", "longer": "wholesome"}[damage])
    run_in(output, *tasks)
    assert log.new() == ["a"]
    assert contents(output) == {"a.txt": "whole", "c.txt": "whole"}


def test_a_task_that_failed_is_tried_again_the_next_time(output: Path, log: Log, tmp_path: Path) -> None:
    source = tmp_path / "in.csv"
    tasks = [task("a", "copy", source=str(source), inputs=(str(source),)), joining("b", "a"), task("c", log=log.path)]
    outcome = run_in(output, *tasks)
    assert states(outcome) == {"a": "failed", "b": "skipped"} | done("c")
    assert outcome.failures["a"] == f"{source}: no such file"
    source.write_text("back")
    assert states(run_in(output, *tasks)) == done("a", "b") | up_to_date("c")
    assert json.loads((output / "manifest.json").read_text())["failures"] == {}


def test_an_input_that_vanishes_while_it_is_read_is_said_and_nothing_comes_of_it(output: Path, tmp_path: Path) -> None:
    source = tmp_path / "in.csv"
    source.write_text("1")
    outcome = run_in(output, task("a", "vanish", source=str(source), inputs=(str(source),)))
    assert "changed while it was read" in outcome.failures["a"]
    assert contents(output) == {}


def test_what_a_failed_task_made_of_something_else_does_not_pass_for_its_output(output: Path) -> None:
    run_in(output, task("a", text="of yesterday"))
    outcome = run_in(output, task("a", "fail"))
    assert states(outcome) == {"a": "failed"}
    assert contents(output) == {}


# -- partial and temporary tasks --------------------------------------------------------------------------------------


def test_a_partial_task_makes_the_best_of_what_there_is(output: Path, tmp_path: Path) -> None:
    source = tmp_path / "in.csv"
    tasks = [
        task("a", text="1"),
        task("b", "copy", source=str(source), inputs=(str(source),)),
        joining("report", "a", "b", partial=True),
    ]
    assert states(run_in(output, *tasks)) == done("a", "report") | {"b": "failed"}
    assert contents(output)["report.txt"] == "1"
    assert states(run_in(output, *tasks)) == up_to_date("a", "report") | {"b": "failed"}
    source.write_text("2")
    assert states(run_in(output, *tasks)) == up_to_date("a") | done("b", "report")
    assert contents(output)["report.txt"] == "12"


def test_a_partial_task_with_nothing_to_go_by_is_skipped(output: Path) -> None:
    outcome = run_in(output, task("bad", "fail"), joining("report", "bad", partial=True))
    assert states(outcome) == {"bad": "failed", "report": "skipped"}


def test_temporary_outputs_go_when_those_who_wanted_them_are_done(output: Path, log: Log) -> None:
    tasks = [
        task("piece", text="1", temporary=True, log=log.path),
        joining("film", "piece", log=log.path),
        joining("still", "piece", log=log.path),
    ]
    run_in(output, *tasks)
    assert contents(output) == {"film.txt": "1", "still.txt": "1"}
    log.new()
    assert states(run_in(output, *tasks)) == up_to_date("piece", "film", "still")
    assert log.new() == []
    (output / "film.txt").unlink()
    run_in(output, *tasks)
    assert log.new() == ["film", "piece"]
    assert contents(output) == {"film.txt": "1", "still.txt": "1"}


def test_temporary_outputs_stay_for_a_task_that_failed(output: Path, tmp_path: Path, log: Log) -> None:
    source = tmp_path / "in.csv"
    last = task("film", "copy", after=("piece",), source=str(source), inputs=(str(source),))
    tasks = [task("piece", text="1", temporary=True, log=log.path), last]
    run_in(output, *tasks)
    assert contents(output) == {"piece.txt": "1"}
    source.write_text("2")
    run_in(output, *tasks)
    assert log.new() == ["piece"]
    assert contents(output) == {"film.txt": "2"}


# -- what goes wrong around it ----------------------------------------------------------------------------------------


def test_a_full_disk_ends_the_run_with_what_is_done_in_place(output: Path) -> None:
    tasks = [task("a", text="1"), task("b", "fill_disk"), task("c")]
    outcome = run_in(output, *tasks)
    assert states(outcome) == done("a") | {"b": "failed", "c": "not begun or stopped"}
    assert outcome.problem == f"b: {output / 'b.txt'}: {os.strerror(28)}"
    assert contents(output) == {"a.txt": "1"}
    assert states(run_in(output, task("a", text="1"), task("b"), task("c"))) == up_to_date("a") | done("b", "c")


def test_a_disk_that_fills_up_while_outputs_are_moved_ends_the_run(
    output: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace = os.replace

    def full(source: str, target: str) -> None:
        if os.path.basename(target) == "b.txt":
            raise OSError(28, os.strerror(28), target)
        replace(source, target)

    monkeypatch.setattr(os, "replace", full)
    outcome = run_in(output, task("a"), task("b"), task("c"))
    assert outcome.problem == f"{output / 'b.txt'}: {os.strerror(28)}"
    assert sorted(contents(output)) == ["a.txt"]
    monkeypatch.undo()
    assert states(run_in(output, task("a"), task("b"), task("c"))) == up_to_date("a") | done("b", "c")


def test_an_output_folder_that_cannot_be_made_is_an_error_of_the_system(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="file"):
        run_in(tmp_path / "file" / "out", task("a"))


def test_a_run_that_made_nothing_leaves_nothing(output: Path) -> None:
    run_in(output / "deeper", task("bad", "fail"))
    assert not output.exists()


def test_two_runs_in_one_folder_are_refused_and_told_who_is_there(output: Path) -> None:
    with Workspace(output), pytest.raises(FolderInUse, match=f"another run is at work .*process {os.getpid()} on"):
        run_in(output, task("a"))
    assert states(run_in(output, task("a"))) == done("a")


def test_the_lock_of_a_dead_process_is_none(output: Path) -> None:
    (output / ".workplan").mkdir(parents=True)
    (output / ".workplan" / "lock").write_text('{"process": 1, "host": "here", "since": "long ago"}')
    assert states(run_in(output, task("a"))) == done("a")


@pytest.mark.parametrize(
    "left",
    [
        ".workplan/scratch/0123/a.txt",
        f".workplan/.00007904{files.ending_beside(Path('plan.json'))}",
        f".00007904{files.ending_beside(Path('manifest.json'))}",
    ],
)
def test_what_dead_processes_left_is_cleared_away(output: Path, left: str) -> None:
    half = output / left
    half.parent.mkdir(parents=True, exist_ok=True)
    half.write_text("half")
    run_in(output, task("b"))
    assert not half.exists()


@pytest.mark.parametrize("content", ["", "{", "[]", '{"schema": 1}', '{"schema": 1, "tasks": {"a": {"key": 3}}}'])
def test_a_damaged_manifest_costs_time_and_nothing_else(output: Path, content: str) -> None:
    run_in(output, task("a", text="1"))
    (output / "manifest.json").write_text(content)
    assert states(run_in(output, task("a", text="1"))) == done("a")
    assert states(run_in(output, task("a", text="1"))) == up_to_date("a")


def test_the_manifest_of_a_newer_program_is_left_alone(output: Path) -> None:
    output.mkdir()
    (output / "manifest.json").write_text('{"schema": 2}')
    with pytest.raises(ManifestError, match="of schema 2, this program knows 1"):
        run_in(output, task("a"))
    assert (output / "manifest.json").read_text() == '{"schema": 2}'


def test_a_record_counts_before_the_manifest_is_written(output: Path, log: Log) -> None:
    with Workspace(output) as workspace, SerialExecutor() as executor:
        run(Plan(three(log), "1"), workspace, executor)
        records = {path: path.read_text() for path in (output / ".workplan" / "records").iterdir()}
        assert len(records) == 3
        assert not (output / "manifest.json").exists()
    log.new()
    # As if the process had been killed before it wrote the manifest.
    (output / "manifest.json").unlink()
    (output / ".workplan" / "records").mkdir()
    for path, content in records.items():
        path.write_text(content)
    assert states(run_in(output, *three(log))) == up_to_date("a", "b", "c")


# -- Ctrl-C and progress ----------------------------------------------------------------------------------------------


def interrupt_after(seconds: float) -> threading.Timer:
    timer = threading.Timer(seconds, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    return timer


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for a process")
@pytest.mark.parametrize("executor", EXECUTORS)
def test_ctrl_c_stops_soon_with_partial_tasks_done_and_the_next_run_goes_on(output: Path, executor: str) -> None:
    slow = task("slow", "sleep", seconds=60)
    tasks = [task("a", text="1"), slow, task("b"), joining("report", "a", "slow", partial=True)]
    timer = interrupt_after(1.5)
    started = time.monotonic()
    outcome = run_in(output, *tasks, executor=EXECUTORS[executor]())
    assert time.monotonic() - started < 3.5
    timer.join()
    assert outcome.interrupted
    assert states(outcome)["a"] == states(outcome)["report"] == State.DONE.value
    assert states(outcome)["slow"] == State.STOPPED.value
    assert contents(output)["report.txt"] == "1"
    assert "slow.txt" not in contents(output)
    assert not (output / ".workplan" / "scratch").exists()
    again = run_in(output, task("a", text="1"), task("slow"), task("b"))
    assert states(again)["a"] == State.UP_TO_DATE.value


class Clock:
    """Time flies: every line of progress is shown."""

    now = 0.0

    def __call__(self) -> float:
        self.now += 10.0
        return self.now


def test_progress_says_what_is_done_and_how_long_it_will_take(output: Path) -> None:
    stream = io.StringIO()
    with Progress(stream, clock=Clock()) as progress:
        run_in(output, task("a"), task("b", "chatter", title="The second"), progress=progress, title="Making")
    lines = stream.getvalue().splitlines()
    assert any(line.startswith(" 50%") and "left  Making" in line for line in lines)
    assert any(line.startswith(" 75%") and line.endswith("Making, The second: half way") for line in lines)
    assert "b.txt is nearly there" in lines
    assert lines[-1].startswith("100%  done in")


@pytest.mark.parametrize("executor", EXECUTORS)
def test_what_is_counted_is_counted_over_all_tasks_and_never_goes_back(output: Path, executor: str) -> None:
    stream = io.StringIO()
    films = [task(f"{n}", "count", to=n, amount=n, unit="frame") for n in (4, 2, 3)]
    run_in(output, films[1])
    with Progress(stream, clock=Clock()) as progress:
        run_in(output, *films, task("a"), executor=EXECUTORS[executor](), progress=progress)
    counts = re.findall(r"frame (\d+) of (\d+)$", stream.getvalue(), re.MULTILINE)
    assert {total for _, total in counts} == {"7"}  # Two are there already.
    numbers = [int(number) for number, _ in counts]
    assert numbers == sorted(numbers)
    if executor == "serial":
        assert [*dict.fromkeys(numbers)] == [1, 2, 3, 4, 5, 6, 7]


def test_an_outcome_counts_in_words() -> None:
    assert str(Outcome()) == "nothing to do"
    assert str(Outcome(states={"a": State.DONE, "b": State.STOPPED})) == "1 done, 1 not begun or stopped"
