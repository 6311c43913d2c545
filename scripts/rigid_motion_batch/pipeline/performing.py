"""Doing one job, wherever that is: a folder with files comes of it, or a `TaskError`.

Nothing here touches a store, so it does not matter where it happens or how it ends: here, in a worker, in a Blender.
Jobs and what comes of them are pickled.
"""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import time
import traceback
import uuid
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from typing import Any, Self

from rigid_motion_batch.supervising import death

from .steps import Job, TaskError, sha256_in, sha256_of

Made = dict[str, Any]
"""What a job has made: the `folder`, its `files` with size, time of change and digest, the `seconds` that it took, and
`facts` that the step has returned."""

FULL_OR_FORBIDDEN = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM})
"""Errors at writing that the next task will have as well."""

NEARLY_NOTHING = 1 << 20
"""Bytes; where fewer are free, the disk is full whatever the program that failed says (Blender says little)."""


class ExecutorError(Exception):
    """Error that says why nothing can be done by these means, and the way out, in one line."""


class Executor:
    """Executor of jobs: this class at once, in this process. A context; may be used again after `stop`."""

    capacity = 1
    """Number of jobs that it takes at a time."""

    def submit(self, job: Job) -> Future[Made]:
        """Begin a job. Its future raises TaskError where it failed, and others where who did it is gone: see `loss`."""
        future: Future[Made] = Future()
        try:
            future.set_result(perform(job))
        except Exception as error:
            future.set_exception(error)
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


def loss(error: BaseException, job: Job) -> str:
    """Return how it came that a job has no result, and no error of its own: it may be tried again."""
    if isinstance(error, CancelledError):
        return "its worker is gone"
    code = getattr(error, "exitcode", None) or getattr(error, "returncode", None)
    how = f"died ({death(code)})" if code else f"failed: {type(error).__name__}: {error}"
    return f"its process {how}{job.last_words()}"


def perform(job: Job) -> Made:
    """Do a job. Raises TaskError, and CalledProcessError where a Blender died."""
    # Another who does it at the same time, and was taken for dead, is not in the way.
    job.folder = job.place / uuid.uuid4().hex[:8]
    try:
        return _make(job)
    except subprocess.CalledProcessError:
        raise
    except Exception as error:
        problem = _problem(error, job)
        with suppress(OSError):
            if not problem.fatal and shutil.disk_usage(job.output).free < NEARLY_NOTHING:
                problem.args, problem.fatal = (f"{os.strerror(errno.ENOSPC)} ({problem})",), True
        raise problem from None


def _make(job: Job) -> Made:
    """Have the files of a job written."""
    started, task = time.perf_counter(), job.task
    for item in task.inputs:
        if os.path.exists(item.path) and not os.path.isfile(item.path):
            raise TaskError(f"{item.path}: this is no file, but a folder, pipe or device; give a file")
    job.folder.mkdir(parents=True)
    if job.blender and task.step.blender:
        from .blender import call_in_blender

        facts = call_in_blender(job)
    else:
        facts = task.step.function(job, task.parameters)
    for item in task.inputs:
        if sha256_in(item.path) != item.sha256:
            raise TaskError(f"{item.path}: this file changed while it was read; run the same command again")
    files = {}
    for path in sorted(job.folder.rglob("*")):
        if path.is_file() and not path.is_symlink():
            status = path.stat()
            files[path.relative_to(job.folder).as_posix()] = status.st_size, status.st_mtime_ns, sha256_of(path)
    for name, place in task.publish.items():
        if not name.endswith("/") and name not in files:
            raise TaskError(f"{job.output / place}: this was to be made, and was not")
    return {"folder": job.folder, "files": files, "seconds": time.perf_counter() - started, "facts": facts or {}}


def _problem(error: Exception, job: Job) -> TaskError:
    """Return an error as one of the task, with its place in the program where nobody foresaw it."""
    if isinstance(error, TaskError):
        return error
    problem = TaskError(f"{type(error).__name__}: {error}")
    if isinstance(error, OSError):
        path = str(error.filename or "")
        # The user knows where files will be, and not the folder of a task at work.
        known = job.task.publish.get(path.removeprefix(f"{job.folder}{os.sep}").replace(os.sep, "/"))
        shown = os.fspath(job.output / known) if known else path.replace(str(job.folder), str(job.output))
        problem = TaskError(": ".join(filter(None, (shown, error.strerror or str(error)))))
        is_own = path.startswith(str(job.output)) or error.errno == errno.ENOSPC
        problem.fatal = error.errno in FULL_OR_FORBIDDEN and is_own
    problem.details = traceback.format_exc()
    return problem
