"""The same work done by the workers of a Dask scheduler, all of them processes of their own on this machine."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from distributed import Client

from rigid_motion_batch.cli import compare
from rigid_motion_batch.pipeline import dask
from rigid_motion_batch.pipeline.dask import DaskExecutor
from rigid_motion_batch.pipeline.steps import OWN_FOLDER, RunError
from tests.scripts.comparing import outputs, write_toss
from tests.scripts.pipeline.plans import half_written
from tests.scripts.stopping import descendants

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


def wait_for(condition: Callable[[], object], seconds: float = 120.0) -> None:
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
        wait_for(lambda: self.executor.capacity == count)


def processor_time(processes: Iterable[int]) -> int:
    """Clock ticks that processes have taken, of those that still live."""
    result = 0
    for process in processes:
        with suppress(FileNotFoundError, ProcessLookupError):
            taken = Path(f"/proc/{process}/stat").read_text().rsplit(") ", 1)[1].split()[11:13]
            result += sum(map(int, taken))
    return result


def at_work(output: Path) -> list[Path]:
    """What is printed by orders that are being done."""
    return [*output.glob(f"{OWN_FOLDER}/scratch/*/*/log")]


@contextmanager
def comparing(arguments: list[str], said: Path | None = None) -> Iterator[subprocess.Popen]:
    """A comparison at work, which is ended with the block, and a file for what it says."""
    command = [sys.executable, "-m", "rigid_motion_batch", "compare", *arguments]
    with (said or Path(os.devnull)).open("w") as stream, subprocess.Popen(command, stderr=stream) as process:
        try:
            yield process
        finally:
            process.terminate()


FILMED = ("--rates", "5", "--modes", "lerp_slerp", "--resolution", "64x36", "--fps", "30")


def options(clips: list[Path], output: Path, cluster: Cluster, *more: str) -> list[str]:
    return [*map(str, clips), *(more or FILMED), "--output", str(output), "--scheduler", cluster.address]


@pytest.fixture
def clips(tmp_path: Path) -> list[Path]:
    """Two clips and one that nobody can read."""
    (tmp_path / "clips").mkdir()
    bad = tmp_path / "clips" / "bad.csv"
    bad.write_text("junk\n")
    return [bad, *(write_toss(tmp_path / "clips" / f"{name}.csv") for name in ("one", "two"))]


@pytest.mark.blender
@pytest.mark.any_blender
@pytest.mark.slow
def test_the_workers_make_what_one_machine_makes_and_say_what_fails(
    cluster: Cluster, clips: list[Path], tmp_path: Path, capfd: pytest.CaptureFixture
) -> None:
    shared, alone = tmp_path / "shared", tmp_path / "alone"
    assert compare.main([*options(clips, shared, cluster), "--json"]) == 1
    printed, said = capfd.readouterr()
    answer = json.loads(printed)
    assert [*answer["failures"]] == [f"read {clips[0]}"]
    assert answer["tasks"]["done"] > 10
    assert "bad.csv:1: no column has a known name" in said
    assert compare.main([*map(str, clips), *FILMED, "--output", str(alone)]) == 1
    assert outputs(shared) == outputs(alone)
    assert half_written(shared) == []
    capfd.readouterr()
    assert compare.main([*options(clips[1:], shared, cluster), "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["tasks"].get("failed", 0) == 0


@pytest.mark.blender
@pytest.mark.any_blender
@pytest.mark.slow
def test_ctrl_c_leaves_no_process_at_work(cluster: Cluster, tmp_path: Path) -> None:
    clips = [write_toss(tmp_path / f"{name}.csv", samples=300) for name in ("one", "two")]
    command = options(clips, tmp_path / "out", cluster, "--rates", "5", "--fps", "120")
    out = tmp_path / "out"
    with comparing(command) as process:
        wait_for(lambda: (out / "report.html").exists() and len(at_work(out)) == 2)  # At films, which take long.
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 130

    def spent() -> int:
        return sum(processor_time(descendants(worker.pid)) for worker in cluster.workers)

    def idle() -> bool:
        before = spent()
        time.sleep(1.0)
        return spent() == before

    wait_for(idle, 20)  # A film takes longer.


@pytest.mark.parametrize(
    ("version", "folder", "told"),
    [
        ("program 2", "", ", and this run is of program 2; start it again with that; it is left out"),
        (dask.version_here(), "none", "it does not see {}"),
    ],
)
def test_workers_that_cannot_do_it_are_left_out(cluster, tmp_path, monkeypatch, version, folder, told):
    monkeypatch.setattr(dask, "version_here", lambda: version)
    connecting = Connecting(tmp_path / folder, cluster.address)
    with pytest.raises(RunError, match="none of its workers is fit"), connecting.executor:
        connecting.wait_for_workers(2)
    assert told.format(tmp_path / folder) in connecting.notes[-1]


def test_a_worker_without_this_program_is_left_out_and_lives(cluster: Cluster, tmp_path: Path) -> None:
    connecting = Connecting(tmp_path, cluster.address)
    with connecting.executor as executor:
        stranger = cluster.add_worker(program=tmp_path)

        def left_out() -> bool:
            capacity = executor.capacity
            return any("No module named 'rigid_motion_batch'" in note for note in connecting.notes) and capacity == 2

        wait_for(left_out)
        assert stranger.poll() is None
    stranger.kill()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("address", "complaint"),
    [
        ("tcp://127.0.0.1:9", "tcp://127.0.0.1:9: no Dask scheduler answers there .*; start one"),
        ("farm", r"farm: no .*\(missing port number .* address that it prints, such as tcp://farm:8786"),
        ("gopher://farm:70", "unknown address scheme 'gopher'"),
    ],
)
def test_a_wrong_address_is_said_to_be_one(tmp_path: Path, address: str, complaint: str) -> None:
    with pytest.raises(RunError, match=complaint):
        Connecting(tmp_path, address).executor.__enter__()


@pytest.mark.blender
@pytest.mark.any_blender
@pytest.mark.slow
def test_workers_may_come_and_die_and_the_scheduler_too_and_nothing_is_lost(clips: list[Path], tmp_path: Path) -> None:
    (tmp_path / "dask").mkdir()
    out, said = tmp_path / "out", tmp_path / "said"
    with cluster_in(tmp_path / "dask", workers=0) as cluster:
        asked = options(clips[1:], out, cluster, "--rates", "5", "--resolution", "320x180", "--fps", "60")
        with comparing(asked, said) as process:
            waiting = f"{cluster.address} has no worker; waiting for one"
            wait_for(lambda: waiting in said.read_text())
            dying = cluster.add_worker()
            wait_for(lambda: at_work(out) and descendants(dying.pid))
            dying.kill()
            wait_for(lambda: said.read_text().count(waiting) == 2)  # What it was doing is for the next that comes.
            cluster.add_worker()
            cluster.add_worker()
            wait_for(lambda: (out / "report.html").exists() and at_work(out))
            cluster.scheduler.kill()
            assert process.wait(120) == 2
        gone = f"{cluster.address}: the Dask scheduler is gone; no finished work is lost"
        assert gone in " ".join(said.read_text().split())
