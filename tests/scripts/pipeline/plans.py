"""Helpers to run plans of the steps in `steps`, and to inspect the results."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rigid_motion_batch.pipeline.executors import Executor
from rigid_motion_batch.pipeline.running import Plan, Run, share_of
from rigid_motion_batch.pipeline.steps import OWN_FOLDER, Step, Task
from rigid_motion_batch.pipeline.store import Store
from rigid_motion_batch.progress import Progress, Stage
from tests.scripts.pipeline.steps import FILE, Join, Write


def task(name: str, step: Step, *after: Task, **fields: object) -> Task:
    """Return a task that publishes its file under its name."""
    fields = {"publish": {FILE: f"{name}.txt"}} | fields
    return Task(step, name, after=tuple(item.key for item in after), **fields)


def writing(name: str, text: str = "", log: object = "", **fields: object) -> Task:
    return task(name, Write(text or name, str(log)), **fields)


def joining(name: str, *after: Task, log: object = "", **fields: object) -> Task:
    """Return a task that joins the texts of other tasks."""
    return task(name, Join(str(log)), *after, **fields)


class Listener(Progress):
    """Records progress and notes."""

    def __init__(self) -> None:
        super().__init__(io.StringIO())
        self.total = 0.0
        self.reached: list[tuple[float, str]] = []
        self.notes: list[str] = []

    @contextmanager
    def stage(self, title: str, total: float) -> Iterator[Stage]:
        def keep() -> None:
            self.reached.append((stage.done, stage.doing))

        stage = Stage(title, total, keep)
        yield stage
        self.total = stage.total

    def note(self, text: str, style: str = "") -> None:
        self.notes += [] if style else [text]


class Watched(Store):
    """A store that records the names of tasks that made a result."""

    def __init__(self, output: Path, **options: object) -> None:
        super().__init__(output, **options)
        self.made: list[str] = []

    def keep(self, task: Task, *made: object) -> None:
        self.made.append(task.name)
        super().keep(task, *made)


def run(plan: Plan, store: Store, executor: Executor, **options: object) -> Run:
    """Run the missing tasks of a plan."""
    work = Run(store, executor, **{"progress": Listener(), **options})
    work.do(plan)
    return work


def run_in(output: Path, *tasks: Task, executor: Executor | None = None, **options: object) -> Run:
    """Run a plan in a folder."""
    of_store = {name: options.pop(name) for name in ("alone", "overwrite") if name in options}
    share = options.pop("share", ())
    with Store(output, **of_store) as store, executor or Executor() as opened:
        return run(lambda: share_of(lambda: tasks, *share), store, opened, **options)


def states(outcome: Run) -> dict[str, int]:
    return {state: number for state, number in outcome.counts.items() if number}


def contents(output: Path) -> dict[str, str]:
    """Return the texts of all files in a folder, except the pipeline's own files."""
    return {
        path.relative_to(output).as_posix(): path.read_text()
        for path in output.rglob("*")
        if path.is_file() and OWN_FOLDER not in path.relative_to(output).parts
    }


def half_written(output: Path) -> list[Path]:
    """Return the files being made, also those of a killed run."""
    return [*(output / OWN_FOLDER / "scratch").glob("*")]
