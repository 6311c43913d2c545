"""Tasks, and the functions that do them.

A task is plain data: it can be written to a file, sent to another process or to another machine. What it does is a
function of this program that is marked as a `step`; nothing else can be named.
"""

from __future__ import annotations

import importlib
import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, TypeVar

from rigid_motion_batch.places import NAMED

FUNCTION = re.compile(r"[a-z_]\w*(?:\.[a-z_]\w*)*:[a-z_]\w*", re.ASCII)
"""package.module:function"""

SHORT = 256
"""Characters of an argument that is kept once for all tasks that have the same."""

Step = TypeVar("Step", bound=Callable[..., Mapping[str, Any] | None])


class TaskError(Exception):
    """Why a task cannot be done, in one line for the user: a recording that is damaged, a picture that is missing."""


def _plain(value: Any) -> Any:
    """What comes back of a value from JSON. Short ones are shared by all that have the same: nobody changes them."""
    text = json.dumps(value, allow_nan=False)
    if isinstance(value, list | tuple) and len(text) > SHORT:
        return [_plain(one) for one in value]
    return _loaded(text)


@lru_cache(maxsize=256)
def _loaded(text: str) -> Any:
    value = json.loads(text)
    return [_plain(one) for one in value] if isinstance(value, list) else value


class Paths(Sequence[str]):
    """Paths, joined when they are asked for.

    Many tasks make files of the same names below folders of their own. Such names are kept once for all of them.

    Parameters
    ----------
    paths : iterable of str
    """

    __slots__ = ("_pieces", "_stem")

    def __init__(self, paths: Iterable[str]) -> None:
        listed = tuple(paths)
        self._stem = _stem_of(listed)
        self._pieces = _once(tuple(tuple(path.split(self._stem)) if self._stem else (path,) for path in listed))

    def __len__(self) -> int:
        return len(self._pieces)

    def __getitem__(self, index: int | slice) -> str | tuple[str, ...]:
        return tuple(self)[index]

    def __iter__(self) -> Iterator[str]:
        return map(self._stem.join, self._pieces)

    def __eq__(self, other: object) -> bool:
        return tuple(self) == tuple(other) if isinstance(other, Paths | tuple) else NotImplemented

    def __hash__(self) -> int:
        return hash(tuple(self))

    def __repr__(self) -> str:
        return repr(tuple(self))


def _stem_of(paths: Sequence[str]) -> str:
    """What all paths hold of the first: all before its extension, or its folder; empty where they hold neither."""
    stems = (path.rpartition(end)[0] for path in paths[:1] for end in "./")
    return next((stem for stem in stems if stem and all(stem in path for path in paths)), "")


@lru_cache(maxsize=256)
def _once(pieces: tuple[tuple[str, ...], ...]) -> tuple[tuple[str, ...], ...]:
    """The first that was the same."""
    return pieces


@dataclass(frozen=True, slots=True)
class Task:
    """A piece of work.

    Raises
    ------
    ValueError
        For arguments that JSON cannot hold.
    """

    name: str
    """Unique in its plan, in one line."""

    function: str
    """A `step`, as "package.module:function"."""

    arguments: Mapping[str, Any] = field(default_factory=dict)
    """Given to the function by name. Anything that JSON holds."""

    inputs: tuple[str, ...] = ()
    """Files from outside that it reads. When their content changes, the task is done again. Relative ones count from
    the folder in which the program was started."""

    outputs: Sequence[str] = ()
    """All files that it makes: paths with "/" below the output folder, at least one."""

    after: tuple[str, ...] = ()
    """The tasks whose outputs it reads, each named once."""

    title: str = ""
    """What people read of it; the name unless given."""

    weight: float = 1.0
    """About how many seconds it takes beside the others: what progress and the time left are reckoned by."""

    partial: bool = False
    """Makes the best of what there is: it is done also where tasks before it failed or were stopped, once no more can
    come. A report, for one."""

    temporary: bool = False
    """Nobody but the tasks after it wants its outputs: they are deleted when those tasks are done."""

    amount: int = 0
    """How many it makes of what is counted over all tasks."""

    unit: str = ""
    """What that is: "frame"."""

    def __post_init__(self) -> None:
        # What came back from JSON is what a worker, or the next run, will be given; what is the same is shared.
        plain = {name: _plain(value) for name, value in dict(self.arguments).items()}
        object.__setattr__(self, "arguments", plain)
        object.__setattr__(self, "function", sys.intern(self.function))
        object.__setattr__(self, "inputs", tuple(map(str, self.inputs)))
        object.__setattr__(self, "outputs", Paths(map(str, self.outputs)))
        object.__setattr__(self, "after", tuple(dict.fromkeys(map(str, self.after))))
        object.__setattr__(self, "title", self.title or self.name)

    def as_json(self) -> dict[str, Any]:
        """Every field, for `Task(**fields)`."""
        return {name: getattr(self, name) for name in self.__slots__} | {"outputs": [*self.outputs]}


def step(function: Step) -> Step:
    """Mark a function that tasks may name.

    It is called as `function(job, **arguments)` with a `Job`, writes every output of its task, and may return facts
    about what it did, a dictionary for JSON that the manifest keeps. It raises `TaskError` for what is the input's
    fault and not its own.
    """
    function.is_step = True
    return function


def find_step(name: str) -> Callable[..., Mapping[str, Any] | None]:
    """The function of that name.

    A plan may come from a file. So only modules of this program are imported, and only what they mark is called.

    Raises
    ------
    ValueError
        Where there is no such step.
    """
    if not FUNCTION.fullmatch(name):
        raise ValueError(f"{name!r} is no function; write package.module:function")
    module_name, _, function_name = name.partition(":")
    if file_of(module_name) is None:
        raise ValueError(f"{name}: this program has no module {module_name}")
    function = getattr(importlib.import_module(module_name), function_name, None)
    if not getattr(function, "is_step", False):
        raise ValueError(f"{name}: {module_name} has no step of that name; mark it with @step")
    return function


@cache
def file_of(module: str) -> Path | None:
    """The file of a module of this program; None where there is none."""
    package, *inner = module.split(".")
    if package not in NAMED:
        return None
    place = NAMED[package].joinpath(*inner)
    found = (place.with_suffix(".py"), place / "__init__.py")
    return next((path for path in found if path.is_file()), None)


def places_of(outputs: Iterable[str]) -> dict[str, str]:
    """Where each output of a task is in its scratch folder: by its name alone, for folders are slow to make.

    Only where two of them have the same name, the outputs of one folder are in one with a number.
    """
    parts = {path: path.rpartition("/") for path in outputs}
    if len({name.casefold() for *_, name in parts.values()}) == len(parts):
        return {path: name for path, (*_, name) in parts.items()}
    numbers = {folder: number for number, folder in enumerate(sorted({folder for folder, *_ in parts.values()}))}
    return {path: f"{numbers[folder]}/{name}" for path, (folder, _, name) in parts.items()}


class Job:
    """A task's view of its files while it is done.

    Parameters
    ----------
    output : Path
        The output folder.
    scratch : Path
        Where the outputs are written, until all of them are there.
    outputs : iterable of str
        Those of the task.
    finished : iterable of str
        The tasks before it that are done: all, but for a task that is `partial`.
    progress : callable
        Takes the share that is done and what is being done.
    note : callable
        Takes a line for the user.
    """

    def __init__(
        self,
        output: Path,
        scratch: Path,
        outputs: Iterable[str],
        finished: Iterable[str] = (),
        progress: Callable[[float, str], object] = lambda share, doing: None,
        note: Callable[[str], object] = lambda text: None,
    ) -> None:
        self.output = output
        self.finished = frozenset(finished)
        self._scratch = scratch
        self._places = places_of(outputs)
        self._progress = progress
        self._note = note

    def reads(self, path: str) -> Path:
        """Where an output of a task before this one is."""
        return self.output / path

    def writes(self, path: str) -> Path:
        """Where to write an output of this task, under its own name; beside it are those of the same folder."""
        if path not in self._places:
            raise ValueError(f"{path!r} is not among the outputs of this task: {', '.join(sorted(self._places))}")
        place = self._scratch / self._places[path]
        place.parent.mkdir(parents=True, exist_ok=True)
        return place

    def progress(self, done: float, total: float = 1.0, doing: str = "") -> None:
        """Say how far it is, and what is being done. Cheap enough to be called often."""
        self._progress(min(done / total, 1.0) if total else 1.0, doing)

    def note(self, text: str) -> None:
        """Say something that the user should know, a line."""
        self._note(text)
