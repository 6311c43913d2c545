"""Running a plan: what is missing is given to an executor, in order, kept, and published.

A plan is a function that returns its tasks one by one, each after those that it reads from. So of ten thousand clips
only those are in memory that are at work. One failure is no reason to stop: the tasks that need what failed are
skipped, and all others are done. What ends a run before its time is Ctrl-C, and a disk that is full or must not be
written. Nothing is printed here.
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
from dataclasses import dataclass, field
from pathlib import Path

from .performing import FULL_OR_FORBIDDEN, Executor, Failed, Lost, Made, Order, Told, perform
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

    seconds: float = 0.0
    """Of work, by all workers together."""

    facts: Counter[str] = field(default_factory=Counter)
    """Sums of the numbers among the facts of what was done."""

    interrupted: bool = False
    """By Ctrl-C."""

    problem: str = ""
    """Why nothing more could be done, in one line; empty where everything was tried."""

    def continued(self, later: Outcome) -> Outcome:
        """What became of both of two runs of one plan."""
        done = self.counts[State.DONE]
        later.counts.update({State.DONE: done, State.UP_TO_DATE: -done})
        later.seconds += self.seconds
        later.facts.update(self.facts)
        return later

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
        found, strangers, chosen = cls(), [], share.chooser()
        places: set[int] = set()
        sleeping: dict[str, tuple[Task, bool]] = {}
        for task in plan():
            for path in task.publish.values():
                place = hash(path.casefold())
                if place in places:
                    raise OutputError(f"{path}: two results would go here; choose other names")
                places.add(place)
            wanted = chosen(task)
            if task.step.temporary:
                sleeping[task.key] = task, wanted
                continue
            before = [sleeping.pop(key) for key in task.after if key in sleeping]
            result = store.result(task.key)
            if result and (not wanted or store.is_published(task, result)):
                found.up_to_date += wanted
                continue
            to_do = [task] if wanted else []
            if wanted:
                strangers += store.strangers(task, result)
            if not result:
                to_do += [one for one, also in before if also and not store.result(one.key)]
            for one in to_do:
                found.weight += one.weight
                found.tasks += 1
                found.amounts[one.unit] += one.amount
        if strangers and not store.overwrite:
            raise OutputError(not_written([os.fspath(store.output / path) for path in strangers]))
        return found


def run(
    plan: Plan,
    store: Store,
    executor: Executor,
    *,
    progress: Progress | None = None,
    share: Share = EVERYTHING,
    retries: int = RETRIES,
    blender: str = "",
) -> Outcome:
    """Do what is missing of a plan.

    Parameters
    ----------
    plan : callable
        Returns its tasks, the same each time.
    store : Store
        Opened.
    executor : Executor
        Opened. One may do several plans, one after the other.
    progress : Progress, optional
    share : Share
        What is to be done here; of the rest, what is there is used.
    retries : int
        How often a task is begun anew whose process died.
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
    attempt = _Run(plan, store, executor, progress or Progress(), share, retries, blender, survey)
    outcome = attempt.run()
    if not attempt.damaged or outcome.interrupted or outcome.problem:
        return outcome
    again = _Run(plan, store, executor, progress or Progress(), share, retries, blender, Survey.of(plan, store, share))
    again.mends = False
    return outcome.continued(again.run())


class _OutOfTime(BaseException):
    """Raised inside a task that takes too long after Ctrl-C."""


class _Hopeless(Exception):
    """Raised where no task can be done any more."""


@dataclass(eq=False)
class _Open:
    """A task that is not settled."""

    number: int
    task: Task
    waits: int = 0
    """For how many others."""

    key: str = ""
    """Under which its result is kept: that of the task, but for a partial one where something failed."""

    share: float = 0.0
    losses: int = 0


class _Run:
    """A run that is under way."""

    def __init__(
        self,
        plan: Plan,
        store: Store,
        executor: Executor,
        progress: Progress,
        share: Share,
        retries: int,
        blender: str,
        survey: Survey,
    ) -> None:
        self.plan, self.store, self.executor, self.progress = plan, store, executor, progress
        self.share, self.retries, self.blender = share, retries, blender
        self.survey, self.chosen = survey, share.chooser()
        self.mends, self.damaged = True, False
        """Whether what turns out to be damaged will be made again, and whether anything did."""
        self.outcome = Outcome()
        self.details: dict[str, str] = {}
        self.settled: dict[str, str | None] = {}
        """Key of a task to that of its result; None where it has none."""
        self.sleeping: dict[str, tuple[Task, bool]] = {}
        """Temporary tasks that nobody has asked for, by their keys, and whether they are in the share."""
        self.open: dict[int, _Open] = {}
        """What is not settled, by its place in the plan."""
        self.readers: dict[str, list[_Open]] = {}
        """Key of a task that is not settled to those that wait for it."""
        self.ready: list[tuple[int, _Open]] = []
        self.temporary: set[str] = set()
        """Keys of temporary tasks whose reader was opened."""
        self.at_work: dict[str, _Open] = {}
        """By the folder of the order."""
        self.number = 0
        self.weight_done = 0.0
        self.amounts_done: Counter[str] = Counter()
        self.shown: dict[str, int] = {}
        self.rest: Iterator[Task] = iter(())

    # -- doing it -----------------------------------------------------------------------------------------------------

    def run(self) -> Outcome:
        self.progress.begin(self.survey.weight)
        self.rest = iter(self.plan())
        try:
            self._work()
            if self.share == EVERYTHING and not self.outcome.failures:
                self.store.sweep(key for key in self.settled.values() if key)
        except _Hopeless as error:
            self.outcome.problem = str(error)
            self.executor.stop()
            self._drop_scratch()
        except KeyboardInterrupt:
            self._interrupted()
        counts = self.outcome.counts
        if self.outcome.problem or self.outcome.interrupted:
            over = counts[State.DONE] + counts[State.FAILED] + counts[State.SKIPPED]
            counts[State.STOPPED] = max(0, self.survey.tasks - over)
        if self.share == EVERYTHING:
            self._write_failures()
        return self.outcome

    def _work(self) -> None:
        more = True
        while True:
            while more and len(self.ready) < self.executor.capacity:
                task = next(self.rest, None)
                if more := task is not None:
                    self._meet(task, self.chosen(task))
            while self.ready and len(self.at_work) < self.executor.capacity:
                self._begin(heapq.heappop(self.ready)[1])
            if self.at_work:
                self.executor.wait(self._hear, PATIENCE)
            elif not (more or self.ready):
                return

    def _meet(self, task: Task, chosen: bool) -> None:
        """Take a task from the plan: it is up to date, or ready, or waits for others."""
        if task.step.temporary:
            self.sleeping[task.key] = task, chosen
            return
        before = [self.sleeping.pop(key) for key in task.after if key in self.sleeping]
        is_open = task.key in self.readers
        result = None if is_open else self.store.result(task.key)
        if result and (not chosen or self.store.is_published(task, result)):
            for one, _ in before:
                self.store.discard(one.key)
            self.settled[task.key] = task.key
            if chosen:
                self._count(task, State.UP_TO_DATE)
            return
        if not (result or is_open):
            for one, also in before:
                if also and not self.store.result(one.key):
                    self._open(one)
        if chosen:
            self.temporary.update(one.key for one, _ in before)
            self._open(task)

    def _open(self, task: Task) -> None:
        self.number += 1
        self.open[self.number] = opened = _Open(self.number, task)
        # A task that is there twice waits for itself.
        for key in {*task.after, task.key}:
            if key in self.readers:
                self.readers[key].append(opened)
                opened.waits += 1
        self.readers.setdefault(task.key, [])
        if not opened.waits:
            heapq.heappush(self.ready, (opened.number, opened))

    def _result_of(self, key: str) -> str | None:
        """The key of the result of a task before; of earlier plans too."""
        if key not in self.settled:
            self.settled[key] = key if self.store.result(key) else None
        return self.settled[key]

    def _begin(self, opened: _Open) -> None:
        """Begin a task whose predecessors are settled, or settle it if there is nothing to do."""
        task = opened.task
        before = [self._result_of(key) for key in task.after]
        opened.key = task.key_after(before)
        if result := self.store.result(opened.key):
            is_new = not self.store.is_published(task, result)
            if self._publish(opened, result):
                self._close(opened, State.DONE if is_new else State.UP_TO_DATE)
        elif self.settled.get(task.key, "") is None or (None in before and not (task.step.partial and any(before))):
            self.store.withdraw(task.publish.values())
            self._close(opened, State.SKIPPED)
        else:
            self._submit(opened, before)

    def _submit(self, opened: _Open, before: Iterable[str | None]) -> None:
        task = opened.task
        order = self._order(task, before)
        self.at_work[order.folder] = opened
        opened.share = 0.0
        self._show(task.shown)
        self.executor.submit(order)

    def _order(self, task: Task, before: Iterable[str | None]) -> Order:
        return Order(
            step=task.step,
            parameters=task.parameters,
            before=tuple(os.fspath(self.store.folder_of(key)) if key else None for key in before),
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
        task = opened.task
        if isinstance(message, Told):
            opened.share = message.share
            self._show(f"{task.shown}: {message.doing}" if message.doing else task.shown)
            return
        del self.at_work[order.folder]
        if isinstance(message, Lost):
            self._lost(opened, order, message)
            return
        for note in message.notes:
            self.progress.note(note)
        if isinstance(message, Failed):
            self._failed(opened, message)
        elif self._kept(opened, message):
            self._close(opened, State.DONE)

    def _kept(self, opened: _Open, made: Made) -> bool:
        """Whether what was made could be kept and published."""
        try:
            result = self.store.keep(opened.task, opened.key, Path(made.folder), made.index)
        except OSError as error:
            shutil.rmtree(made.folder, ignore_errors=True)
            self._failed(opened, self._of_system(error))
            return False
        self.outcome.seconds += made.index["seconds"]
        facts = made.index["facts"].items()
        self.outcome.facts.update({name: fact for name, fact in facts if isinstance(fact, (int, float))})
        return self._publish(opened, result)

    def _publish(self, opened: _Open, result: Result) -> bool:
        try:
            self.store.publish(opened.task, result)
            return True
        except OutputError as error:
            self._failed(opened, Failed(str(error)))
        except OSError as error:
            self._failed(opened, self._of_system(error))
        return False

    def _of_system(self, error: OSError) -> Failed:
        where = error.filename2 or error.filename or self.store.output
        return Failed(f"{where}: {error.strerror or error}", hopeless=error.errno in FULL_OR_FORBIDDEN)

    def _lost(self, opened: _Open, order: Order, lost: Lost) -> None:
        shutil.rmtree(order.folder, ignore_errors=True)
        opened.losses += 1
        shown = opened.task.shown
        if opened.losses <= self.retries:
            self.progress.note(f"{shown}: {lost.message}; trying again")
            self._submit(opened, [self._result_of(key) for key in opened.task.after])
        else:
            self._failed(opened, Failed(f"{shown}: {lost.message}; given up after {opened.losses} attempts"))

    def _failed(self, opened: _Open, failed: Failed) -> None:
        # An error that nobody foresaw does not say by itself what it is about.
        task = opened.task
        said = f"{task.shown}: {failed.message}" if failed.details else failed.message
        self.outcome.failures[task.name] = said
        self.details[task.name] = failed.details
        if failed.hopeless:
            self._close(opened, State.FAILED, said)
            raise _Hopeless(said)
        keys = [key for key in map(self._result_of, task.after) if key]
        damaged = [key for key in keys if self.mends and not self.store.result(key, thoroughly=True)]
        for key in damaged:
            self.store.discard(key)
        if damaged:
            self.damaged = True
            self.progress.note(f"{task.shown}: what it reads is damaged; it is made again")
        # What is there under its name was made of something else.
        self.store.withdraw(task.publish.values())
        self._close(opened, State.FAILED, said)

    def _close(self, opened: _Open, state: State, problem: str = "") -> None:
        """A task that was opened has come to its end: those after it may begin."""
        task = opened.task
        there = state in (State.DONE, State.UP_TO_DATE)
        self.open.pop(opened.number, None)
        waiting = self.readers.pop(task.key, [])
        self.settled[task.key] = opened.key if there else None
        self.weight_done += task.weight
        self.amounts_done[task.unit] += task.amount
        self._count(task, state, problem)
        if there:
            for key in task.after:
                if key in self.temporary:
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

    # -- Ctrl-C -------------------------------------------------------------------------------------------------------

    def _interrupted(self) -> None:
        self.outcome.interrupted = True
        deadline = time.monotonic() + AFTER_CTRL_C
        with suppress(KeyboardInterrupt, _OutOfTime, _Hopeless, OSError):  # The next run will do the rest.
            self.executor.stop()
            self._drop_scratch()
            for opened in [*self.open.values()]:
                if opened.task.step.partial:
                    self._do_at_once(opened, deadline)
            for task in self.rest:
                if task.step.partial and self.chosen(task):
                    self.number += 1
                    self._do_at_once(_Open(self.number, task), deadline)
                if time.monotonic() > deadline:
                    return

    def _do_at_once(self, opened: _Open, deadline: float) -> None:
        """Do a partial task in this process, with what there is."""
        before = [self._result_of(key) for key in opened.task.after]
        opened.key = opened.task.key_after(before)
        if not any(before):
            return

        def tell(share: float, doing: str) -> None:
            if time.monotonic() > deadline:
                raise _OutOfTime

        tell(0.0, "")
        self.readers.setdefault(opened.task.key, [])
        if result := self.store.result(opened.key):
            made = self._publish(opened, result)
        else:
            message = perform(self._order(opened.task, before), tell)
            made = isinstance(message, Made) and self._kept(opened, message)
        if made:
            self.settled[opened.task.key] = opened.key
            self._count(opened.task, State.DONE)

    def _drop_scratch(self) -> None:
        for folder in self.at_work:
            shutil.rmtree(folder, ignore_errors=True)
        self.at_work.clear()

    # -- saying it ----------------------------------------------------------------------------------------------------

    def _show(self, doing: str) -> None:
        begun = self.at_work.values()
        by_now = Counter(self.amounts_done)
        for one in begun:
            by_now[one.task.unit] += one.share * one.task.amount
        for unit in filter(None, by_now):
            # What a worker that died had done does not make the count go back.
            self.shown[unit] = max(int(by_now[unit]), self.shown.get(unit, 0))
        counts = {unit: (shown, self.survey.amounts[unit]) for unit, shown in self.shown.items()}
        done = self.weight_done + sum(one.task.weight * one.share for one in begun)
        self.progress.reach(min(done, self.survey.weight), doing, counts)

    def _write_failures(self) -> None:
        """Write what went wrong for who looks closer: with what Python said of errors that nobody foresaw."""
        path = self.store.own / "failures.json"
        failures = {
            name: {"message": said, "details": self.details[name]} for name, said in self.outcome.failures.items()
        }
        with suppress(OSError):
            self.store.note(path.name, failures) if failures else path.unlink(missing_ok=True)
