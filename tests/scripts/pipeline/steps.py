"""Steps for the tests of the pipeline: what they do can be seen from outside, in files."""

from __future__ import annotations

import errno
import json
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

from rigid_motion_batch.pipeline.steps import Job, TaskError, step

FILE = "out.txt"
"""The one file that every result has."""


@dataclass(frozen=True)
class Write:
    text: str = ""
    log: str = ""
    seconds: float = 0.0
    files: tuple[str, ...] = ()
    """More of them, with the same text."""


@dataclass(frozen=True)
class Nothing:
    log: str = ""


@dataclass(frozen=True)
class Die:
    marker: str
    times: int
    words: str = ""


@dataclass(frozen=True)
class Fail:
    foreseen: bool = True


@dataclass(frozen=True)
class Count:
    to: int


@step(stage="write")
def write(job: Job, parameters: Write) -> dict[str, int]:
    """Write a text, and note in a log that it was done."""
    _note(parameters.log, parameters.text)
    (job.folder / FILE).write_text("half")
    time.sleep(parameters.seconds)
    for name in (FILE, *parameters.files):
        place = job.folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(parameters.text)
    return {"characters": len(parameters.text)}


@step(stage="join")
def join(job: Job, parameters: Nothing) -> None:
    """Write what is in the results before it that are there."""
    _note(parameters.log, "join")
    (job.folder / FILE).write_text("".join((folder / FILE).read_text() for folder in job.before if folder))


@step(stage="report", partial=True)
def report(job: Job, parameters: Nothing) -> None:
    """The same, also where some are missing."""
    join.function(job, parameters)


@step()
def copy(job: Job, parameters: Nothing) -> None:
    """Write what is in a file from outside."""
    _note(parameters.log, "copy")
    try:
        (job.folder / FILE).write_text(job.inputs[0].read_text())
    except FileNotFoundError:
        raise TaskError(f"{job.inputs[0]}: no such file") from None


@step()
def vanish(job: Job, parameters: Nothing) -> None:
    """Write what is in a file that is taken away meanwhile."""
    copy.function(job, parameters)
    job.inputs[0].unlink()


@step()
def fail(job: Job, parameters: Fail) -> None:
    """Write half, and fail."""
    (job.folder / FILE).write_text("half")
    if parameters.foreseen:
        raise TaskError("it cannot be made; make another")
    raise KeyError("unforeseen")


@step()
def stumble(job: Job, parameters: Write) -> None:
    """Fail at writing a file."""
    (job.folder / parameters.text).mkdir(parents=True)
    (job.folder / parameters.text).write_text("never")


@step()
def forget(job: Job, parameters: Nothing) -> None:
    """Make nothing."""


@step()
def die(job: Job, parameters: Die) -> None:
    """Write half and die of SIGKILL, so many times; then write all."""
    (job.folder / FILE).write_text("half")
    with Path(parameters.marker).open("a") as stream:
        stream.write("x")
    if len(Path(parameters.marker).read_text()) <= parameters.times:
        os.write(2, parameters.words.encode())
        os.kill(os.getpid(), signal.SIGKILL)
    (job.folder / FILE).write_text("whole")


@step()
def process_id(job: Job, parameters: Write) -> None:
    """Write who did it, after a while."""
    time.sleep(parameters.seconds)
    (job.folder / FILE).write_text(str(os.getpid()))


@step()
def fill_disk(job: Job, parameters: Nothing) -> None:
    """What writing on a full disk comes to."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(job.folder / FILE))


@step()
def chatter(job: Job, parameters: Nothing) -> None:
    """Print on the standard output as Blender does, from Python and from below, and say how far it is."""
    print("Saved: 'x.png'", flush=True)
    os.write(1, b"Fra:1 Mem:1M\n")
    job.progress(1, 2, "half way")
    time.sleep(0.5)
    job.note("it is nearly there")
    (job.folder / FILE).write_text("spoken")


@step()
def parse(job: Job, parameters: Nothing) -> None:
    """Write the values that another task has written as JSON."""
    (job.folder / FILE).write_text(",".join(map(str, json.loads((job.before[0] / FILE).read_text()).values())))


@step()
def count(job: Job, parameters: Count) -> None:
    """Say how far it is, one by one."""
    for number in range(parameters.to):
        job.progress(number + 1, parameters.to)
    (job.folder / FILE).write_text("counted")


def _note(log: str, text: str) -> None:
    if log:
        with Path(log).open("a") as stream:
            stream.write(f"{text}\n")
