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
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from .performing import FULL_OR_FORBIDDEN, Executor, ExecutorError, Failed, Lost, Made, Order, Told, perform
from .steps import Task
from .store import OutputError, Result, Store, not_written

Plan = Callable[[], Iterable[Task]]

RETRIES = 2
"""How often a task is begun anew whose process died."""

PATIENCE = 0.5
"""Seconds between two looks at the clock while nothing happens."""

AFTER_CTRL_C = 1.0
"""Seconds for everything that is done after Ctrl-C."""


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
        """What became of both of two runs of one plan."""
        done = self.counts[State.DONE]
        later.counts.update({State.DONE: done, State.UP_TO_DATE: -done})
        return later

    def note_failures(self, store: Store) -> None:
        """Have the store keep what failed, for whoever asks later."""
        failures = {name: {"message": said, "details": self.details[name]} for name, said in self.failures.items()}
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
    """A task as it is found in a store, and the temporary ones that are for it alone."""

    task: Task
    chosen: bool
    result: Result | None
    temporary: tuple[Task, ...]
    missing: tuple[Task, ...]
    """Those of them that are to be done before it."""

    done: bool


def look_through(plan: Plan, store: Store, share: Share = EVERYTHING) -> Iterator[Found]:
    """All tasks of a plan but the temporary ones."""
    chosen = share.chooser()
    sleeping: dict[str, tuple[Task, bool]] = {}
    for task in plan():
        wanted = chosen(task)
        if task.step.temporary:
            sleeping[task.key] = task, wanted
            continue
        own = [sleeping.pop(key) for key in task.after if key in sleeping]
        result = store.result(task.key)
        done = bool(result) and (not wanted or store.is_published(task, result))
        missing = () if result else tuple(one for one, also in own if also and not store.result(one.key))
        yield Found(task, wanted, result, tuple(one for one, _ in own), missing, done)


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
            for task in (*found.missing, *([found.task] if found.chosen else [])):
                survey.weight += task.weight
                survey.tasks += 1
                survey.amounts[task.unit] += task.amount
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

    Returns
    -------
    Outcome
        Also after Ctrl-C: then partial tasks have been done with what there is, if that took no longer than a moment,
        and nothing is at work any more.

    Raises
    ------
    OutputError
        Before anything is done, where something would be replaced that must not be.
    """
    survey = Survey.of(plan, store, share)
    if not survey.tasks:
        return Outcome(Counter({State.UP_TO_DATE: survey.up_to_date}))
    attempt = _Run(plan, store, executor, progress or Progress(), share, blender, survey)
    outcome = attempt.run()
    if not attempt.damaged or outcome.interrupted or outcome.problem:
        return outcome
    again = replace(attempt, survey=Survey.of(plan, store, share), mends=False)
    return outcome.continued(again.run())


class _OutOfTime(BaseException):
    """Raised inside a task that takes too long after Ctrl-C."""


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
    mends: bool = True
    """Whether what turns out to be damaged will be made again."""

    def __post_init__(self) -> None:
        self.outcome, self.damaged = Outcome(), False
        self.settled: dict[str, str | None] = {}
        """Key of a task to that of its result; None where it has none."""
        self.open: dict[int, _Open] = {}
        """By their places in the plan."""
        self.readers: dict[str, list[_Open]] = {}
        """Key of an open task to those that wait for it."""
        self.ready: list[tuple[int, _Open]] = []
        self.temporary: set[str] = set()
        self.at_work: dict[str, _Open] = {}
        """By the folder of the order."""
        self.number, self.weight_done = 0, 0.0
        self.amounts_done: Counter[str] = Counter()
        self.shown: Counter[str] = Counter()
        self.rest = look_through(self.plan, self.store, self.share)

    def run(self) -> Outcome:
        self.progress.begin(self.survey.weight)
        outcome = self.outcome
        try:
            self._work()
            if self.share == EVERYTHING and not outcome.failures:
                self.store.sweep(key for key in self.settled.values() if key)
        except (_Hopeless, ExecutorError) as error:
            outcome.problem = str(error)
            self._stop()
        except KeyboardInterrupt:
            self._interrupted()
        if outcome.problem or outcome.interrupted:
            over = sum(outcome.counts[state] for state in (State.DONE, State.FAILED, State.SKIPPED))
            outcome.counts[State.STOPPED] = max(0, self.survey.tasks - over)
        if self.share == EVERYTHING:
            outcome.note_failures(self.store)
        return outcome

    def _work(self) -> None:
        more = True
        while more or self.ready or self.at_work:
            while more and len(self.ready) < self.executor.capacity:
                found = next(self.rest, None)
                if more := found is not None:
                    self._meet(found)
            while self.ready and len(self.at_work) < self.executor.capacity:
                self._begin(heapq.heappop(self.ready)[1])
            if self.at_work or not self.executor.capacity:
                self.executor.wait(self._hear, PATIENCE)

    def _meet(self, found: Found) -> None:
        """Take a task from the plan: it is up to date, or ready, or waits for others."""
        if found.done and found.task.key not in self.readers:
            for one in found.temporary:
                self.store.discard(one.key)
            self.settled[found.task.key] = found.task.key
            if found.chosen:
                self._count(found.task, State.UP_TO_DATE)
            return
        for task in found.missing:
            self._open(task)
        if found.chosen:
            self.temporary.update(one.key for one in found.temporary)
            self._open(found.task)

    def _open(self, task: Task) -> None:
        self.number += 1
        self.open[self.number] = opened = _Open(task, self.number)
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
            order = self._order(task)
            self.at_work[order.folder], opened.share = opened, 0.0
            self._show(task.shown)
            self.executor.submit(order)

    def _order(self, task: Task) -> Order:
        return Order(
            step=task.step,
            parameters=task.parameters,
            before=tuple(os.fspath(self.store.folder_of(key)) if key else None for key in self._before(task)),
            inputs=task.inputs,
            wanted={name: os.fspath(self.store.output / path) for name, path in task.publish.items()},
            output=os.fspath(self.store.output),
            folder=os.fspath(self.store.new_scratch()),
            blender=self.blender,
        )

    def _hear(self, order: Order, message: Told | Made | Failed | Lost) -> None:
        opened = self.at_work.get(order.folder)
        if opened is None:
            return
        shown = opened.task.shown
        if isinstance(message, Told):
            opened.share = message.share
            self._show(f"{shown}: {message.doing}" if message.doing else shown)
            return
        del self.at_work[order.folder]
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
            self._close(opened, State.DONE if is_new else State.UP_TO_DATE)

    def _failed(self, opened: _Open, failed: Failed) -> None:
        # An error that nobody foresaw does not say by itself what it is about.
        task = opened.task
        said = f"{task.shown}: {failed.message}" if failed.details else failed.message
        self.outcome.failures[task.name], self.outcome.details[task.name] = said, failed.details
        if failed.hopeless:
            self._close(opened, State.FAILED, said)
            raise _Hopeless(said)
        keys = [key for key in self._before(task) if key and self.mends]
        for key in (key for key in keys if not self.store.result(key, thoroughly=True)):
            self.store.discard(key)
            self.damaged = True
            self.progress.note(f"{task.shown}: what it reads is damaged; it is made again")
        # What is there under its name was made of something else.
        self.store.withdraw(task.publish.values())
        self._close(opened, State.FAILED, said)

    def _close(self, opened: _Open, state: State, problem: str = "") -> None:
        """An open task has come to its end: those after it may begin."""
        task, there = opened.task, state in (State.DONE, State.UP_TO_DATE)
        self.open.pop(opened.number, None)
        waiting = self.readers.pop(task.key, [])
        self.settled[task.key] = opened.key if there else None
        self.weight_done += task.weight
        self.amounts_done[task.unit] += task.amount
        self._count(task, state, problem)
        for key in self.temporary.intersection(task.after) if there else ():
            self.store.discard(key)
        for one in waiting:
            if one.task.key == task.key:
                self.readers.setdefault(task.key, [])
            one.waits -= 1
            if not one.waits:
                heapq.heappush(self.ready, (one.number, one))

    def _count(self, task: Task, state: State, problem: str = "") -> None:
        self.outcome.counts[state] += 1
        self.progress.finish(task, state, problem)

    def _show(self, doing: str) -> None:
        by_now, weight = Counter(self.amounts_done), self.weight_done
        for one in self.at_work.values():
            by_now[one.task.unit] += one.share * one.task.amount
            weight += one.share * one.task.weight
        del by_now[""]
        # What a worker that died had done does not make the count go back.
        self.shown |= Counter({unit: int(number) for unit, number in by_now.items()})
        counts = {unit: (number, self.survey.amounts[unit]) for unit, number in self.shown.items()}
        self.progress.reach(min(weight, self.survey.weight), doing, counts)

    # -- Ctrl-C -------------------------------------------------------------------------------------------------------

    def _stop(self) -> None:
        self.executor.stop()
        for folder in self.at_work:
            shutil.rmtree(folder, ignore_errors=True)
        self.at_work.clear()

    def _interrupted(self) -> None:
        self.outcome.interrupted = True
        deadline = time.monotonic() + AFTER_CTRL_C
        with suppress(KeyboardInterrupt, _OutOfTime, _Hopeless, OSError):  # The next run will do the rest.
            self._stop()
            rest = (_Open(found.task) for found in self.rest if found.chosen and not found.done)
            for opened in (*self.open.values(), *rest):
                if opened.task.step.partial and any(before := self._before(opened.task)):
                    opened.key = opened.task.key_after(before)
                    self._do_at_once(opened, deadline)

    def _do_at_once(self, opened: _Open, deadline: float) -> None:
        """Do a partial task in this process, with what there is."""

        def tell(share: float, doing: str) -> None:
            if time.monotonic() > deadline:
                raise _OutOfTime

        tell(0.0, "")
        made = self.store.result(opened.key) or perform(self._order(opened.task), tell)
        if isinstance(made, (Made, Result)):
            self._settle(opened, made)


def _of_system(error: OSError) -> Failed:
    where = error.filename2 or error.filename
    return Failed(f"{where}: {error.strerror or error}", hopeless=error.errno in FULL_OR_FORBIDDEN)
