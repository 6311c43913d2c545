"""Worker processes of `pebble` that do orders on this machine: whatever kills one costs its task alone.

In a worker tasks run in the main thread, as Blender wants it.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress

from pebble import CONSTS, ProcessPool

from rigid_motion_batch.supervising import end_with_parent, join_session, session

from .performing import Executor, Failed, Lost, Made, Order, Tell, perform

CONSTS.term_timeout = 0.05
"""Seconds that a worker has to end by itself before it is killed: Blender at work does not listen."""


class ProcessExecutor(Executor):
    """Does orders in processes, each with a pool for itself, which are started when there is work for them.

    Parameters
    ----------
    jobs : int
        How many there are at most.
    """

    def __init__(self, jobs: int) -> None:
        self.capacity = max(1, jobs)
        self._pools: list[ProcessPool] = []
        self._idle: list[ProcessPool] = []

    def submit(self, order: Order, tell: Tell) -> Future[Made | Failed | Lost]:
        with _without_interrupts():
            pool = self._pool()
            future = pool.schedule(perform, (order,))
        future.add_done_callback(lambda _: self._idle.append(pool))
        return future

    def stop(self) -> None:
        pools, self._pools, self._idle = self._pools, [], []
        for pool in pools:
            pool.stop()
        for pool in pools:
            with suppress(RuntimeError):
                pool.join()

    def _pool(self) -> ProcessPool:
        while self._idle:
            if (pool := self._idle.pop()).active:  # And not killed while it had nothing to do.
                return pool
        spawn = multiprocessing.get_context("spawn")
        self._pools.append(ProcessPool(1, initializer=_begin, initargs=(session(),), context=spawn))
        return self._pools[-1]


def _begin(command: str) -> None:
    """Begin a worker: it ends with its parent, and nobody sees what libraries print in it."""
    end_with_parent()
    join_session(command)
    # Where Blender is loaded in the parent, its own modules hide what brings them.
    sys.path[:] = [folder for folder in sys.path if not os.path.exists(os.path.join(folder, "addon_utils.py"))]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Have Ctrl-C reach this process alone, and none that is started meanwhile: the parent decides what comes of it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
