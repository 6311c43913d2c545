"""Many machines: orders are done by the workers of a Dask scheduler, with the output folder on a disk that all share.

Every worker is asked first which version of the program it has, and whether it sees the folder; tasks go only to those
that fit. Each thread of a worker hands its tasks to a process of its own, for Blender is not made for threads, and so
that a task which nobody wants any more can be ended. Dask gives a task of a worker that died to another one.
"""

from __future__ import annotations

import asyncio
import logging
import os
import queue
import time
import uuid
from collections import deque
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Self

from distributed import Client, Future, KilledWorker, Security, get_worker
from distributed.comm import connect

from .executors import ProcessExecutor, Tell
from .performing import ExecutorError, Failed, Lost, Made, Order, Told, progress_of, write_progress
from .steps import version_here

CONNECTING = 5.0
"""Seconds that a scheduler has to answer."""

LOOK = 1.0
"""Seconds between two looks at which workers there are, and at whether a task is still wanted."""

PROGRESS = 0.2
"""Seconds between two looks at how far tasks are."""

ANSWER = 10.0
"""Seconds for the result of a task that is done."""

UNREACHABLE = (OSError, RuntimeError, TimeoutError, CancelledError)
"""What Dask raises where its scheduler does not answer."""


LOADED = version_here()
"""The version that this process was started with, whatever was done to the files since."""


# -- what a worker does -----------------------------------------------------------------------------------------------

_idle: dict[str, deque[ProcessExecutor]] = {}
"""Session to the processes that wait for its next task."""


def identify(folder: str) -> str:
    """The version of the program here; where a folder of the run is not seen, that."""
    return LOADED if os.path.isdir(folder) else f"it does not see {folder}; choose one on a disk that all share"


def retire(session: str) -> None:
    """End the processes of a run that is over."""
    for executor in _idle.pop(session, ()):
        executor.__exit__()


def do(order: Order, session: str) -> Made | Failed | Lost:
    """Do an order, as a task of Dask's, in a process that is kept for the run.

    Its folder is the beginning of the name of that which is used: where Dask has it done twice, the one does not get
    in the way of the other.
    """
    worker = get_worker()
    key = worker.get_current_task()
    ended: list[Made | Failed | Lost] = []

    def hear(_: Order, message: Told | Made | Failed | Lost) -> None:
        if isinstance(message, Told):
            write_progress(order, message.share, message.doing)
        else:
            ended.append(message)

    idle = _idle.setdefault(session, deque())
    try:
        executor = idle.pop()
    except IndexError:
        executor = ProcessExecutor(1)
    try:
        executor.submit(replace(order, folder=f"{order.folder}-{uuid.uuid4().hex[:8]}"))
        while not ended:
            executor.wait(hear, PROGRESS)
            task = worker.state.tasks.get(key)
            if not ended and (task is None or task.state == "cancelled"):
                return Lost("it was stopped")
    finally:
        if ended:
            idle.append(executor)
        else:
            executor.__exit__()
    return ended[0]


# -- what the run does ------------------------------------------------------------------------------------------------


class DaskExecutor:
    """Does orders on the workers of a Dask scheduler.

    Parameters
    ----------
    address : str
        Of the scheduler: tcp://HOST:8786, or tls:// with the certificates in Dask's configuration.
    folder : Path
        One of this run in the output folder, which all workers must see.
    note : callable
        Takes a line for the user about the workers.

    Raises
    ------
    ExecutorError
        On entering, where no scheduler answers, or all its workers are unfit.
    """

    def __init__(self, address: str, folder: Path, note: Callable[[str], object]) -> None:
        self._address, self._folder, self._note = address, folder, note
        self._session = uuid.uuid4().hex
        self._workers: dict[str, int] = {}
        """The addresses of those that fit, and how many threads they have."""
        self._unfit: set[str] = set()
        self._at_work: dict[Future, tuple[Order, frozenset[str]]] = {}
        """With the workers that may do it."""
        self._ended: queue.SimpleQueue[Future] = queue.SimpleQueue()
        self._looked_at = 0.0
        self._alone = False
        """Whether it was said that there is no worker."""
        self._client: Client

    @property
    def capacity(self) -> int:
        # A worker goes on with the next task while what it has just made is put in place.
        return 2 * sum(self._workers.values())

    @property
    def workers(self) -> list[str]:
        """The addresses of those that get tasks."""
        return [*self._workers]

    def submit(self, order: Order) -> None:
        key = f"{order.step.function.__name__}-{uuid.uuid4().hex[:8]}"
        asked = replace(order, here=os.getcwd())
        future = self._client.submit(do, asked, self._session, key=key, workers=self.workers, pure=False)
        self._at_work[future] = order, frozenset(self._workers)
        future.add_done_callback(self._ended.put)

    def wait(self, tell: Tell, seconds: float) -> None:
        self._look()
        try:
            future = self._ended.get(timeout=min(seconds, PROGRESS))
        except queue.Empty:
            for order, _ in [*self._at_work.values()]:
                if progress := progress_of(order):
                    tell(order, Told(order, *progress))
            return
        if future in self._at_work:
            order, _ = self._at_work.pop(future)
            tell(order, self._message(future))

    def stop(self) -> None:
        futures = [*self._at_work]
        self._at_work.clear()
        with suppress(*UNREACHABLE):
            self._client.cancel(futures, force=True)

    def __enter__(self) -> Self:
        for name in ("distributed", "distributed.client"):
            # What there is to say of the connection is said here, in one line.
            logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            # A client that finds nobody goes on trying for long, even when it has said so.
            asyncio.run(_knock(self._address))
            self._client = Client(self._address, timeout=CONNECTING, set_as_default=False, name="rigid-motion")
        except TypeError:
            raise ExecutorError(
                f"{self._address}: Dask's configuration has no certificates; set "
                "DASK_DISTRIBUTED__COMM__TLS__CA_FILE, and CERT and KEY of the CLIENT"
            ) from None
        except (ValueError, ImportError) as error:
            raise ExecutorError(f"{self._address}: {error}; give an address such as tcp://farm:8786") from None
        except OSError:
            raise ExecutorError(
                f"{self._address}: no Dask scheduler answers there; start one with `dask scheduler`, or give the "
                "address that it prints"
            ) from None
        try:
            if (said := self._client.run_on_scheduler(_asker(), "")).startswith("No module"):
                raise ExecutorError(f"{self._address}: the scheduler: {said}")
            self._look()
            if self._unfit and not self._workers:
                raise ExecutorError(f"{self._address}: none of its workers is fit")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        with suppress(*UNREACHABLE):
            self._client.run(retire, self._session, workers=self.workers, on_error="ignore")
            self._client.close(timeout=2.0)

    def _look(self) -> None:
        """See which workers have come and gone. Raises ExecutorError where the scheduler has."""
        if time.monotonic() - self._looked_at < LOOK:
            return
        self._looked_at = time.monotonic()
        threads = self._threads()
        for address in self._workers.keys() - threads.keys():
            del self._workers[address]
            self._note(f"worker {address} is gone; others go on with its tasks")
        self._unfit &= threads.keys()
        if strangers := threads.keys() - self._workers.keys() - self._unfit:
            self._welcome({address: threads[address] for address in strangers})
        for future, (order, workers) in [*self._at_work.items()]:
            # Of those that could have done it none is left: that is no fault of the task.
            if self._workers and not workers.intersection(self._workers):
                del self._at_work[future]
                self._client.cancel([future], force=True)
                self.submit(order)
        if not self._alone and not threads:
            self._note(f"{self._address} has no worker; waiting for one: `dask worker {self._address}`")
        self._alone = not threads

    def _threads(self) -> dict[str, int]:
        """The workers that the scheduler knows, and how many threads each has."""
        with suppress(*UNREACHABLE):
            if self._client.status == "running":
                found = self._client.sync(self._client.scheduler.identity, n_workers=-1, callback_timeout=ANSWER)
                return {address: worker["nthreads"] for address, worker in found["workers"].items()}
        raise ExecutorError(f"{self._address}: the Dask scheduler is gone")

    def _welcome(self, threads: dict[str, int]) -> None:
        """Ask workers who have come who they are, and take those that fit."""
        answers: dict[str, str | BaseException] = {}
        with suppress(*UNREACHABLE):  # They are seen again at the next look, or gone.
            answers = self._client.run(_asker(), str(self._folder), workers=[*threads], on_error="return")
        for address, answer in answers.items():
            if answer == LOADED:
                self._workers[address] = threads[address]
            elif not isinstance(answer, OSError):
                self._unfit.add(address)
                said = _first_sentence(answer) if isinstance(answer, BaseException) else answer
                said = f"it has {said}, and this is {LOADED}" if said.startswith("program") else said
                self._note(f"worker {address}: {said}; it is left out")

    def _message(self, future: Future) -> Made | Failed | Lost:
        """What became of an order that Dask has done with."""
        try:
            return future.result(timeout=ANSWER)
        except KilledWorker as error:
            return Lost(f"{error.allowed_failures + 1} workers died of it, {error.last_worker.address} last")
        except (CancelledError, Exception) as error:  # Of Dask's, or of a worker's machine; not of the task's.
            self._threads()  # Where the scheduler is gone, that is what there is to say.
            return Lost(f"its worker failed: {_first_sentence(error)}")


async def _knock(address: str) -> None:
    """Raises OSError where nobody answers who speaks Dask's language."""
    async with asyncio.timeout(CONNECTING + 1.0):  # Someone else's server may keep it waiting.
        comm = await connect(address, timeout=CONNECTING, **Security().get_connection_args("client"))
    comm.abort()


def _asker() -> Callable[[str], str]:
    """`identify`, in a function that is sent whole: a worker that cannot import what it is sent would die of that."""

    def ask(folder: str) -> str:
        try:
            from rigid_motion_batch.pipeline.dask import identify
        except ImportError as error:
            return f"{error}; start scheduler and workers with this program on their module path: see docs/farm.md"
        return identify(folder)

    return ask


def _first_sentence(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[0].split('. ')[0]}" if lines else type(error).__name__
