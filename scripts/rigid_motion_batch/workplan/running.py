"""Running a plan: what has to be done is given to an executor, in order, and what comes of it is put in place.

One failure is no reason to stop: the tasks that need what failed are skipped, and all others are done. What ends a run
before its time is Ctrl-C, and a disk that is full or must not be written.
"""

from __future__ import annotations

import enum
import heapq
import os
import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from rigid_motion_batch.progress import Progress, Stage

from .executors import Executor
from .performing import FULL_OR_FORBIDDEN, Failed, Lost, Made, Message, Noted, Order, Told, perform
from .plan import Plan
from .status import Status
from .tasks import Task
from .workspace import Workspace

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

    @property
    def there(self) -> bool:
        """Whether its outputs are there."""
        return self in (State.DONE, State.UP_TO_DATE)


@dataclass
class Outcome:
    """What became of a run."""

    states: dict[str, State] = field(default_factory=dict)
    """Of every task."""

    failures: dict[str, str] = field(default_factory=dict)
    """Task to what was wrong, in one line."""

    interrupted: bool = False
    """By Ctrl-C."""

    problem: str = ""
    """Why nothing more could be done, in one line; empty where everything was tried."""

    def count(self, state: State) -> int:
        return sum(one is state for one in self.states.values())

    def of(self, state: State) -> list[str]:
        """The tasks in that state."""
        return [name for name, one in self.states.items() if one is state]

    def __str__(self) -> str:
        """How many of each: "12 done, 3 up to date, 1 failed"."""
        counts = Counter(self.states.values())
        return ", ".join(f"{counts[state]} {state.value}" for state in State if counts[state]) or "nothing to do"


def run(
    plan: Plan,
    workspace: Workspace,
    executor: Executor,
    *,
    force: bool = False,
    retries: int = RETRIES,
    progress: Progress | None = None,
    title: str = "Working",
    describe: Callable[[str], str] = lambda problem: problem,
) -> Outcome:
    """Do what is missing or has changed of a plan.

    Parameters
    ----------
    plan : Plan
    workspace : Workspace
        Opened.
    executor : Executor
        Opened. One may do several plans, one after the other.
    force : bool
        Do everything again, but for what was done since the workspace was opened.
    retries : int
        How often a task is begun anew whose process died.
    progress : Progress, optional
        Opened; one of its own unless given.
    title : str
        Of the stage in the progress.
    describe : callable
        From what was wrong with a task to the line that is shown for it.

    Returns
    -------
    Outcome
        Also after Ctrl-C: then partial tasks have been done with what there is, if that took no longer than a moment,
        and nothing is at work any more.
    """
    if progress is None:
        with Progress() as own:
            return run(
                plan,
                workspace,
                executor,
                force=force,
                retries=retries,
                progress=own,
                title=title,
                describe=describe,
            )
    plan.write(workspace.plan_path)
    workspace.manifest.versions |= {plan.version_of(function): parts for function, parts in plan.versions.items()}
    for mends in (True, False):
        attempt = _Run(plan, workspace, executor, force, retries, progress, describe, mends)
        outcome = attempt.run(title)
        if not attempt.damaged or outcome.interrupted or outcome.problem:
            break
    return outcome


def order_for(
    task: Task, inputs: Mapping[str, tuple[int, int] | None], finished: Iterable[str], workspace: Workspace
) -> Order:
    """The order to do a task, with a scratch folder of its own."""
    return Order(
        name=task.name,
        function=task.function,
        arguments=task.arguments,
        inputs=inputs,
        outputs=tuple(task.outputs),
        output=os.fspath(workspace.output),
        scratch=os.fspath(workspace.scratch()),
        finished=tuple(finished),
    )


class _OutOfTime(BaseException):
    """Raised inside a task that takes too long after Ctrl-C."""


class _Hopeless(Exception):
    """Raised where no task can be done any more."""


class _Run:
    """A run that is under way."""

    def __init__(
        self,
        plan: Plan,
        workspace: Workspace,
        executor: Executor,
        force: bool,
        retries: int,
        progress: Progress,
        describe: Callable[[str], str],
        mends: bool,
    ) -> None:
        self.plan, self.workspace, self.executor = plan, workspace, executor
        self.force, self.retries = force, retries
        self.progress, self.describe = progress, describe
        self.outcome = Outcome()
        self.status = Status(plan, workspace.manifest, workspace.output, force=force, done_here=workspace.done_here)
        self.wanted = plan.late | {name for name, standing in self.status.survey().items() if standing.reasons}
        self.mends, self.damaged = mends, False
        """Whether what turns out to be damaged will be made again, and whether anything did."""
        self.open_before = [len(plan.tasks[name].after) for name in plan.order]
        """Of every task, by its place: how many before it are not settled yet."""
        self.ready = [place for place, number in enumerate(self.open_before) if not number]
        self.at_work: dict[str, Order] = {}
        self.shares: dict[str, float] = {}
        self.losses: Counter[str] = Counter()
        self.weight_done = 0.0
        self.totals = _amounts(dict.fromkeys(self.wanted, 1.0), plan)
        """How many there will be of what is counted."""
        self.made: Counter[str] = Counter()
        self.shown: dict[str, int] = {}
        self.stage: Stage

    # -- doing it -----------------------------------------------------------------------------------------------------

    def run(self, title: str) -> Outcome:
        # What is up to date has no weight: it would make the time that is left look short.
        total = sum(self.plan.tasks[name].weight for name in self.wanted)
        try:
            with self.progress.stage(title, total) as self.stage:
                self._work()
        except _Hopeless as error:
            self.outcome.problem = str(error)
            self.executor.stop()
            self._drop_scratch()
        except KeyboardInterrupt:
            self._interrupted()
        self.outcome.states = {name: self.outcome.states.get(name, State.STOPPED) for name in self.plan.order}
        return self.outcome

    def _work(self) -> None:
        while True:
            while self.ready and len(self.at_work) < self.executor.capacity:
                self._begin(self.plan.order[heapq.heappop(self.ready)])
            if not self.at_work:
                return
            self.executor.wait(self._hear, PATIENCE)
            self._show()

    def _begin(self, name: str) -> None:
        """Begin a task whose predecessors are settled, or settle it if there is nothing to do."""
        task, states = self.plan.tasks[name], self.outcome.states
        there = [before for before in task.after if states[before].there]
        if len(there) < len(task.after) and not (task.partial and there):
            self._settle(name, State.SKIPPED)
            return
        if name not in self.wanted or (name in self.plan.late and not self.status.reasons(name, there)):
            self._settle(name, State.DONE if name in self.workspace.done_here else State.UP_TO_DATE)
            return
        self._submit(task, there)

    def _submit(self, task: Task, there: Iterable[str]) -> None:
        order = order_for(task, self.status.seen(task.name), there, self.workspace)
        self.at_work[task.name] = order
        self.shares[task.name] = 0.0
        self._show(task.title)
        self.executor.submit(order)

    def _hear(self, message: Message) -> None:
        name = message.name
        if name not in self.at_work:
            return
        title = self.plan.tasks[name].title
        if isinstance(message, Told):
            self.shares[name] = message.share
            doing = message.doing or self._count(self.plan.tasks[name].unit)
            self._show(f"{title}: {doing}" if doing else title)
        elif isinstance(message, Noted):
            self.progress.note(message.text)
        elif isinstance(message, Lost):
            self._lost(message)
        else:
            order = self.at_work.pop(name)
            if isinstance(message, Made):
                self._put_in_place(message, order)
            else:
                self._failed(message)

    def _put_in_place(self, made: Made, order: Order) -> None:
        key = self.status.key(made.name, order.finished)
        try:
            self.workspace.put_in_place(order, key, made, self.status.made_of(made.name))
        except OSError as error:
            shutil.rmtree(order.scratch, ignore_errors=True)
            where = f"{error.filename2 or error.filename or self.workspace.output}: "
            hopeless = error.errno in FULL_OR_FORBIDDEN
            self._failed(Failed(made.name, f"{where}{error.strerror or error}", hopeless=hopeless))
            return
        self._settle(made.name, State.DONE)

    def _lost(self, lost: Lost) -> None:
        order = self.at_work.pop(lost.name)
        shutil.rmtree(order.scratch, ignore_errors=True)
        self.losses[lost.name] += 1
        task = self.plan.tasks[lost.name]
        if self.losses[lost.name] <= self.retries:
            self.progress.note(f"{task.title}: {lost.message}; trying again")
            self._submit(task, order.finished)
        else:
            times = self.losses[lost.name]
            self._failed(Failed(lost.name, f"{task.title}: {lost.message}; given up after {times} attempts"))

    def _failed(self, failed: Failed) -> None:
        # An error that nobody foresaw does not say by itself what it is about.
        said = f"{self.plan.tasks[failed.name].title}: {failed.message}" if failed.details else failed.message
        self.outcome.failures[failed.name] = said
        self.workspace.manifest.failures[failed.name] = {"message": said, "details": failed.details}
        if failed.hopeless:
            self.outcome.states[failed.name] = State.FAILED
            raise _Hopeless(said)
        task = self.plan.tasks[failed.name]
        read = [before for before in task.after if self.outcome.states[before].there]
        if self.mends and (damaged := self.workspace.withdraw_damaged(read)):
            self.damaged = True
            self.progress.note(f"{task.title}: {damaged} is damaged; it is made again")
        else:
            self.progress.note(self.describe(said))
        # What is there under its name was made of something else.
        record = self.workspace.manifest.get(failed.name)
        if record is None or record.key != self.status.key(failed.name):
            self.workspace.discard(task.outputs)
        self._settle(failed.name, State.FAILED)

    def _settle(self, name: str, state: State) -> None:
        """A task has come to its end: those after it may begin."""
        self.outcome.states[name] = state
        task = self.plan.tasks[name]
        if state.there:
            self.workspace.manifest.failures.pop(name, None)
            self._discard_before(task)
        self.shares.pop(name, None)
        if name in self.wanted:
            self.weight_done += task.weight
            self.made[task.unit] += task.amount
        for place in map(self.plan.place.__getitem__, self.plan.readers[name]):
            self.open_before[place] -= 1
            if not self.open_before[place]:
                heapq.heappush(self.ready, place)

    def _discard_before(self, task: Task) -> None:
        """Delete what was made for this task, and for others that are done as well."""
        for before in task.after:
            states = (self.outcome.states.get(reader) for reader in self.plan.readers[before])
            if self.plan.tasks[before].temporary and all(state and state.there for state in states):
                self.workspace.discard(self.plan.tasks[before].outputs)

    def _count(self, unit: str) -> str:
        """How many there are by now of what is counted: "frame 170 of 2400". It never goes back."""
        if not unit:
            return ""
        by_now = self.made[unit] + round(_amounts(self.shares, self.plan)[unit])
        self.shown[unit] = max(by_now, self.shown.get(unit, 0))
        return f"{unit} {self.shown[unit]} of {self.totals[unit]:.0f}"

    def _show(self, doing: str | None = None) -> None:
        begun = sum(self.plan.tasks[name].weight * share for name, share in self.shares.items())
        self.stage.reach(self.weight_done + begun, doing)

    # -- Ctrl-C -------------------------------------------------------------------------------------------------------

    def _interrupted(self) -> None:
        self.outcome.interrupted = True
        deadline = time.monotonic() + AFTER_CTRL_C
        try:
            self.executor.stop()
            self._drop_scratch()
            for name in self.plan.order:
                if self.plan.tasks[name].partial and name not in self.outcome.states:
                    self._do_at_once(name, deadline)
        except (KeyboardInterrupt, _OutOfTime, _Hopeless, OSError):
            pass  # The next run will do it.

    def _do_at_once(self, name: str, deadline: float) -> None:
        """Do a partial task in this process, with what there is."""
        task = self.plan.tasks[name]
        there = [before for before in task.after if (state := self.outcome.states.get(before)) and state.there]
        if not there:
            return

        def tell(_: Message) -> None:
            if time.monotonic() > deadline:
                raise _OutOfTime

        order = order_for(task, {}, there, self.workspace)
        made = perform(order, tell)
        if isinstance(made, Made):
            self._put_in_place(made, order)

    def _drop_scratch(self) -> None:
        for order in self.at_work.values():
            shutil.rmtree(order.scratch, ignore_errors=True)
        self.at_work.clear()


def _amounts(shares: Mapping[str, float], plan: Plan) -> Counter[str]:
    """Of what is counted, how many there are where of each task a share is done."""
    amounts: Counter[str] = Counter()
    for name, share in shares.items():
        amounts[plan.tasks[name].unit] += plan.tasks[name].amount * share
    return amounts
