"""Worker processes of `pebble` that do orders on this machine.

Each worker has a pool for itself, so that whatever kills it costs the task that it was at, and nothing else. In a
worker tasks run in the main thread, as Blender wants it.
"""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import queue
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Self

from pebble import CONSTS, ProcessExpired, ProcessFuture, ProcessPool

from rigid_motion_batch.supervising import end_with_parent, join_session, session

from .performing import Failed, Lost, Made, Order, Tell, Told, perform, progress_of

CONSTS.term_timeout = 0.2
"""Seconds that a worker has to end by itself before it is killed: Blender at work does not listen."""

LOOK = 0.2
"""Seconds between two looks at how far tasks are."""


class ProcessExecutor:
    """Does orders in processes, which are started when there is work for them.

    Parameters
    ----------
    jobs : int
        How many there are at most.
    """

    def __init__(self, jobs: int) -> None:
        self.capacity = max(1, jobs)
        self._idle: list[ProcessPool] = []
        self._at_work: dict[ProcessFuture, tuple[Order, ProcessPool]] = {}
        self._ended: queue.SimpleQueue[ProcessFuture] = queue.SimpleQueue()
        self._logs: tempfile.TemporaryDirectory | None = None

    def submit(self, order: Order) -> None:
        with _without_interrupts():
            pool = self._pool()
            future = pool.schedule(perform, (order,))
        self._at_work[future] = order, pool
        future.add_done_callback(self._ended.put)

    def wait(self, tell: Tell, seconds: float) -> None:
        ends = time.monotonic() + seconds
        while self._at_work:
            try:
                future = self._ended.get(timeout=max(0.0, min(LOOK, ends - time.monotonic())))
            except queue.Empty:
                for order, _ in self._at_work.values():
                    if progress := progress_of(order):
                        tell(order, Told(order, *progress))
                if time.monotonic() >= ends:
                    return
                continue
            if future in self._at_work:
                order, pool = self._at_work.pop(future)
                message = self._message(future)
                if isinstance(message, Lost) and not pool.active:
                    _stop([pool])
                else:
                    self._idle.append(pool)
                tell(order, message)
                return

    def stop(self) -> None:
        pools = [*self._idle, *(pool for _, pool in self._at_work.values())]
        self._idle.clear()
        self._at_work.clear()
        _stop(pools)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        if self._logs:
            self._logs.cleanup()
            self._logs = None

    def _pool(self) -> ProcessPool:
        while self._idle:
            pool = self._idle.pop()
            if pool.active:
                return pool
            _stop([pool])  # Its worker was killed while it had nothing to do.
        if self._logs is None:
            self._logs = tempfile.TemporaryDirectory(prefix="rigid-motion-", ignore_cleanup_errors=True)
        spawn = multiprocessing.get_context("spawn")
        return ProcessPool(1, initializer=_begin, initargs=(self._logs.name, session()), context=spawn)

    def _message(self, future: ProcessFuture) -> Made | Failed | Lost:
        try:
            return future.result()
        except ProcessExpired as error:
            return Lost(f"its process died ({_death(error.exitcode)}){self._last_words(error.pid)}")
        except (CancelledError, Exception) as error:  # Of pebble's, or at unpickling; not of the task's.
            return Lost(f"its process failed: {type(error).__name__}: {error}")

    def _last_words(self, process: int | None) -> str:
        try:
            lines = Path(self._logs.name, f"{process}").read_text(encoding="utf-8", errors="replace").split("\n")
        except (OSError, AttributeError):
            return ""
        said = next((line.strip() for line in reversed(lines) if line.strip()), "")
        return f": {said[:200]}" if said else ""


def processors() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _begin(logs: str, command: str) -> None:
    """Begin a worker: it ends with its parent, and what libraries print in it goes into a file."""
    end_with_parent()
    join_session(command)
    # Where Blender is loaded in the parent, its own modules hide what brings them.
    sys.path[:] = [folder for folder in sys.path if not os.path.exists(os.path.join(folder, "addon_utils.py"))]
    log = os.open(Path(logs, f"{os.getpid()}"), os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    for stream in (1, 2):
        os.dup2(log, stream)
    faulthandler.enable()


def _stop(pools: list[ProcessPool]) -> None:
    for pool in pools:
        pool.stop()
    for pool in pools:
        with suppress(RuntimeError):
            pool.join()


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
