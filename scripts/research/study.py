"""Studies as tasks of the pipeline: functions that read and write files by their names.

A function of a study is called with `Files` and with the arguments that its task has, and writes the files that the
task says. What they made is kept until what they use changes: a study that was stopped goes on where it was, and one
that has more recordings measures these alone.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigid_motion_batch.pipeline.steps import Job, Step, Task, TaskError
from rigid_motion_batch.pipeline.store import Store

ROOMS = ("rigid_motion/motion", "analysis", "recordings")
"""What numbers may depend on."""

PICTURE_ROOMS = (*ROOMS, "rigid_motion/animation", "scenes", "assets/models.blend", "research/making")


@dataclass(frozen=True)
class Call:
    """A function of a study, with its arguments."""

    function: str
    """package.module:function"""

    arguments: str
    """As JSON, by name."""

    outputs: tuple[str, ...]
    after: tuple[str, ...]
    """The names of the tasks before it."""


class Files:
    """What a function of a study reads and writes."""

    def __init__(self, job: Job, call: Call) -> None:
        self.finished = {name for name, folder in zip(call.after, job.before, strict=True) if folder is not None}
        """The names of the tasks before this one that are done."""

        self.progress, self.note = job.progress, job.note
        self._folder, self._before = job.folder, [folder for folder in job.before if folder is not None]

    def reads(self, path: str) -> Path:
        """Return where a file is that a task before this one made."""
        return next(place for folder in self._before if (place := folder / path).exists())

    def writes(self, path: str) -> Path:
        """Return where to write a file of this task."""
        place = self._folder / path
        place.parent.mkdir(parents=True, exist_ok=True)
        return place


def _call(job: Job, call: Call) -> None:
    """Call a function of this package."""
    module, _, name = call.function.partition(":")
    if not module.startswith("research."):
        raise TaskError(f"{call.function}: no function of a study")
    getattr(importlib.import_module(module), name)(Files(job, call), **json.loads(call.arguments))


def numbers(job: Job, call: Call) -> None:
    """Make files that Blender has no part in."""
    _call(job, call)


def pictures(job: Job, call: Call) -> None:
    """Make files with Blender."""
    _call(job, call)


def page(job: Job, call: Call) -> None:
    """Make a page of what there is."""
    _call(job, call)


numbers = Step(numbers, rooms=(*ROOMS, "research/paper"))
pictures = Step(pictures, rooms=(*PICTURE_ROOMS, "research/paper"))
page = Step(page, rooms=(*ROOMS, "research"), partial=True)


class Study:
    """The tasks of a study, in their order.

    Parameters
    ----------
    store : Store
        Opened.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self.tasks: dict[str, Task] = {}

    def add(
        self,
        name: str,
        function: Callable[..., None],
        outputs: Sequence[str],
        *,
        after: Iterable[str] = (),
        source: str = "",
        arguments: Mapping[str, Any] | None = None,
        step: Step = numbers,
        weight: float = 1.0,
    ) -> str:
        """Add a task, which may read a file and what tasks before it made, and return its name."""
        before = tuple(after)
        given = dict(arguments or {}) | ({"source": source} if source else {})
        call = Call(f"{function.__module__}:{function.__name__}", json.dumps(given), tuple(outputs), before)
        self.tasks[name] = Task(
            step,
            call,
            name,
            after=tuple(self.tasks[one].key for one in before),
            inputs=(self._store.input(source),) if source else (),
            publish={path: path for path in outputs},
            weight=weight,
        )
        return name
