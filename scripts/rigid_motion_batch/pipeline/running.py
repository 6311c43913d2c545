"""Running a plan: what is missing is given to an executor, in order, kept, and published.

A plan is a function that returns its tasks one by one, each after those that it reads from. So of ten thousand clips
only those are in memory that are at work. Where a task fails those that need it are skipped, and all others are done.
What ends a run is Ctrl-C, and a disk that is full or must not be written. Nothing is printed here.
"""

from __future__ import annotations

import enum
import heapq
import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from .performing import FULL_OR_FORBIDDEN, Executor, Failed, Lost, Made, Order, outcome_of, progress_of
from .steps import Task
from .store import OutputError, Result, Store, not_written

Plan = Callable[[], Iterable[Task]]

RETRIES = 2
"""How often a task is begun anew whose process died."""

LOOK = 0.2
"""Seconds between two looks at how far tasks are."""


class State(enum.Enum):
    """What became of a task. The values are what people read."""

    DONE = "done"
    UP_TO_DATE = "up to date"
    FAILED = "failed"
    SKIPPED = "skipped"
    """A task before it failed."""

    STOPPED = "not begun or stopped"


class Progress:
    """Is told how a run gets on. This one does nothing."""

    def begin(self, total: float) -> None:
        """So many seconds of work, as far as one can say."""

    def reach(self, done: float, doing: str, counts: Mapping[str, tuple[int, int]]) -> None:
        """So much of the total is done; what is being done, and of what is counted ("frame") how many of how many."""

    def note(self, text: str) -> None:
        """A line for the user."""

    def finish(self, task: Task, state: State, problem: str) -> None:
        """What became of a task, and in a line what was wrong with it."""


@dataclass
class Outcome:
    """What became of a run."""

    counts: Counter[State] = field(default_factory=Counter)
    failures: dict[str, str] = field(default_factory=dict)
    """Task to what was wrong, in one line."""

    details: dict[str, str] = field(default_factory=dict)
    """And to what Python said of it; empty where that is known."""

    interrupted: bool = False
    """By Ctrl-C."""

    problem: str = ""
    """Why nothing more could be done, in one line; empty where everything was tried."""

    def continued(self, later: Outcome) -> Outcome:
        """What became of this and a later run, which found done what this one has done."""
        done = self.counts[State.DONE]
        later.counts.update({State.DONE: done, State.UP_TO_DATE: -done})
        later.failures, later.details = self.failures | later.failures, self.details | later.details
        return later

    def note_failures(self, store: Store) -> None:
        """Have the store keep what failed, for whoever asks later."""
        details = self.details
        failures = {name: {"message": m, "details": details.get(name, "")} for name, m in self.failures.items()}
        with suppress(OSError):
            store.note("failures.json", failures)

    def __str__(self) -> str:
        """How many of each: "12 done, 3 up to date, 1 failed"."""
        return ", ".join(f"{self.counts[state]} {state.value}" for state in State if self.counts[state]) or (
            "nothing to do"
        )


@dataclass(frozen=True)
class Share:
    """A part of a plan, for one of several workers: tasks of some stages, and of their groups every `of`-th."""

    stages: frozenset[str] = frozenset()
    """Empty for all."""

    number: int = 1
    of: int = 1

    def chooser(self) -> Callable[[Task], bool]:
        """What says of every task of a plan, asked in their order, whether it is in the share."""
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
    """All tasks of a plan."""
    chosen = share.chooser()
    for task in plan():
        wanted, result = chosen(task), store.result(task.key)
        yield Found(task, wanted, result, bool(result) and (not wanted or store.is_published(task, result)))


@dataclass
class Survey:
    """What there is to do."""

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
        for found in look_through(plan, store, share):
            for path in found.task.publish.values():
                if (place := hash(path.casefold())) in places:
                    raise OutputError(f"{path}: two results would go here; choose other names")
                places.add(place)
            if found.done:
                survey.up_to_date += found.chosen
                continue
            if found.chosen:
                strangers += store.strangers(found.task, found.result)
                survey.weight += found.task.weight
                survey.tasks += 1
                survey.amounts[found.task.unit] += found.task.amount
        if strangers and not store.overwrite:
            raise OutputError(not_written([os.fspath(store.output / path) for path in strangers]))
        return survey


def run(
    plan: Plan,
    store: Store,
    executor: Executor,
    *,
    progress: Progress | None = None,
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
    survey = Survey.of(plan, store, share)
    if survey.tasks:
        outcome = _Run(plan, store, executor, progress or Progress(), share, blender, survey).run()
    else:
        outcome = Outcome(Counter({State.UP_TO_DATE: survey.up_to_date}))
    outcome = (before or Outcome()).continued(outcome)
    if share == EVERYTHING:
        outcome.note_failures(store)
    return outcome


class _Hopeless(Exception):
    """Raised where no task can be done any more."""


@dataclass(eq=False)
class _Open:
    """A task that is not settled."""

    task: Task
    number: int = 0
    waits: int = 0
    """For how many others."""

    key: str = ""
    """Under which its result is kept: that of the task, but for a partial one where something failed."""

    share: float = 0.0
    losses: int = 0


@dataclass(eq=False)
class _Run:
    """A run that is under way."""

    plan: Plan
    store: Store
    executor: Executor
    progress: Progress
    share: Share
    blender: str
    survey: Survey

    def __post_init__(self) -> None:
        self.outcome = Outcome()
        self.settled: dict[str, str | None] = {}
        """Key of a task to that of its result; None where it has none."""
        self.readers: dict[str, list[_Open]] = {}
        """Key of an open task to those that wait for it."""
        self.ready: list[tuple[int, _Open]] = []
        self.at_work: dict[Future[Made | Failed | Lost], tuple[_Open, Order]] = {}
        self.number, self.weight_done = 0, 0.0
        self.amounts_done: Counter[str] = Counter()
        self.shown: Counter[str] = Counter()

    def run(self) -> Outcome:
        self.progress.begin(self.survey.weight)
        outcome = self.outcome
        try:
            self._work()
            if self.share == EVERYTHING and not outcome.failures:
                self.store.sweep(key for key in self.settled.values() if key)
        except _Hopeless as error:
            outcome.problem = str(error)
        except KeyboardInterrupt:
            outcome.interrupted = True
        if outcome.problem or outcome.interrupted:
            self.executor.stop()
            over = sum(outcome.counts[state] for state in (State.DONE, State.FAILED, State.SKIPPED))
            outcome.counts[State.STOPPED] = max(0, self.survey.tasks - over)
        return outcome

    def _work(self) -> None:
        rest = look_through(self.plan, self.store, self.share)
        found: Found | None
        more = True
        while more or self.ready or self.at_work:
            while more and len(self.ready) < self.executor.capacity:
                if found := next(rest, None):
                    self._meet(found)
                more = found is not None
            while self.ready and len(self.at_work) < self.executor.capacity:
                self._begin(heapq.heappop(self.ready)[1])
            ended, _ = wait(self.at_work, LOOK, FIRST_COMPLETED)
            for future in ended:
                opened, order = self.at_work.pop(future)
                self._end(opened, order, outcome_of(future))
            for opened, order in () if ended else self.at_work.values():
                if progress := progress_of(order):
                    self._tell(opened, *progress)

    def _meet(self, found: Found) -> None:
        """Take a task from the plan: it is up to date, or ready, or waits for others."""
        task = found.task
        if found.done and task.key not in self.readers:
            self.settled[task.key] = task.key
            if found.chosen:
                self._count(task, State.UP_TO_DATE)
        elif found.chosen:
            self.number += 1
            opened = _Open(task, self.number)
            # A task that is there twice waits for itself.
            for key in {*task.after, task.key} & self.readers.keys():
                self.readers[key].append(opened)
                opened.waits += 1
            self.readers.setdefault(task.key, [])
            if not opened.waits:
                heapq.heappush(self.ready, (opened.number, opened))

    def _before(self, task: Task) -> list[str | None]:
        """The keys of the results of the tasks before one, also of earlier plans; None where there is none."""
        for key in task.after:
            if key not in self.settled:
                self.settled[key] = key if self.store.result(key) else None
        return [self.settled[key] for key in task.after]

    def _begin(self, opened: _Open) -> None:
        """Begin a task whose predecessors are settled, or settle it if there is nothing to do."""
        task = opened.task
        before = self._before(task)
        opened.key = task.key_after(before)
        if result := self.store.result(opened.key):
            self._settle(opened, result)
        elif self.settled.get(task.key, "") is None or (None in before and not (task.step.partial and any(before))):
            self.store.withdraw(task.publish.values())
            self._close(opened, State.SKIPPED)
        else:
            order = Order(
                step=task.step,
                parameters=task.parameters,
                before=tuple(os.fspath(self.store.folder_of(key)) if key else None for key in before),
                inputs=task.inputs,
                wanted={name: os.fspath(self.store.output / path) for name, path in task.publish.items()},
                output=os.fspath(self.store.output),
                folder=os.fspath(self.store.new_scratch()),
                blender=self.blender,
            )
            self._tell(opened, 0.0, "")
            future = self.executor.submit(order, lambda share, doing: self._tell(opened, share, doing))
            self.at_work[future] = opened, order

    def _end(self, opened: _Open, order: Order, message: Made | Failed | Lost) -> None:
        """Take what came of an order."""
        shown = opened.task.shown
        for note in message.notes:
            self.progress.note(note)
        if isinstance(message, Made):
            self._settle(opened, message)
        elif isinstance(message, Failed):
            self._failed(opened, message)
        else:
            shutil.rmtree(order.folder, ignore_errors=True)
            opened.losses += 1
            if opened.losses <= RETRIES:
                self.progress.note(f"{shown}: {message.message}; trying again")
                heapq.heappush(self.ready, (opened.number, opened))
            else:
                self._failed(opened, Failed(f"{shown}: {message.message}; given up after {opened.losses} attempts"))

    def _settle(self, opened: _Open, made: Made | Result) -> None:
        """Keep what was made, and put its files in place."""
        task, is_new = opened.task, True
        try:
            if isinstance(made, Made):
                made = self.store.keep(task, opened.key, Path(made.folder), made.index)
            else:
                is_new = not self.store.is_published(task, made)
            self.store.publish(task, made)
        except OutputError as error:
            self._failed(opened, Failed(str(error)))
        except OSError as error:
            self._failed(opened, _of_system(error))
        else:
            for key in task.spends:
                self.store.discard(key)
            self._close(opened, State.DONE if is_new else State.UP_TO_DATE)

    def _failed(self, opened: _Open, failed: Failed) -> None:
        # An error that nobody foresaw does not say by itself what it is about.
        task = opened.task
        said = f"{task.shown}: {failed.message}" if failed.details else failed.message
        if not failed.hopeless and self.store.discard_damaged(key for key in self._before(task) if key):
            said = f"{task.shown}: what it reads was damaged; run the same command again"
        self.outcome.failures[task.name], self.outcome.details[task.name] = said, failed.details
        self._close(opened, State.FAILED, said)
        if failed.hopeless:
            raise _Hopeless(said)
        # What is there under its name was made of something else.
        self.store.withdraw(task.publish.values())

    def _close(self, opened: _Open, state: State, problem: str = "") -> None:
        """An open task has come to its end: those after it may begin."""
        task, there = opened.task, state in (State.DONE, State.UP_TO_DATE)
        waiting = self.readers.pop(task.key, [])
        self.settled[task.key] = opened.key if there else None
        self.weight_done += task.weight
        self.amounts_done[task.unit] += task.amount
        self._count(task, state, problem)
        for one in waiting:
            if one.task.key == task.key:
                self.readers.setdefault(task.key, [])
            one.waits -= 1
            if not one.waits:
                heapq.heappush(self.ready, (one.number, one))

    def _count(self, task: Task, state: State, problem: str = "") -> None:
        self.outcome.counts[state] += 1
        self.progress.finish(task, state, problem)

    def _tell(self, opened: _Open, share: float, doing: str) -> None:
        """Tell how far a task is, and with it the whole."""
        opened.share = share
        at_work = {opened, *(one for one, _ in self.at_work.values())}
        weight = self.weight_done + sum(one.share * one.task.weight for one in at_work)
        by_now = Counter(self.amounts_done)
        for one in at_work:
            by_now[one.task.unit] += one.share * one.task.amount
        del by_now[""]
        # What a worker that died had done does not make the count go back.
        self.shown |= Counter({unit: int(number) for unit, number in by_now.items()})
        counts = {unit: (number, self.survey.amounts[unit]) for unit, number in self.shown.items()}
        shown = opened.task.shown
        self.progress.reach(min(weight, self.survey.weight), f"{shown}: {doing}" if doing else shown, counts)


def _of_system(error: OSError) -> Failed:
    where = error.filename2 or error.filename
    return Failed(f"{where}: {error.strerror or error}", hopeless=error.errno in FULL_OR_FORBIDDEN)
