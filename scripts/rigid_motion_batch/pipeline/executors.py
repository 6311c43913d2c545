"""Executors of jobs: in this process, or in worker processes, where a crash costs only the job of that worker.

A job results in a folder with files, or in a `TaskError`. Nothing here touches a store, so a job can run and end
anywhere: here, in a worker, or in a Blender of the user's, one program per job, which has the standard library, NumPy
and bpy. Jobs and their results are pickled.
"""

from __future__ import annotations

import errno
import multiprocessing
import os
import pickle
import shutil
import signal
import subprocess
import sys
import threading
import traceback
from concurrent.futures import Future
from contextlib import AbstractContextManager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, cast

from rigid_motion_batch.places import EXTENSION, PACKAGE
from rigid_motion_batch.supervising import death, end_with_parent, held_back, join_session, session

from .steps import StepJob, TaskError, sha256_in, sha256_of

Made = dict[str, Any]
"""The result of a job: its `folder`, its `files` with size, modification time and digest, and the `facts` that its step
returned."""

FULL_OR_FORBIDDEN = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM})
"""Errors of writing that would also fail the next task."""

PROGRAM = """import sys
place, *path = sys.argv[sys.argv.index("--") + 1 :]
sys.path[:0] = path
from rigid_motion_batch.pipeline.executors import perform_in_blender
perform_in_blender(place)"""


class Executor(AbstractContextManager["Executor"]):
    """Executor of jobs: this class runs each at once, in this process. A context; can be used again after `stop`."""

    capacity = 1
    """The number of jobs that it takes at a time."""

    def submit(self, job: StepJob) -> Future[Made]:
        """Start a job. Its future raises TaskError if the job failed, another error if its process died: see `loss`."""
        future: Future[Made] = Future()
        try:
            future.set_result(perform(job))
        except Exception as error:
            future.set_exception(error)
        return future

    def stop(self) -> None:
        """Stop all running jobs, within a second."""

    def __exit__(self, *_: object) -> None:
        self.stop()


class ProcessExecutor(Executor):
    """Executor that runs several jobs at a time, in processes that are started when there is work for them.

    Jobs run in the main thread of a process, as Blender requires. Each process has a `pebble` pool of its own: a larger
    pool may lose a job if its process is killed while taking it. Raises ImportError without `pebble`.
    """

    def __init__(self, jobs: int) -> None:
        import pebble

        pebble.CONSTS.term_timeout = 0.05  # Blender does not react while it works, so it is killed.
        self.capacity = max(1, jobs)
        spawn = multiprocessing.get_context("spawn")
        self._new_pool = partial(
            pebble.ProcessPool, 1, initializer=_initialize_worker, initargs=(session(),), context=spawn
        )
        self._pools: dict[Any, Future[Made]] = {}
        """The last job of each pool."""

    def submit(self, job: StepJob) -> Future[Made]:
        with held_back({signal.SIGINT}):  # Ctrl-C reaches this process only, which decides what to do.
            idle = (pool for pool, last in self._pools.items() if last.done() and pool.active)
            pool = next(idle, None) or self._new_pool()
            self._pools[pool] = pool.schedule(_perform, (job,))
        return self._pools[pool]

    def stop(self) -> None:
        for pool in self._pools:
            pool.stop()
        for pool in self._pools:
            with suppress(RuntimeError):
                pool.join()


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def loss(error: BaseException, job: StepJob) -> str:
    """Return why a job has neither a result nor an error of its own; the job may be tried again."""
    code = getattr(error, "exitcode", None) or getattr(error, "returncode", None)
    how = f"died ({death(code)})" if code else f"failed: {type(error).__name__}: {error}"
    log = job.place / "log"
    printed = log.read_text(encoding="utf-8", errors="replace").strip() if log.exists() else ""
    return ": ".join(filter(None, [f"its process {how}", printed.rpartition("\n")[2][:200]]))


def perform(job: StepJob) -> Made:
    """Do a job. Raises TaskError, or CalledProcessError if a Blender died."""
    if job.blender and job.task.step.blender:
        return _made_by_blender(job)
    try:
        return _write_result(job)
    except Exception as error:
        problem = _as_task_error(error, job)
        with suppress(OSError):  # Blender's messages about a full disk say little.
            if not problem.fatal and shutil.disk_usage(job.output).free < 1 << 20:
                problem.args, problem.fatal = (f"{os.strerror(errno.ENOSPC)} ({problem})",), True
        raise problem from None


def _write_result(job: StepJob) -> Made:
    """Write the files of a job, and return its result."""
    task = job.task
    job.folder.mkdir(parents=True)
    facts = task.step.make(job)
    for path, digest in task.inputs.items():
        if sha256_in(path) != digest:
            raise TaskError(f"{path}: this file changed while it was read; run the same command again")
    files = {}
    for made in sorted(job.folder.rglob("*")):
        if made.is_file() and not made.is_symlink():
            status = made.stat()
            files[made.relative_to(job.folder).as_posix()] = status.st_size, status.st_mtime_ns, sha256_of(made)
    for name, place in task.publish.items():
        if not name.endswith("/") and name not in files:
            raise TaskError(f"{job.output / place}: this was to be made, and was not")
    return {"folder": job.folder, "files": files, "facts": facts or {}}


def _as_task_error(error: Exception, job: StepJob) -> TaskError:
    """Return an error as one of the task, with a traceback if it was unexpected."""
    if isinstance(error, TaskError):
        return error
    problem = TaskError(f"{type(error).__name__}: {error}")
    if isinstance(error, OSError):
        path = str(error.filename or "")
        # Show the place where the file will be published: the user does not know the folder of a running task.
        known = job.task.publish.get(path.removeprefix(f"{job.folder}{os.sep}").replace(os.sep, "/"))
        shown = os.fspath(job.output / known) if known else path.replace(str(job.folder), str(job.output))
        problem = TaskError(": ".join(filter(None, (shown, error.strerror or str(error)))))
        is_own = path.startswith(str(job.output)) or error.errno == errno.ENOSPC
        problem.fatal = error.errno in FULL_OR_FORBIDDEN and is_own
    problem.details = traceback.format_exc()
    return problem


# -- in a process of its own ------------------------------------------------------------------------------------------


def _initialize_worker(command: str) -> None:
    """Initialize a worker: it ends with its parent, and output of libraries is discarded."""
    end_with_parent()
    join_session(command)
    # If the parent has loaded Blender, Blender's modules hide the package that contains them.
    sys.path[:] = [folder for folder in sys.path if not Path(folder, "addon_utils.py").exists()]
    _print_to(os.devnull)


def _perform(job: StepJob) -> Made:
    """Do a job in a worker. Printed output goes into a log, which is read if the worker dies."""
    with suppress(OSError):
        os.chdir(job.here)
    job.place.mkdir(parents=True, exist_ok=True)
    _print_to(job.place / "log")
    try:
        return perform(job)
    finally:
        _print_to(os.devnull)


def _print_to(path: str | Path) -> None:
    opened = os.open(path, os.O_WRONLY | os.O_CREAT, 0o600)
    for stream in (1, 2):
        os.dup2(opened, stream)
    os.close(opened)


# -- in a Blender of the user's ---------------------------------------------------------------------------------------


def _made_by_blender(job: StepJob) -> Made:
    """Do a job in a Blender process of its own."""
    job.place.mkdir(parents=True, exist_ok=True)
    (job.place / "job").write_bytes(pickle.dumps(replace(job, blender="")))
    module = sys.modules[type(job.task.step).__module__]  # The module may be outside this package.
    root = Path(cast(str, module.__file__)).resolve().parents[module.__name__.count(".")]
    command = [job.blender, "--background", "--factory-startup", "--python-exit-code", "1", "--python-expr", PROGRAM]
    command += ["--", *map(os.fspath, (job.place.absolute(), PACKAGE.parent, EXTENSION.parent, root))]
    with (job.place / "log").open("ab") as log:
        parent = subprocess.PIPE  # Its end tells Blender that this process is gone.
        before = end_with_parent if sys.platform == "linux" else None
        subprocess.check_call(command, stdin=parent, stdout=log, stderr=log, preexec_fn=before)
    answer = pickle.loads((job.place / "answer").read_bytes())
    if isinstance(answer, Exception):
        raise answer
    return cast(Made, answer)


def perform_in_blender(place: str) -> None:
    """Do the job in a folder, inside the Blender that was started for it."""
    threading.Thread(target=lambda: (sys.stdin.buffer.read(), os._exit(1)), daemon=True).start()
    done = Executor().submit(pickle.loads(Path(place, "job").read_bytes()))
    Path(place, "answer").write_bytes(pickle.dumps(done.exception() or done.result()))
    # Not sys.exit: Blender can take long to shut down.
    os._exit(0)
