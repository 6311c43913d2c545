from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from rigid_motion_batch.workplan import Plan, PlanError, Task
from tests.scripts.workplan.plans import joining, task


def making(*outputs: str, name: str = "a") -> Task:
    return replace(task(name), outputs=outputs)


def test_every_task_comes_after_those_it_reads_and_otherwise_as_listed() -> None:
    plan = Plan([joining("last", "b", "c"), task("a"), joining("c", "d"), task("b"), task("d")], "1")
    assert plan.order == ("b", "d", "c", "last", "a")
    assert plan.readers["d"] == ("c",)


@pytest.mark.parametrize(
    ("tasks", "complaint"),
    [
        ([task("a"), task("a")], "there are two of that name"),
        ([task("")], "a name is one line"),
        ([task("a\nb")], "a name is one line"),
        ([making()], "it makes nothing"),
        ([joining("a", "b")], "no task 'b' to come before it"),
        ([joining("a", "b"), joining("b", "c"), joining("c", "a")], "wait for one another"),
        ([joining("a", "a")], "wait for one another"),
        ([making("x"), making("x", name="b")], "made by 'a' already"),
        ([making("X"), making("x", name="b")], "made by 'a' already"),
        ([making("x"), making("x/y", name="b")], "lies in 'x'"),
        ([task("a", temporary=True), joining("b", "a", partial=True)], "is temporary"),
        ([replace(task("a"), function="os.system")], "package.module:function"),
    ],
)
def test_a_plan_that_cannot_be_carried_out_is_refused(tasks: list[Task], complaint: str) -> None:
    with pytest.raises(PlanError, match=complaint):
        Plan(tasks, "1")


@pytest.mark.parametrize(
    "output",
    [
        *("../x", "a/../../x", "/etc/x", "a/./b", "a//b", "", ".", "..", "a\\..\\b", "C:x", "C:/x", "//host/x", "a\nb"),
        *("manifest.json", ".workplan/lock", ".WorkPlan/lock", "manifest.json/x"),
    ],
)
def test_no_output_lies_outside_the_folder_or_among_the_plans_own_files(output: str) -> None:
    with pytest.raises(PlanError, match=r"below the output folder|its own files"):
        Plan([making(output)], "1")


def test_a_long_chain_is_no_deep_recursion() -> None:
    chain = [task("0"), *(joining(f"{n}", f"{n - 1}") for n in range(1, 5000))]
    assert Plan(reversed(chain), "1").order[-1] == "4999"


def test_a_plan_is_read_back_as_it_was_written(tmp_path: Path) -> None:
    plan = Plan([task("ä b", text="1", inputs=("in.txt",)), joining("c", "ä b", partial=True)], "v", tmp_path / "here")
    plan.write(tmp_path / "plan.json")
    again = Plan.read(tmp_path / "plan.json")
    assert (again.tasks, again.order, again.version, again.folder) == (plan.tasks, plan.order, "v", tmp_path / "here")


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"schema": 9}', '{"schema": 1, "tasks": [{"names": 1}]}'])
def test_a_file_that_is_no_plan_is_said_to_be_none(tmp_path: Path, content: str) -> None:
    (tmp_path / "plan.json").write_text(content)
    with pytest.raises(PlanError, match=r"plan\.json"):
        Plan.read(tmp_path / "plan.json")
