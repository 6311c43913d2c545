"""Damage to what the work plan keeps, by accident or on purpose: the work that it concerns is done again."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion_batch.workplan import Plan, Task
from rigid_motion_batch.workplan.__main__ import main
from rigid_motion_batch.workplan.manifest import Manifest
from tests.scripts.workplan.plans import contents, done, joining, run_in, states, task, up_to_date
from tests.thoroughness import tried

TASKS = (task("a", text="1"), task("b", text="2"), joining("c", "a", "b"))

HOSTILE = {
    "nothing": "",
    "brackets": "[" * 200_000,
    "brackets in a line": '{"schema": 1, "tasks": {\n"a": ' + "[" * 200_000 + "\n}}\n",
    "a name with a NUL": '{"schema": 1, "tasks": {\n"a\\u0000": {"key": "k", "outputs": {"\\u0000": {}}}\n}}\n',
    "a device": '{"schema": 1, "tasks": {\n"a": {"key": "k", "outputs": {"/dev/zero": '
    '{"size": 0, "mtime_ns": 0, "sha256": ""}}}\n}}\n',
    "wrong types": '{"schema": 1, "tasks": {\n"a": {"key": 1, "outputs": [], "seconds": "x", "facts": 3}\n}}\n',
    "huge numbers": '{"schema": 1, "tasks": {\n"a": {"key": "k", "seconds": 1e999, "outputs": {"a.txt": '
    f'{{"size": {"9" * 5000}, "mtime_ns": 1, "sha256": ""}}}}}}\n}}}}\n',
    "no text": "\ufffe\ud800".encode("utf-8", "surrogatepass").decode("latin-1"),
    "versions that are none": '{"schema": 1, "versions": {"v": 1}, "failures": 7, "tasks": {\n}}\n',
}


@pytest.mark.parametrize("content", HOSTILE.values(), ids=HOSTILE)
@pytest.mark.parametrize("place", ["manifest.json", ".workplan/records/0.json"])
def test_a_manifest_that_makes_no_sense_costs_time_and_nothing_else(tmp_path: Path, place: str, content: str) -> None:
    run_in(tmp_path, *TASKS)
    (tmp_path / place).parent.mkdir(exist_ok=True)
    (tmp_path / place).write_text(content)
    assert {*states(run_in(tmp_path, *TASKS)).values()} <= {"done", "up to date"}
    assert states(run_in(tmp_path, *TASKS)) == up_to_date("a", "b", "c")
    assert contents(tmp_path) == {"a.txt": "1", "b.txt": "2", "c.txt": "12"}


def test_a_damaged_line_costs_its_task_alone(tmp_path: Path) -> None:
    run_in(tmp_path, *TASKS)
    manifest = tmp_path / "manifest.json"
    lines = manifest.read_text().splitlines(keepends=True)
    manifest.write_text("".join(line[:40] + "\n" if line.startswith('"b"') else line for line in lines))
    assert states(run_in(tmp_path, *TASKS)) == up_to_date("a", "c") | done("b")


WHOLE = (
    b'{"schema": 1, "versions": {"v": {"a.py": "1"}}, "failures": {}, "tasks": {\n'
    b'"a": {"key": "k", "outputs": {"a.txt": {"size": 1, "mtime_ns": 2, "sha256": "s"}}, "seconds": 0.1},\n'
    b'"b": {"key": "k", "outputs": {}, "seconds": 0.1, "facts": {"x": 1}, "made_of": {"version": "v"}}\n}}\n'
)


@settings(max_examples=tried(400))
@given(changes=st.dictionaries(st.integers(14, len(WHOLE) - 1), st.integers(0, 255), max_size=8), length=st.integers(0))
def test_whatever_becomes_of_its_bytes_a_manifest_is_read(
    tmp_path_factory: pytest.TempPathFactory, changes: dict[int, int], length: int
) -> None:
    folder = tmp_path_factory.getbasetemp()
    path = folder / "manifest.json"
    path.write_bytes(bytes(changes.get(n, byte) for n, byte in enumerate(WHOLE))[:length])
    manifest = Manifest(path, folder / "records")
    records = [manifest.get(name) for name in manifest]
    manifest.close()
    if not changes and length >= len(WHOLE):
        assert manifest.is_whole
        assert [record.seconds for record in records] == [0.1, 0.1]


def replaced_by_pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def replaced_by_device(path: Path) -> None:
    path.unlink()
    path.symlink_to("/dev/zero")


def replaced_by_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def replaced_by_loop(path: Path) -> None:
    path.unlink()
    path.symlink_to(path)


def cut(path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])


DAMAGES = (replaced_by_pipe, replaced_by_device, replaced_by_folder, replaced_by_loop, cut)

needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no pipes and devices among its files")


@needs_pipes
@pytest.mark.parametrize(
    ("place", "damage"),
    [
        # A folder for a manifest may be anybody's: see test_ownership.
        *(("manifest.json", damage) for damage in DAMAGES if damage is not replaced_by_folder),
        *(("a.txt", damage) for damage in DAMAGES),
    ],
)
def test_whatever_lies_in_the_place_of_a_file_the_work_is_done_again(
    tmp_path: Path, place: str, damage: Callable[[Path], None]
) -> None:
    run_in(tmp_path, *TASKS)
    damage(tmp_path / place)
    assert {*states(run_in(tmp_path, *TASKS)).values()} <= {"done", "up to date"}
    assert contents(tmp_path)["c.txt"] == "12"
    assert states(run_in(tmp_path, *TASKS)) == up_to_date("a", "b", "c")


@needs_pipes
@pytest.mark.parametrize("damage", [replaced_by_pipe, replaced_by_device, replaced_by_folder, cut])
def test_a_plan_that_is_damaged_is_said_to_be_none_and_written_anew(
    tmp_path: Path, damage: Callable[[Path], None], capsys: pytest.CaptureFixture
) -> None:
    run_in(tmp_path, *TASKS)
    damage(tmp_path / ".workplan" / "plan.json")
    assert main(["list", str(tmp_path)]) == 2
    assert "run the program that plans once more" in capsys.readouterr().err
    run_in(tmp_path, *TASKS)
    assert main(["list", str(tmp_path)]) == 0


@pytest.mark.parametrize("place", [".workplan", ".workplan/records", ".workplan/scratch"])
def test_a_file_where_the_program_keeps_a_folder_is_cleared_away(tmp_path: Path, place: str) -> None:
    (tmp_path / place).parent.mkdir(exist_ok=True)
    (tmp_path / place).write_text("no folder")
    assert states(run_in(tmp_path, *TASKS)) == done("a", "b", "c")


@pytest.mark.parametrize(
    "fields",
    [
        {"name": 3},
        {"function": None},
        {"arguments": [1]},
        {"arguments": 7},
        {"outputs": 5},
        {"after": [["a"]]},
        {"weight": "heavy"},
        {"weight": -1.0},
        {"unknown": 1},
        {"outputs": ["a\0b"]},
    ],
)
def test_a_plan_with_wrong_types_is_refused_in_a_line(
    tmp_path: Path, fields: dict[str, object], capsys: pytest.CaptureFixture
) -> None:
    path = tmp_path / "plan.json"
    Plan([task("a")], "1").write(path)
    content = json.loads(path.read_text())
    content["tasks"][0] |= fields
    path.write_text(json.dumps(content))
    assert main(["list", str(tmp_path / "out"), "--plan", str(path)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_plan_of_brackets_is_refused_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "plan.json").write_text("[" * 200_000)
    assert main(["list", str(tmp_path / "out"), "--plan", str(tmp_path / "plan.json")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@needs_pipes
@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "NUL"])
def test_an_input_that_is_no_file_is_refused_and_not_waited_for(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "in"
    {
        "pipe": lambda: os.mkfifo(path),
        "device": lambda: path.symlink_to("/dev/zero"),
        "folder": path.mkdir,
        "NUL": lambda: None,
    }[kind]()
    source = f"{path}\0" if kind == "NUL" else str(path)
    outcome = run_in(tmp_path / "out", task("a", "copy", source=source, inputs=(source,)), task("b", text="1"))
    assert states(outcome) == {"a": "failed", "b": "done"}


def rewritten(path: Path, content: str) -> None:
    """Change a file so that its size and time do not show it."""
    status = path.stat()
    assert len(content) == status.st_size
    path.write_text(content)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def parsing(name: str, part: str) -> Task:
    return task(name, "parse", after=(part,), part=f"{part}.txt")


def test_a_task_that_fails_for_what_it_reads_is_done_again_with_that(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    tasks = [task("part", text='{"a": 1}'), parsing("whole", "part")]
    run_in(tmp_path, *tasks)
    rewritten(tmp_path / "part.txt", '{"a": 1[')
    os.remove(tmp_path / "whole.txt")
    assert states(run_in(tmp_path, *tasks)) == done("part", "whole")
    assert f"whole: {tmp_path / 'part.txt'} is damaged; it is made again" in capsys.readouterr().err
    assert contents(tmp_path) == {"part.txt": '{"a": 1}', "whole.txt": "1"}


def test_a_task_that_fails_for_its_own_reasons_is_tried_once(tmp_path: Path) -> None:
    tasks = [task("part", text="no JSON"), parsing("whole", "part")]
    outcome = run_in(tmp_path, *tasks)
    assert states(outcome) == {"part": "done", "whole": "failed"}
    assert "JSONDecodeError" in outcome.failures["whole"]
