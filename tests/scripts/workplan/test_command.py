"""`python -m scripts.workplan`: one task of a plan that another program has written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from scripts.workplan.__main__ import main
from tests.scripts.workplan.plans import contents, done, joining, run_in, states, task, up_to_date

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def planned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An output folder with a plan of which one task could not be done, for want of a file."""
    monkeypatch.chdir(tmp_path)
    run_in(tmp_path / "out", *plan())
    return tmp_path / "out"


def plan() -> list:
    source = task("a", "copy", source="in.csv", inputs=("in.csv",), title="The copy")
    return [source, task("b", text="2"), joining("c", "a", "b"), joining("report", "a", "b", partial=True)]


def run_one(output: Path, name: str) -> int:
    return main(["run", str(output), name])


def test_the_tasks_are_listed(planned: Path, capsys: pytest.CaptureFixture) -> None:
    assert main(["list", str(planned)]) == 0
    assert capsys.readouterr().out.splitlines() == ["to do a", "done  b", "to do c", "done  report"]


def test_tasks_are_done_one_by_one_and_a_later_run_knows(planned: Path, capsys: pytest.CaptureFixture) -> None:
    Path("in.csv").write_text("1")
    assert [run_one(planned, name) for name in ("a", "c", "c")] == [0, 0, 0]
    assert contents(planned)["c.txt"] == "12"
    said = capsys.readouterr().out
    assert "The copy: done in" in said
    assert said.splitlines()[-1] == "c: up to date"
    assert states(run_in(planned, *plan())) == up_to_date("a", "b", "c") | done("report")


def test_it_works_from_another_folder_as_a_process_of_its_own(planned: Path, tmp_path: Path) -> None:
    Path("in.csv").write_text("1")
    command = [sys.executable, "-m", "scripts.workplan", "run", str(planned), "a"]
    assert subprocess.run(command, cwd=ROOT, timeout=60, capture_output=True).returncode == 0
    assert contents(planned)["a.txt"] == "1"


def test_a_task_that_fails_ends_with_code_1(planned: Path, capsys: pytest.CaptureFixture) -> None:
    assert run_one(planned, "a") == 1
    assert "The copy: in.csv: no such file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "complaint"), [("c", "c: first do 'a'"), ("z", "no task 'z'; see list"), ("", "no task ''")]
)
def test_a_task_that_cannot_be_begun_ends_with_code_2(
    planned: Path, capsys: pytest.CaptureFixture, name: str, complaint: str
) -> None:
    assert run_one(planned, name) == 2
    assert complaint in capsys.readouterr().err


def test_a_folder_without_a_plan_is_said_to_be_one_and_left_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert main(["list", str(tmp_path / "nowhere")]) == 2
    assert os.path.join("nowhere", ".workplan", "plan.json") in capsys.readouterr().err
    assert not (tmp_path / "nowhere").exists()


def test_a_plan_from_a_stranger_runs_nothing_but_steps(planned: Path, capsys: pytest.CaptureFixture) -> None:
    path = planned / ".workplan" / "plan.json"
    path.write_text(path.read_text().replace("tests.scripts.workplan.steps:copy", "os:system"))
    assert run_one(planned, "a") == 1
    assert "this checkout has no module os" in capsys.readouterr().err
