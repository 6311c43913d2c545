"""Doing one task, wherever that is: from an order to a folder with files, and a message of what came of it.

Nothing here touches a store, so it does not matter where it happens or how it ends: here, in a worker, in a Blender.
Orders and messages are pickled. How far a task is, it writes into a file beside its folder.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import stat
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, Self

from .steps import Input, Job, Step, TaskError, sha256_of

FULL_OR_FORBIDDEN = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM})
"""Errors at writing that the next task will have as well."""

NEARLY_NOTHING = 1 << 20
"""Bytes; where fewer are free, the disk is full whatever the program that failed says (Blender says little)."""

INTERVAL = 0.2
"""Seconds between two messages about how far a task is."""


@dataclass(frozen=True)
class Order:
    """A task to be done, and where."""

    step: Step
    parameters: Any
    before: tuple[str | None, ...]
    """The folders of the results of the tasks before it."""

    inputs: tuple[Input, ...]
    wanted: Mapping[str, str]
    """Files that the result must have, and where they will be for the user."""

    output: str
    folder: str
    """Where to write; not there yet."""

    blender: str = ""
    """The program that does it, if that is not to be this one."""


@dataclass(frozen=True)
class Made:
    """A task's files are in `folder`."""

    folder: str
    index: Mapping[str, Any]
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Failed:
    """A task cannot be done."""

    message: str
    details: str = ""
    """Where in the program, for an error that nobody foresaw."""

    hopeless: bool = False
    """Whether the others will fail for the same reason: the disk is full."""

    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Lost:
    """Whoever did a task is gone; nothing is known of the task itself, so it may be tried again."""

    message: str
    notes: Sequence[str] = ()


Tell = Callable[[float, str], object]


class Executor(Protocol):
    """Who does orders. A context; may be used again after `stop`."""

    capacity: int
    """How many orders it takes at a time."""

    def submit(self, order: Order, tell: Tell) -> Future[Made | Failed | Lost]:
        """Begin an order. How far it is, is told here, or written for `progress_of`."""

    def stop(self) -> None:
        """End what is at work, within a second."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


class SerialExecutor(Executor):
    """Does an order at once, in this process."""

    capacity = 1

    def submit(self, order: Order, tell: Tell) -> Future[Made | Failed | Lost]:
        future: Future[Made | Failed | Lost] = Future()
        future.set_result(perform(order, tell))
        return future

    def stop(self) -> None:
        pass


def processors() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def outcome_of(future: Future[Made | Failed | Lost]) -> Made | Failed | Lost:
    """What became of an order."""
    try:
        return future.result()
    except (CancelledError, Exception) as error:  # Of pebble's, or at unpickling; not of the task's.
        if code := getattr(error, "exitcode", None):
            return Lost(f"its process died ({_death(code)})")
        return Lost(f"its process failed: {type(error).__name__}: {error}")


def _death(code: int) -> str:
    if -code in {*signal.Signals}:
        name = signal.Signals(-code).name
        return f"{name}, perhaps for want of memory" if name == "SIGKILL" else name
    return f"exit code {code}"


class ExecutorError(Exception):
    """Why nothing can be done by these means, and the way out, in one line."""


def perform(order: Order, tell: Tell | None = None) -> Made | Failed | Lost:
    """Do a task. Its folder is there afterwards if it was made, and only then.

    Parameters
    ----------
    order : Order
    tell : callable, optional
        Takes the share that is done and what is being done; written into a file for `progress_of` unless given.
    """
    if order.step.blender and order.blender:
        from .blender import perform_in_blender

        return perform_in_blender(order, tell)
    job = Job(
        Path(order.folder),
        [None if before is None else Path(before) for before in order.before],
        [Path(one.path) for one in order.inputs],
        tell or _writing(order),
    )
    started = time.perf_counter()
    done: Made | Failed | None = None
    try:
        for one in order.inputs:
            if os.path.exists(one.path) and not os.path.isfile(one.path):
                raise TaskError(f"{one.path}: this is no file, but a folder, pipe or device; give a file")
        job.folder.mkdir(parents=True)
        facts = order.step.function(job, order.parameters)
        for one in order.inputs:
            if _changed(one):
                raise TaskError(f"{one.path}: this file changed while it was read; run the same command again")
        files = {path.relative_to(job.folder).as_posix(): path for path in sorted(job.folder.rglob("*"))}
        files = {name: _state_of(path) for name, path in files.items() if not path.is_dir()}
        for name, shown in order.wanted.items():
            if not name.endswith("/") and name not in files:
                raise TaskError(f"{shown}: this was to be made, and was not")
        index = {"files": files, "seconds": time.perf_counter() - started, "facts": dict(facts or {})}
        done = Made(order.folder, index, job.notes)
    except TaskError as error:
        done = Failed(str(error), notes=job.notes)
    except OSError as error:
        where = f"{_shown(error.filename, order)}: " if error.filename else ""
        own = str(error.filename or "").startswith(order.output)
        hopeless = error.errno in FULL_OR_FORBIDDEN and (own or error.errno == errno.ENOSPC)
        done = Failed(f"{where}{error.strerror or error}", traceback.format_exc(), hopeless, job.notes)
    except Exception as error:
        done = Failed(f"{type(error).__name__}: {error}", traceback.format_exc(), notes=job.notes)
    finally:
        with suppress(OSError):
            os.remove(f"{order.folder}.progress")
        if not isinstance(done, Made):
            shutil.rmtree(order.folder, ignore_errors=True)
    if isinstance(done, Failed) and not done.hopeless and _is_full(order.output):
        return Failed(f"{os.strerror(errno.ENOSPC)} ({done.message})", done.details, True, done.notes)
    return done


def progress_of(order: Order) -> tuple[float, str] | None:
    """How far an order is that is done elsewhere, and what is being done; None where nothing is known."""
    try:
        share, doing = json.loads(Path(f"{order.folder}.progress").read_text(encoding="utf-8"))
        return float(share), str(doing)
    except (OSError, ValueError, TypeError):
        return None


def _writing(order: Order) -> Callable[[float, str], None]:
    """What writes how far a task is for `progress_of`, not too often."""
    said_at = 0.0

    def tell(share: float, doing: str) -> None:
        nonlocal said_at
        if time.monotonic() - said_at >= INTERVAL:
            said_at = time.monotonic()
            with suppress(OSError):
                Path(f"{order.folder}.progress").write_text(json.dumps([share, doing]), encoding="utf-8")

    return tell


def _changed(one: Input) -> bool:
    try:
        found = os.stat(one.path)
    except (OSError, ValueError):
        return one.size >= 0
    return (found.st_size, found.st_mtime_ns) != (one.size, one.mtime_ns)


def _state_of(path: Path) -> tuple[int, int, str]:
    """Size, time of change and digest of a file."""
    found = path.lstat()
    if not stat.S_ISREG(found.st_mode):
        raise TaskError(f"{path.name}: this was to be a file")
    return found.st_size, found.st_mtime_ns, sha256_of(path)


def _shown(found: str | bytes | int, order: Order) -> str:
    """A path as the user knows it: the folder of a task at work is nobody's business."""
    path = str(found)
    name = Path(path).relative_to(order.folder).as_posix() if path.startswith(order.folder + os.sep) else ""
    # What takes a file's place when it is whole has a name that ends in the file's.
    known = [wanted for wanted in order.wanted if name and (name == wanted or name.endswith(wanted.rpartition("/")[2]))]
    if known:
        return order.wanted[max(known, key=len)]
    return path.replace(order.folder, order.output)


def _is_full(output: str) -> bool:
    try:
        return shutil.disk_usage(output).free < NEARLY_NOTHING
    except OSError:
        return False
