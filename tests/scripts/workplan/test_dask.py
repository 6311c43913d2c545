"""The same work done by the workers of a Dask scheduler, all of them processes of their own on this machine."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from distributed import Client

from rigid_motion_batch.cli import compare
from rigid_motion_batch.workplan import ExecutorError, Plan, Workspace, run
from rigid_motion_batch.workplan.dask_executor import DaskExecutor
from rigid_motion_batch.workplan.running import order_for
from tests.scripts.comparing import outputs, write_toss
from tests.scripts.workplan.plans import STEPS, contents, done, joining, run_in, states, task
from tests.thoroughness import THOROUGH

ROOT = Path(__file__).resolve().parents[3]

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

    def __init__(self, output: Path, address: str, version: str = "1") -> None:
        self.notes: list[str] = []
        self.executor = DaskExecutor(
            address, output, identify=f"{STEPS}:identify", version=version, note=self.notes.append
        )

    def wait_for_workers(self, count: int) -> None:
        def there() -> bool:
            self.executor.wait(lambda _: None, 0.1)
            return len(self.executor.workers) == count

        wait_for(there)


def children(process: int) -> list[int]:
    """Those of all threads of a process."""
    found = [path.read_text().split() for path in Path(f"/proc/{process}/task").glob("*/children")]
    return [int(child) for some in found for child in some]


def test_tasks_are_done_by_the_workers_and_say_how_they_get_on(
    cluster: Cluster, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    connecting = Connecting(tmp_path, cluster.address)
    tasks = [*(task(name, "sleep", seconds=0.4) for name in "abcd"), task("chat", "chatter"), joining("all", "a", "b")]
    with Workspace(tmp_path) as workspace, connecting.executor as executor:
        connecting.wait_for_workers(2)
        outcome = run(Plan(tasks, "1"), workspace, executor)
    made = contents(tmp_path)
    assert states(outcome) == done("a", "b", "c", "d", "chat", "all")
    assert made["all.txt"] == made["a.txt"] + made["b.txt"]
    assert len({made[f"{name}.txt"] for name in "abcd"}) == 2
    assert "chat.txt is nearly there" in capsys.readouterr().err
    assert os.listdir(tmp_path / ".workplan") == ["plan.json"]


def test_a_task_that_fails_or_kills_its_process_is_told_and_the_others_go_on(
    cluster: Cluster, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    tasks = [task("bad", "fail"), task("b", "die", marker=str(tmp_path / "marker"), times=1), task("c")]
    outcome = run_in(out, *tasks, executor=Connecting(out, cluster.address).executor)
    assert states(outcome) == {"bad": "failed"} | done("b", "c")
    assert contents(out) == {"b.txt": "whole", "c.txt": ""}
    said = capsys.readouterr().err
    assert "bad.txt: cannot be made; make another" in said
    assert "b: its process died (SIGKILL, perhaps for want of memory); trying again" in said


def test_a_run_that_stops_leaves_no_process_at_work(cluster: Cluster, tmp_path: Path) -> None:
    workers = [process.pid for process in cluster.workers]
    connecting = Connecting(tmp_path, cluster.address)
    with Workspace(tmp_path) as workspace, connecting.executor as executor:
        connecting.wait_for_workers(len(workers))
        order = order_for(task("a", "sleep", seconds=600.0), {}, (), workspace)
        executor.submit(order)
        wait_for(lambda: list(workspace.own.glob("scratch/*/a.txt")))
        before = [child for worker in workers for child in children(worker)]
        executor.stop()
        wait_for(lambda: len([child for worker in workers for child in children(worker)]) < len(before))
        wait_for(lambda: not list(workspace.own.glob("scratch/*/a.txt")))


def test_workers_of_another_version_are_left_out(cluster: Cluster, tmp_path: Path) -> None:
    connecting = Connecting(tmp_path, cluster.address, version="2")
    with Workspace(tmp_path), pytest.raises(ExecutorError, match="none of its workers is fit"):
        connecting.executor.__enter__()
    assert connecting.notes[-1].endswith(": it has 1, and this is 2; it is left out")


def test_a_worker_without_this_program_is_left_out_and_lives(cluster: Cluster, tmp_path: Path) -> None:
    connecting = Connecting(tmp_path, cluster.address)
    with Workspace(tmp_path), connecting.executor as executor:
        stranger = cluster.add_worker(program=tmp_path)

        def left_out() -> bool:
            executor.wait(lambda _: None, 0.1)
            return any("it cannot import rigid_motion_batch.workplan.dask_worker" in note for note in connecting.notes)

        # The stranger may have been left out before the others were asked who they are.
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


COMPARE = (sys.executable, ROOT / "scripts" / "compare.py")
OPTIONS = ("--rates", "5", "--modes", "lerp_slerp,motor_spline", "--resolution", "64x36", "--fps", "10")

MOMENTS = int(os.environ.get("RIGID_MOTION_KILLS", "2" if THOROUGH else "1"))
"""How many times a run is killed, in turn the program and a Dask worker."""


def start(clip: Path, output: Path, *who: str) -> subprocess.Popen:
    """In the folder of the clip, which is not that of the workers."""
    command = [*COMPARE, clip.name, *OPTIONS, *who, "--output", output]
    return subprocess.Popen(command, cwd=clip.parent, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def assert_well_ended(process: subprocess.Popen) -> None:
    _, said = process.communicate(timeout=240)
    assert process.returncode == 0, said


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_toss(tmp_path_factory.mktemp("clips") / "toss.csv")


@pytest.fixture(scope="module")
def wanted(clip: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What comes out on one machine."""
    folder = tmp_path_factory.mktemp("here")
    assert compare.main([str(clip), *OPTIONS, "--jobs", "0", "--output", str(folder)]) == 0
    assert "toss/5/comparison.mp4" in outputs(folder)
    return outputs(folder)


def test_compare_makes_the_same_of_a_recording_as_on_one_machine_whatever_is_killed(
    cluster: Cluster, clip: Path, wanted: dict[str, bytes], tmp_path: Path
) -> None:
    who = ("--scheduler", cluster.address)
    started = time.monotonic()
    assert_well_ended(start(clip, tmp_path / "out", *who))
    seconds = time.monotonic() - started
    assert outputs(tmp_path / "out") == wanted
    chance = random.Random(5)
    for number in range(MOMENTS):
        # The next one is to have something to do.
        for path in [*(tmp_path / "out").rglob("*.mp4"), *(tmp_path / "out").rglob("keys.csv")]:
            path.unlink()
        process = start(clip, tmp_path / "out", *who)
        time.sleep(chance.uniform(0.2, 0.9) * seconds)
        if number % 2:
            chance.choice(cluster.workers).kill()
            cluster.add_worker()
            assert_well_ended(process)
            assert outputs(tmp_path / "out") == wanted
        else:
            process.kill()
            process.communicate()
            found = outputs(tmp_path / "out")
            assert [path for path, content in found.items() if content not in (wanted[path], b"")] == []
    assert_well_ended(start(clip, tmp_path / "out", *who))
    assert outputs(tmp_path / "out") == wanted


def test_compare_without_a_scheduler_says_so(clip: Path, tmp_path: Path) -> None:
    command = [*COMPARE, clip, "--no-video", "--scheduler", "tcp://127.0.0.1:9", "--output", tmp_path / "out"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 2
    assert ended.stderr.startswith("compare.py: tcp://127.0.0.1:9: no Dask scheduler answers there")
    assert not (tmp_path / "out").exists()


def test_workers_may_come_and_die_and_the_scheduler_too_and_nothing_is_lost(tmp_path: Path) -> None:
    tasks = [*(task(f"{n}", "sleep", seconds=0.4) for n in range(8)), joining("all", *map(str, range(8)))]
    later = [*tasks, *(task(f"later {n}", "sleep", seconds=3.0) for n in range(4))]
    (tmp_path / "dask").mkdir()
    out = tmp_path / "out"
    with cluster_in(tmp_path / "dask", workers=0) as cluster, Workspace(out) as workspace:
        connecting = Connecting(out, cluster.address)
        with connecting.executor as executor:
            assert connecting.notes == [
                f"{cluster.address} has no worker; waiting for one: `dask worker {cluster.address}`"
            ]
            first, _ = cluster.add_worker(), cluster.add_worker()
            connecting.wait_for_workers(2)
            when_done = threading.Thread(target=wait_for, args=(lambda: (out / "1.txt").exists() and not first.kill(),))
            when_done.start()
            outcome = run(Plan(tasks, "1"), workspace, executor)
            when_done.join()
            assert states(outcome) == done(*(f"{n}" for n in range(8)), "all")
            assert [note.split(" ", 2)[2] for note in connecting.notes[1:]] == ["is gone; others go on with its tasks"]

            def at_work() -> bool:
                return bool(list(workspace.own.glob("scratch/*/later*"))) and not cluster.scheduler.kill()

            when_at_work = threading.Thread(target=wait_for, args=(at_work,))
            when_at_work.start()
            outcome = run(Plan(later, "1"), workspace, executor)
            when_at_work.join()
            assert outcome.problem == f"{cluster.address}: the Dask scheduler is gone"
    made = contents(out)
    assert "half" not in "".join(made.values())
    assert made["all.txt"] == "".join(made[f"{n}.txt"] for n in range(8))
