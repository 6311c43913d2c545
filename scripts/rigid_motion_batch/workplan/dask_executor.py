"""Many machines: orders are done by the workers of a Dask scheduler, with the output folder on a disk that all share.

Every worker is asked first which version of the program it has, and whether it sees the folder; tasks go only to those
that fit. Dask gives a task of a worker that died to another one. Nothing but the run itself puts outputs in place.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import queue
import shutil
import time
import uuid
from collections.abc import Callable, Iterable
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Self

from distributed import Client, Future, KilledWorker, Security
from distributed.comm import connect

from . import dask_worker
from .executors import ExecutorError
from .hashing import code_version
from .performing import Failed, Lost, Made, Message, Order, from_json

CONNECTING = 5.0
"""Seconds that a scheduler has to answer."""

FIRST_WORKER = 60.0
"""Seconds that the first worker has to say who it is; it may be at another's task."""

LOOKING = 1.0
"""Seconds between two looks at which workers there are."""

FETCHING = 10.0
"""Seconds for the result of a task that is done."""

RETRIES = 2
"""How often a worker is asked again whose process died."""

START = "start the scheduler and the workers with this program on their module path: see docs/farm.md"

UNREACHABLE = (OSError, RuntimeError, TimeoutError, CancelledError)
"""What Dask raises where its scheduler does not answer."""


@dataclass
class _Worker:
    """A Dask worker, as long as it is there."""

    threads: int
    accepted: bool = False
    losses: int = 0
    """How often the process died that was to say who it is."""
    refused: str = ""
    """Why it gets no tasks."""


@dataclass(frozen=True)
class _AtWork:
    """An order that Dask has."""

    order: Order
    future: Future
    workers: frozenset[str]
    """The addresses of those that may do it."""


class DaskExecutor:
    """Does orders on the workers of a Dask scheduler.

    Parameters
    ----------
    address : str
        Of the scheduler: tcp://HOST:8786, or tls:// with the certificates in Dask's configuration.
    output : Path
        The output folder, under a path that is the same everywhere.
    identify : str
        A step that writes the version of the program to `path`, its one output.
    version : str
        What it has to write.
    note : callable
        Takes a line for the user about the workers.

    Raises
    ------
    ExecutorError
        On entering, where no scheduler answers, or all its workers are unfit.
    """

    def __init__(
        self, address: str, output: Path, *, identify: str, version: str, note: Callable[[str], object]
    ) -> None:
        self._address, self._output = address, output.absolute()
        self._identify, self._version, self._note = identify, version, note
        self._session = uuid.uuid4().hex
        self._workers: dict[str, _Worker] = {}
        self._questions: dict[str, tuple[str, Order, Future]] = {}
        """Key of a question to whom it was put."""
        self._at_work: dict[str, _AtWork] = {}
        self._waiting: list[Order] = []
        self._news: queue.SimpleQueue[Message | Future] = queue.SimpleQueue()
        self._looked_at = 0.0
        self._missed = False
        """Whether it was said that there is no worker."""
        self._client: Client

    @property
    def capacity(self) -> int:
        # A worker goes on with the next task while what it has just made is put in place.
        return 2 * sum(worker.threads for worker in self._workers.values() if worker.accepted) or 1

    @property
    def workers(self) -> list[str]:
        """The addresses of those that get tasks."""
        return [address for address, worker in self._workers.items() if worker.accepted]

    def submit(self, order: Order) -> None:
        self._waiting.append(order)
        self._distribute()

    def wait(self, tell: Callable[[Message], object], seconds: float) -> None:
        ends = time.monotonic() + seconds
        self._look(tell)
        with suppress(queue.Empty):
            news = self._news.get(timeout=max(0.0, ends - time.monotonic()))
            while True:
                self._take(news, tell)
                news = self._news.get_nowait()

    def stop(self) -> None:
        self._waiting.clear()
        at_work, self._at_work = self._at_work, {}
        self._cancel(one.future for one in at_work.values())

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
            self._check_scheduler()
            self._client.subscribe_topic(dask_worker.TOPIC, self._hear_event)
            self._wait_for_first()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self._cancel(future for _, _, future in self._questions.values())
        with suppress(*UNREACHABLE):
            self._client.close(timeout=2.0)

    def _check_scheduler(self) -> None:
        """Raises ExecutorError where the scheduler could not read what it has to pass on."""
        try:
            self._client.run_on_scheduler(find_spec, dask_worker.__name__)
        except Exception as error:
            raise ExecutorError(f"{self._address}: the scheduler: {_first_sentence(error)}; {START}") from None

    # -- workers ------------------------------------------------------------------------------------------------------

    def _wait_for_first(self) -> None:
        """Wait until a worker is accepted. Raises ExecutorError where all that there are have been refused."""
        ends = time.monotonic() + FIRST_WORKER
        while not self.workers and time.monotonic() < ends:
            self.wait(lambda _: None, 0.1)
            if self._workers and all(worker.refused for worker in self._workers.values()):
                raise ExecutorError(f"{self._address}: none of its workers is fit")
            if self._missed:
                return

    def _look(self, tell: Callable[[Message], object]) -> None:
        """See which workers have come and gone."""
        if time.monotonic() - self._looked_at < LOOKING:
            return
        self._looked_at = time.monotonic()
        try:
            if self._client.status != "running":
                raise OSError
            found = self._client.sync(self._client.scheduler.identity, n_workers=-1, callback_timeout=FETCHING)
        except UNREACHABLE:
            for order in [*self._waiting, *(one.order for one in self._at_work.values())][:1]:
                tell(self._gone(order))
            return
        there = found["workers"]
        for address in [address for address in self._workers if address not in there]:
            if self._workers.pop(address).accepted:
                self._note(f"worker {address} is gone; others go on with its tasks")
        self._welcome({address: there[address]["nthreads"] for address in there.keys() - self._workers.keys()})
        if not self._missed and not self._workers:
            self._note(f"{self._address} has no worker; waiting for one: `dask worker {self._address}`")
        self._missed = not self._workers

    def _welcome(self, threads: dict[str, int]) -> None:
        """Ask workers who have come, by their addresses, who they are."""
        if not threads:
            return
        # A worker that was sent a function it cannot import would die of that.
        try:
            found = self._client.run(find_spec, dask_worker.__name__, workers=list(threads), on_error="return")
        except UNREACHABLE:
            return  # It is seen again at the next look, or gone.
        for address, answer in found.items():
            if isinstance(answer, OSError):
                continue  # The same.
            self._workers[address] = worker = _Worker(threads[address])
            if isinstance(answer, ModuleSpec):
                self._ask(address)
            else:
                self._refuse(worker, f"worker {address}: it cannot import {dask_worker.__name__}; {START}")

    def _refuse(self, worker: _Worker, reason: str) -> None:
        worker.refused = reason
        self._note(f"{reason}; it is left out")

    def _ask(self, address: str) -> None:
        scratch = self._output / ".workplan" / "scratch" / f"who-{uuid.uuid4().hex[:12]}"
        order = Order("who", self._identify, {"path": "who"}, {}, ("who",), str(self._output), str(scratch))
        future = self._send(order, [address])
        self._questions[future.key] = address, order, future

    def _answered(self, address: str, order: Order, future: Future) -> None:
        """Take a worker that has answered, or leave it out."""
        if address not in self._workers:
            return
        worker = self._workers[address]
        try:
            answer = json.loads(future.result(timeout=FETCHING))
            message = from_json(answer["message"])
        except Exception as error:  # Whatever went wrong over there, that worker is not to be had.
            self._refuse(worker, f"worker {address}: {_first_sentence(error)}")
            return
        if isinstance(message, Lost) and worker.losses < RETRIES:
            worker.losses += 1
            self._ask(address)
            return
        unfit = self._unfit(address, answer, message)
        shutil.rmtree(answer["scratch"], ignore_errors=True)
        if unfit:
            self._refuse(worker, unfit)
            return
        worker.accepted = True
        for key, one in list(self._at_work.items()):
            # Of those that could have done it none is left.
            if not one.workers.intersection(self._workers):
                del self._at_work[key]
                self._cancel([one.future])
                self._waiting.append(one.order)
        self._distribute()

    def _unfit(self, address: str, answer: dict[str, Any], message: Message) -> str:
        """Why that worker must not work with us; empty where it may."""
        if not isinstance(message, Made):
            return f"worker {address}: {message.message}"
        try:
            version = Path(answer["scratch"], "who").read_text(encoding="utf-8")
        except OSError:
            return f"worker {address}: {self._output} is another folder there; choose one on a disk that all share"
        if version != self._version:
            return f"worker {address}: it has {version}, and this is {self._version}"
        if answer["loaded"] != code_version("rigid_motion_batch/workplan"):
            return f"worker {address}: it was started before the program changed; restart it"
        return ""

    # -- orders -------------------------------------------------------------------------------------------------------

    def _distribute(self) -> None:
        """Give Dask the orders that are waiting, if there is anybody to do them."""
        workers = self.workers
        while workers and self._waiting:
            order = self._waiting.pop(0)
            future = self._send(order, workers)
            self._at_work[future.key] = _AtWork(order, future, frozenset(workers))

    def _send(self, order: Order, workers: list[str]) -> Future:
        future = self._client.submit(
            dask_worker.do,
            json.dumps(order.as_json()),
            self._session,
            os.getcwd(),
            key=f"{order.name}-{uuid.uuid4().hex[:8]}",
            workers=workers,
            pure=False,
        )
        future.add_done_callback(self._news.put)
        return future

    def _take(self, news: Message | Future, tell: Callable[[Message], object]) -> None:
        if not isinstance(news, Future):
            tell(news)
        elif news.key in self._questions:
            self._answered(*self._questions.pop(news.key))
        elif news.key in self._at_work:
            tell(self._ended(self._at_work.pop(news.key)))

    def _ended(self, one: _AtWork) -> Message:
        """What became of an order that Dask has done with."""
        name = one.order.name
        try:
            answer = json.loads(one.future.result(timeout=FETCHING))
        except KilledWorker as error:
            return Lost(name, f"{error.allowed_failures + 1} workers died of it, {error.last_worker.address} last")
        except CancelledError:
            return Lost(name, "it was cancelled") if self._client.status == "running" else self._gone(one.order)
        except Exception as error:  # Of Dask's, or of a worker's machine; not of the task's.
            return Lost(name, f"its worker failed: {_first_sentence(error)}")
        message = from_json(answer["message"])
        if isinstance(message, Made):
            try:
                with suppress(FileNotFoundError):
                    Path(one.order.scratch).rmdir()
                Path(answer["scratch"]).rename(one.order.scratch)
            except OSError as error:
                return Lost(name, f"{error.filename}: {error.strerror}")
        return message

    def _gone(self, order: Order) -> Failed:
        return Failed(order.name, f"{self._address}: the Dask scheduler is gone", hopeless=True)

    def _hear_event(self, event: tuple[float, dict[str, str]]) -> None:
        """Take what a task said, of whichever run."""
        _, said = event
        if said["session"] == self._session:
            self._news.put(from_json(json.loads(said["message"])))

    def _cancel(self, futures: Iterable[Future]) -> None:
        with suppress(*UNREACHABLE):
            self._client.cancel(list(futures), force=True)


async def _knock(address: str) -> None:
    """Raises OSError where nobody answers who speaks Dask's language."""
    async with asyncio.timeout(CONNECTING + 1.0):  # Someone else's server may keep it waiting.
        comm = await connect(address, timeout=CONNECTING, **Security().get_connection_args("client"))
    comm.abort()


def _first_sentence(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[0].split('. ')[0]}" if lines else type(error).__name__
