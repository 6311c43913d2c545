"""Reasons why a task would be done: never done, or its parameters, inputs, modules, or steps before it have changed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from .running import EVERYTHING, Plan, Share
from .steps import Task
from .store import OutputError, Store

MOST = 3
"""Number of changes that are named, of several."""


def explain(plan: Plan, store: Store, share: Share = EVERYTHING) -> Iterator[tuple[Task, str]]:
    """Yield the tasks of a share of a plan that a run would do, and why. Nothing is written."""
    latest, chosen = store.latest(), {task.name for task in share.tasks(plan)}
    changed: dict[str, str] = {}
    """Key to name, of tasks that would be done."""
    for task in plan():
        if not store.index_of(task.key):
            changed[task.key] = task.shown
        if task.name not in chosen or store.is_done(task):
            continue
        if task.key not in changed:
            yield task, _unpublished(task, store)
        elif store.folder_of(task.key).exists():
            yield task, "its result is damaged"
        elif earlier := latest.get(task.name):
            yield task, _difference(task, earlier.get("made_of", {}), changed)
        else:
            yield task, "never done"


def _difference(task: Task, before: Mapping[str, Any], changed: Mapping[str, str]) -> str:
    """Return in what a task differs from what its last result was made of."""
    reasons = []
    for title, part in (("program", "versions"), ("parameters", "parameters"), ("input file", "inputs")):
        old, new = (dict(_leaves(made_of.get(part))) for made_of in (before, task.made_of))
        names = [name for name in {**old, **new} if old.get(name) != new.get(name)]
        if part == "parameters":
            names = [f"{name}: {old.get(name)} -> {new.get(name)}" for name in names]
        reasons += [f"{title} changed ({_few(names)})"] if names else []
    if before.get("after") != task.made_of["after"]:
        anew = [changed[key] for key in task.after if key in changed]
        reasons.append(f"an earlier step changed ({_few(anew)})" if anew else "earlier steps are others")
    return "; ".join(reasons) or "its step is another"


def _leaves(plain: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of nested mappings, each under the names that lead to it: "radii.rigid"."""
    if isinstance(plain, Mapping):
        for key, inner in plain.items():
            yield from _leaves(inner, f"{name}.{key}" if name else key)
    elif not name.endswith("$"):
        yield name, plain


def _unpublished(task: Task, store: Store) -> str:
    if missing := [path for path in task.publish.values() if not (store.output / path).exists()]:
        return f"{_few(missing)} missing"
    try:
        others = store.strangers(task, task.key)
    except OutputError as error:
        return str(error)
    return f"{_few(others)} edited" if others else "published of something else"


def _few(names: Iterable[str]) -> str:
    names = [name if len(name) < 80 else name.partition(":")[0] for name in names]
    return ", ".join(names[:MOST]) + (f" and {len(names) - MOST} more" if len(names) > MOST else "")
