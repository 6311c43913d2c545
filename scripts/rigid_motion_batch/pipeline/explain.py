"""Reasons why a task would be done: never done, or its parameters, inputs, modules, or steps before it have changed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from .running import EVERYTHING, Plan, Share
from .steps import Task
from .store import Store

MOST = 3
"""Number of changes that are named, of several."""


def explain(plan: Plan, store: Store, share: Share = EVERYTHING) -> Iterator[tuple[Task, str]]:
    """Yield the tasks of a share of a plan that a run would do, and why. Nothing is written."""
    latest, chosen = store.latest(), {task.name for task in share.tasks(plan)}
    changed: dict[str, str] = {}
    """Key to name, of tasks that would be done."""
    for task in plan():
        reason = ""
        if index := store.index_of(task.key):
            missing = [path for _, path in store.unpublished(task, index)]
            reason = f"{_few(missing)} missing, edited or of something else" if missing else ""
        else:
            changed[task.key] = task.shown
            earlier = store.index_of(latest.get(task.name, "")) or {}
            is_damaged = store.folder_of(task.key).exists()
            reason = "its result is damaged" if is_damaged else _difference(earlier.get("made_of"), task, changed)
        if reason and task.name in chosen:
            yield task, reason


def _difference(before: Mapping[str, Any] | None, task: Task, changed: Mapping[str, str]) -> str:
    """Return in what a task differs from what its last result was made of."""
    if before is None:
        return "never done"
    reasons = []
    for title, part in (("program", "versions"), ("parameters", "parameters"), ("input file", "inputs")):
        old, new = (dict(_leaves(made_of.get(part))) for made_of in (before, task.made_of))
        names = [name for name in {**old, **new} if old.get(name) != new.get(name)]
        if part == "parameters":
            values = [f"{old.get(name)} -> {new.get(name)}" for name in names]
            names = [f"{name}: {v}" if len(v) < 60 else name for name, v in zip(names, values, strict=True)]
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


def _few(names: Iterable[str]) -> str:
    names = [*names]
    return ", ".join(names[:MOST]) + (f" and {len(names) - MOST} more" if len(names) > MOST else "")
