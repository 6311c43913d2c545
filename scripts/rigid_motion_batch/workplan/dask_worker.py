"""What a Dask worker does with an order: it hands it to a process of its own, as a run on one machine does.

So Blender, which is not made for threads, has a process for itself in which it does one task at a time, however many
threads the Dask worker has; the worker answers its scheduler while Blender renders; and a task that nobody wants any
more, because the run was stopped or is gone, can be ended at once.

Dask is told the name of `do`; what goes to and fro is plain text, JSON of orders and messages.
"""

from __future__ import annotations

import json
import shutil
import threading
import time
import uuid
from dataclasses import replace
from pathlib import Path

from distributed import Worker, get_worker

from .hashing import code_version
from .performing import Failed, Lost, Made, Message, Noted, Order, as_json
from .processes import ProcessExecutor

LOADED = code_version("rigid_motion_batch/workplan")
"""The version of the work plan that this process was started with, whatever was done to the files since."""

TOPIC = "rigid-motion"
"""Of Dask's events, for what tasks say while they are done."""

LISTENING = 0.2
"""Seconds between two looks at whether a task is still wanted."""

INTERVAL = 0.5
"""Seconds between two messages about how far a task is."""

IDLE = 60.0
"""Seconds that a process stays without work."""

_idle: dict[str, list[tuple[ProcessExecutor, threading.Timer]]] = {}
_idle_lock = threading.Lock()


def do(order: str, session: str, folder: str) -> str:
    """Do an order, as a task of Dask's.

    Parameters
    ----------
    order : str
        JSON of an `Order`. Its scratch folder is the beginning of the name of that which is used: where Dask has it
        done twice, the one does not get in the way of the other.
    session : str
        Names the run. A process is used for one run only, so that it has the program as that run found it.
    folder : str
        The one that the run was started in, which relative inputs count from.

    Returns
    -------
    str
        JSON of the "message" that ends it, the "scratch" folder and the version that is "loaded" here.
    """
    worker = get_worker()
    key = worker.get_current_task()
    asked = Order(**json.loads(order))
    attempt = replace(asked, scratch=f"{asked.scratch}-{uuid.uuid4().hex[:8]}")
    ended = _perform(attempt, session, Path(folder), worker, key)
    if not isinstance(ended, Made):
        shutil.rmtree(attempt.scratch, ignore_errors=True)
    return json.dumps({"message": as_json(ended), "scratch": attempt.scratch, "loaded": LOADED})


def _perform(order: Order, session: str, folder: Path, worker: Worker, key: object) -> Made | Failed | Lost:
    ended: list[Made | Failed | Lost] = []
    said_at = 0.0

    def hear(message: Message) -> None:
        nonlocal said_at
        if isinstance(message, Made | Failed | Lost):
            ended.append(message)
        elif isinstance(message, Noted) or time.monotonic() - said_at >= INTERVAL:
            said_at = time.monotonic()
            worker.log_event(TOPIC, {"session": session, "message": json.dumps(as_json(message))})

    processes = _borrow(session, folder)
    try:
        processes.submit(order)
        while not ended:
            processes.wait(hear, LISTENING)
            if not ended and not _is_wanted(worker, key):
                processes.stop()
                ended.append(Lost(order.name, "it was stopped"))
    except BaseException:
        processes.stop()
        raise
    _give_back(session, processes)
    return ended[0]


def _is_wanted(worker: Worker, key: object) -> bool:
    """Whether anybody waits for a task: Dask forgets those of a run that was stopped, or has died."""
    task = worker.state.tasks.get(key)
    return task is not None and task.state != "cancelled"


def _borrow(session: str, folder: Path) -> ProcessExecutor:
    with _idle_lock:
        if not _idle.get(session):
            # Where that folder is not, there may be all that is asked for by its whole path.
            return ProcessExecutor(1, folder=folder if folder.is_dir() else None)
        processes, retirement = _idle[session].pop()
    retirement.cancel()
    return processes


def _give_back(session: str, processes: ProcessExecutor) -> None:
    retirement = threading.Timer(IDLE, _retire, (session, processes))
    retirement.daemon = True
    with _idle_lock:
        _idle.setdefault(session, []).append((processes, retirement))
    retirement.start()


def _retire(session: str, processes: ProcessExecutor) -> None:
    with _idle_lock:
        there = [pair for pair in _idle.get(session, []) if pair[0] is processes]
        for pair in there:
            _idle[session].remove(pair)
        if not _idle.get(session):
            _idle.pop(session, None)
    if there:
        processes.stop()
