"""The same work done by the workers of a Dask scheduler, all of them processes of their own on this machine."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from distributed import Client

from rigid_motion_batch.pipeline import dask
from rigid_motion_batch.pipeline.dask import DaskExecutor
from rigid_motion_batch.pipeline.performing import ExecutorError, Order
from rigid_motion_batch.pipeline.running import run
from rigid_motion_batch.pipeline.steps import OWN
from rigid_motion_batch.pipeline.store import Store
from tests.scripts.pipeline import steps
from tests.scripts.pipeline.plans import Listener, contents, joining, states, task, writing
from tests.scripts.pipeline.steps import Die, Fail, Write

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/task").exists(), reason="kills, and looks for processes where Linux shows them"
)

PATH = os.environ["PYTHONPATH"]
"""Of modules: this program, and the steps of the tests."""


class Cluster:
    """Dask's own commands at work. Workers without a nanny, so that one that is killed stays dead."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / "scheduler.json"
        self.processes: list[subprocess.Popen] = []
        options = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show")
        self.scheduler = self._start("scheduler", *options, "--scheduler-file", self.file)
        try:
            wait_for(self._is_announced)
            self.address = json.loads(self.file.read_text())["address"]
        except BaseException:
            self.stop()
            raise

    def _is_announced(self) -> bool:
        """Dask opens the file first and writes it next: for a moment it is there and empty."""
        try:
            return "address" in json.loads(self.file.read_text())
        except (FileNotFoundError, json.JSONDecodeError):
            return False

    @property
    def workers(self) -> list[subprocess.Popen]:
        """Those that live."""
        return [process for process in self.processes[1:] if process.poll() is None]

    def add_worker(self, program: str | Path = PATH) -> subprocess.Popen:
        options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
        command = ("worker", self.address, *options, "--local-directory", self.folder)
        return self._start(*command, program=program)

    def stop(self) -> None:
        for process in self.processes:
            process.kill()
        for process in self.processes:
            process.wait()

    def _start(self, *command: object, program: str | Path = PATH) -> subprocess.Popen:
        process = subprocess.Popen(
            [sys.executable, "-m", "dask", *map(str, command)],
            cwd=self.folder,
            env=os.environ | {"PYTHONPATH": str(program)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self.processes.append(process)
        return process


def wait_for(condition: Callable[[], object], seconds: float = 60.0) -> None:
    ends = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < ends, "it never came to that"
        time.sleep(0.05)


@contextmanager
def cluster_in(folder: Path, workers: int) -> Iterator[Cluster]:
    made = Cluster(folder)
    try:
        for _ in range(workers):
            made.add_worker()
        if workers:
            with Client(made.address, set_as_default=False) as client:
                client.wait_for_workers(workers, timeout=60)
        yield made
    finally:
        made.stop()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with cluster_in(tmp_path_factory.mktemp("dask"), workers=2) as made:
        yield made


class Connecting:
    """An executor on a cluster, with all that it had to say."""

    def __init__(self, folder: Path, address: str) -> None:
        self.notes: list[str] = []
        self.executor = DaskExecutor(address, folder, self.notes.append)

    def wait_for_workers(self, count: int) -> None:
        def there() -> bool:
            self.executor.wait(lambda *_: None, 0.1)
            return len(self.executor.workers) == count

        wait_for(there)


def at_work(process: int) -> list[str]:
    """The processes that a worker has started for tasks."""
    found = [path.read_text().split() for path in Path(f"/proc/{process}/task").glob("*/children")]
    return [one for some in found for one in some if b"spawn_main" in Path(f"/proc/{one}/cmdline").read_bytes()]


def test_tasks_are_done_by_the_workers_and_say_how_they_get_on(cluster: Cluster, tmp_path: Path) -> None:
    with Store(tmp_path) as store:
        connecting, listener = Connecting(store.scratch, cluster.address), Listener()
        slow = [task(name, steps.process_id, Write(name, seconds=0.4)) for name in "abcd"]
        tasks = [*slow, task("chat", steps.chatter), joining("all", *slow[:2])]
        with connecting.executor as executor:
            connecting.wait_for_workers(2)
            outcome = run(lambda: tasks, store, executor, progress=listener)
    made = contents(tmp_path)
    assert states(outcome) == {"done": 6}
    assert made["all.txt"] == made["a.txt"] + made["b.txt"]
    assert len({made[f"{name}.txt"] for name in "abcd"}) == 2
    assert listener.notes == ["it is nearly there"]
    assert any(doing == "chat: half way" for _, doing, _ in listener.reached)
    assert not (tmp_path / OWN / "scratch").exists()


def test_a_task_that_fails_or_kills_its_process_is_told_and_the_others_go_on(cluster: Cluster, tmp_path: Path) -> None:
    dying = task("b", steps.die, Die(str(tmp_path / "marker"), 1))
    tasks, listener = [task("bad", steps.fail, Fail()), dying, writing("c")], Listener()
    with Store(tmp_path / "out") as store, Connecting(store.scratch, cluster.address).executor as executor:
        outcome = run(lambda: tasks, store, executor, progress=listener)
    assert states(outcome) == {"failed": 1, "done": 2}
    assert contents(tmp_path / "out") == {"b.txt": "whole", "c.txt": "c"}
    assert outcome.failures == {"bad": "it cannot be made; make another"}
    said = "b: its process died (SIGKILL, perhaps for want of memory): last words; trying again"
    assert listener.notes == [said]


def test_a_run_that_stops_leaves_no_process_at_work(cluster: Cluster, tmp_path: Path) -> None:
    with Store(tmp_path) as store:
        connecting = Connecting(store.scratch, cluster.address)
        with connecting.executor as executor:
            connecting.wait_for_workers(len(cluster.workers))
            folder = store.new_scratch()
            executor.submit(Order(steps.write, Write("a", seconds=600.0), (), (), {}, str(tmp_path), str(folder)))
            wait_for(lambda: list(folder.parent.glob("*/out.txt")))
            assert any(at_work(worker.pid) for worker in cluster.workers)
        wait_for(lambda: not any(at_work(worker.pid) for worker in cluster.workers))


def test_workers_of_another_version_are_left_out(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask, "LOADED", "program 2")
    connecting = Connecting(tmp_path, cluster.address)
    with pytest.raises(ExecutorError, match="none of its workers is fit"):
        connecting.executor.__enter__()
    assert connecting.notes[-1].endswith(", and this is program 2; it is left out")


def test_workers_that_do_not_see_the_folder_are_left_out(cluster: Cluster, tmp_path: Path) -> None:
    connecting = Connecting(tmp_path / "none", cluster.address)
    with pytest.raises(ExecutorError, match="none of its workers is fit"):
        connecting.executor.__enter__()
    assert f"it does not see {tmp_path / 'none'}" in connecting.notes[-1]


def test_a_worker_without_this_program_is_left_out_and_lives(cluster: Cluster, tmp_path: Path) -> None:
    connecting = Connecting(tmp_path, cluster.address)
    with connecting.executor as executor:
        stranger = cluster.add_worker(program=tmp_path)

        def left_out() -> bool:
            executor.wait(lambda *_: None, 0.1)
            return any("No module named 'rigid_motion_batch'; start" in note for note in connecting.notes)

        wait_for(lambda: left_out() and len(executor.workers) == 2)
        assert stranger.poll() is None
    stranger.kill()


@pytest.mark.parametrize(
    ("address", "complaint"),
    [
        ("tcp://127.0.0.1:9", "tcp://127.0.0.1:9: no Dask scheduler answers there; start one"),
        ("farm", "farm: missing port number .*; give an address such as tcp://farm:8786"),
        ("gopher://farm:70", "unknown address scheme 'gopher'"),
    ],
)
def test_a_wrong_address_is_said_to_be_one_within_seconds(tmp_path: Path, address: str, complaint: str) -> None:
    started = time.monotonic()
    with pytest.raises(ExecutorError, match=complaint):
        Connecting(tmp_path, address).executor.__enter__()
    assert time.monotonic() - started < 10.0


def test_workers_may_come_and_die_and_the_scheduler_too_and_nothing_is_lost(tmp_path: Path) -> None:
    first = [task(f"{n}", steps.process_id, Write(f"{n}", seconds=0.4)) for n in range(8)]
    first.append(joining("all", *first))
    later = [*first, *(task(f"later {n}", steps.write, Write(f"{n}", seconds=3.0)) for n in range(4))]
    (tmp_path / "dask").mkdir()
    out = tmp_path / "out"
    with cluster_in(tmp_path / "dask", workers=0) as cluster, Store(out) as store:
        connecting = Connecting(store.scratch, cluster.address)
        with connecting.executor as executor:
            assert connecting.notes == [
                f"{cluster.address} has no worker; waiting for one: `dask worker {cluster.address}`"
            ]
            dying, _ = cluster.add_worker(), cluster.add_worker()
            connecting.wait_for_workers(2)
            when_done = threading.Thread(target=wait_for, args=(lambda: (out / "1.txt").exists() and not dying.kill(),))
            when_done.start()
            outcome = run(lambda: first, store, executor)
            when_done.join()
            assert states(outcome) == {"done": 9}
            assert [note.split(" ", 2)[2] for note in connecting.notes[1:]] == ["is gone; others go on with its tasks"]

            def are_at_work() -> bool:
                return bool(list(store.scratch.glob("*/out.txt"))) and not cluster.scheduler.kill()

            when_at_work = threading.Thread(target=wait_for, args=(are_at_work,))
            when_at_work.start()
            outcome = run(lambda: later, store, executor)
            when_at_work.join()
            assert outcome.problem == f"{cluster.address}: the Dask scheduler is gone"
    made = contents(out)
    assert "half" not in "".join(made.values())
    assert made["all.txt"] == "".join(made[f"{n}.txt"] for n in range(8))
