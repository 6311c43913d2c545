"""Steps for the tests of work plans: what they do can be seen from outside, in files."""

from __future__ import annotations

import errno
import json
import os
import signal
import time
from pathlib import Path

from rigid_motion_batch.workplan import Job, TaskError, step


@step
def write(job: Job, *, path: str, text: str = "", log: str = "") -> dict[str, int]:
    """Write a text, and note in a log that it was done."""
    _note(log, path)
    job.writes(path).write_text(text)
    return {"characters": len(text)}


@step
def write_all(job: Job, *, texts: dict[str, str], more: str = "") -> None:
    """Write several outputs, and something that is none."""
    for path, text in texts.items():
        job.writes(path).write_text(text)
    if more:
        job.writes(path).with_name(more).write_text("left over")


@step
def join(job: Job, *, path: str, parts: list[str], log: str = "") -> None:
    """Write what is in the parts that are there."""
    _note(log, path)
    job.writes(path).write_text("".join(job.reads(part).read_text() for part in parts if job.reads(part).is_file()))


@step
def copy(job: Job, *, source: str, path: str, log: str = "") -> None:
    """Write what is in a file from outside."""
    _note(log, path)
    try:
        job.writes(path).write_text(Path(source).read_text())
    except FileNotFoundError:
        raise TaskError(f"{source}: no such file") from None


@step
def vanish(job: Job, *, source: str, path: str) -> None:
    """Write what is in a file that is taken away meanwhile."""
    job.writes(path).write_text(Path(source).read_text())
    Path(source).unlink()


@step
def fail(job: Job, *, path: str, foreseen: bool = True) -> None:
    """Write half, and fail."""
    job.writes(path).write_text("half")
    if foreseen:
        raise TaskError(f"{path}: cannot be made; make another")
    raise KeyError(path)


@step
def stumble(job: Job, *, path: str, beside: str = "") -> None:
    """Fail at writing an output, or what is to take its place."""
    place = job.writes(path)
    place = place.with_name(f"{beside}{place.name}")
    place.mkdir()
    place.write_text("never")


@step
def forget(job: Job, *, path: str) -> None:
    """Make nothing."""


@step
def die(job: Job, *, path: str, marker: str, times: int) -> None:
    """Write half and die of SIGKILL, so many times; then write all."""
    job.writes(path).write_text("half")
    with Path(marker).open("a") as stream:
        stream.write("x")
    if len(Path(marker).read_text()) <= times:
        os.kill(os.getpid(), signal.SIGKILL)
    job.writes(path).write_text("whole")


@step
def sleep(job: Job, *, path: str, seconds: float, log: str = "") -> None:
    """Take a time in which nothing is said, and cannot be interrupted from within."""
    _note(log, path)
    job.writes(path).write_text("half")
    ends = time.monotonic() + seconds
    while time.monotonic() < ends:
        try:
            time.sleep(max(0.0, ends - time.monotonic()))
        except Exception:
            continue
    job.writes(path).write_text(f"{os.getpid()}")


@step
def fill_disk(job: Job, *, path: str) -> None:
    """What writing on a full disk comes to."""
    job.writes(path).write_text("half")
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(job.writes(path)))


@step
def chatter(job: Job, *, path: str) -> None:
    """Print on the standard output as Blender does, from Python and from below."""
    print("Saved: 'x.png'", flush=True)
    os.write(1, b"Fra:1 Mem:1M\n")
    job.progress(1, 2, "half way")
    job.note(f"{path} is nearly there")
    job.writes(path).write_text("spoken")


@step
def process_id(job: Job, *, path: str) -> None:
    """Write who did it."""
    job.writes(path).write_text(str(os.getpid()))


@step
def hoard(job: Job, *, path: str, megabytes: int) -> None:
    """Take memory for a moment."""
    job.writes(path).write_text(f"{os.getpid()} {sum(bytearray(megabytes << 20)[::4096])}")


def unmarked(job: Job, *, path: str) -> None:
    """Not a step."""
    job.writes(path).write_text("never")


def _note(log: str, text: str) -> None:
    if log:
        with Path(log).open("a") as stream:
            stream.write(f"{text}\n")


@step
def identify(job: Job, *, path: str) -> None:
    """Say which version this is."""
    job.writes(path).write_text("1")


@step
def parse(job: Job, *, path: str, part: str) -> None:
    """Write the values that another task has written as JSON."""
    job.writes(path).write_text(",".join(map(str, json.loads(job.reads(part).read_text()).values())))


@step
def count(job: Job, *, path: str, to: int) -> None:
    """Say how far it is, one by one."""
    for number in range(to):
        job.progress(number + 1, to)
    job.writes(path).write_text("counted")
