"""Steps and tasks: what can be done, and what is to be done, of what.

A step writes the files of a result, from results of other tasks and from files; its fields are its parameters. A task
is a step with all of these, and has a key, a digest of everything its result depends on. So all keys are known before
anything is done, and equal tasks have one result. Standard library alone: Blender's own Python loads this.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import inspect
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any, ClassVar, dataclass_transform

from rigid_motion_batch import places

from .values import plain

OWN_FOLDER = ".rigid-motion"
"""The folder in an output folder where the pipeline keeps its own files."""

VERSION_VARIABLE = "RIGID_MOTION_VERSION"
"""A variable of the environment: the version that this program is to have, of those at work at one plan."""

LOOK_INTERVAL_S = 0.2
"""Seconds between two looks at tasks that are being done."""


class RunError(Exception):
    """Error that says why a run cannot begin or go on, and the way out, in one line."""


class TaskError(Exception):
    """Error that says why a task cannot be done, and what to do about it, in one line.

    `details` say where in the program, for an error that nobody foresaw; one is `fatal` where other tasks will fail for
    the same reason: the disk is full.
    """

    details = ""
    fatal = False


@dataclass_transform(frozen_default=True)
class Step:
    """What can be done: each is a frozen dataclass of values, and `class Read(Step, stage="read")` says what it is.

    A step may use some `rooms`, files and folders of the program as `places.place_of` names them. It belongs to a
    `stage` of the work, for `--only`. A `partial` one goes on with what there is where some of the tasks before it
    failed. One of `blender` needs bpy: it is done by the Blender that the user names, if any.
    """

    rooms: ClassVar[tuple[str, ...]] = ()
    stage: ClassVar[str] = ""
    partial: ClassVar[bool] = False
    blender: ClassVar[bool] = False

    def __init_subclass__(cls, **said: Any) -> None:
        for name, value in said.items():
            setattr(cls, name, value)
        dataclass(frozen=True)(cls)

    def make(self, job: StepJob) -> Mapping[str, Any] | None:
        """Write the files of the result into the job's folder, and return facts for JSON, if there are any."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Task:
    """Something to do once, unless its result is there.

    Its `name` is its subject, for people and from one plan to the next: "measure hand/10". It comes `after` tasks whose
    results it reads, given by their keys, and reads `inputs`, files with their digests when the work was planned (empty
    for one that cannot be read). It `spends` those results that are for it alone: they are deleted when it is done.
    `publish` has files of the result and where they go in the output folder, with slashes; "FOLDER/" stands for all
    files below. It takes `seconds`, roughly.
    """

    step: Step
    name: str
    after: tuple[str, ...] = ()
    inputs: Mapping[str, str] = field(default_factory=dict)
    spends: tuple[str, ...] = ()
    publish: Mapping[str, str] = field(default_factory=dict)
    seconds: float = 1.0

    @cached_property
    def key(self) -> str:
        """The digest of what its result depends on, wherever its inputs are."""
        return self.key_after(self.after)

    def key_after(self, after: Iterable[str | None]) -> str:
        """Return its key where the tasks before it had these keys; None for one that failed."""
        kind: Any = type(self.step)
        # 128 bits, and short enough for the paths of Windows.
        return _digest([versions_of(kind), self.step, [*self.inputs.values()], list(after)])[:32]


@dataclass
class StepJob:
    """A task that is done somewhere, with its files: what goes to a worker, and what its step is given.

    All that is written meanwhile is below `place`, which may be missing; the result's files go into `folder`, which is
    there, and empty, while it is done. `before` are the folders of the results of the tasks before it, None for those
    that failed, in partial steps alone. A step that needs Blender is done by the program `blender`, if that is not to
    be this one. Relative paths start `here`.
    """

    task: Task
    place: Path
    output: Path
    before: Sequence[Path | None] = ()
    blender: str = ""
    here: str = field(default_factory=os.getcwd)

    @property
    def folder(self) -> Path:
        return self.place / "result"

    @property
    def results(self) -> list[Path]:
        """The folders of the results before it that there are, which are all but in partial steps."""
        return [folder for folder in self.before if folder]

    def progress(self, done: float, total: float) -> None:
        """Say how far it is."""
        with suppress(OSError):
            (self.place / "progress").write_text(f"{done / total}", encoding="utf-8")

    def reached(self) -> float:
        """Return how far it is, wherever it is done, from 0 to 1."""
        with suppress(OSError, ValueError):  # It has said nothing yet.
            return float((self.place / "progress").read_text(encoding="utf-8"))
        return 0.0


@cache
def versions_of(kind: type[Step]) -> dict[str, str]:
    """Return the versions of the program, and in a checkout of what a step may use and of its own module."""
    result = {"program": places.manifest()["version"]}
    if places.CHECKOUT:
        result |= {room: digest_of(places.place_of(room)) for room in kind.rooms}
        result[kind.__module__] = digest_of(Path(inspect.getfile(kind)))
    return result


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
    text = json.dumps(content, default=plain, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()
