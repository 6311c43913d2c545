"""Steps and tasks: a step is a kind of work, a task is a step with its inputs and a key.

A step writes the files of a result, from results of other tasks and from files; its fields are its parameters. The key
of a task is a digest of everything that its result depends on. So all keys are known before any work, and equal tasks
share one result. Standard library and NumPy only: Blender's own Python loads this.
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
"""The folder inside an output folder where the pipeline keeps its own files."""

VERSION_VARIABLE = "RIGID_MOTION_VERSION"
"""Environment variable with the version that this program must have, the same for all machines that work on a plan."""

LOOK_INTERVAL_S = 0.2
"""Seconds between two checks of running tasks."""


class RunError(Exception):
    """Error that says why a run cannot begin or continue, and what to do, in one line."""


class TaskError(Exception):
    """Error that says why a task cannot be done, and what to do, in one line.

    `details` is the traceback of an unexpected error. An error is `fatal` if other tasks will fail for the same reason,
    such as a full disk.
    """

    details = ""
    fatal = False


@dataclass_transform(frozen_default=True)
class Step:
    """A kind of work: each is a frozen dataclass of values, with class arguments: `class Read(Step, stage="read")`.

    A step depends on some `rooms`: files and folders of the program, named as in `places.place_of`. It belongs to a
    `stage` of the work, for `--only`. A `partial` step continues with the available results if some tasks before it
    failed. A `blender` step needs bpy: it runs in the Blender that the user names, if any.
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
    """Work to do once, unless its result exists.

    Its `name` says what it does, for people, and is the same in the next plan: "measure hand/10". It comes `after`
    tasks whose results it reads, given by their keys, and reads `inputs`: files with their digests at planning time (""
    for a file that cannot be read). It `spends` results that only it needs: they are deleted when it is done. `publish`
    maps files of the result to their places in the output folder, with slashes; "FOLDER/" means all files below. It
    takes roughly `seconds`.
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
        """The digest of everything that the result depends on, except the location of inputs."""
        return self.key_after(self.after)

    def key_after(self, after: Iterable[str | None]) -> str:
        """Return the task's key if the tasks before it had these keys; None for a failed task."""
        kind: Any = type(self.step)
        # 128 bits, short enough for the paths of Windows.
        return _digest([versions_of(kind), self.step, [*self.inputs.values()], list(after)])[:32]


@dataclass
class StepJob:
    """A task that runs somewhere, with its files: sent to a worker, and given to its step.

    Everything is written below `place`, which may not exist yet. The files of the result go into `folder`, which exists
    and is empty when the step starts. `before` are the folders of the results before this task; None for failed tasks,
    which only partial steps get. The program `blender` runs steps that need Blender, if it is not this one. Relative
    paths start at `here`.
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
        """The folders of the results before this task that exist: all of them, except in partial steps."""
        return [folder for folder in self.before if folder]

    def progress(self, done: float, total: float) -> None:
        """Report the progress of the step."""
        with suppress(OSError):
            (self.place / "progress").write_text(f"{done / total}", encoding="utf-8")

    def reached(self) -> float:
        """Return the progress of the step, from 0 to 1, wherever it runs."""
        with suppress(OSError, ValueError):  # The step has not reported yet.
            return float((self.place / "progress").read_text(encoding="utf-8"))
        return 0.0


@cache
def versions_of(kind: type[Step]) -> dict[str, str]:
    """Return the version of the program; in a checkout also digests of the step's rooms and of its own module."""
    result = {"program": places.manifest()["version"]}
    if places.CHECKOUT:
        result |= {room: digest_of(places.place_of(room)) for room in kind.rooms}
        result[kind.__module__] = digest_of(Path(inspect.getfile(kind)))
    return result


@cache
def digest_of(place: Path) -> str:
    """Return the digest of a file, or of all files of a folder, computed once in the life of this process."""
    files = sorted(path for path in place.rglob("[!.]*") if path.is_file()) if place.is_dir() else [place]
    files = [path for path in files if path.suffix != ".pyc"]
    return _digest([[path.relative_to(place).as_posix(), sha256_of(path)] for path in files])[:12]


def version_here() -> str:
    """Return the version that all machines working on a plan must share, as of the first call in this process."""
    result = [f"program {places.manifest()['version']} {digest_of(places.PACKAGE)} {digest_of(places.EXTENSION)}"]
    for module in ("numpy", "bpy"):
        with suppress(importlib.metadata.PackageNotFoundError):
            result.append(f"{module} {importlib.metadata.version(module)}")
    return ", ".join(result)


def sha256_in(path: Path | str) -> str:
    """Return the digest of a file; empty if it is no readable file."""
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
