"""Running of plans: missing tasks go to an executor in order, and their results are stored and published.

A plan is a function that yields its tasks one by one, each after the tasks whose results it reads. So of ten thousand
clips, only those in progress are in memory. If a task fails, the tasks that need it are skipped, and all others are
done. Only Ctrl-C ends a run early, or a disk that is full or read-only. Nothing is printed here.
"""

from __future__ import annotations

import itertools
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import suppress
from dataclasses import dataclass, field

from rigid_motion_batch.progress import Progress

from .executors import FULL_OR_FORBIDDEN, Executor, Made, loss
from .steps import LOOK_INTERVAL_S, RunError, StepJob, Task, TaskError
from .store import Store

Plan = Callable[[], Iterable[Task]]

MAX_ATTEMPTS = 3
"""The number of times that a task is started if its process dies."""

STATES = "done", "up to date", "failed", "skipped", "not begun or stopped"
DONE, UP_TO_DATE, FAILED, SKIPPED, STOPPED = STATES
"""States of a task, in words for the user. A task is skipped if a task before it failed."""


def share_of(plan: Plan, stage: str = "", number: int = 1, of: int = 1) -> Iterator[Task]:
    """Yield one of several equal shares of the tasks of a stage, or of all; a task stays with the tasks it reads."""
    shares: dict[str, int] = {}
    turn = itertools.cycle(range(of))
    for task in plan():
        if stage in ("", task.step.stage):
            before = [shares[key] for key in task.after if key in shares]
            shares[task.key] = before[0] if before else next(turn)
            if shares[task.key] == number - 1:
                yield task


def tasks_left(plan: Plan, store: Store) -> tuple[dict[str, float], int]:
    """Return the names of the tasks still to do, with their seconds, and the number of tasks already done.

    Raises RunError if a file would be replaced that must stay.
    """
    left: dict[str, float] = {}
    done = 0
    for task in plan():
        index = store.index_of(task.key)
        unpublished = store.unpublished(task, index)
        if index and not unpublished:
            done += 1
        else:
            left[task.name] = task.seconds
            store.refuse(unpublished)
    return left, done


@dataclass(eq=False)
class Run:
    """A run of one plan, or of several plans of the same work, in an open store with an open executor.

    `progress` gets a stage for each plan, and messages about tasks. `blender` is the program for steps that need
    Blender, if it is not this one. `counts` maps each of the `STATES` to its number of tasks, `failures` a task to its
    error in one line, `noted` a task to that message with Python's traceback. If the run was `interrupted` by Ctrl-C,
    no task is running any more. If the run cannot continue, `problem` says why, in one line.
    """

    store: Store
    executor: Executor
    progress: Progress
    blender: str = ""
    counts: Counter[str] = field(default_factory=Counter)
    failures: dict[str, str] = field(default_factory=dict)
    noted: dict[str, dict[str, str]] = field(default_factory=dict)
    interrupted: bool = False
    problem: str = ""

    def do(self, plan: Plan, title: str = "") -> None:
        """Do the missing tasks of a plan, which yields the same tasks each time.

        Raises RunError before anything is done if a file would be replaced that must stay.
        """
        self._settled: dict[str, str | None] = {}
        """Key of a task to the key of its result; None if it has none."""
        self._open: set[str] = set()
        """The keys of tasks that were reached and are not settled."""
        self._waiting: list[Task] = []
        self._at_work: dict[Future[Made], tuple[Task, StepJob]] = {}
        self._losses: Counter[str] = Counter()
        self._done = 0.0
        """Seconds of the tasks that have ended."""
        with self.progress.stage(title, 1.0) as self._stage:
            self._left, up_to_date = tasks_left(plan, self.store)
            self._stage.total = sum(self._left.values())
            # This plan finds the results of an earlier plan up to date.
            self.counts = Counter({DONE: (done := self.counts[DONE]), UP_TO_DATE: up_to_date - done})
            try:
                if self._left:
                    self._run_tasks(iter(plan()))
            except RunError as error:
                self.problem = str(error)
            except KeyboardInterrupt:
                self.interrupted = True
            if self._left:
                self.executor.stop()
                self.counts[STOPPED] = len(self._left)
        if self.store.alone:
            with suppress(OSError):
                self.store.note("failures.json", self.noted)

    def _run_tasks(self, rest: Iterator[Task]) -> None:
        """Do tasks, each once all tasks before it are settled. Raises RunError if the run cannot continue."""
        while True:
            ready = [task for task in self._waiting if self._open.isdisjoint(task.after)]
            while len(ready) < self.executor.capacity and (task := next(rest, None)):
                if task.name in self._left:
                    ready += [task] if self._open.isdisjoint(task.after) else []
                    self._open.add(task.key)
                    self._waiting.append(task)
                else:
                    self._settled[task.key] = task.key
            if not (self._waiting or self._at_work):
                break
            for task in ready[: self.executor.capacity - len(self._at_work)]:
                self._waiting.remove(task)
                self._start(task)
            ended = wait(self._at_work, LOOK_INTERVAL_S, FIRST_COMPLETED).done
            for future in ended:
                self._end(future, *self._at_work.pop(future))
            if self._at_work and not ended:
                self._show_progress(next(iter(self._at_work.values()))[0])
        if self.store.alone and not self.failures:
            self.store.sweep({*self._settled.values()})

    def _keys_before(self, task: Task) -> list[str | None]:
        """Return the keys of the results before a task, also of earlier plans; None for missing ones."""
        for key in task.after:
            if key not in self._settled:
                self._settled[key] = key if self.store.index_of(key) else None
        return [self._settled[key] for key in task.after]

    def _start(self, task: Task) -> None:
        """Start a task whose predecessors are settled, or settle it if there is nothing to do."""
        before = self._keys_before(task)
        if self.store.index_of(task.key_after(before)):
            self._settle(task)
        elif None in before and not (task.step.partial and any(before)):
            self._close(task, SKIPPED)
        else:
            folders = [self.store.results / key if key else None for key in before]
            job = StepJob(task, self.store.new_scratch(), self.store.output, folders, self.blender)
            self._show_progress(task)
            self._at_work[self.executor.submit(job)] = task, job

    def _end(self, future: Future[Made], task: Task, job: StepJob) -> None:
        """Take the result of a job, or its error."""
        try:
            made = future.result()
        except TaskError as error:
            # An unexpected error does not name its task.
            said = f"{task.name}: {error}" if error.details else str(error)
            self._fail(task, said, error.details, fatal=error.fatal)
        except Exception as error:
            self._losses[task.key] += 1
            said = f"{task.name}: {loss(error, job)}"
            if self._losses[task.key] < MAX_ATTEMPTS:
                self.progress.note(f"{said}; trying again")
                self._waiting.insert(0, task)
            else:
                self._fail(task, f"{said}; given up after {MAX_ATTEMPTS} attempts")
        else:
            self._settle(task, made)
        shutil.rmtree(job.place, ignore_errors=True)

    def _settle(self, task: Task, made: Made | None = None) -> None:
        """Store a result, unless it exists, and publish its files."""
        key = task.key_after(self._keys_before(task))
        try:
            if made:
                self.store.keep(task, key, made)
            is_new = self.store.publish(task, key) or made
        except RunError as error:
            self._fail(task, str(error))
        except OSError as error:
            said = f"{error.filename2 or error.filename}: {error.strerror or error}"
            self._fail(task, said, fatal=error.errno in FULL_OR_FORBIDDEN)
        else:
            for spent in task.spends:
                self.store.discard(spent)
            self._close(task, DONE if is_new else UP_TO_DATE, key)

    def _fail(self, task: Task, said: str, details: str = "", *, fatal: bool = False) -> None:
        self.failures[task.name], self.noted[task.name] = said, {"message": said, "details": details}
        self.progress.error(said)
        self._close(task, FAILED)
        if fatal:
            raise RunError(said)

    def _close(self, task: Task, state: str, key: str | None = None) -> None:
        """Record that a task has ended with a result of this key, or None: the tasks after it may start."""
        self._open.discard(task.key)
        self._settled[task.key] = key
        self.counts[state] += 1
        self._done += self._left.pop(task.name)
        if key is None:
            self.store.withdraw(task.publish.values())  # The file under this name was made from an older state.
        self._show_progress(task)

    def _show_progress(self, task: Task) -> None:
        """Show the progress of the whole run, and the name of a task."""
        at_work = sum(job.reached() * begun.seconds for begun, job in self._at_work.values())
        self._stage.reach(self._done + at_work, task.name)
