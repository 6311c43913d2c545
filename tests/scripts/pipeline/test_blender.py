"""Tests of steps run by a Blender program, named by `BLENDER`; otherwise by a stand-in, a Python with bpy."""

import os
import signal
import sys
import threading
import time
from pathlib import Path

import pytest

from rigid_motion_batch.cli.compare import version_of
from rigid_motion_batch.pipeline import running
from rigid_motion_batch.pipeline.executors import ProcessExecutor
from rigid_motion_batch.pipeline.running import Run
from rigid_motion_batch.pipeline.steps import OWN_FOLDER, RunError, Task
from rigid_motion_batch.pipeline.store import Store
from tests.scripts.pipeline.plans import Listener, contents, half_written, run, states, task, writing
from tests.scripts.pipeline.steps import Save
from tests.scripts.processes import alive, descendants

ROOT = Path(__file__).resolve().parents[3]

STAND_IN = """#!{python}
import bpy, sys
if "--version" in sys.argv:
    print("Blender", bpy.app.version_string)
else:
    exec(sys.argv[sys.argv.index("--python-expr") + 1])
"""


@pytest.fixture(params=["program", "stand-in"])
def blender(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.delenv("PYTHONPATH")  # Blender ignores it.
    monkeypatch.chdir(ROOT)
    if request.param == "program":
        if "BLENDER" not in os.environ:
            pytest.skip("needs BLENDER, the path of a Blender program: .ci/blender-window, for instance")
        return os.environ["BLENDER"]
    if os.name == "nt":
        pytest.skip("Windows runs no scripts by their first line")
    path = tmp_path / "blender"
    path.write_text(STAND_IN.format(python=sys.executable))
    path.chmod(0o755)
    return str(path)


def saving(scene: Save, store: Store, *after: Task, source: Path | None = None) -> Task:
    inputs = store.inputs(*filter(None, [source]))
    publish = {"scene.blend": "scene.blend", "out.txt": "out.txt"}
    return task("save", scene, *after, inputs=inputs, publish=publish)


def saved(output: Path, blender: str, fate: str = "", listener: Listener | None = None) -> Run:
    with Store(output) as store, ProcessExecutor(1) as executor:
        tasks = [saving(Save("one", (1, 2), fate), store)]
        return run(lambda: tasks, store, executor, blender=blender, progress=listener or Listener())


def test_a_step_is_done_by_the_program(blender: str, tmp_path: Path) -> None:
    source = tmp_path / "in.csv"
    source.write_text("source")
    with Store(tmp_path / "out") as store, ProcessExecutor(1) as executor:
        before = writing("a", "before ")
        tasks = [before, saving(Save("one", (1, 2, 250)), store, before, source=source)]
        outcome = run(lambda: tasks, store, executor, blender=blender)
    assert states(outcome) == {"done": 2}
    said = (tmp_path / "out" / "out.txt").read_text()
    assert said == f"{'BLENDER' in os.environ and blender == os.environ['BLENDER']} before source"
    assert (tmp_path / "out" / "scene.blend").stat().st_size > 1000
    assert half_written(tmp_path / "out") == []


@pytest.mark.slow
def test_an_error_is_told_in_one_line(blender: str, tmp_path: Path) -> None:
    assert saved(tmp_path, blender, "full").problem == f"save: {tmp_path / 'scene.blend'}: No space left on device"


@pytest.mark.slow
def test_a_blender_that_dies_is_started_again(blender: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "MAX_ATTEMPTS", 2)
    listener = Listener()
    outcome = saved(tmp_path / "out", blender, "killed", listener)
    assert [note.partition(" (")[0] for note in listener.notes] == ["save: its process died"]
    assert outcome.failures["save"].endswith("given up after 2 attempts")
    assert contents(tmp_path / "out") == {}


def test_a_blender_says_which_it_is(blender: str) -> None:
    assert version_of(blender).count(".") == 2


@pytest.mark.parametrize("path", ["/nowhere/blender", "/bin/true", "/tmp"])
def test_what_is_no_blender_is_said_to_be_none(path: str) -> None:
    with pytest.raises(RunError, match=f"{path}: .*; give the path of a Blender program"):
        version_of(path)


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks for processes where Linux shows them")
def test_a_blender_ends_with_what_started_it(blender: str, tmp_path: Path) -> None:
    pids: list[int] = []

    def kill() -> None:
        ends = time.monotonic() + 60.0
        while not list(tmp_path.glob(f"{OWN_FOLDER}/scratch/*/*/*/begun")) and time.monotonic() < ends:
            time.sleep(0.05)
        pids.append(descendants(os.getpid())[-1])
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=kill, daemon=True).start()
    assert saved(tmp_path, blender, "slow").interrupted
    ends = time.monotonic() + 10.0
    while alive(pids[0]) and time.monotonic() < ends:
        time.sleep(0.05)
    assert not alive(pids[0])
