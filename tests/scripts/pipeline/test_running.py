"""Tests of runs of plans: with any executor, in separate processes, and if one dies."""

import json
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from rigid_motion_batch.pipeline.executors import Executor, ProcessExecutor
from rigid_motion_batch.pipeline.running import Run, share_of
from rigid_motion_batch.pipeline.steps import OWN_FOLDER, Step, Task
from rigid_motion_batch.pipeline.store import Store
from tests.scripts.pipeline import steps
from tests.scripts.pipeline.plans import Listener, contents, half_written, joining, run, run_in, states, task, writing
from tests.scripts.pipeline.steps import FILE, Die, Fail, Join, Write


class Log:
    """The log of started tasks; `new` returns those since its last call."""

    def __init__(self, path: Path) -> None:
        self.path, self.seen = path, 0

    def __str__(self) -> str:
        return str(self.path)

    def new(self) -> list[str]:
        lines = self.path.read_text().split() if self.path.exists() else []
        lines, self.seen = lines[self.seen :], len(lines)
        return sorted(lines)


@pytest.fixture
def log(tmp_path: Path) -> Log:
    return Log(tmp_path / "log")


def test_an_error_that_nobody_foresaw_names_its_task_and_a_file_says_where(output: Path) -> None:
    outcome = run_in(output, writing("a"), task("the bad one", Fail("unforeseen")))
    assert outcome.failures["the bad one"] == "the bad one: KeyError: 'unforeseen'"
    failures = json.loads((output / OWN_FOLDER / "failures.json").read_text())
    assert "in make" in failures["the bad one"]["details"]
    run_in(output, writing("a"))
    run_in(output, writing("b"))
    assert json.loads((output / OWN_FOLDER / "failures.json").read_text()) == {}


def test_a_task_that_does_not_make_what_it_publishes_has_failed(output: Path) -> None:
    outcome = run_in(output, writing("a", publish={"forgotten.txt": "a.txt"}))
    assert outcome.failures["a"] == f"{output / 'a.txt'}: this was to be made, and was not"


def test_an_input_that_vanishes_while_it_is_read_is_said_and_nothing_comes_of_it(output: Path, tmp_path: Path) -> None:
    source = tmp_path / "in.csv"
    source.write_text("1")
    with Store(output) as store:
        outcome = run(lambda: [task("a", steps.Vanish(), inputs=store.inputs(source))], store, Executor())
    assert "changed while it was read" in outcome.failures["a"]
    assert contents(output) == {}


def test_a_plan_is_taken_task_by_task(output: Path) -> None:
    """With ten thousand clips, only a few may be in memory."""
    ahead: list[int] = []

    def plan() -> Iterator[Task]:
        for number in range(40):
            ahead.append(number - len(list(output.glob("*.txt"))))
            yield writing(f"{number}")

    with Store(output) as store:
        run(plan, store, Executor())
    assert max(ahead[40:]) <= 1


def film(output: Path, log: object, piece: str = "1", step: Step | None = None, **options: object) -> Run:
    """Run a plan of a film, with pieces that are made only if the film is missing."""
    pieces = [Task(Write(text, str(log)), f"piece {text}") for text in (piece, "2")]
    whole = task("film", step or Join(str(log)), *pieces, spends=tuple(item.key for item in pieces))
    with Store(output, **options) as store, Executor() as executor:
        return run(lambda: [whole] if store.index_of(whole.key) else [*pieces, whole], store, executor)


def kept(output: Path) -> int:
    return len(os.listdir(output / OWN_FOLDER / "results"))


def test_spent_results_go_when_what_wanted_them_is_done(output: Path, log: Log) -> None:
    film(output, log)
    assert contents(output) == {"film.txt": "12"}
    assert kept(output) == 1
    log.new()
    assert states(film(output, log)) == {"up to date": 1}
    (output / "film.txt").unlink()
    film(output, log)
    assert log.new() == []
    film(output, log, "3")
    assert log.new() == ["2", "3", "join"]
    assert contents(output) == {"film.txt": "32"}


def test_results_stay_for_a_task_that_failed(output: Path, log: Log) -> None:
    film(output, log, step=Fail())
    assert log.new() == ["1", "2"]
    assert kept(output) == 2
    film(output, log)
    assert log.new() == ["join"]
    assert kept(output) == 1


@pytest.mark.parametrize("parts", [1, 2, 3])
def test_the_shares_of_a_plan_make_the_whole(output: Path, log: Log, parts: int) -> None:
    first = [writing(f"{n}", f"{n}", log) for n in range(5)]
    tasks = [*first, joining("pair", *first[:2], log=log), task("all", steps.Report(str(log)), *first)]
    for stage in ("write", "join", "report"):
        for number in range(1, parts + 1):
            outcome = run_in(output, *tasks, alone=False, share=(stage, number, parts))
            assert not outcome.failures
    assert contents(output)["all.txt"] == "01234"
    assert contents(output)["pair.txt"] == "01"
    assert log.new() == ["0", "1", "2", "3", "4", "join", "join"]
    assert states(run_in(output, *tasks)) == {"up to date": 7}


def test_shares_are_even_and_a_task_goes_with_what_it_reads() -> None:
    firsts = [writing(f"{n}") for n in range(6)]
    pairs = [item for first in firsts for item in (first, task(f"after {first.name}", Write("x"), first))]
    shares = [[item.name for item in share_of(lambda: pairs, "write", number, 3)] for number in (1, 2, 3)]
    assert shares == [[f"{n}", f"after {n}", f"{n + 3}", f"after {n + 3}"] for n in range(3)]


def test_a_full_disk_ends_the_run_with_what_is_done_in_place(output: Path) -> None:
    full = task("b", Fail("full disk"), publish={f"x/{FILE}": "another.txt", FILE: "b.txt"})
    outcome = run_in(output, writing("a", "1"), full, writing("c"))
    assert states(outcome) == {"done": 1, "failed": 1, "not begun or stopped": 1}
    assert outcome.problem == f"b: {output / 'b.txt'}: {os.strerror(28)}"
    assert contents(output) == {"a.txt": "1"}
    assert states(run_in(output, writing("a", "1"), writing("b"), writing("c"))) == {"up to date": 1, "done": 2}


def test_a_disk_that_fills_up_while_files_are_published_ends_the_run(output, monkeypatch):
    replace = os.replace

    def full(source: str, target: str) -> None:
        if Path(target).name == "b.txt":
            raise OSError(28, os.strerror(28), target)
        replace(source, target)

    monkeypatch.setattr(os, "replace", full)
    outcome = run_in(output, writing("a"), writing("b"), writing("c"))
    assert outcome.problem == f"{output / 'b.txt'}: {os.strerror(28)}"
    assert sorted(contents(output)) == ["a.txt"]
    monkeypatch.undo()
    assert states(run_in(output, writing("a"), writing("b"), writing("c"))) == {"up to date": 1, "done": 2}


def test_a_run_that_made_nothing_leaves_nothing(output: Path) -> None:
    run_in(output / "deeper", task("bad", Fail()))
    assert not output.exists()


@pytest.mark.parametrize("executor", [Executor, partial(ProcessExecutor, 2)], ids=["serial", "processes"])
def test_ctrl_c_leaves_what_is_done_and_nothing_half_written(output: Path, executor: Callable[[], Executor]) -> None:
    def interrupt() -> None:
        while not (output / "a.txt").exists():
            time.sleep(0.02)
        signal.raise_signal(signal.SIGINT) if os.name == "nt" else os.kill(os.getpid(), signal.SIGINT)

    first, slow = writing("a", "1"), task("slow", Write("2", seconds=60.0))
    tasks = [first, slow, joining("b", slow), task("report", steps.Report(), first, slow)]
    threading.Thread(target=interrupt, daemon=True).start()
    outcome = run_in(output, *tasks, executor=executor())
    assert outcome.interrupted
    assert states(outcome) == {"done": 1, "not begun or stopped": 3}
    assert contents(output) == {"a.txt": "1"}
    assert half_written(output) == []


def test_progress_is_told_in_weights_and_names(output: Path) -> None:
    listener = Listener()
    tasks = [writing("a", seconds=2.0), task("b", steps.Chatter(), seconds=4.0)]
    outcome = run_in(output, *tasks, executor=ProcessExecutor(2), progress=listener)
    assert listener.total == 6.0
    assert any(doing == "b" and done in (2.0, 4.0) for done, doing in listener.reached)  # Half of the total is 2.0.
    assert listener.reached[-1][0] == 6.0
    assert states(outcome) == {"done": 2}


needs_signals = pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")


def test_tasks_are_done_by_as_many_processes_as_there_are_jobs(output: Path) -> None:
    tasks = [task(name, steps.ProcessId(name, 0.4)) for name in "abcd"]
    run_in(output, *tasks, executor=ProcessExecutor(2))
    workers = set(contents(output).values())
    assert len(workers) == 2
    assert str(os.getpid()) not in workers


@needs_signals
def test_a_worker_that_dies_is_replaced_and_its_task_done_again(output: Path, tmp_path: Path) -> None:
    dying = task("b", Die(str(tmp_path / "marker"), 2))
    listener = Listener()
    tasks = [writing("a"), dying, joining("c", dying)]
    assert states(run_in(output, *tasks, executor=ProcessExecutor(2), progress=listener)) == {"done": 3}
    assert contents(output)["c.txt"] == "whole"
    said = "b: its process died (SIGKILL, perhaps for want of memory); trying again"
    assert listener.notes == [said, said]


@needs_signals
def test_a_task_that_kills_every_worker_is_given_up_and_the_others_go_on(output: Path, tmp_path: Path) -> None:
    bad = task("bad", Fail())
    needs_bad = joining("c", bad)
    tasks = [task("b", Die(str(tmp_path / "marker"), 99, "reading\nno such bone: Hand\n\n")), bad, writing("a")]
    outcome = run_in(output, *tasks, needs_bad, joining("d", needs_bad), executor=ProcessExecutor(1))
    assert states(outcome) == {"failed": 2, "done": 1, "skipped": 2}
    assert outcome.failures["bad"] == "it cannot be made; make another"
    died = "its process died (SIGKILL, perhaps for want of memory): no such bone: Hand"
    assert outcome.failures["b"] == f"b: {died}; given up after 3 attempts"
    assert contents(output) == {"a.txt": "a"}


def test_what_is_printed_in_a_worker_does_not_get_in_the_way(output: Path, capfd: pytest.CaptureFixture) -> None:
    run_in(output, task("a", steps.Chatter()), executor=ProcessExecutor(1))
    assert capfd.readouterr() == ("", "")


def test_an_executor_can_be_used_again_after_it_was_stopped(output: Path) -> None:
    with Store(output) as store, ProcessExecutor(1) as executor:
        run(lambda: [writing("a")], store, executor)
        executor.stop()
        assert states(run(lambda: [writing("b")], store, executor)) == {"done": 1}
