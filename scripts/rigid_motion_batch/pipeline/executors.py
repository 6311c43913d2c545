"""Worker processes of `pebble` that do jobs on this machine: whatever kills one costs its task alone.

In a worker tasks run in the main thread, as Blender wants it.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path

from pebble import CONSTS, ProcessPool

from rigid_motion_batch.supervising import end_with_parent, held_back, join_session, session

from .performing import Executor, Made, perform
from .steps import Job

CONSTS.term_timeout = 0.05
"""Seconds that a worker has to end by itself before it is killed: Blender at work does not listen."""


class ProcessExecutor(Executor):
    """Does jobs in processes, each with a pool for itself, which are started when there is work for them.

    Parameters
    ----------
    jobs : int
        How many there are at most.
    """

    def __init__(self, jobs: int) -> None:
        self.capacity = max(1, jobs)
        self._pools: list[ProcessPool] = []
        self._idle: list[ProcessPool] = []

    def submit(self, job: Job) -> Future[Made]:
        with held_back({signal.SIGINT}):  # Ctrl-C reaches this process alone, which decides what comes of it.
            pool = self._pool()
            future = pool.schedule(_perform, (job,))
        future.add_done_callback(lambda _: self._idle.append(pool))
        return future

    def stop(self) -> None:
        pools, self._pools, self._idle = self._pools, [], []
        for pool in pools:
            pool.stop()  # type: ignore[no-untyped-call]  # Pebble has no types there
        for pool in pools:
            with suppress(RuntimeError):
                pool.join()

    def _pool(self) -> ProcessPool:
        while self._idle:
            pool = self._idle.pop()
            if pool.active:  # And not killed while it had nothing to do.
                return pool
        spawn = multiprocessing.get_context("spawn")
        self._pools.append(ProcessPool(1, initializer=_begin, initargs=(session(),), context=spawn))
        return self._pools[-1]


def _begin(command: str) -> None:
    """Begin a worker: it ends with its parent, and no one sees what libraries print in it."""
    end_with_parent()
    join_session(command)
    # Where Blender is loaded in the parent, its own modules hide what brings them.
    sys.path[:] = [folder for folder in sys.path if not Path(folder, "addon_utils.py").exists()]
    _print_to(os.devnull)


def _perform(job: Job) -> Made:
    """Do a job in a worker. What is printed meanwhile is kept: of a worker that dies these are the last words."""
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
