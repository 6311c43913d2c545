"""Steps for the tests of the pipeline: what they do can be seen from outside, in files."""

from __future__ import annotations

import errno
import os
import signal
import time
from pathlib import Path

from rigid_motion_batch.pipeline.steps import Step, StepJob, TaskError

FILE = "out.txt"
"""The one file that every result has."""


class Write(Step, stage="write"):
    """Write a text, and note in a log that it was done."""

    text: str = ""
    log: str = ""
    seconds: float = 0.0
    files: tuple[str, ...] = ()
    """More of them, with the same text."""

    def make(self, job: StepJob) -> dict[str, int]:
        _note(self.log, self.text)
        (job.folder / FILE).write_text("half")
        time.sleep(self.seconds)
        for name in (FILE, *self.files):
            place = job.folder / name
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(self.text)
        return {"characters": len(self.text)}


class Join(Step, stage="join"):
    """Write what is in the results before it that are there."""

    log: str = ""

    def make(self, job: StepJob) -> None:
        _note(self.log, "join")
        (job.folder / FILE).write_text("".join((folder / FILE).read_text() for folder in job.before if folder))


class Report(Join, stage="report", partial=True):
    """The same, also where some are missing."""


class Copy(Step):
    """Write what is in a file from outside."""

    log: str = ""

    def make(self, job: StepJob) -> None:
        _note(self.log, "copy")
        source = Path(*job.task.inputs)
        try:
            (job.folder / FILE).write_text(source.read_text())
        except FileNotFoundError:
            raise TaskError(f"{source}: no such file") from None


class Vanish(Copy):
    """Write what is in a file that is taken away meanwhile."""

    def make(self, job: StepJob) -> None:
        super().make(job)
        Path(*job.task.inputs).unlink()


class Fail(Step):
    """Write half, and fail."""

    foreseen: bool = True

    def make(self, job: StepJob) -> None:
        (job.folder / FILE).write_text("half")
        if self.foreseen:
            raise TaskError("it cannot be made; make another")
        raise KeyError("unforeseen")


class Stumble(Step):
    """Fail at writing a file."""

    file: str

    def make(self, job: StepJob) -> None:
        (job.folder / self.file).mkdir(parents=True)
        (job.folder / self.file).write_text("never")


class Forget(Step):
    """Make nothing."""

    def make(self, job: StepJob) -> None:
        pass


class Die(Step):
    """Write half and die of SIGKILL, so many times; then write all."""

    marker: str
    times: int
    words: str = ""

    def make(self, job: StepJob) -> None:
        (job.folder / FILE).write_text("half")
        with Path(self.marker).open("a") as stream:
            stream.write("x")
        if len(Path(self.marker).read_text()) <= self.times:
            os.write(2, self.words.encode())
            os.kill(os.getpid(), signal.SIGKILL)
        (job.folder / FILE).write_text("whole")


class ProcessId(Step):
    """Write who did it, after a while."""

    text: str
    seconds: float

    def make(self, job: StepJob) -> None:
        time.sleep(self.seconds)
        (job.folder / FILE).write_text(str(os.getpid()))


class FillDisk(Step):
    """What writing on a full disk comes to."""

    def make(self, job: StepJob) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(job.folder / FILE))


class Chatter(Step):
    """Print on the standard output as Blender does, from Python and from below, and say how far it is."""

    def make(self, job: StepJob) -> None:
        print("Saved: 'x.png'", flush=True)
        os.write(1, b"Fra:1 Mem:1M\n")
        job.progress(1, 2)
        time.sleep(0.5)
        (job.folder / FILE).write_text("spoken")


def _note(log: str, text: str) -> None:
    if log:
        with Path(log).open("a") as stream:
            stream.write(f"{text}\n")
