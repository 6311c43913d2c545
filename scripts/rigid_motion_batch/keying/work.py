"""What is done to inputs, an input while it is done, and what comes of it."""

from __future__ import annotations

import argparse
import os
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Self

from rigid_motion_batch.recordings.recordings import NoMotion, TrajectoryError
from rigid_motion_batch.supervising import report

from .planning import InputJob
from .records import FileProblem, InputRecord, Unreadable, refuse_read_only

Note = Callable[[str], None]
"""Writes a line for the user."""


@dataclass(frozen=True)
class Work(ABC):
    """What is done to inputs, and how: plain data, which goes to worker processes and into the keys of results."""

    doing: ClassVar[str]
    """As a heading: "Baking"."""

    done: ClassVar[str]
    """The word for what becomes of objects: "baked"."""

    objects: Sequence[str] | None
    """The names and patterns of the objects that are meant; None for all."""

    overwrite: bool
    """True if files that were not made of an input may be replaced."""

    dry_run: bool
    processes: int = field(default=1, kw_only=True)
    """For one input, where it has parts."""

    @classmethod
    def of(cls, options: argparse.Namespace, **own: Any) -> Self:
        """Return what the options say, and the fields that a kind of work has of its own."""
        return cls(options.objects, options.overwrite, options.dry_run, **own)

    def record_of(self, job: InputJob) -> InputRecord:
        """Return what is known of what was made of an input."""
        return InputRecord(job.folder, job.source, overwrite=self.overwrite)

    def needs_blender(self, job: InputJob) -> bool:  # noqa: ARG002 - some do
        return True

    @abstractmethod
    def do(self, doing: RunningJob) -> None:
        """Do one input, and write what comes of it."""


@dataclass(frozen=True)
class ClipNumbers:
    """What became of the keys of a clip, an object, a rig or a recorded body. Lengths are in metres."""

    name: str
    keys_before: int
    keys_after: int
    error: float = 0.0
    where: str = ""
    """The place and the time of the error."""

    reason: str = ""
    """Why it stays as it was."""


@dataclass
class Numbers:
    """What is known of what was done to an input: plain data. Lengths are in metres."""

    size: float | None = None
    tolerance: float | None = None
    bytes_before: int | None = None
    bytes_after: int | None = None
    """Of whole files."""

    clips: list[ClipNumbers] = field(default_factory=list)


@dataclass
class Outcome:
    """What became of an input."""

    source: str

    objects: int = 0
    bones: int = 0
    clips: int = 0
    """The number of them that were done."""

    refused: int = 0
    """The number of objects and bones that were not."""

    failed: bool = False
    unreadable: bool = False
    incomplete: bool = False
    """True if there may be objects in it that cannot be looked at, for a library is missing."""

    reason: str = ""
    """Why it failed, or was left alone."""

    numbers: Numbers = field(default_factory=Numbers)
    old: Mapping[str, Any] | None = None
    """The numbers as an earlier run has noted them, where that has done the input."""

    written: list[Path] = field(default_factory=list)
    """The files that were written, or would have been."""

    beside: list[Path] = field(default_factory=list)
    """Files that belong to those."""

    read: list[Path] = field(default_factory=list)
    """The files that were read beside the input."""

    matched: set[str] = field(default_factory=set)
    """The names and patterns among those requested that there was an object or a bone for."""

    def add_written(self, path: Path) -> None:
        """Note that a file is complete at its place."""
        self.written.append(path)
        report(written=os.fspath(path))

    @property
    def done(self) -> int:
        return self.objects + self.bones + self.clips

    def as_data(self) -> dict[str, Any]:
        """Return what is printed as JSON."""
        known = asdict(self.numbers) if self.old is None else self.old
        written = list(map(os.fspath, self.written))
        return {"source": self.source, "state": self.state, "written": written, "reason": self.reason, **known}

    @property
    def state(self) -> str:
        """Return what became of it, in a word."""
        if self.failed:
            return "failed"
        return "left alone" if not self.written else "written" if self.old is None else "already written"

    @property
    def is_complete(self) -> bool:
        """Return whether something was written, and nothing is left to be done."""
        return bool(self.written) and not (self.failed or self.refused or self.incomplete)


class RunningJob:
    """An input while it is done: what is said of it, and what comes of it."""

    def __init__(self, work: Work, job: InputJob, note: Note) -> None:
        self.work, self.job, self.note = work, job, note
        self.title = job.source
        self.record = work.record_of(job)
        self.would = "would be " if work.dry_run else ""
        self.outcome = Outcome(job.source)

    def say(self, text: object) -> None:
        self.note(f"{self.title}: {text}")

    @contextmanager
    def failing(self) -> Iterator[None]:
        """Say why the block fails, where it does, also where that was not foreseen: others are to be done."""
        try:
            yield
        except FileProblem as problem:
            self.outcome.failed = True
            self.outcome.unreadable = isinstance(problem, Unreadable) and not self.outcome.written
            self.outcome.reason = str(problem)
            self.say(problem)
        except Exception as error:
            self.outcome.failed = True
            self.outcome.reason = f"this program failed ({type(error).__name__}: {error})"
            self.say(f"not written, for {self.outcome.reason}:")
            for line in "".join(traceback.format_exception(error)).splitlines():
                self.note(line)

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Say why the block cannot read a recording, where it cannot; what was found in a folder may hold no motion."""
        try:
            yield
        except TrajectoryError as error:
            if self.job.is_found and isinstance(error, NoMotion):
                self.leave_alone(error.problem)
                return
            self.outcome.failed = self.outcome.unreadable = True
            self.outcome.reason = str(error).removeprefix(f"{self.job.source}: ")
            self.note(str(error))

    def leave_alone(self, reason: str) -> None:
        """Say that nothing is written, and why."""
        self.outcome.reason = reason
        self.say(f"{reason}; left alone, nothing is written")

    def refuse(self, name: str, reason: str, count: int = 1) -> None:
        """Say that so many objects or bones are not done, and why."""
        self.outcome.refused += count
        self.say(f"{name}: not {self.work.done}: {reason}")

    def require_free(self, path: Path) -> None:
        """Raise FileProblem where a file must not or cannot be written: better said before hours go into it."""
        self.record.refuse_to_replace(path)
        refuse_read_only(path)

    def tell_written(self, path: Path) -> None:
        self.say(f"{self.would}written to {path}")
        self.outcome.add_written(path)
