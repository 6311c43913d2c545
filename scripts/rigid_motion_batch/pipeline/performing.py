"""Doing one task, wherever that is: from an order to a folder with files, and an answer.

Nothing here touches a store, so it does not matter where it happens or how it ends: here, in a worker, in a Blender.
Orders and answers are pickled. How far a task is, it writes into a file beside its folder.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import stat
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

from rigid_motion_batch.supervising import death

from .steps import Input, Job, Step, TaskError, sha256_of

FULL_OR_FORBIDDEN = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM})
"""Errors at writing that the next task will have as well."""

NEARLY_NOTHING = 1 << 20
"""Bytes; where fewer are free, the disk is full whatever the program that failed says (Blender says little)."""

INTERVAL = 0.2
"""Seconds between two messages about how far a task is."""

Tell = Callable[[float, str], object]
"""A function that takes the share of a task that is done, and what is being done."""


@dataclass(frozen=True)
class Order:
    """A task to be done, and where."""

    step: Step
    parameters: Any
    before: tuple[str | None, ...]
    """The folders of the results of the tasks before it."""

    inputs: tuple[Input, ...]
    requested: Mapping[str, str]
    """Files that the result must have, and where they will be for the user."""

    output: str
    folder: str
    """The folder to write into; not there yet."""

    blender: str = ""
    """The program that does it, if that is not to be this one."""

    here: str = field(default_factory=os.getcwd)
    """The folder where relative paths start."""


@dataclass(frozen=True)
class Answer:
    """Result of an order."""

    index: Mapping[str, Any] | None = None
    """Index of the files that are in its folder now; None where nothing was made."""

    problem: str = ""
    """The reason why nothing was made, in one line."""

    details: str = ""
    """The place in the program, for an error that was not foreseen."""

    fatal: bool = False
    """True if the others will fail for the same reason: the disk is full."""

    lost: bool = False
    """True if whoever did it is gone; nothing is known of the task itself, so it may be tried again."""

    notes: Sequence[str] = ()


class ExecutorError(Exception):
    """Error that says why nothing can be done by these means, and the way out, in one line."""


class Executor:
    """Executor of orders: this class at once, in this process. A context; may be used again after `stop`."""

    capacity = 1
    """Number of orders that it takes at a time."""

    def submit(self, order: Order, tell: Tell) -> Future[Answer]:
        """Begin an order, whose result `answer_of` returns. Its progress is reported, or written for `progress_of`."""
        future: Future[Answer] = Future()
        future.set_result(perform(order, tell))
        return future

    def stop(self) -> None:
        """End what is at work, within a second."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def answer_of(future: Future[Answer], order: Order) -> Answer:
    """Return what came of an order that was submitted."""
    try:
        return future.result()
    except (CancelledError, Exception) as error:  # Of whoever was to do it; not of the task's.
        if isinstance(error, CancelledError):
            return Answer(problem="its worker is gone", lost=True)
        code = getattr(error, "exitcode", None)
        how = f"died ({death(code)})" if code else f"failed: {type(error).__name__}: {error}"
        return Answer(problem=f"its process {how}{last_words(log_of(order))}", lost=True)


def log_of(order: Order) -> Path:
    """Return the file into which a worker prints what libraries print while it does an order."""
    return Path(f"{order.folder}.log")


def last_words(log: Path) -> str:
    """Return the last line of a log, behind a colon; nothing where there is none."""
    with suppress(OSError):
        said = [line.strip() for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
        return f": {said[-1][:200]}" if said else ""
    return ""


def perform(order: Order, tell: Tell | None = None) -> Answer:
    """Do a task. Its folder is there afterwards if it was made, and only then.

    Parameters
    ----------
    order : Order
    tell : callable, optional
        Given how far it is, which is written into a file for `progress_of` unless given.
    """
    if order.step.blender and order.blender:
        from .blender import perform_in_blender

        return perform_in_blender(order, tell)
    before = [None if one is None else Path(one) for one in order.before]
    job = Job(Path(order.folder), before, [Path(one.path) for one in order.inputs], tell or _writing(order))
    started, answer = time.perf_counter(), Answer()
    try:
        for one in order.inputs:
            if os.path.exists(one.path) and not os.path.isfile(one.path):
                raise TaskError(f"{one.path}: this is no file, but a folder, pipe or device; give a file")
        job.folder.mkdir(parents=True)
        facts = order.step.function(job, order.parameters)
        for one in order.inputs:
            if _changed(one):
                raise TaskError(f"{one.path}: this file changed while it was read; run the same command again")
        paths = [path for path in sorted(job.folder.rglob("*")) if not path.is_dir()]
        files = {path.relative_to(job.folder).as_posix(): _state_of(path) for path in paths}
        for name, shown in order.requested.items():
            if not name.endswith("/") and name not in files:
                raise TaskError(f"{shown}: this was to be made, and was not")
        answer = Answer({"files": files, "seconds": time.perf_counter() - started, "facts": dict(facts or {})})
    except TaskError as error:
        answer = Answer(problem=str(error))
    except OSError as error:
        where = f"{_shown(error.filename, order)}: " if error.filename else ""
        is_own = str(error.filename or "").startswith(order.output)
        fatal = error.errno in FULL_OR_FORBIDDEN and (is_own or error.errno == errno.ENOSPC)
        answer = Answer(None, f"{where}{error.strerror or error}", traceback.format_exc(), fatal)
    except Exception as error:
        answer = Answer(None, f"{type(error).__name__}: {error}", traceback.format_exc())
    finally:
        with suppress(OSError):
            os.remove(f"{order.folder}.progress")
        if answer.index is None:
            shutil.rmtree(order.folder, ignore_errors=True)
    if answer.problem and not answer.fatal and _is_full(order.output):
        answer = replace(answer, problem=f"{os.strerror(errno.ENOSPC)} ({answer.problem})", fatal=True)
    return replace(answer, notes=job.notes)


def progress_of(order: Order) -> tuple[float, str] | None:
    """Return how far an order is that is done elsewhere, and what is being done; None where nothing is known."""
    try:
        share, doing = json.loads(Path(f"{order.folder}.progress").read_text(encoding="utf-8"))
        return float(share), str(doing)
    except (OSError, ValueError, TypeError):
        return None


def _writing(order: Order) -> Tell:
    """Return a function that writes how far a task is for `progress_of`, not too often."""
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
        result = os.stat(one.path)
    except (OSError, ValueError):
        return one.size >= 0
    return (result.st_size, result.st_mtime_ns) != (one.size, one.mtime_ns)


def _state_of(path: Path) -> tuple[int, int, str]:
    """Return size, time of change and digest of a file."""
    result = path.lstat()
    if not stat.S_ISREG(result.st_mode):
        raise TaskError(f"{path.name}: this was to be a file")
    return result.st_size, result.st_mtime_ns, sha256_of(path)


def _shown(result: str | bytes | int, order: Order) -> str:
    """Return a path as the user knows it: the folder of a task at work is left out."""
    path = str(result)
    name = Path(path).relative_to(order.folder).as_posix() if path.startswith(order.folder + os.sep) else ""
    # What takes a file's place when it is whole has a name that ends in the file's.
    known = [
        requested
        for requested in order.requested
        if name and (name == requested or name.endswith(requested.rpartition("/")[2]))
    ]
    if known:
        return order.requested[max(known, key=len)]
    return path.replace(order.folder, order.output)


def _is_full(output: str) -> bool:
    try:
        return shutil.disk_usage(output).free < NEARLY_NOTHING
    except OSError:
        return False
