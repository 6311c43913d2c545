"""Running plans: what is missing is given to an executor, in order, kept, and published.

A plan is a function that returns its tasks one by one, each after those that it reads from. So of ten thousand clips
only those are in memory that are at work. Where a task fails those that need it are skipped, and all others are done.
What ends a run is Ctrl-C, and a disk that is full or must not be written. Nothing is printed here.
"""

from __future__ import annotations

import io
import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import suppress
from dataclasses import dataclass, field

from rigid_motion_batch.progress import Progress

from .performing import FULL_OR_FORBIDDEN, Executor, ExecutorError, Made, loss
from .steps import Job, Task, TaskError
from .store import OutputError, Store

Plan = Callable[[], Iterable[Task]]

RETRIES = 2
"""Number of times that a task is begun anew whose process died."""

LOOK = 0.2
"""Seconds between two looks at how far tasks are."""

DONE, UP_TO_DATE, FAILED, SKIPPED = "done", "up to date", "failed", "skipped"
STOPPED = "not begun or stopped"
STATES = (DONE, UP_TO_DATE, FAILED, SKIPPED, STOPPED)
"""States of a task, for people. It is skipped where a task before it failed."""


@dataclass(frozen=True)
class Share:
    """A part of a plan, for one of several workers: tasks of a stage, and of their groups every `of`-th."""

    stage: str = ""
    """Empty for all."""

    number: int = 1
    of: int = 1

    def tasks(self, plan: Plan) -> Iterator[Task]:
        """Yield the tasks of a plan that are in the share."""
        groups: dict[str, int] = {}
        for task in plan():
            if self.stage in ("", task.step.stage):
                group = groups.setdefault(task.group or task.name, len(groups)) if self.of > 1 else 0
                if group % self.of == self.number - 1:
                    yield task


EVERYTHING = Share()


@dataclass
class Survey:
    """Tasks, and what they come to."""

    tasks: int = 0
    up_to_date: int = 0
    weight: float = 0.0
    frames: int = 0

    def add(self, task: Task) -> None:
        self.tasks += 1
        self.weight += task.weight
        self.frames += task.frames

    @classmethod
    def of(cls, plan: Plan, store: Store, share: Share = EVERYTHING) -> Survey:
        """Look through a plan for what there is to do.

        Raises
        ------
        OutputError
            Where something would be replaced that must not be, or two tasks publish one file.
        """
        survey, strangers = cls(), []
        places: set[int] = set()
        for task in share.tasks(plan):
            for path in task.publish.values():
                if (place := hash(path.casefold())) in places:
                    raise OutputError(f"{path}: two results would go here; choose other names")
                places.add(place)
            if store.is_done(task):
                survey.up_to_date += 1
            else:
                strangers += store.strangers(task, store.index_of(task.key))
                survey.add(task)
        store.require_none(strangers)
        return survey


@dataclass(eq=False)
class Run:
    """A run in an opened store, by an opened executor: of one plan, or of several of the same work."""

    store: Store
    executor: Executor
    progress: Progress = field(default_factory=lambda: Progress(io.StringIO()))
    """Gets a stage for each plan, and what is said of tasks."""

    share: Share = EVERYTHING
    """What is to be done here; of the rest, what is there is used."""

    blender: str = ""
    """The program for steps that need Blender, if it is not to be this one."""

    counts: Counter[str] = field(default_factory=Counter)
    failures: dict[str, str] = field(default_factory=dict)
    """Task to what was wrong, in one line."""

    details: dict[str, str] = field(default_factory=dict)
    """Task to what Python said of its failure; empty where the reason is known."""

    interrupted: bool = False
    """True if it was interrupted by Ctrl-C; then nothing is at work any more."""

    problem: str = ""
    """The reason why nothing more could be done, in one line; empty where everything was tried."""

    def do(self, plan: Plan, title: str = "") -> None:
        """Do what is missing of a plan, which yields the same tasks each time.

        Raises
        ------
        OutputError
            Before anything is done, where something would be replaced that must not be.
        """
        # What an earlier plan did is found up to date by this one.
        done = self.counts[DONE]
        self.counts = Counter({DONE: done, UP_TO_DATE: -done})
        with self.progress.stage(title, 1.0) as self._stage:
            self._survey = Survey.of(plan, self.store, self.share)
            self._stage.total = self._survey.weight
            if self._survey.tasks:
                self._do(plan)
            else:
                self.counts[UP_TO_DATE] += self._survey.up_to_date
        if self.share == EVERYTHING:
            failures = {name: {"message": m, "details": self.details[name]} for name, m in self.failures.items()}
            with suppress(OSError):
                self.store.note("failures.json", failures)

    def _do(self, plan: Plan) -> None:
        self._settled: dict[str, str | None] = {}
        """Key of a task to that of its result; None where it has none."""
        self._open: set[str] = set()
        """The keys of tasks that are met, and not settled."""
        self._waiting: list[Task] = []
        self._at_work: dict[Future[Made], tuple[Task, Job]] = {}
        self._losses: Counter[str] = Counter()
        """Key of a task to how many died that did it."""
        self._reached = Survey()
        """The tasks that have come to their end."""
        try:
            self._work(self.share.tasks(plan))
            if self.share == EVERYTHING and not self.failures:
                self.store.sweep(key for key in self._settled.values() if key)
        except ExecutorError as error:
            self.problem = str(error)
        except KeyboardInterrupt:
            self.interrupted = True
        if self.problem or self.interrupted:
            self.executor.stop()
            self.counts[STOPPED] = self._survey.tasks - self._reached.tasks

    def _work(self, rest: Iterator[Task]) -> None:
        """Do tasks, each when those before it are settled. Raises ExecutorError where nothing more can be done."""
        more = True
        while more or self._waiting or self._at_work:
            capacity = self.executor.capacity
            ready = list(filter(self._is_ready, self._waiting))
            while more and len(ready) < capacity:
                task = next(rest, None)
                if more := task is not None:
                    ready += filter(self._is_ready, self._meet(task))
            for task in ready[: max(0, capacity - len(self._at_work))]:
                self._waiting.remove(task)
                self._begin(task)
            if not capacity:
                time.sleep(LOOK)
            ended, _ = wait(self._at_work, LOOK, FIRST_COMPLETED)
            for future in ended:
                self._end(future, *self._at_work.pop(future))
            for task, job in () if ended else self._at_work.values():
                job.look()
                self._show(task, job.doing)

    def _meet(self, task: Task) -> list[Task]:
        """Take a task from the plan: it is up to date, or waits from now on, and is returned."""
        if task.key not in self._open and self.store.is_done(task):
            self._settled[task.key] = task.key
            self.counts[UP_TO_DATE] += 1
            return []
        self._open.add(task.key)
        self._waiting.append(task)
        return [task]

    def _is_ready(self, task: Task) -> bool:
        return not any(key in self._open for key in reversed(task.after))

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
            folders = [self.store.folder_of(key) if key else None for key in before]
            job = Job(task, self.store.new_scratch(), self.store.output, folders, self.blender)
            self._show(task)
            self._at_work[self.executor.submit(job)] = task, job

    def _end(self, future: Future[Made], task: Task, job: Job) -> None:
        """Take what came of a job."""
        for note in job.notes():
            self.progress.note(note)
        try:
            made = future.result()
        except TaskError as error:
            # An error that nobody foresaw does not say by itself what it is about.
            said = f"{task.shown}: {error}" if error.details else str(error)
            self._fail(task, said, error.details, fatal=error.fatal)
        except (CancelledError, Exception) as error:
            self._losses[task.key] += 1
            if self._losses[task.key] <= RETRIES:
                self.progress.note(f"{task.shown}: {loss(error, job)}; trying again")
                self._waiting.insert(0, task)
            else:
                attempts = f"given up after {self._losses[task.key]} attempts"
                self._fail(task, f"{task.shown}: {loss(error, job)}; {attempts}")
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
        except OutputError as error:
            self._fail(task, str(error))
        except OSError as error:
            said = f"{error.filename2 or error.filename}: {error.strerror or error}"
            self._fail(task, said, fatal=error.errno in FULL_OR_FORBIDDEN)
        else:
            for spent in task.spends:
                self.store.discard(spent)
            self._close(task, DONE if is_new else UP_TO_DATE, key)

    def _fail(self, task: Task, said: str, details: str = "", *, fatal: bool = False) -> None:
        if not fatal and self.store.discard_damaged(filter(None, self._before(task))):
            said = f"{task.shown}: what it reads was damaged; run the same command again"
        self.failures[task.name], self.details[task.name] = said, details
        self.progress.error(said)
        self._close(task, FAILED)
        if fatal:
            raise ExecutorError(said)

    def _close(self, task: Task, state: str, key: str | None = None) -> None:
        """Take it that a task has come to its end, with a result of this key: those after it may begin."""
        self._open.discard(task.key)
        self._settled[task.key] = key
        self.counts[state] += 1
        self._reached.add(task)
        if key is None:
            self.store.withdraw(task.publish.values())  # What is there under its name was made of something else.
        self._show(task)

    def _show(self, task: Task, doing: str = "") -> None:
        """Report how far the whole is, and a task."""
        parts = [(job.share, one) for one, job in self._at_work.values()]
        frames = int(self._reached.frames + sum(share * one.frames for share, one in parts))
        counted = f"frame {frames} of {self._survey.frames}" if self._survey.frames else ""
        words = ", ".join(filter(None, (": ".join(filter(None, (task.shown, doing))), counted)))
        self._stage.reach(self._reached.weight + sum(share * one.weight for share, one in parts), words)
