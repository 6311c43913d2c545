"""Steps and tasks: what can be done, and what is to be done, of what.

A step is a function that writes the files of a result, by parameters, from results of other tasks and from files. A
task is a step with all of these, and has a key, a digest of everything its result depends on. So all keys are known
before anything is done, and equal tasks have one result. Standard library alone: Blender's own Python loads this.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.metadata
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any, cast

from rigid_motion_batch import places

from .values import to_plain

DIGITS = 32
"""Digits of SHA-256 in a key: 128 bits, and short enough for the paths of Windows."""

OWN = ".rigid-motion"
"""The folder in an output folder where the pipeline keeps its own files."""


class TaskError(Exception):
    """Error that says what is wrong with the input of a task, and what to do about it, in one line."""


class Job:
    """A task's view of its files while it is done.

    Parameters
    ----------
    folder : Path
        Where the result's files are to be written; there, and empty.
    before : sequence of Path or None
        The folders of the results of the tasks before it; None for those that failed, in partial steps alone.
    inputs : sequence of Path
    tell : callable
        Takes the share that is done and what is being done.
    """

    def __init__(
        self,
        folder: Path,
        before: Sequence[Path | None] = (),
        inputs: Sequence[Path] = (),
        tell: Callable[[float, str], object] = lambda *_: None,
    ) -> None:
        self.folder, self.before, self.inputs = folder, tuple(before), tuple(inputs)
        self.notes: list[str] = []
        self._tell = tell

    @property
    def results(self) -> list[Path]:
        """The folders of the results before it that there are, which are all but in partial steps."""
        return [folder for folder in self.before if folder]

    def progress(self, done: float, total: float = 1.0, doing: str = "") -> None:
        """Say how far it is, and what is being done. Cheap enough to be called often."""
        self._tell(min(done / total, 1.0) if total else 1.0, doing)

    def note(self, text: str) -> None:
        """Say something that the user should know, in a line, when the task is done."""
        self.notes.append(text)


@dataclass(frozen=True, eq=False)
class Step:
    """A function of a job and parameters that writes files into the job's folder, and may return facts for JSON."""

    function: Callable[[Job, Any], Mapping[str, Any] | None]

    rooms: tuple[str, ...] = ()
    """The files and folders of the program that it may use, as `places.place_of` names them, or below this package."""

    stage: str = ""
    """The part of the work that it belongs to, for `--only`."""

    partial: bool = False
    """True if it goes on with what there is where some of the tasks before it failed."""

    blender: bool = False
    """True if it needs bpy: done by the Blender that the user names, if any."""

    @property
    def name(self) -> str:
        """The name package.module:function, which finds it again."""
        return f"{self.function.__module__}:{self.function.__name__}"

    @cached_property
    def versions(self) -> Mapping[str, str]:
        """The versions of the program, and in a checkout of the packages it may use and the function's own module."""
        result = {"program": places.manifest()["version"]}
        if places.CHECKOUT:
            module = importlib.import_module(self.function.__module__)
            result |= {room: digest_of(place_of_room(room)) for room in self.rooms}
            result[self.function.__module__] = digest_of(Path(cast(str, module.__file__)))
        return result

    @cached_property
    def digest(self) -> str:
        """The digest of its name and versions."""
        return _digest([self.name, self.versions])

    def __reduce__(self) -> tuple[Callable[[str], Step], tuple[str]]:
        return step_named, (self.name,)


def step(**options: Any) -> Callable[[Callable[[Job, Any], Mapping[str, Any] | None]], Step]:
    """Make a step of a function, with the fields of `Step`."""
    return lambda function: Step(function, **options)


def step_named(name: str) -> Step:
    """Return the step of a name. Raises ValueError where there is none."""
    module, _, function = name.partition(":")
    result = getattr(importlib.import_module(module), function, None)
    if not isinstance(result, Step):
        raise ValueError(f"{name}: no such step")
    return result


@dataclass(frozen=True, slots=True)
class Input:
    """A file that a task reads, as it was when the work was planned."""

    path: str
    sha256: str
    """The digest of its content; empty where it is missing or no file."""

    size: int = -1
    mtime_ns: int = 0


@dataclass(frozen=True, eq=False, slots=True)
class Task:
    """Something to do once, unless its result is there."""

    step: Step
    parameters: Any
    """A frozen dataclass."""

    name: str
    """The subject of the task, for people and from one plan to the next: "measure hand/10"."""

    after: tuple[str, ...] = ()
    """The keys of tasks whose results it reads."""

    inputs: tuple[Input, ...] = ()

    spends: tuple[str, ...] = ()
    """The keys of the tasks before it whose results are for it alone, and are deleted when it is done."""

    publish: Mapping[str, str] = field(default_factory=dict)
    """Files of the result to where they go in the output folder, with slashes; "FOLDER/" stands for all files below."""

    title: str = ""
    weight: float = 1.0
    """The seconds that it takes, roughly."""

    amount: int = 0
    unit: str = ""
    """The unit that is counted over all tasks, and how many it makes: 120 "frame"."""

    group: str = ""
    """Tasks of one group are the share of one worker, where a job is split."""

    key: str = field(init=False)

    def __post_init__(self) -> None:
        for path in self.publish.values():
            require_inside(path.removesuffix("/"))
        object.__setattr__(self, "key", self.key_after(self.after))

    def key_after(self, after: Iterable[str | None]) -> str:
        """Return its key where the tasks before it had these keys; None for one that failed."""
        inputs = [one.sha256 for one in self.inputs]
        return _digest([self.step.digest, to_plain(self.parameters), list(after), inputs])[:DIGITS]

    @property
    def made_of(self) -> dict[str, Any]:
        """Return what its result depends on, for people; `explain` compares it."""
        return {
            "step": self.step.name,
            "versions": dict(self.step.versions),
            "parameters": to_plain(self.parameters),
            "inputs": {one.path: one.sha256 for one in self.inputs},
            "after": list(self.after),
        }

    def published(self, files: Iterable[str] = ()) -> Iterator[tuple[str, str]]:
        """Yield each file that is published and where it goes, of a result with these files."""
        for name, path in self.publish.items():
            if name.endswith("/"):
                yield from ((one, path + one.removeprefix(name)) for one in files if one.startswith(name))
            else:
                yield name, path

    @property
    def shown(self) -> str:
        return self.title or self.name


def require_inside(path: str) -> None:
    """Make sure that a path of an output, with slashes, leads into the output folder on every system.

    Raises
    ------
    ValueError
        Where it does not, or leads to where the pipeline keeps its own files.
    """
    parts = path.split("/")
    # A colon in the first part would be a drive of Windows, and in another a stream of a file.
    if not path.isprintable() or "\\" in path or ":" in path or {"", ".", ".."} & {*parts}:
        raise ValueError(f"{path!r} is no path below the output folder")
    if parts[0].casefold() == OWN:
        raise ValueError(f"{path!r} is where the program keeps its own files")


def place_of_room(room: str) -> Path:
    """Return the file or folder of a package or module."""
    own = places.PACKAGE / room
    return own if own.exists() else places.place_of(room)


@cache
def digest_of(place: Path) -> str:
    """Return the digest of the content of a file, or of all files of a folder, once in the life of this process."""
    files = sorted(path for path in place.rglob("*") if _is_source(path)) if place.is_dir() else [place]
    return _digest([[path.relative_to(place).as_posix(), sha256_of(path)] for path in files])[:12]


def version_here() -> str:
    """Return the version that all who work at one plan must have, as it was when this process asked first."""
    result = [f"program {places.manifest()['version']} {digest_of(places.PACKAGE)} {digest_of(places.EXTENSION)}"]
    for module in ("numpy", "bpy"):
        with suppress(importlib.metadata.PackageNotFoundError):
            result.append(f"{module} {importlib.metadata.version(module)}")
    return ", ".join(result)


def sha256_of(path: Path | str) -> str:
    with open(path, "rb") as stream:  # noqa: PTH123 - a path may be text as it was given, "/" at its end and all
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _is_source(path: Path) -> bool:
    return path.is_file() and path.suffix != ".pyc" and not path.name.startswith(".")


def _digest(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
