"""Who does orders: this process, or worker processes of `pebble`, where whatever kills one costs its task alone.

In a worker tasks run in the main thread, as Blender wants it.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager, suppress
from typing import Protocol, Self

from pebble import CONSTS, ProcessExpired, ProcessPool

from rigid_motion_batch.supervising import end_with_parent

from .performing import Failed, Lost, Made, Order, perform

CONSTS.term_timeout = 0.05
"""Seconds that a worker has to end by itself before it is killed: Blender at work does not listen."""

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
        self._pools.append(ProcessPool(1, initializer=_begin, context=multiprocessing.get_context("spawn")))
        return self._pools[-1]


def outcome_of(future: Future[Made | Failed | Lost]) -> Made | Failed | Lost:
    """What became of an order."""
    try:
        return future.result()
    except ProcessExpired as error:
        return Lost(f"its process died ({_death(error.exitcode)})")
    except (CancelledError, Exception) as error:  # Of pebble's, or at unpickling; not of the task's.
        return Lost(f"its process failed: {type(error).__name__}: {error}")


def processors() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _begin() -> None:
    """Begin a worker: it ends with its parent, and nobody sees what libraries print in it."""
    end_with_parent()
    # Where Blender is loaded in the parent, its own modules hide what brings them.
    sys.path[:] = [folder for folder in sys.path if not os.path.exists(os.path.join(folder, "addon_utils.py"))]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)


def _death(code: int) -> str:
    if code is not None and -code in {*signal.Signals}:
        name = signal.Signals(-code).name
        return f"{name}, perhaps for want of memory" if name == "SIGKILL" else name
    return f"exit code {code}"


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
