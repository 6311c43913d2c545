"""Steps and tasks: what can be done, and what is to be done, of what.

A step is a function that writes the files of a result, by parameters, from results of other tasks and from files. A
task is a step with all of these, and has a key, a digest of everything its result depends on. So all keys are known
before anything is done, and equal tasks have one result. Standard library alone: Blender's own Python loads this.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import inspect
import json
import os
import pkgutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from rigid_motion_batch import places
from rigid_motion_batch.files import append_lines, lines_of

from .values import to_plain

DIGITS = 32
"""Digits of SHA-256 in a key: 128 bits, and short enough for the paths of Windows."""

OWN = ".rigid-motion"
"""The folder in an output folder where the pipeline keeps its own files."""

INTERVAL = 0.2
"""Seconds between two messages about how far a task is."""


class TaskError(Exception):
    """Error that says why a task cannot be done, and what to do about it, in one line."""

    details = ""
    """The place in the program, for an error that nobody foresaw."""

    fatal = False
    """True if other tasks will fail for the same reason: the disk is full."""


@dataclass
class Job:
    """A task that is done somewhere, with its files: what goes to a worker, and what its step is given."""

    task: Task
    place: Path
    """A folder for all that is written meanwhile, which may be missing."""

    output: Path
    before: Sequence[Path | None] = ()
    """The folders of the results of the tasks before it; None for those that failed, in partial steps alone."""

    blender: str = ""
    """The program that does steps that need Blender, if that is not to be this one."""

    here: str = field(default_factory=os.getcwd)
    """The folder where relative paths start."""

    folder: Path = field(init=False)
    """Where the result's files are to be written: there, and empty, while it is done."""

    share: float = 0.0
    """The share of it that was done at the last look, and what was being done."""

    doing: str = ""
    _said_at: float = 0.0

    @property
    def results(self) -> list[Path]:
        """The folders of the results before it that there are, which are all but in partial steps."""
        return [folder for folder in self.before if folder]

    @property
    def inputs(self) -> list[Path]:
        return [Path(item.path) for item in self.task.inputs]

    def progress(self, done: float, total: float = 1.0, doing: str = "") -> None:
        """Say how far it is, and what is being done. Cheap enough to be called often."""
        if time.monotonic() - self._said_at >= INTERVAL:
            self._said_at = time.monotonic()
            with suppress(OSError):
                said = json.dumps([min(done / total, 1.0) if total else 1.0, doing])
                (self.place / "progress").write_text(said, encoding="utf-8")

    def look(self) -> None:
        """See how far it is, wherever it is done."""
        with suppress(OSError, ValueError):
            self.share, self.doing = json.loads((self.place / "progress").read_bytes())

    def note(self, text: str) -> None:
        """Say something that the user should know, in a line, when the task is done."""
        append_lines(self.place / "notes", [{"note": text}])

    def notes(self) -> list[str]:
        """Return what it has said, wherever it was done."""
        return [str(line.get("note")) for line in lines_of(self.place / "notes")]

    def last_words(self) -> str:
        """Return the last line that libraries have printed where it was done, behind a colon; empty for none."""
        printed = ""
        with suppress(OSError):
            printed = (self.place / "log").read_text(encoding="utf-8", errors="replace")
        return "".join(f": {line[:200]}" for line in [*filter(str.strip, printed.splitlines())][-1:])


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
            result |= {room: digest_of(place_of_room(room)) for room in self.rooms}
            result[self.function.__module__] = digest_of(Path(inspect.getfile(self.function)))
        return result

    def __reduce__(self) -> tuple[Callable[[str], Step], tuple[str]]:
        return pkgutil.resolve_name, (self.name,)


def step(**options: Any) -> Callable[[Callable[[Job, Any], Mapping[str, Any] | None]], Step]:
    """Make a step of a function, with the fields of `Step`."""
    return lambda function: Step(function, **options)


@dataclass(frozen=True, slots=True)
class Input:
    """A file that a task reads, as it was when the work was planned."""

    path: str
    sha256: str
    """The digest of its content; empty where there is no file that can be read."""


@dataclass(frozen=True, eq=False)
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

    frames: int = 0
    """The number of frames of films that it renders, which are counted over all tasks."""

    group: str = ""
    """Tasks of one group are the share of one worker, where a job is split."""

    def __post_init__(self) -> None:
        for path in self.publish.values():
            require_inside(path.removesuffix("/"))

    @property
    def made_of(self) -> dict[str, Any]:
        """What its result depends on, for people; `explain` compares it."""
        return {
            "step": self.step.name,
            "versions": dict(self.step.versions),
            "parameters": to_plain(self.parameters),
            "inputs": {item.path: item.sha256 for item in self.inputs},
            "after": list(self.after),
        }

    @cached_property
    def key(self) -> str:
        """The digest of what its result depends on, wherever its inputs are."""
        return self.key_after(self.after)

    def key_after(self, after: Iterable[str | None]) -> str:
        """Return its key where the tasks before it had these keys; None for one that failed."""
        inputs = [item.sha256 for item in self.inputs]
        return _digest({**self.made_of, "inputs": inputs, "after": list(after)})[:DIGITS]

    def published(self, files: Iterable[str] = ()) -> Iterator[tuple[str, str]]:
        """Yield each file that is published and where it goes, of a result with these files."""
        for name, path in self.publish.items():
            if name.endswith("/"):
                yield from ((file, path + file.removeprefix(name)) for file in files if file.startswith(name))
            else:
                yield name, path

    @property
    def shown(self) -> str:
        return self.title or self.name


def require_inside(path: str) -> None:
    """Raise ValueError unless a path, with slashes, is that of a file for the user below the output folder."""
    parts = path.split("/")
    # A colon in the first part would be a drive of Windows, and in another a stream of a file.
    if not path.isprintable() or {*"\\:"} & {*path} or {"", ".", ".."} & {*parts} or parts[0].casefold() == OWN:
        raise ValueError(f"{path!r} is no path below the output folder")


def place_of_room(room: str) -> Path:
    """Return the file or folder of a package or module."""
    own = places.PACKAGE / room
    return own if own.exists() else places.place_of(room)


@cache
def digest_of(place: Path) -> str:
    """Return the digest of the content of a file, or of all files of a folder, once in the life of this process."""
    files = sorted(path for path in place.rglob("[!.]*") if path.is_file()) if place.is_dir() else [place]
    files = [path for path in files if path.suffix != ".pyc"]
    return _digest([[path.relative_to(place).as_posix(), sha256_of(path)] for path in files])[:12]


def version_here() -> str:
    """Return the version that all who work at one plan must have, as it was when this process asked first."""
    result = [f"program {places.manifest()['version']} {digest_of(places.PACKAGE)} {digest_of(places.EXTENSION)}"]
    for module in ("numpy", "bpy"):
        with suppress(importlib.metadata.PackageNotFoundError):
            result.append(f"{module} {importlib.metadata.version(module)}")
    return ", ".join(result)


def sha256_in(path: Path | str) -> str:
    """Return the digest of a file; empty where there is no file that can be read."""
    try:
        return sha256_of(path) if os.path.isfile(path) else ""
    except (OSError, ValueError):
        return ""


def sha256_of(path: Path | str) -> str:
    with open(path, "rb") as stream:  # noqa: PTH123 - a path may be text as it was given, "/" at its end and all
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _digest(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
