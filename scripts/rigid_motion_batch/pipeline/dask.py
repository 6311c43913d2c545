"""Many machines: the workers of a Dask scheduler do jobs, each in processes of its own, as they are done here.

The output folder is on a disk that all share. Every worker is asked first whether it has this version of the program,
and sees the folder. A job is for one worker that fits, and is lost with it: the run begins it anew at another.
"""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import os
from collections import Counter
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, wait
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Self, cast

from distributed import Client, Security, get_worker
from distributed.comm import connect

from .executors import Executor, Made, ProcessExecutor
from .steps import LOOK_INTERVAL_S, RunError, StepJob, version_here

CONNECTING_S = 5.0
"""Seconds that a scheduler has to answer."""

UNREACHABLE = (OSError, RuntimeError, TimeoutError, CancelledError)
"""Errors that Dask raises where its scheduler does not answer."""


def do(job: StepJob) -> Made:
    """Do a job on a worker, in a process of its own, which ends with the worker, or where the job is cancelled."""
    worker = get_worker()
    key, future = worker.get_current_task(), _processes(worker.state.nthreads).submit(job)
    while not wait([future], LOOK_INTERVAL_S).done:
        task = worker.state.tasks.get(key)
        if (task is None or task.state == "cancelled") and future.cancel():
            break
    return future.result()


@cache
def _processes(jobs: int) -> ProcessExecutor:
    # Dask's nanny makes daemons of workers, which Python lets have no children.
    cast(Any, multiprocessing.current_process())._config["daemon"] = False
    return ProcessExecutor(jobs)


def reason_against(requested: str, folder: str) -> str:
    """Return why this worker does not fit a run of this version into a folder; empty where it does."""
    if not os.path.isdir(folder):
        return f"it does not see {folder}; choose one on a disk that all share"
    here = version_here()
    return "" if here == requested else f"it has {here}, and this run is of {requested}; start it again with that"


class DaskExecutor(Executor):
    """The workers of the Dask scheduler at an address, tcp://HOST:8786, or tls:// with certificates in Dask's settings.

    All of them must see the output folder; `note` takes lines for the user about them. Raises RunError on
    entering, where no scheduler answers, and later, where it is gone, or all its workers are unfit.
    """

    def __init__(self, address: str, folder: Path, note: Callable[[str], object]) -> None:
        self._address, self._folder, self._note = address, os.fspath(folder), note
        self._fit: dict[str, int] = {}
        """Address of a worker to how many threads it has; 0 where it does not fit."""
        self._jobs: dict[Future[Made], str] = {}
        """Jobs at work, and the addresses of their workers."""
        self._waits = False

    @property
    def capacity(self) -> int:  # type: ignore[override]  # it is only read
        """The threads of all workers that fit. Raises RunError where there are workers, and none of them fits."""
        threads = self._answer(self._client.nthreads)
        for address in self._fit.keys() - threads.keys():
            if self._fit.pop(address):
                self._note(f"worker {address} is gone; others go on with its tasks")
            for future in [future for future, place in self._jobs.items() if place == address]:
                future.cancel()  # Dask itself does not always do so.
        if new := [*threads.keys() - self._fit.keys()]:
            asked = reason_against, version_here(), self._folder
            answers = self._answer(self._client.run, *asked, workers=new, on_error="return")
            for address, answer in answers.items():
                if not isinstance(answer, OSError):  # Otherwise it is gone.
                    self._fit[address] = 0 if answer else threads[address]
                    if answer:
                        self._note(f"worker {address}: {answer}; it is left out")
        if {*self._fit.values()} == {0}:
            raise RunError(f"{self._address}: none of its workers is fit")
        if not threads and not self._waits:
            self._note(f"{self._address} has no worker; waiting for one: `dask worker {self._address}`")
        self._waits = not threads
        return sum(self._fit.values())

    def submit(self, job: StepJob) -> Future[Made]:
        self._jobs = {future: address for future, address in self._jobs.items() if not future.done()}
        busy = Counter(self._jobs.values())
        address = max(self._fit, key=lambda address: self._fit[address] - busy[address])
        future: Future[Made] = self._client.get_executor(pure=False, workers=[address]).submit(do, job)
        self._jobs[future] = address
        return future

    def _answer(self, question: Callable[..., dict[str, Any]], *what: object, **how: object) -> dict[str, Any]:
        """Return what the scheduler answers, by the addresses of workers."""
        with suppress(*UNREACHABLE):
            if self._client.status == "running":
                return question(*what, **how)
        raise RunError(f"{self._address}: the Dask scheduler is gone")

    def __enter__(self) -> Self:
        for name in ("distributed", "distributed.client", "tornado.application"):
            # What there is to say of the connection is said here, in one line.
            logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            # A client that finds nobody goes on trying for long, and someone else's server may keep it waiting.
            knocking = connect(self._address, timeout=CONNECTING_S, **Security().get_connection_args("client"))
            asyncio.run(asyncio.wait_for(knocking, CONNECTING_S + 1.0))
            self._client = Client(self._address, timeout=CONNECTING_S, set_as_default=False, name="rigid-motion")
        except (OSError, ValueError, ImportError, TypeError) as error:  # The last one where tls:// has no certificates.
            raise RunError(
                f"{self._address}: no Dask scheduler answers there ({error}); start one with `dask scheduler`, and "
                "give the address that it prints, such as tcp://farm:8786; tls:// needs certificates in Dask's settings"
            ) from None
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(*UNREACHABLE):
            self._client.close(timeout=2.0)  # Then nobody wants what is at work, and it is cancelled.
