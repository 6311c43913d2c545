"""Plans of the steps in `steps`, and what is to be seen of their runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rigid_motion_batch.workplan import (
    Executor,
    Outcome,
    Plan,
    ProcessExecutor,
    SerialExecutor,
    State,
    Task,
    Workspace,
    run,
)

STEPS = "tests.scripts.workplan.steps"

FIELDS = ("inputs", "partial", "temporary", "title", "amount", "unit")
"""Of a task, those that tests set."""

EXECUTORS = {"serial": SerialExecutor, "processes": lambda: ProcessExecutor(2)}


def task(name: str, function: str = "write", after: tuple[str, ...] = (), **fields: object) -> Task:
    """A task that makes the file of its name; what is no field of a task is an argument of its function."""
    of_task = {key: fields.pop(key) for key in FIELDS if key in fields}
    arguments = {"path": f"{name}.txt", **fields}
    return Task(name, f"{STEPS}:{function}", arguments, outputs=(f"{name}.txt",), after=after, **of_task)


def joining(name: str, *parts: str, **fields: object) -> Task:
    """A task that joins the files of others."""
    return task(name, "join", after=parts, parts=[f"{part}.txt" for part in parts], **fields)


def run_in(
    output: Path,
    *tasks: Task,
    executor: Executor | None = None,
    version: str = "1",
    versions: Mapping[str, Mapping[str, str]] | None = None,
    **options: object,
) -> Outcome:
    """Run a plan in a folder."""
    with Workspace(output) as workspace, executor or SerialExecutor() as opened:
        return run(Plan(tasks, version, versions=versions), workspace, opened, **options)


def states(outcome: Outcome) -> dict[str, str]:
    return {name: state.value for name, state in outcome.states.items()}


def done(*names: str) -> dict[str, str]:
    return dict.fromkeys(names, State.DONE.value)


def up_to_date(*names: str) -> dict[str, str]:
    return dict.fromkeys(names, State.UP_TO_DATE.value)


def contents(output: Path) -> dict[str, str]:
    """The outputs in a folder, without what the work plan keeps there of its own."""
    return {
        str(path.relative_to(output)): path.read_text()
        for path in output.rglob("*")
        if path.is_file() and ".workplan" not in path.parts and path.name != "manifest.json"
    }
