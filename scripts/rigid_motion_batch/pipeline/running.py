"""Running a plan: what is missing is given to an executor, in order, kept, and published.

A plan is a function that returns its tasks one by one, each after those that it reads from. So of ten thousand clips
only those are in memory that are at work. Where a task fails those that need it are skipped, and all others are done.
What ends a run is Ctrl-C, and a disk that is full or must not be written. Nothing is printed here.
"""

from __future__ import annotations

import enum
import io
import os
import shutil
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from rigid_motion_batch.progress import Progress, Stage

from .performing import FULL_OR_FORBIDDEN, Answer, Executor, ExecutorError, Order, answer_of, progress_of
from .steps import Task
from .store import OutputError, Result, Store, not_written

Plan = Callable[[], Iterable[Task]]

RETRIES = 2
"""Number of times that a task is begun anew whose process died."""

LOOK = 0.2
"""Seconds between two looks at how far tasks are."""


class State(enum.Enum):
    """State of a task. The values are what people read."""

    DONE = "done"
    UP_TO_DATE = "up to date"
    FAILED = "failed"
    SKIPPED = "skipped"
    """A task before it failed."""

    STOPPED = "not begun or stopped"


@dataclass
class Outcome:
    """Outcome of a run."""

    counts: Counter[State] = field(default_factory=Counter)
    failures: dict[str, str] = field(default_factory=dict)
    """Task to what was wrong, in one line."""

    details: dict[str, str] = field(default_factory=dict)
    """Task to what Python said of its failure; empty where the reason is known."""

    interrupted: bool = False
    """True if the run was interrupted by Ctrl-C."""

    problem: str = ""
    """The reason why nothing more could be done, in one line; empty where everything was tried."""

    def later(self) -> Outcome:
        """Return the outcome to begin a later run with, which finds done what this one has done."""
        done = self.counts[State.DONE]
        return Outcome(Counter({State.DONE: done, State.UP_TO_DATE: -done}), self.failures, self.details)

    def note_failures(self, store: Store) -> None:
        """Have the store keep what failed, for whoever asks later."""
        details = self.details
        failures = {name: {"message": m, "details": details.get(name, "")} for name, m in self.failures.items()}
        with suppress(OSError):
            store.note("failures.json", failures)

    def __str__(self) -> str:
        """Return how many tasks are in each state: "12 done, 3 up to date, 1 failed"."""
        return ", ".join(f"{self.counts[state]} {state.value}" for state in State if self.counts[state]) or (
            "nothing to do"
        )


@dataclass(frozen=True)
class Share:
    """A part of a plan, for one of several workers: tasks of some stages, and of their groups every `of`-th."""

    stages: frozenset[str] = frozenset()
    """The stages; empty for all."""

    number: int = 1
    of: int = 1

    def chooser(self) -> Callable[[Task], bool]:
        """Return a function that says of every task of a plan, asked in their order, whether it is in the share."""
        groups: dict[str, int] = {}

        def chosen(task: Task) -> bool:
            if self.stages and task.step.stage not in self.stages:
                return False
            return groups.setdefault(task.group or task.name, len(groups)) % self.of == self.number - 1

        return chosen


EVERYTHING = Share()


@dataclass(frozen=True, eq=False, slots=True)
class Found:
    """A task as it is found in a store."""

    task: Task
    chosen: bool
    result: Result | None
    done: bool


def look_through(plan: Plan, store: Store, share: Share = EVERYTHING) -> Iterator[Found]:
    """Yield all tasks of a plan."""
    chosen = share.chooser()
    for task in plan():
        requested, result = chosen(task), store.result(task.key)
        yield Found(task, requested, result, result is not None and (not requested or store.is_published(task, result)))


@dataclass
class Survey:
    """Tasks that there are to do."""

    weight: float = 0.0
    tasks: int = 0
    up_to_date: int = 0
    amounts: Counter[str] = field(default_factory=Counter)

    @classmethod
    def of(cls, plan: Plan, store: Store, share: Share = EVERYTHING) -> Survey:
        """Look through a plan.

        Raises
        ------
        OutputError
            Where something would be replaced that must not be, or two tasks publish one file.
        """
        survey, strangers = cls(), []
        places: set[int] = set()
        for result in look_through(plan, store, share):
            for path in result.task.publish.values():
                if (place := hash(path.casefold())) in places:
                    raise OutputError(f"{path}: two results would go here; choose other names")
                places.add(place)
            if result.done:
                survey.up_to_date += result.chosen
                continue
            if result.chosen:
                strangers += store.strangers(result.task, result.result)
                survey.weight += result.task.weight
                survey.tasks += 1
                survey.amounts[result.task.unit] += result.task.amount
        if strangers and not store.overwrite:
            raise OutputError(not_written([os.fspath(store.output / path) for path in strangers]))
        return survey


def run(
    plan: Plan,
    store: Store,
    executor: Executor,
    *,
    progress: Progress | None = None,
    title: str = "",
    share: Share = EVERYTHING,
    blender: str = "",
    before: Outcome | None = None,
) -> Outcome:
    """Do what is missing of a plan.

    Parameters
    ----------
    plan : callable
        Returns its tasks, the same each time.
    store, executor
        Opened. An executor may do several plans, one after the other.
    progress : Progress, optional
        Gets a stage of this title, and what is said of tasks.
    share : Share
        What is to be done here; of the rest, what is there is used.
    blender : str
        The program for steps that need Blender, if it is not to be this one.
    before : Outcome, optional
        What became of an earlier plan of the same work, which this one's goes on from.

    Returns
    -------
    Outcome
        Also after Ctrl-C: then nothing is at work any more.

    Raises
    ------
    OutputError
        Before anything is done, where something would be replaced that must not be.
    """
    progress, outcome = progress or Progress(io.StringIO()), (before or Outcome()).later()
    with progress.stage(title, 1.0) as stage:
        survey = Survey.of(plan, store, share)
        stage.total = survey.weight
        if survey.tasks:
            _Run(plan, store, executor, progress, stage, share, blender, survey, outcome).run()
        else:
            outcome.counts[State.UP_TO_DATE] += survey.up_to_date
    if share == EVERYTHING:
        outcome.note_failures(store)
    return outcome


@dataclass(eq=False)
class _Open:
    """A task that is not settled."""

    task: Task
    pending: list[str]
    """The keys of the tasks that it waits for, and perhaps of others that are settled."""

    key: str = ""
    """The key under which its result is kept: that of the task, but for a partial one where something failed."""

    share: float = 0.0
    losses: int = 0


@dataclass(eq=False)
class _Run:
    """A run that is under way."""

    plan: Plan
    store: Store
    executor: Executor
    progress: Progress
    stage: Stage
    share: Share
    blender: str
    survey: Survey
    outcome: Outcome

    settled: dict[str, str | None] = field(default_factory=dict)
    """Key of a task to that of its result; None where it has none."""

    open: set[str] = field(default_factory=set)
    """The keys of tasks that are met, and not settled."""

    waiting: list[_Open] = field(default_factory=list)
    at_work: dict[Future[Answer], tuple[_Open, Order]] = field(default_factory=dict)
    weight_done: float = 0.0
    amounts_done: Counter[str] = field(default_factory=Counter)
    shown: Counter[str] = field(default_factory=Counter)

    def run(self) -> None:
        try:
            self._work()
            if self.share == EVERYTHING and not self.outcome.failures:
                self.store.sweep(key for key in self.settled.values() if key)
        except ExecutorError as error:
            self.outcome.problem = str(error)
        except KeyboardInterrupt:
            self.outcome.interrupted = True
        if self.outcome.problem or self.outcome.interrupted:
            self.executor.stop()
            self.outcome.counts[State.STOPPED] = max(0, self.survey.tasks)

    def _work(self) -> None:
        rest = look_through(self.plan, self.store, self.share)
        more = True
        while more or self.waiting or self.at_work:
            capacity = self.executor.capacity
            ready = [one for one in self.waiting if self._is_ready(one)]
            while more and len(ready) < capacity:
                result = next(rest, None)
                if more := result is not None:
                    ready += filter(self._is_ready, self._meet(result))
            for opened in ready[: max(0, capacity - len(self.at_work))]:
                self.waiting.remove(opened)
                self._begin(opened)
            if not capacity:
                time.sleep(LOOK)
            ended, _ = wait(self.at_work, LOOK, FIRST_COMPLETED)
            for future in ended:
                opened, order = self.at_work.pop(future)
                self._end(opened, order, answer_of(future, order))
            for opened, order in () if ended else self.at_work.values():
                if progress := progress_of(order):
                    self._tell(opened, *progress)

    def _is_ready(self, opened: _Open) -> bool:
        while opened.pending and opened.pending[-1] not in self.open:
            opened.pending.pop()
        return not opened.pending

    def _meet(self, result: Found) -> list[_Open]:
        """Take a task from the plan: it is up to date, or waits from now on, and is returned."""
        task = result.task
        if result.done and task.key not in self.open:
            self.settled[task.key] = task.key
            self.outcome.counts[State.UP_TO_DATE] += result.chosen
        elif result.chosen:
            # A task that is there twice waits for itself.
            pending = [key for key in (task.key, *task.after) if key in self.open]
            self.waiting.append(_Open(task, pending))
            self.open.add(task.key)
            return self.waiting[-1:]
        return []

    def _before(self, task: Task) -> list[str | None]:
        """Return the keys of the results of the tasks before one, also of earlier plans; None where there is none."""
        for key in task.after:
            if key not in self.settled:
                self.settled[key] = key if self.store.result(key) else None
        return [self.settled[key] for key in task.after]

    def _begin(self, opened: _Open) -> None:
        """Begin a task whose predecessors are settled, or settle it if there is nothing to do."""
        task = opened.task
        before = self._before(task)
        opened.key = task.key_after(before)
        if self.store.result(opened.key):
            self._settle(opened)
        elif self.settled.get(task.key, "") is None or (None in before and not (task.step.partial and any(before))):
            self.store.withdraw(task.publish.values())
            self._close(opened, State.SKIPPED)
        else:
            order = Order(
                step=task.step,
                parameters=task.parameters,
                before=tuple(os.fspath(self.store.folder_of(key)) if key else None for key in before),
                inputs=task.inputs,
                requested={name: os.fspath(self.store.output / path) for name, path in task.publish.items()},
                output=os.fspath(self.store.output),
                folder=os.fspath(self.store.new_scratch()),
                blender=self.blender,
            )
            self._tell(opened, 0.0, "")
            future = self.executor.submit(order, lambda share, doing: self._tell(opened, share, doing))
            self.at_work[future] = opened, order

    def _end(self, opened: _Open, order: Order, answer: Answer) -> None:
        """Take what came of an order."""
        shown = opened.task.shown
        for note in answer.notes:
            self.progress.note(note)
        if answer.index:
            self._settle(opened, order.folder, answer.index)
        elif answer.lost:
            shutil.rmtree(order.folder, ignore_errors=True)
            opened.losses += 1
            if opened.losses <= RETRIES:
                self.progress.note(f"{shown}: {answer.problem}; trying again")
                self.waiting.insert(0, opened)
            else:
                self._fail(opened, f"{shown}: {answer.problem}; given up after {opened.losses} attempts")
        else:
            # An error that nobody foresaw does not say by itself what it is about.
            said = f"{shown}: {answer.problem}" if answer.details else answer.problem
            self._fail(opened, said, answer.details, fatal=answer.fatal)

    def _settle(self, opened: _Open, made: str = "", index: Mapping[str, Any] | None = None) -> None:
        """Keep what was made, unless it is there, and put its files in place."""
        task, is_new = opened.task, True
        try:
            if index:
                result = self.store.keep(task, opened.key, Path(made), index)
            else:
                result = cast(Result, self.store.result(opened.key))
                is_new = not self.store.is_published(task, result)
            self.store.publish(task, result)
        except OutputError as error:
            self._fail(opened, str(error))
        except OSError as error:
            said = f"{error.filename2 or error.filename}: {error.strerror or error}"
            self._fail(opened, said, fatal=error.errno in FULL_OR_FORBIDDEN)
        else:
            for key in task.spends:
                self.store.discard(key)
            self._close(opened, State.DONE if is_new else State.UP_TO_DATE)

    def _fail(self, opened: _Open, said: str, details: str = "", *, fatal: bool = False) -> None:
        task = opened.task
        if not fatal and self.store.discard_damaged(key for key in self._before(task) if key):
            said = f"{task.shown}: what it reads was damaged; run the same command again"
        self.outcome.failures[task.name], self.outcome.details[task.name] = said, details
        self.progress.error(said)
        self._close(opened, State.FAILED)
        if fatal:
            raise ExecutorError(said)
        # What is there under its name was made of something else.
        self.store.withdraw(task.publish.values())

    def _close(self, opened: _Open, state: State) -> None:
        """Close an open task that has come to its end: those after it may begin."""
        task = opened.task
        self.open.discard(task.key)
        self.settled[task.key] = opened.key if state in (State.DONE, State.UP_TO_DATE) else None
        self.survey.tasks -= 1
        self.weight_done += task.weight
        self.amounts_done[task.unit] += task.amount
        self.outcome.counts[state] += 1

    def _tell(self, opened: _Open, share: float, doing: str) -> None:
        """Report how far a task is, and with it the whole."""
        opened.share = share
        weight, by_now = self.weight_done, defaultdict[str, float](float, self.amounts_done)
        for one in {opened, *(one for one, _ in self.at_work.values())}:
            weight += one.share * one.task.weight
            by_now[one.task.unit] += one.share * one.task.amount
        # What a worker that died had done does not make the count go back.
        self.shown |= Counter({unit: int(number) for unit, number in by_now.items() if unit})
        counted = [f"{unit} {number} of {self.survey.amounts[unit]}" for unit, number in self.shown.items()]
        shown = ": ".join(filter(None, (opened.task.shown, doing)))
        self.stage.reach(weight, ", ".join([shown, *counted]))
