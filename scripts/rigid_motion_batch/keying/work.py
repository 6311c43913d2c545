"""The work done on an input, its state while it runs, and its outcome."""

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
    """A kind of work and its options: plain data, passed to worker processes and included in the keys of results."""

    doing: ClassVar[str]
    """The word for the heading: "Baking"."""

    done: ClassVar[str]
    """The word for finished objects: "baked"."""

    objects: Sequence[str] | None
    """The names and patterns of the objects to process; None for all."""

    overwrite: bool
    """True if files that were not made from the input may be replaced."""

    dry_run: bool
    processes: int = field(default=1, kw_only=True)
    """Processes for one input, if it has several parts."""

    @classmethod
    def of(cls, options: argparse.Namespace, **own: Any) -> Self:
        """Create work from command-line options and the fields that a subclass adds."""
        return cls(options.objects, options.overwrite, options.dry_run, **own)

    def record_of(self, job: InputJob) -> InputRecord:
        """Return the record of the results made from an input."""
        return InputRecord(job.folder, job.source, overwrite=self.overwrite)

    def needs_blender(self, job: InputJob) -> bool:  # noqa: ARG002 - some do
        return True

    @abstractmethod
    def do(self, doing: RunningJob) -> None:
        """Process one input, and write its results."""


@dataclass(frozen=True)
class ClipNumbers:
    """The numbers of keys of a clip, an object, a rig or a recorded body. Lengths are in metres."""

    name: str
    keys_before: int
    keys_after: int
    error: float = 0.0
    where: str = ""
    """The place and the time of the error."""

    reason: str = ""
    """Why it was left as it was."""


@dataclass
class Numbers:
    """Measurements of an input and its results: plain data. Lengths are in metres."""

    size: float | None = None
    tolerance: float | None = None
    bytes_before: int | None = None
    bytes_after: int | None = None
    """The sizes of whole files."""

    clips: list[ClipNumbers] = field(default_factory=list)


@dataclass
class Outcome:
    """The outcome of an input."""

    source: str

    objects: int = 0
    bones: int = 0
    clips: int = 0
    """The numbers of objects, bones and clips that were done."""

    refused: int = 0
    """The number of objects and bones that could not be done."""

    failed: bool = False
    unreadable: bool = False
    incomplete: bool = False
    """True if the input may have objects that cannot be read, because a library is missing."""

    reason: str = ""
    """Why it failed, or was left alone."""

    numbers: Numbers = field(default_factory=Numbers)
    old: Mapping[str, Any] | None = None
    """The numbers recorded by an earlier run, if that has done the input."""

    written: list[Path] = field(default_factory=list)
    """The files that were written, or would have been."""

    beside: list[Path] = field(default_factory=list)
    """Companion files of the written files."""

    read: list[Path] = field(default_factory=list)
    """The other files that were read."""

    matched: set[str] = field(default_factory=set)
    """The requested names and patterns that matched an object or a bone."""

    def add_written(self, path: Path) -> None:
        """Record that a file is complete and in place."""
        self.written.append(path)
        report(written=os.fspath(path))

    @property
    def done(self) -> int:
        return self.objects + self.bones + self.clips

    def as_data(self) -> dict[str, Any]:
        """Return the data that is printed as JSON."""
        known = asdict(self.numbers) if self.old is None else self.old
        written = list(map(os.fspath, self.written))
        return {"source": self.source, "state": self.state, "written": written, "reason": self.reason, **known}

    @property
    def state(self) -> str:
        """Return the outcome in a word or two."""
        if self.failed:
            return "failed"
        return "left alone" if not self.written else "written" if self.old is None else "already written"

    @property
    def is_complete(self) -> bool:
        """Return whether something was written and nothing was refused, failed or missing."""
        return bool(self.written) and not (self.failed or self.refused or self.incomplete)


class RunningJob:
    """An input while it is processed: its messages and its outcome."""

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
        """Report any failure of the block, also an unforeseen one, so that other inputs can still be processed."""
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
        """Report why the block cannot read a recording; leave a file from a folder alone if it holds no motion."""
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
        """Report that nothing is written, and why."""
        self.outcome.reason = reason
        self.say(f"{reason}; left alone, nothing is written")

    def refuse(self, name: str, reason: str, count: int = 1) -> None:
        """Report that `count` objects or bones are not done, and why."""
        self.outcome.refused += count
        self.say(f"{name}: not {self.work.done}: {reason}")

    def require_free(self, path: Path) -> None:
        """Raise FileProblem if a file may not or cannot be written, before hours of work go into it."""
        self.record.refuse_to_replace(path)
        refuse_read_only(path)

    def tell_written(self, path: Path) -> None:
        self.say(f"{self.would}written to {path}")
        self.outcome.add_written(path)
