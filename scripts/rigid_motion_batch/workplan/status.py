"""Is it done? Whether there is anything to do for a task, and why: decided here, for all who ask.

A task has a key, the digest of all that its outputs depend on. It is done where a record has that key and the outputs
are in place as they were made. Beside the key a record holds in short what the key is the digest of, which decides
nothing: it is there to say what changed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from .hashing import FileState, digest_of, task_key
from .manifest import Manifest, Record
from .performing import seen
from .plan import Plan
from .tasks import Task

LONGEST_ARGUMENT = 40
"""Characters of an argument that are kept to be shown again; of longer ones there is a digest."""

DIGITS = 16
"""Of a digest that only has to be told from another one."""

SHOWN = 3
"""So many of a kind are named; of more it is said how many there are."""


class Reason(NamedTuple):
    """Why there is something to do for a task."""

    what: str
    of: str = ""
    """Which file, option or task."""


NO_OUTPUT = "no output yet"
UNFINISHED = "was not finished"
MISSING, DAMAGED = "output missing", "output changed since"
INPUT, OPTIONS, PROGRAM = "input changed", "options changed", "the program changed"
DEPENDS = "what it reads is made anew"
FORCED = "--force"

NEVER_DONE = (Reason(NO_OUTPUT),)


@dataclass(frozen=True, slots=True)
class Standing:
    """How a task stands before a run."""

    there: bool
    """Whether its outputs are what it would make of what is there, or nobody wants them any more."""

    reasons: tuple[Reason, ...]
    """Why a run would do it again; empty where it would not. A partial task that is there may have some: it would be
    done again for what there would be then."""


class Status:
    """The tasks of a plan beside the records of an output folder.

    Parameters
    ----------
    plan : Plan
    manifest : Manifest
    output : Path
        The output folder.
    force : bool
        Everything is to be done again.
    done_here : collection of str
        The tasks of which that is not true, since they were done just now.
    """

    def __init__(
        self, plan: Plan, manifest: Manifest, output: Path, *, force: bool = False, done_here: Collection[str] = ()
    ) -> None:
        self._plan, self._manifest, self._output = plan, manifest, output
        self._force, self._done_here = force, done_here
        self._inputs: dict[str, tuple[tuple[int, int] | None, str | None]] = {}
        self._keys: dict[str, bytes] = {}

    # -- keys ---------------------------------------------------------------------------------------------------------

    def key(self, name: str, there: Iterable[str] | None = None) -> str:
        """The key of a task; of a partial one for those of its predecessors that are there.

        To be asked in the order of the plan: it is remembered for the tasks after it.
        """
        if there is not None or name not in self._keys:
            task = self._plan.tasks[name]
            inputs = {path: self._digest(path) for path in task.inputs}
            before = ((one, self.key(one)) for one in sorted(task.after if there is None else there))
            self._keys[name] = bytes.fromhex(task_key(task, inputs, before, self._plan.version_of(task.function)))
        return self._keys[name].hex()

    def seen(self, name: str) -> dict[str, tuple[int, int] | None]:
        """The absolute paths of a task's inputs, and what was seen of them when the key was made."""
        return {os.fspath(self._plan.folder / path): self._inputs[path][0] for path in self._plan.tasks[name].inputs}

    def made_of(self, name: str) -> dict[str, Any]:
        """What the key of a task is the digest of, in short."""
        task = self._plan.tasks[name]
        content: dict[str, Any] = {"function": task.function, "version": self._plan.version_of(task.function)}
        content["arguments"] = dict(_in_short(task.arguments))
        if task.inputs:
            content["inputs"] = {path: self._inputs[path][1] for path in task.inputs}
        return content

    def _digest(self, path: str) -> str | None:
        if path not in self._inputs:
            place = self._plan.folder / path
            try:
                state = FileState.of(place)
                self._inputs[path] = (state.size, state.mtime_ns), state.sha256
            except (OSError, ValueError):
                self._inputs[path] = seen(place), None
        return self._inputs[path][1]

    # -- whether, and why ---------------------------------------------------------------------------------------------

    def reasons(self, name: str, there: Iterable[str] | None = None) -> tuple[Reason, ...]:
        """Why there is something to do for a task; empty where it is done. `there` as of `key`."""
        key, record, task = self.key(name, there), self._manifest.get(name), self._plan.tasks[name]
        if record is None:
            return NEVER_DONE
        if not record.key:
            return (Reason(UNFINISHED),)
        if record.key != key:
            return tuple(self._changes(task, record)) or (Reason(DEPENDS),)
        if self._force and name not in self._done_here:
            return (Reason(FORCED),)
        return tuple(self._damages(task, record))

    def survey(self, only: Collection[str] | None = None) -> dict[str, Standing]:
        """How tasks stand, in the order of the plan: all, or those that are named, with all before them."""
        tasks, readers = self._plan.tasks, self._plan.readers
        order = [name for name in self._plan.order if only is None or name in only]
        own: dict[str, tuple[Reason, ...]] = {}
        for name in order:
            there = [b for b in tasks[name].after if b in own and not own[b]] if tasks[name].partial else None
            own[name] = self.reasons(name, there)
        for name in reversed(order):
            wanted = any(own.get(reader) or reader in self._plan.late for reader in readers[name])
            if tasks[name].temporary and not wanted:
                own[name] = ()  # Those that its outputs were for are done.
        found: dict[str, Standing] = {}
        for name in order:
            reasons, doing = own[name], [before for before in tasks[name].after if own.get(before)]
            if doing and (tasks[name].partial if not reasons else reasons == (Reason(DEPENDS),)):
                reasons = tuple(Reason(DEPENDS, before) for before in doing[:SHOWN])
            found[name] = Standing(not own[name], reasons)
        return found

    def _changes(self, task: Task, record: Record) -> Iterator[Reason]:
        """What is not as it was when the record was made, apart from the tasks before this one."""
        now, before = self.made_of(task.name), record.made_of
        if not before:
            yield Reason(PROGRAM)
            return
        for path, digest in now.get("inputs", {}).items():
            known = before.get("inputs")
            if not isinstance(known, dict) or known.get(path) != digest:
                yield Reason(INPUT, path)
        changed = list(_differences(before.get("arguments"), now["arguments"]))
        if changed or [*record.outputs] != [*task.outputs]:
            yield Reason(OPTIONS, few(changed))
        if before.get("version") != now["version"]:
            parts = self._manifest.versions.get(str(before.get("version")), {})
            yield Reason(PROGRAM, few(_differing(parts, self._plan.parts_of(task.function))) if parts else "")

    def _damages(self, task: Task, record: Record) -> Iterator[Reason]:
        """The outputs that are not as they were made."""
        for path in task.outputs:
            state, place = record.outputs.get(path), f"{self._output}{os.sep}{path}"
            if state is None or not state.still(place):
                yield Reason(DAMAGED if os.path.lexists(place) else MISSING, path)


def explain(survey: Mapping[str, Standing], plan: Plan) -> list[str]:
    """What a run would do and why, in lines: tasks of one step that are done for one reason are in one."""
    groups: dict[tuple[object, ...], list[str]] = {}
    for name, standing in survey.items():
        if standing.reasons:
            alike = tuple(r if r.what in (INPUT, OPTIONS, PROGRAM) else r.what for r in standing.reasons)
            groups.setdefault((plan.tasks[name].function, *dict.fromkeys(alike)), []).append(name)
    return [f"{few(_labels(names, plan))}: {_why(names, survey, plan)}" for names in groups.values()]


def _why(names: Iterable[str], survey: Mapping[str, Standing], plan: Plan) -> str:
    """The reasons that some tasks have in common."""
    of: dict[str, dict[str, None]] = {}
    for reason in (reason for name in names for reason in survey[name].reasons):
        which = _labels([reason.of], plan) if reason.what == DEPENDS and reason.of else [reason.of]
        of.setdefault(reason.what, {}).update(dict.fromkeys(filter(None, which)))
    return "; ".join(f"{what} ({few(which)})" if which else what for what, which in of.items())


def _labels(names: Iterable[str], plan: Plan) -> dict[str, None]:
    """What people know tasks by: what is done, and of what."""
    tasks = (plan.tasks[name] for name in names)
    return dict.fromkeys(f"{task.function.rpartition(':')[2].replace('_', ' ')} {task.title}" for task in tasks)


def _in_short(arguments: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Arguments by their names, those within one another by both names, as text that is short."""
    for name, value in arguments.items():
        inner = {f"{name}.{part}": one for part, one in value.items()} if isinstance(value, dict) else {name: value}
        for path, one in inner.items():
            text = json.dumps(one, sort_keys=True, separators=(",", ":"))
            yield path, text if len(text) <= LONGEST_ARGUMENT else f"{digest_of(text)[:DIGITS]}..."


def _differences(before: object, now: Mapping[str, str]) -> Iterator[str]:
    """The arguments that are others: "radius: 0.1 -> 0.2", and of long ones the name."""
    before = before if isinstance(before, dict) else {}
    for name in _differing(before, now):
        old, new = before.get(name, "none"), now.get(name, "none")
        yield name if "..." in f"{old}{new}" else f"{name}: {old} -> {new}"


def _differing(before: Mapping[str, object], now: Mapping[str, object]) -> list[str]:
    return [name for name in sorted({*before, *now}) if before.get(name) != now.get(name)]


def few(names: Collection[str]) -> str:
    """The first few, and how many more there are."""
    some = ", ".join([*names][:SHOWN])
    return f"{some} and {len(names) - SHOWN} more" if len(names) > SHOWN else some
