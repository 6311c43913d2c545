"""Running plans: what is missing is given to an executor, in order, kept, and published.

A plan is a function that returns its tasks one by one, each after those that it reads from. So of ten thousand clips
only those are in memory that are at work. Where a task fails those that need it are skipped, and all others are done.
What ends a run is Ctrl-C, and a disk that is full or must not be written. Nothing is printed here.
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
"""Number of times that a task is begun whose process dies."""

STATES = "done", "up to date", "failed", "skipped", "not begun or stopped"
DONE, UP_TO_DATE, FAILED, SKIPPED, STOPPED = STATES
"""States of a task, for people. It is skipped where a task before it failed."""


def share_of(plan: Plan, stage: str = "", number: int = 1, of: int = 1) -> Iterator[Task]:
    """Yield the tasks of a stage, or of all, that are one of several equal shares; a task goes with what it reads."""
    shares: dict[str, int] = {}
    turn = itertools.cycle(range(of))
    for task in plan():
        if stage in ("", task.step.stage):
            before = [shares[key] for key in task.after if key in shares]
            shares[task.key] = before[0] if before else next(turn)
            if shares[task.key] == number - 1:
                yield task


def survey(plan: Plan, store: Store) -> tuple[dict[str, float], int]:
    """Return the names of the tasks of a plan that are to be done, with their seconds, and how many are done.

    Raises RunError where something would be replaced that must not be.
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
    """A run in an opened store, by an opened executor: of one plan, or of several of the same work.

    `progress` gets a stage for each plan, and what is said of tasks; `blender` is the program for steps that need it,
    if it is not to be this one. `counts` says how many tasks are in which of the `STATES`, `failures` what was wrong
    with a task, in one line, and `noted` that with what Python said of it. Where it was `interrupted` by Ctrl-C,
    nothing is at work any more; where nothing more could be done, `problem` says why, in one line.
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
        """Do what is missing of a plan, which yields the same tasks each time.

        Raises RunError before anything is done, where something would be replaced that must not be.
        """
        self._settled: dict[str, str | None] = {}
        """Key of a task to that of its result; None where it has none."""
        self._open: set[str] = set()
        """The keys of tasks that are met, and not settled."""
        self._waiting: list[Task] = []
        self._at_work: dict[Future[Made], tuple[Task, StepJob]] = {}
        self._losses: Counter[str] = Counter()
        self._done = 0.0
        """Seconds of tasks that have come to their end."""
        with self.progress.stage(title, 1.0) as self._stage:
            self._left, up_to_date = survey(plan, self.store)
            self._stage.total = sum(self._left.values())
            # What an earlier plan did is found up to date by this one.
            self.counts = Counter({DONE: (done := self.counts[DONE]), UP_TO_DATE: up_to_date - done})
            try:
                if self._left:
                    self._work(iter(plan()))
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

    def _work(self, rest: Iterator[Task]) -> None:
        """Do tasks, each when those before it are settled. Raises RunError where nothing more can be done."""
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
                self._begin(task)
            ended = wait(self._at_work, LOOK_INTERVAL_S, FIRST_COMPLETED).done
            for future in ended:
                self._end(future, *self._at_work.pop(future))
            if self._at_work and not ended:
                self._show(next(iter(self._at_work.values()))[0])
        if self.store.alone and not self.failures:
            self.store.sweep({*self._settled.values()})

    def _before(self, task: Task) -> list[str | None]:
        """Return the keys of the results of the tasks before one, also of earlier plans; None where there is none."""
        for key in task.after:
            if key not in self._settled:
                self._settled[key] = key if self.store.index_of(key) else None
        return [self._settled[key] for key in task.after]

    def _begin(self, task: Task) -> None:
        """Begin a task whose predecessors are settled, or settle it if there is nothing to do."""
        before = self._before(task)
        if self.store.index_of(task.key_after(before)):
            self._settle(task)
        elif None in before and not (task.step.partial and any(before)):
            self._close(task, SKIPPED)
        else:
            folders = [self.store.results / key if key else None for key in before]
            job = StepJob(task, self.store.new_scratch(), self.store.output, folders, self.blender)
            self._show(task)
            self._at_work[self.executor.submit(job)] = task, job

    def _end(self, future: Future[Made], task: Task, job: StepJob) -> None:
        """Take what came of a job."""
        try:
            made = future.result()
        except TaskError as error:
            # An error that nobody foresaw does not say by itself what it is about.
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
        """Keep what was made, unless it is there, and put its files in place."""
        key = task.key_after(self._before(task))
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
        """Take it that a task has come to its end, with a result of this key: those after it may begin."""
        self._open.discard(task.key)
        self._settled[task.key] = key
        self.counts[state] += 1
        self._done += self._left.pop(task.name)
        if key is None:
            self.store.withdraw(task.publish.values())  # What is there under its name was made of something else.
        self._show(task)

    def _show(self, task: Task) -> None:
        """Report how far the whole is, and a task."""
        at_work = sum(job.reached() * begun.seconds for begun, job in self._at_work.values())
        self._stage.reach(self._done + at_work, task.name)
