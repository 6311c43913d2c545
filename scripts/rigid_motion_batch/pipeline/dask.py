"""Many machines: the workers of a Dask scheduler do jobs, each in processes of its own, as they are done here.

The output folder is on a disk that all share. Every worker is asked first whether it has this version of the program,
and sees the folder. Those that fit get a resource of Dask's, which jobs need: so Dask sends them there alone, and those
of a worker that dies to another.
"""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import os
import time
import uuid
from collections.abc import Awaitable, Callable
from concurrent.futures import CancelledError, Future, wait
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Self, cast

from distributed import Client, Security, get_worker
from distributed.comm import connect

from .executors import ProcessExecutor
from .performing import Executor, ExecutorError, Made
from .steps import Job, version_here

CONNECTING = 5.0
"""Seconds that a scheduler has to answer."""

BUSY = 30.0
"""Seconds that one may take to answer which is connected: where it is gone, that is seen at once."""

LOOK = 0.5
"""Seconds between two looks at which workers there are, and at whether a job is still to be done."""

UNREACHABLE = (OSError, RuntimeError, TimeoutError, CancelledError)
"""Errors that Dask raises where its scheduler does not answer."""


def do(job: Job) -> Made:
    """Do a job on a worker, in a process of its own, which ends with the worker, or where the job is cancelled."""
    worker = get_worker()
    key, future = worker.get_current_task(), _processes(worker.state.nthreads).submit(job)
    while not wait([future], LOOK).done:
        task = worker.state.tasks.get(key)
        if (task is None or task.state == "cancelled") and future.cancel():
            break
    return future.result()


@cache
def _processes(jobs: int) -> ProcessExecutor:
    # Dask's nanny makes daemons of workers, which Python lets have no children.
    cast(Any, multiprocessing.current_process())._config["daemon"] = False
    return ProcessExecutor(jobs)


class DaskExecutor(Executor):
    """The workers of the Dask scheduler at an address, tcp://HOST:8786, or tls:// with certificates in Dask's settings.

    All of them must see the output folder; `note` takes lines for the user about them. Raises ExecutorError on
    entering, where no scheduler answers, or all its workers are unfit, and later, where it is gone.
    """

    def __init__(self, address: str, folder: Path, note: Callable[[str], object]) -> None:
        self._address, self._folder, self._note = address, folder, note
        self._resource = f"rigid-motion-{uuid.uuid4().hex[:8]}"
        self._fit: dict[str, bool] = {}
        """The workers that were asked, by their addresses."""
        self._capacity, self._looked_at = 0, 0.0
        self._client: Client

    @property
    def capacity(self) -> int:  # type: ignore[override]  # it is only read
        """The threads of all workers that fit. Raises ExecutorError where there are workers, and none of them fits."""
        if time.monotonic() - self._looked_at > LOOK:
            self._capacity, self._looked_at = self._look(), time.monotonic()
        return self._capacity

    def submit(self, job: Job) -> Future[Made]:
        return self._client.get_executor(pure=False, resources={self._resource: 1}).submit(do, job)

    def _look(self) -> int:
        """See which workers there are, ask those that are new, and return how many threads fit."""
        threads, before = self._threads(), bool(self._fit)
        for address in self._fit.keys() - threads.keys():
            if self._fit.pop(address):
                self._note(f"worker {address} is gone; others go on with its tasks")
        if strangers := [*threads.keys() - self._fit.keys()]:
            answers: dict[str, str | BaseException] = {}
            with suppress(*UNREACHABLE):
                ask = _asker(version_here(), os.fspath(self._folder), self._resource)
                answers = self._client.run(ask, workers=strangers, on_error="return")
            for address, said in answers.items():
                if isinstance(said, str):  # Otherwise it is seen again at the next look, or gone.
                    self._fit[address] = not said
                    if said:
                        self._note(f"worker {address}: {said}; it is left out")
        if self._fit and not any(self._fit.values()):
            raise ExecutorError(f"{self._address}: none of its workers is fit")
        if not threads and (before or not self._looked_at):
            self._note(f"{self._address} has no worker; waiting for one: `dask worker {self._address}`")
        return sum(threads[address] for address, fits in self._fit.items() if fits)

    def _threads(self) -> dict[str, int]:
        """Return the workers that the scheduler knows, and how many threads each has."""
        with suppress(*UNREACHABLE):
            if self._client.status == "running":
                result = self._client.sync(self._client.scheduler.identity, n_workers=-1, callback_timeout=BUSY)
                return {address: worker["nthreads"] for address, worker in result["workers"].items()}
        raise ExecutorError(f"{self._address}: the Dask scheduler is gone")

    def __enter__(self) -> Self:
        for name in ("distributed", "distributed.client"):
            # What there is to say of the connection is said here, in one line.
            logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            # A client that finds nobody goes on trying for long, even when it has said so.
            asyncio.run(_knock(self._address))
            self._client = Client(self._address, timeout=CONNECTING, set_as_default=False, name="rigid-motion")
        except (ValueError, ImportError, TypeError) as error:  # The last one where tls:// finds no certificates.
            way_out = "give an address such as tcp://farm:8786, and certificates of tls:// in Dask's configuration"
            raise ExecutorError(f"{self._address}: {error}; {way_out}") from None
        except OSError:
            way_out = "start one with `dask scheduler`, or give the address that it prints"
            raise ExecutorError(f"{self._address}: no Dask scheduler answers there; {way_out}") from None
        try:
            self._look()
        except ExecutorError:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(*UNREACHABLE):
            self._client.close(timeout=2.0)  # Then nobody wants what is at work, and it is cancelled.


async def _knock(address: str) -> None:
    """Raise OSError where nothing answers that speaks Dask's protocol."""
    async with asyncio.timeout(CONNECTING + 1.0):  # Someone else's server may keep it waiting.
        comm = await connect(address, timeout=CONNECTING, **Security().get_connection_args("client"))
    comm.abort()


def _asker(requested: str, folder: str, resource: str) -> Callable[[Any], Awaitable[str]]:
    """Return a function that answers why a worker does not fit, or gives it the resource.

    It is sent whole: one may not have the program.
    """

    async def ask(dask_worker: Any) -> str:
        if not os.path.isdir(folder):
            return f"it does not see {folder}; choose one on a disk that all share"
        try:
            from rigid_motion_batch.pipeline.steps import version_here
        except ImportError as error:
            return str(error)
        if (result := version_here()) != requested:
            return f"it has {result}, and this run is of {requested}; start it anew with that"
        await dask_worker.set_resources(**{resource: dask_worker.state.nthreads})
        return ""

    return ask
