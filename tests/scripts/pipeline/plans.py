"""Plans of the steps in `steps`, and what is to be seen of their runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rigid_motion_batch.pipeline.executors import Executor, ProcessExecutor, SerialExecutor
from rigid_motion_batch.pipeline.running import Outcome, Progress, State, run
from rigid_motion_batch.pipeline.steps import OWN, Step, Task
from rigid_motion_batch.pipeline.store import Store
from tests.scripts.pipeline import steps
from tests.scripts.pipeline.steps import FILE, Nothing, Write

EXECUTORS = {"serial": SerialExecutor, "processes": lambda: ProcessExecutor(2)}


def task(name: str, step: Step = steps.write, parameters: object = None, *after: Task, **fields: object) -> Task:
    """A task that publishes its file under its name."""
    fields = {"publish": {FILE: f"{name}.txt"}} | fields
    made = Nothing() if parameters is None else parameters
    return Task(step, made, name, after=tuple(one.key for one in after), **fields)


def writing(name: str, text: str = "", log: object = "", **fields: object) -> Task:
    return task(name, steps.write, Write(text or name, str(log)), **fields)


def joining(name: str, *after: Task, log: object = "", **fields: object) -> Task:
    """A task that joins the texts of others."""
    return task(name, steps.join, Nothing(str(log)), *after, **fields)


class Listener(Progress):
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.total = 0.0
        self.reached: list[tuple[float, str, Mapping[str, tuple[int, int]]]] = []
        self.notes: list[str] = []
        self.states: dict[str, str] = {}
        self.done: set[str] = set()

    def begin(self, total: float) -> None:
        self.total = total

    def reach(self, done: float, doing: str, counts: Mapping[str, tuple[int, int]]) -> None:
        self.reached.append((done, doing, dict(counts)))

    def note(self, text: str) -> None:
        self.notes.append(text)

    def finish(self, task: Task, state: State, problem: str) -> None:
        self.states[task.name] = state.value
        self.done |= {task.name} if state is State.DONE else set()


def run_in(output: Path, *tasks: Task, executor: Executor | None = None, **options: object) -> Outcome:
    """Run a plan in a folder."""
    of_store = {name: options.pop(name) for name in ("alone", "overwrite") if name in options}
    with Store(output, **of_store) as store, executor or SerialExecutor() as opened:
        return run(lambda: tasks, store, opened, **options)


def states(outcome: Outcome) -> dict[str, int]:
    return {state.value: number for state, number in outcome.counts.items() if number}


def contents(output: Path) -> dict[str, str]:
    """The files in a folder, without what the pipeline keeps there of its own."""
    return {
        path.relative_to(output).as_posix(): path.read_text()
        for path in output.rglob("*")
        if path.is_file() and OWN not in path.relative_to(output).parts
    }
