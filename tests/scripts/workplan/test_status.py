"""Whether a task is done, and why it is to be done again."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from rigid_motion_batch.workplan import Plan, Task, Workspace
from rigid_motion_batch.workplan.__main__ import main
from rigid_motion_batch.workplan.status import Status, explain
from tests.scripts.workplan.plans import STEPS, done, joining, run_in, states, task


def explained(output: Path, *tasks: Task, version: str = "1", force: bool = False, **options: object) -> list[str]:
    """What would be done, and why."""
    plan = Plan(tasks, version, **options)
    with Workspace(output, shared=True) as workspace:
        return explain(Status(plan, workspace.manifest, workspace.output, force=force).survey(), plan)


def two(text: str = "1", **fields: object) -> list[Task]:
    return [task("a", text=text, **fields), joining("b", "a")]


def test_what_was_never_done_has_no_output_yet_and_nothing_is_done_by_asking(tmp_path: Path) -> None:
    assert explained(tmp_path / "out", *two()) == ["write a: no output yet", "join b: no output yet"]
    assert not (tmp_path / "out").exists()


def test_where_all_is_done_there_is_nothing_to_explain(tmp_path: Path) -> None:
    run_in(tmp_path, *two())
    assert explained(tmp_path, *two()) == []


def test_a_changed_option_is_named_with_what_it_was(tmp_path: Path) -> None:
    run_in(tmp_path, *two("1"))
    assert explained(tmp_path, *two("2")) == [
        'write a: options changed (text: "1" -> "2")',
        "join b: what it reads is made anew (write a)",
    ]


def test_a_changed_input_is_named(tmp_path: Path) -> None:
    source = tmp_path / "in.csv"
    copied = task("a", "copy", source=str(source), inputs=(str(source),))
    source.write_text("1")
    run_in(tmp_path / "out", copied)
    source.write_text("2")
    assert explained(tmp_path / "out", copied) == [f"copy a: input changed ({source})"]


def test_an_output_that_is_gone_or_changed_is_named(tmp_path: Path) -> None:
    run_in(tmp_path, *two())
    (tmp_path / "a.txt").write_text("other")
    (tmp_path / "b.txt").unlink()
    assert explained(tmp_path, *two()) == ["write a: output changed since (a.txt)", "join b: output missing (b.txt)"]


def test_a_changed_program_is_named_by_its_files(tmp_path: Path) -> None:
    run_in(tmp_path, *two(), versions={f"{STEPS}:write": {"writing.py": "1", "paper.py": "1"}})
    assert explained(tmp_path, *two(), versions={f"{STEPS}:write": {"writing.py": "2", "paper.py": "1"}}) == [
        "write a: the program changed (writing.py)",
        "join b: what it reads is made anew (write a)",
    ]


def test_a_step_of_which_nothing_changed_is_not_done_again(tmp_path: Path) -> None:
    tasks = [task("a", text="1"), task("b", "chatter")]
    before = {f"{STEPS}:write": {"x.css": "1"}, f"{STEPS}:chatter": {"y.py": "1"}}
    run_in(tmp_path, *tasks, versions=before)
    after = run_in(tmp_path, *tasks, versions=before | {f"{STEPS}:write": {"x.css": "2"}})
    assert states(after) == {"a": "done", "b": "up to date"}


def test_force_is_the_reason_where_there_is_no_other(tmp_path: Path) -> None:
    run_in(tmp_path, *two())
    assert explained(tmp_path, *two(), force=True) == ["write a: --force", "join b: --force"]


def test_tasks_that_are_done_for_one_reason_are_in_one_line(tmp_path: Path) -> None:
    tasks = [task(f"{n}", text="1") for n in range(5)]
    assert explained(tmp_path / "out", *tasks) == ["write 0, write 1, write 2 and 2 more: no output yet"]


@pytest.fixture
def failed(tmp_path: Path) -> tuple[Path, list[Task]]:
    """A folder with a report that was made again after one of its tasks failed, which had been done before."""
    source = tmp_path / "in.csv"
    tasks = [
        task("a", "copy", source=str(source), inputs=(str(source),)),
        task("b", text="2"),
        joining("report", "a", "b", partial=True),
    ]
    source.write_text("1")
    run_in(tmp_path / "out", *tasks)
    source.unlink()
    assert states(run_in(tmp_path / "out", *tasks))["report"] == "done"
    return tmp_path / "out", tasks


def test_a_report_after_a_failure_is_what_can_be_made_for_all_who_ask(
    failed: tuple[Path, list[Task]], capsys: pytest.CaptureFixture
) -> None:
    output, tasks = failed
    capsys.readouterr()
    assert main(["list", str(output)]) == 0
    assert capsys.readouterr().out.splitlines() == ["to do a", "done  b", "done  report"]
    assert main(["run", str(output), "report"]) == 0
    assert "up to date" in capsys.readouterr().out
    assert states(run_in(output, *tasks))["report"] == "up to date"


def test_a_report_is_explained_by_what_may_come_to_be_there(failed: tuple[Path, list[Task]]) -> None:
    output, tasks = failed
    assert explained(output, *tasks)[1:] == ["join report: what it reads is made anew (copy a)"]


def test_the_command_explains_too(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    run_in(tmp_path, *two())
    os.remove(tmp_path / "a.txt")
    capsys.readouterr()
    assert main(["list", "--explain", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines() == ["write a: output missing (a.txt)"]


def test_temporary_outputs_that_are_gone_are_no_reason_where_nobody_wants_them(tmp_path: Path) -> None:
    tasks = [task("part", text="1", temporary=True), joining("whole", "part")]
    assert states(run_in(tmp_path, *tasks)) == done("part", "whole")
    assert explained(tmp_path, *tasks) == []
    os.remove(tmp_path / "whole.txt")
    assert explained(tmp_path, *tasks) == [
        "write part: output missing (part.txt)",
        "join whole: output missing (whole.txt)",
    ]
