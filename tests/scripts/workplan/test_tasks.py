from __future__ import annotations

from pathlib import Path

import pytest

from rigid_motion_batch.workplan import Job, Task
from rigid_motion_batch.workplan.tasks import find_step
from tests.scripts.workplan import steps
from tests.scripts.workplan.plans import STEPS


def test_a_step_is_found_by_its_name() -> None:
    assert find_step(f"{STEPS}:write").__name__ == "write"


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("os:system", "no module os"),
        ("subprocess:run", "no module subprocess"),
        ("numpy:save", "no module numpy"),
        (f"{STEPS}:unmarked", "mark it with @step"),
        (f"{STEPS}:step", "mark it with @step"),
        (f"{STEPS}:nowhere", "mark it with @step"),
        (f"{STEPS}.write", "package.module:function"),
        ("../steps:write", "package.module:function"),
        ("", "package.module:function"),
    ],
)
def test_nothing_but_a_step_of_this_checkout_can_be_named(name: str, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        find_step(name)


def test_arguments_are_what_json_makes_of_them() -> None:
    assert Task("a", "b:c", {"sizes": (1, 2)}, outputs=("x",)).arguments == {"sizes": [1, 2]}
    for wrong in ({"path": Path("x")}, {"number": float("nan")}):
        with pytest.raises((TypeError, ValueError)):
            Task("a", "b:c", wrong, outputs=("x",))


def test_a_job_writes_what_its_task_makes_and_nothing_else(tmp_path: Path) -> None:
    job = Job(tmp_path / "out", tmp_path / "scratch", ["a/b.txt"])
    assert job.writes("a/b.txt").parent.is_dir()
    with pytest.raises(ValueError, match=r"not among the outputs of this task: a/b\.txt"):
        job.writes("../c.txt")


def test_the_steps_of_these_tests_are_marked() -> None:
    assert steps.write.is_step
    assert not hasattr(steps.unmarked, "is_step")
