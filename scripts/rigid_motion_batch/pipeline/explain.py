"""Reasons why a task would be done: never done, or its parameters, inputs, modules, or steps before it have changed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from .running import EVERYTHING, Plan, Share, look_through
from .steps import Task
from .store import OutputError, Result, Store

MOST = 3
"""Number of changes that are named, of several."""


def explain(plan: Plan, store: Store, share: Share = EVERYTHING) -> Iterator[tuple[Task, str]]:
    """Yield the tasks of a share of a plan that a run would do, and why. Nothing is written."""
    latest = store.latest()
    changed: dict[str, str] = {}
    """Key to name, of tasks that would be done."""
    for result in look_through(plan, store, share):
        task = result.task
        if result.result and not result.done:
            yield task, _unpublished(task, store)
        if not result.result:
            if result.chosen:
                is_damaged = store.folder_of(task.key).exists()
                yield task, "its result is damaged" if is_damaged else _reason(task, latest.get(task.name), changed)
            changed[task.key] = task.shown


def _reason(task: Task, earlier: Result | None, changed: Mapping[str, str]) -> str:
    """Return why a task without a result would be done, by what its last result was made of."""
    if earlier is None or not isinstance(before := earlier.index.get("made_of"), dict):
        return "never done"
    now = task.made_of
    changes = {
        what: _differences(before.get(part), now[part], values=part == "parameters")
        for what, part in (("program", "versions"), ("parameters", "parameters"), ("input file", "inputs"))
    }
    reasons = [f"{what} changed ({_few(result)})" for what, result in changes.items() if result]
    if before.get("after") != now["after"]:
        anew = [changed[key] for key in task.after if key in changed]
        reasons.append(f"an earlier step changed ({_few(anew)})" if anew else "earlier steps are others")
    return "; ".join(reasons) or "its step is another"


def _differences(before: Any, now: Any, values: bool = True, name: str = "") -> list[str]:
    """Return what differs between two pieces of plain data, by its names: "fps: 24 -> 30"."""
    if isinstance(before, dict) and isinstance(now, Mapping):
        prefix = f"{name}." if name else ""
        names = [key for key in {**before, **now} if key != "$"]
        return [one for key in names for one in _differences(before.get(key), now.get(key), values, f"{prefix}{key}")]
    if before == now:
        return []
    shown = f"{before} -> {now}"
    return [f"{name}: {shown}" if values and len(shown) < 60 else name]


def _unpublished(task: Task, store: Store) -> str:
    missing = [path for path in task.publish.values() if not (store.output / path).exists()]
    if missing:
        return f"{_few(missing)} missing"
    try:
        others = store.strangers(task, store.result(task.key))
    except OutputError as error:
        return str(error)
    return f"{_few(others)} edited" if others else "published of something else"


def _few(names: Iterable[str]) -> str:
    names = [*names]
    return ", ".join(names[:MOST]) + (f" and {len(names) - MOST} more" if len(names) > MOST else "")
