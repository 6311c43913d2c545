"""`python -m rigid_motion_batch.workplan`: one task of a plan that another program has written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rigid_motion_batch.workplan import Plan
from rigid_motion_batch.workplan.__main__ import main
from tests.scripts.workplan.plans import STEPS, contents, done, joining, run_in, states, task, up_to_date

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
    command = [sys.executable, "-m", "rigid_motion_batch.workplan", "run", str(planned), "a"]
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


def test_in_open_job_description_a_task_says_how_it_gets_on(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    run_in(tmp_path, task("a", "chatter"))
    (tmp_path / "a.txt").unlink()
    capsys.readouterr()
    assert main(["run", str(tmp_path), "a", "--openjd"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[-4:-1] == ["openjd_progress: 50.0", "openjd_status: half way", "openjd_status: a.txt is nearly there"]


def test_in_open_job_description_what_an_input_is_at_fault_for_does_not_hold_up_the_rest(
    planned: Path, capsys: pytest.CaptureFixture
) -> None:
    assert [main(["run", str(planned), name, "--openjd"]) for name in ("a", "c", "report")] == [0, 0, 0]
    said = capsys.readouterr()
    assert "openjd_status: in.csv: no such file" in said.out
    assert "c: first do 'a'" in said.err
    assert main(["finish", str(planned)]) == 1
    said = capsys.readouterr()
    assert said.err.splitlines() == ["not done: a", "not done: c"]
    assert said.out == "Tasks: 2 done, 2 not done.\n"


def test_in_open_job_description_an_error_of_the_program_is_one(tmp_path: Path) -> None:
    run_in(tmp_path, task("a", "fail", foreseen=False), task("b"))
    assert main(["run", str(tmp_path), "a", "--openjd"]) == 1


def test_finishing_clears_up_and_what_was_cleared_away_is_not_made_again(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    plan_path, out = tmp_path / "plan.json", tmp_path / "out"
    Plan([task("part", text="1", temporary=True), joining("whole", "part")], "1").write(plan_path)
    commands = [["run", "part"], ["run", "whole"], ["finish"], ["run", "part"], ["run", "whole"], ["finish"], ["list"]]
    codes = [main([command, str(out), *name, "--plan", str(plan_path)]) for command, *name in commands]
    assert codes == [0] * 7
    assert contents(out) == {"whole.txt": "1"}
    said = capsys.readouterr().out.splitlines()
    assert said[3:5] == ["part: up to date", "whole: up to date"]
    assert said[-2:] == ["done  part", "done  whole"]
    assert sorted(os.listdir(out)) == ["manifest.json", "whole.txt"]


def test_a_plan_is_done_with_inputs_that_are_elsewhere(planned: Path, tmp_path: Path) -> None:
    moved = tmp_path / "moved"
    moved.mkdir()
    (moved / "in.csv").write_text("3")
    assert main(["run", str(planned), "a", "--inputs", str(moved)]) == 0
    assert contents(planned)["a.txt"] == "3"


def test_another_version_of_the_program_is_told_from_that_which_planned(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    for version in "12":
        Plan([task("a")], version).write(tmp_path / f"{version}.json")
    check = ["check", str(tmp_path), f"{STEPS}:identify", "--plan"]
    assert main([*check, str(tmp_path / "1.json")]) == 0
    assert main([*check, str(tmp_path / "2.json")]) == 2
    assert "this is 1, and the plan was made by 2" in capsys.readouterr().err


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
    assert "this program has no module os" in capsys.readouterr().err
