"""Tests of commands that are stopped, or crash, during work that Python cannot interrupt."""

import os
import signal
import time
from pathlib import Path

import pytest

from rigid_motion_batch import supervising
from rigid_motion_batch.recordings import importing
from tests.scripts.baking import one_object_file
from tests.scripts.processes import CRASH, alive, descendants, start
from tests.scripts.reducing import listed, write_csv

SOON = 5.0
"""Allowed seconds until a stopped command ends: on an idle machine it takes 1.3."""

pytestmark = [
    pytest.mark.blender,
    pytest.mark.any_blender,
    pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks for processes where Linux has them"),
]


def files(folder: Path) -> list[str]:
    return [name for name in listed(folder) if name != "stuck"]


STOPPED = "Stopped. 1 object of 1 file reduced; at most 4.6 mm off (hand.csv); 1 file not reached."


@pytest.mark.parametrize(
    ("command", "done", "last", "by"),
    [
        (("reduce.py", "hand.csv", "slow.csv", "hand.csv", "--jobs", 0), ["hand-keys.csv"], STOPPED, signal.SIGINT),
        (("compare.py", "slow.csv", "--no-video", "--output", "made", "--jobs", 2), [], "Stopped. ", signal.SIGINT),
        (("stream.py", "send", "slow.csv", "--room", "r"), [], "Stopped. ", signal.SIGTERM),
    ],
    ids=["reduce", "workers of compare", "sender"],
)
def test_a_reader_at_work_does_not_keep_a_command_from_its_end(tmp_path, command, done, last, by):
    for name in ("hand.csv", "slow.csv"):
        write_csv(tmp_path / name)
    run = start(tmp_path, *command, where="slow.csv")
    run.wait_until_stuck()
    processes = descendants(run.process.pid)
    started = time.monotonic()
    while run.process.poll() is None and time.monotonic() < started + SOON:
        # Like a terminal when Ctrl-C is pressed again and again: all processes get the signal.
        os.killpg(run.process.pid, by)
        time.sleep(0.002)
    seconds = time.monotonic() - started
    printed, said, _ = run.end()
    assert (run.process.returncode, printed.split()) == (128 + by, done), said
    assert said.splitlines()[-1].startswith(last)
    assert "Traceback" not in said
    assert seconds < SOON
    assert {*files(tmp_path)} - {"made"} == {"hand.csv", "slow.csv", *done}
    assert list(run.temporary.iterdir()) == []
    time.sleep(0.2)
    assert not any(map(alive, processes))


def test_what_is_half_written_is_gone(tmp_path):
    one_object_file(tmp_path / "shot.blend")
    run = start(tmp_path, "bake.py", "shot.blend", "--output", "new/farm", where="shot-")
    run.wait_until_stuck()
    assert len(listed(tmp_path / "new" / "farm")) == 1
    run.process.send_signal(signal.SIGTERM)
    printed, said, seconds = run.end()
    assert (run.process.returncode, printed) == (128 + signal.SIGTERM, ""), said
    assert said.splitlines()[-1].startswith("Stopped. Nothing ")
    assert seconds < SOON
    assert files(tmp_path) == ["new", "shot.blend"]
    assert listed(tmp_path / "new" / "farm") == []
    assert list(run.temporary.iterdir()) == []


@pytest.mark.parametrize(("options", "paths"), [((), "hand-keys.csv\n"), (("--json",), "")])
def test_a_crash_names_the_file_that_it_came_at_and_what_is_complete(tmp_path, options, paths):
    for name in ("hand", "slow", "last"):
        write_csv(tmp_path / f"{name}.csv")
    inputs = ("hand.csv", "slow.csv", "last.csv", "--jobs", 0, *options)
    run = start(tmp_path, "reduce.py", *inputs, where="slow.csv", act=CRASH)
    printed, said, _ = run.end()
    assert (run.process.returncode, printed) == (1, paths)
    assert said.splitlines()[-2:] == [
        "reduce.py: the process died (SIGSEGV) at slow.csv: leave that out, or see whether Blender opens it",
        "1 object of 1 file reduced; at most 4.6 mm off (hand.csv); 2 files not reached.",
    ]
    assert "Traceback" not in said
    assert list(run.temporary.iterdir()) == []


def test_no_child_outlives_a_command_that_is_killed(tmp_path):
    write_csv(tmp_path / "slow.csv")
    run = start(tmp_path, "reduce.py", "slow.csv", where="slow.csv")
    run.wait_until_stuck()
    processes = descendants(run.process.pid)
    run.process.kill()
    run.end()
    deadline = time.monotonic() + SOON
    while any(map(alive, processes)) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert processes
    assert not any(map(alive, processes))


def test_the_last_words_are_of_the_command_where_its_child_is_killed(tmp_path):
    write_csv(tmp_path / "slow.csv")
    run = start(tmp_path, "reduce.py", "slow.csv", "--jobs", 1, where="slow.csv")
    run.wait_until_stuck()
    os.kill(descendants(run.process.pid)[0], signal.SIGKILL)
    _, said, _ = run.end()
    assert run.process.returncode == 1, said
    assert "resource_tracker" not in said


def test_ctrl_c_within_an_importer_or_exporter_is_no_fault_of_the_file(tmp_path):
    # In the form that bpy.ops raises.
    interrupted = RuntimeError("Error: Python: Traceback (most recent call last):\n  File ...\nKeyboardInterrupt\n")

    def importer() -> None:
        raise interrupted

    with pytest.raises(KeyboardInterrupt):
        importing.run_operator(tmp_path / "walk.fbx", "import", importer)


@pytest.mark.parametrize("moment", [0.0, 0.3])
def test_ctrl_c_at_the_very_beginning_is_no_traceback(tmp_path, moment):
    write_csv(tmp_path / "slow.csv")
    run = start(tmp_path, "reduce.py", "slow.csv", where="slow.csv")
    time.sleep(0.15 + moment)
    os.killpg(run.process.pid, signal.SIGINT)
    printed, said, seconds = run.end()
    assert printed == ""
    assert seconds < SOON
    assert files(tmp_path) == ["slow.csv"]
    # Before the program has started, Python ends in its own way: by the signal, or with its own traceback.
    if run.process.returncode != -signal.SIGINT and "init_import_site" not in said:
        assert run.process.returncode == 130
        assert said.splitlines()[-1].startswith("Stopped. ")
        assert "Traceback" not in said


@pytest.mark.parametrize(("given", "threads"), [(None, "1"), ("2", "2")])
def test_numpy_has_one_thread_in_commands_unless_it_is_given_more(given, threads, monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    if given:
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", given)

    def popen(_: object, env: dict[str, str]) -> None:
        raise RuntimeError(env["OPENBLAS_NUM_THREADS"])

    monkeypatch.setattr(supervising.subprocess, "Popen", popen)
    with pytest.raises(RuntimeError, match=f"^{threads}$"):
        supervising.supervise("compare.py")
