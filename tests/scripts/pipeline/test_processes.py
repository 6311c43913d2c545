"""Tests of tasks in separate processes: how many run, and what happens if one dies."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from rigid_motion_batch.pipeline.executors import ProcessExecutor
from rigid_motion_batch.pipeline.store import Store
from tests.scripts.pipeline import steps
from tests.scripts.pipeline.plans import Listener, contents, joining, run, run_in, states, task, writing
from tests.scripts.pipeline.steps import Die, Fail

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
