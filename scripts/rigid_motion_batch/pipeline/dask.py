"""Many machines: the workers of a Dask scheduler do shares of a comparison's stages, as the tasks of a job bundle do.

The output folder is on a disk that all share. Every worker is asked first whether it has this version of the program,
and sees the folder; only those that fit get shares. A share is a process of its own, which Dask's worker waits for.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import subprocess
import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from distributed import Client, Future, Security, get_worker
from distributed.comm import connect

from rigid_motion_batch.supervising import end_with_parent

from .bundle import CHECK, COMPARE, share_of
from .performing import ExecutorError
from .running import RETRIES
from .steps import version_here

CONNECTING = 5.0
"""Seconds that a scheduler has to answer."""

LOOK = 0.5
"""Seconds between two looks at which workers there are, and at whether a share is done or still wanted."""

SHARES = 4
"""Of a stage for each thread of a worker: no worker waits long for the last one."""

UNREACHABLE = (OSError, RuntimeError, TimeoutError, CancelledError)
"""What Dask raises where its scheduler does not answer."""


def do(arguments: Sequence[str], here: str) -> dict[str, Any]:
    """On a worker: what Python prints as JSON with these arguments. It ends with the worker, or as that is told to."""
    worker = get_worker()
    key = worker.get_current_task()
    with subprocess.Popen(
        [sys.executable, *arguments],
        cwd=here if os.path.isdir(here) else None,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=end_with_parent if sys.platform == "linux" else None,
    ) as process:
        while True:
            with suppress(subprocess.TimeoutExpired):
                printed, said = process.communicate(timeout=LOOK)
                break
            task = worker.state.tasks.get(key)
            if task is None or task.state == "cancelled":
                process.kill()
    try:
        return json.loads(printed)
    except ValueError:
        raise RuntimeError(f"exit code {process.returncode}: {said.strip()[-500:]}") from None


class Farm:
    """The workers of a Dask scheduler, as a context.

    Parameters
    ----------
    address : str
        Of the scheduler: tcp://HOST:8786, or tls:// with the certificates in Dask's configuration.
    folder : Path
        The output folder, which all workers must see.
    note : callable
        Takes a line for the user about the workers.

    Raises
    ------
    ExecutorError
        On entering, where no scheduler answers, or all its workers are unfit; and later, where it is gone.
    """

    def __init__(self, address: str, folder: Path, note: Callable[[str], object]) -> None:
        self._address, self._folder, self._note = address, folder, note
        self._fit: dict[str, bool] = {}
        """The workers that were asked, by their addresses."""
        self._alone = False
        """Whether it was said that there is no worker."""
        self._client: Client

    def run(self, arguments: Sequence[str], stage: str, tasks: int) -> Iterator[tuple[float, dict[str, Any]]]:
        """Have a stage of so many tasks done by the command of these arguments; the share done, and each answer."""
        parts = max(1, min(tasks, SHARES * sum(self.workers().values())))
        waiting = deque(range(1, parts + 1))
        losses: Counter[int] = Counter()
        at_work: dict[Future, tuple[int, str]] = {}
        try:
            while waiting or at_work:
                workers = self.workers()
                for future, (number, worker) in [*at_work.items()]:
                    if worker in workers and not future.done():
                        continue
                    del at_work[future]
                    try:
                        if worker not in workers:
                            future.cancel(force=True)
                            raise RuntimeError("its worker is gone")
                        answer = future.result(CONNECTING)
                    except (CancelledError, Exception) as error:
                        losses[number] += 1
                        if losses[number] > RETRIES:
                            name = f"{stage} {number}/{parts}"
                            said = f"{name}: {_first_line(error)}; given up after {losses[number]} attempts"
                            yield 1.0 - (len(waiting) + len(at_work)) / parts, {"failures": {name: said}}
                        else:
                            waiting.appendleft(number)
                        continue
                    yield 1.0 - (len(waiting) + len(at_work)) / parts, answer
                busy = Counter(worker for _, worker in at_work.values())
                for worker, threads in workers.items():
                    for number in [waiting.popleft() for _ in range(min(threads - busy[worker], len(waiting)))]:
                        share = [*COMPARE, *arguments, *share_of(os.fspath(self._folder), stage, number, parts)]
                        future = self._client.submit(
                            do, [*share, "--json", "--jobs", "1"], os.getcwd(), workers=[worker], pure=False
                        )
                        at_work[future] = number, worker
                time.sleep(LOOK)
        finally:
            with suppress(*UNREACHABLE):
                self._client.cancel([*at_work], force=True)

    def workers(self) -> dict[str, int]:
        """Those that fit, by address, and how many threads each has. Raises ExecutorError where there are none ever."""
        threads = self._threads()
        for address in self._fit.keys() - threads.keys():
            if self._fit.pop(address):
                self._note(f"worker {address} is gone; others go on with its tasks")
        if strangers := [*threads.keys() - self._fit.keys()]:
            answers: dict[str, str | BaseException] = {}
            with suppress(*UNREACHABLE):
                ask = _asker([*CHECK, version_here()], os.fspath(self._folder))
                answers = self._client.run(ask, workers=strangers, on_error="return")
            for address, said in answers.items():
                if isinstance(said, OSError):
                    continue  # It is seen again at the next look, or gone.
                self._fit[address] = not said
                if said:
                    self._note(f"worker {address}: {said}; it is left out")
        if self._fit and not any(self._fit.values()):
            raise ExecutorError(f"{self._address}: none of its workers is fit")
        if not threads and not self._alone:
            self._note(f"{self._address} has no worker; waiting for one: `dask worker {self._address}`")
        self._alone = not threads
        return {address: threads[address] for address, fits in self._fit.items() if fits}

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
            self.workers()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(*UNREACHABLE):
            self._client.close(timeout=2.0)

    def _threads(self) -> dict[str, int]:
        """The workers that the scheduler knows, and how many threads each has."""
        with suppress(*UNREACHABLE):
            if self._client.status == "running":
                found = self._client.sync(self._client.scheduler.identity, n_workers=-1, callback_timeout=CONNECTING)
                return {address: worker["nthreads"] for address, worker in found["workers"].items()}
        raise ExecutorError(f"{self._address}: the Dask scheduler is gone")


async def _knock(address: str) -> None:
    """Raises OSError where nobody answers who speaks Dask's language."""
    async with asyncio.timeout(CONNECTING + 1.0):  # Someone else's server may keep it waiting.
        comm = await connect(address, timeout=CONNECTING, **Security().get_connection_args("client"))
    comm.abort()


def _asker(check: Sequence[str], folder: str) -> Callable[[], str]:
    """What a worker answers where it does not fit, in a function that is sent whole: it may not have this program."""

    def ask() -> str:
        if not os.path.isdir(folder):
            return f"it does not see {folder}; choose one on a disk that all share"
        ended = subprocess.run([sys.executable, *check], capture_output=True, text=True, check=False)
        lines = (ended.stdout + ended.stderr).strip().splitlines()
        return lines[-1].removeprefix("openjd_fail: ") if ended.returncode and lines else ""

    return ask


def _first_line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
