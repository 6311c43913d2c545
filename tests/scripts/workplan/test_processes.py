from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from rigid_motion_batch.workplan import Plan, ProcessExecutor, Workspace, run
from tests.scripts.workplan.plans import STEPS, contents, done, joining, run_in, states, task

ROOT = Path(__file__).resolve().parents[3]


def test_tasks_are_done_by_as_many_processes_as_there_are_jobs(tmp_path: Path) -> None:
    run_in(tmp_path, *(task(name, "sleep", seconds=0.4) for name in "abcd"), executor=ProcessExecutor(2))
    workers = set(contents(tmp_path).values())
    assert len(workers) == 2
    assert str(os.getpid()) not in workers


def test_no_more_processes_are_started_than_there_is_work_for(tmp_path: Path) -> None:
    with Workspace(tmp_path) as workspace, ProcessExecutor(4) as executor:
        run(Plan([task("a")], "1"), workspace, executor)
        assert len(executor.processes) == 1


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_a_worker_that_dies_is_replaced_and_its_task_done_again(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    tasks = [task("a"), task("b", "die", marker=str(tmp_path / "marker"), times=2), joining("c", "b")]
    assert states(run_in(tmp_path / "out", *tasks, executor=ProcessExecutor(2))) == done("a", "b", "c")
    assert contents(tmp_path / "out")["c.txt"] == "whole"
    assert capsys.readouterr().err.count("b: its process died (SIGKILL, perhaps for want of memory); trying again") == 2


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_a_task_that_kills_every_worker_is_given_up_and_the_others_go_on(tmp_path: Path) -> None:
    tasks = [task("b", "die", marker=str(tmp_path / "marker"), times=99), task("a")]
    outcome = run_in(tmp_path / "out", *tasks, executor=ProcessExecutor(1), retries=1)
    assert states(outcome) == done("a") | {"b": "failed"}
    assert outcome.failures["b"] == (
        "b: its process died (SIGKILL, perhaps for want of memory); given up after 2 attempts"
    )
    assert contents(tmp_path / "out") == {"a.txt": ""}


def test_the_last_words_of_a_worker_are_passed_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "rigid_motion_batch.workplan.processes._command", lambda: [sys.executable, "-c", "raise SystemExit('no')"]
    )
    outcome = run_in(tmp_path, task("a"), executor=ProcessExecutor(1), retries=0)
    assert outcome.failures["a"] == "a: its process died (exit code 1): no; given up after 1 attempts"


def test_a_worker_is_replaced_after_so_many_tasks(tmp_path: Path) -> None:
    tasks = [task(name, "process_id") for name in "abcdef"]
    run_in(tmp_path, *tasks, executor=ProcessExecutor(1, tasks_per_worker=2))
    assert len(set(contents(tmp_path).values())) == 3


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not tell")
def test_a_worker_that_has_grown_large_is_replaced(tmp_path: Path) -> None:
    tasks = [task("a", "hoard", megabytes=1), task("b", "hoard", megabytes=300), task("c", "hoard", megabytes=1)]
    run_in(tmp_path, *tasks, executor=ProcessExecutor(1, largest_worker=250 << 20))
    workers = [contents(tmp_path)[f"{name}.txt"].split()[0] for name in "abc"]
    assert workers[0] == workers[1] != workers[2]


def test_what_is_printed_in_a_worker_does_not_get_in_the_way(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    assert states(run_in(tmp_path, task("a", "chatter"), executor=ProcessExecutor(1))) == done("a")
    said = capfd.readouterr()
    assert said.out == ""
    assert "Fra:1" not in said.err
    assert "a.txt is nearly there" in said.err


def test_names_and_arguments_of_any_script_reach_the_worker(tmp_path: Path) -> None:
    text = "手術 \U0001f600 \udcff \n \x00"
    made = task("übung 手", text=text.replace("\udcff", ""))
    assert states(run_in(tmp_path, made, executor=ProcessExecutor(1))) == done("übung 手")
    odd = b"clip\xff.csv".decode("utf-8", "surrogateescape")
    outcome = run_in(tmp_path, task("a", "copy", source=odd), executor=ProcessExecutor(1))
    assert "no such file" in outcome.failures["a"]


def test_an_executor_can_be_used_again_after_it_was_stopped(tmp_path: Path) -> None:
    with Workspace(tmp_path) as workspace, ProcessExecutor(1) as executor:
        run(Plan([task("a")], "1"), workspace, executor)
        executor.stop()
        assert executor.processes == []
        assert states(run(Plan([task("b")], "1"), workspace, executor)) == done("b")


RUN = f"""
import sys
from pathlib import Path
sys.path.insert(0, {str(ROOT)!r})
from rigid_motion_batch.workplan import Plan, ProcessExecutor, Task, Workspace, run
tasks = [
    Task(str(n), "{STEPS}:sleep", {{"path": f"{{n}}.txt", "seconds": 60}}, outputs=(f"{{n}}.txt",)) for n in range(2)
]
with Workspace(Path(sys.argv[1])) as workspace, ProcessExecutor(2) as executor:
    run(Plan(tasks, "1"), workspace, executor)
"""


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
        return "State:\tZ" not in Path(f"/proc/{process}/status").read_text()
    except (ProcessLookupError, FileNotFoundError):
        return False


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks for processes where Linux shows them")
def test_no_worker_outlives_its_parent_and_the_lock_dies_with_it(tmp_path: Path) -> None:
    parent = subprocess.Popen([sys.executable, "-c", RUN, str(tmp_path)], stderr=subprocess.DEVNULL)
    ends = time.monotonic() + 30.0
    while sum(len(files) for *_, files in os.walk(tmp_path / ".workplan" / "scratch")) < 2 and time.monotonic() < ends:
        time.sleep(0.02)
    children = Path(f"/proc/{parent.pid}/task/{parent.pid}/children").read_text().split()
    assert len(children) == 2
    parent.kill()
    parent.wait()
    ends = time.monotonic() + 5.0
    while any(alive(int(child)) for child in children) and time.monotonic() < ends:
        time.sleep(0.02)
    assert not any(alive(int(child)) for child in children)
    assert states(run_in(tmp_path, task("0"), task("1"))) == done("0", "1")
    assert contents(tmp_path) == {"0.txt": "", "1.txt": ""}


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_whichever_worker_is_killed_whenever_the_outputs_are_the_same(tmp_path: Path) -> None:
    tasks = [task(f"{n}", "sleep", seconds=0.02) for n in range(40)]
    tasks = [*tasks, joining("all", *(f"{n}" for n in range(0, 40, 7)))]
    with Workspace(tmp_path) as workspace, ProcessExecutor(2) as executor:
        over = threading.Event()

        def murder() -> None:
            finished = -1
            while not over.wait(0.23):
                # On a busy machine a worker takes longer to begin: one that is to be killed has let something be done.
                if (now := len(list(tmp_path.glob("*.txt")))) > finished:
                    finished = now
                    for process in executor.processes[:1]:
                        os.kill(process, signal.SIGKILL)

        killer = threading.Thread(target=murder)
        killer.start()
        outcome = run(Plan(tasks, "1"), workspace, executor, retries=50)
        over.set()
        killer.join()
    assert set(states(outcome).values()) == {"done"}
    assert all(text.isdecimal() for text in contents(tmp_path).values())
