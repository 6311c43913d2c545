"""Worker processes on this machine: each does one task at a time, with a Blender of its own where a task asks for it.

A worker is given orders on its standard input and answers on its standard output, a line of JSON each. It ends when its
input does: no worker outlives its parent, however that ends. One that dies takes its task with it, not the run; one
that has done many tasks, or has grown large, is followed by a fresh one.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO, Self

from .performing import Lost, Message, Order, from_json
from .worker import PREFIX

WORKER = Path(__file__).with_name("worker.py")

TASKS_PER_WORKER = 500
"""After so many a worker is replaced: what libraries forgot to free goes with it."""

LARGEST_WORKER = 2 << 30
"""Bytes of memory; a worker that once needed more is replaced when its task is done."""

GRACE = 5.0
"""Seconds that a worker has to end by itself."""


class ProcessExecutor:
    """Does orders in processes that are started when there is work for them.

    Parameters
    ----------
    jobs : int, optional
        How many processes at most; as many as there are processors unless given.
    tasks_per_worker : int
        After how many tasks a worker is replaced.
    largest_worker : int
        Above how many bytes of memory, at its peak, it is.
    folder : Path, optional
        Which one relative paths count from in the processes; the current one unless given.
    """

    def __init__(
        self,
        jobs: int | None = None,
        *,
        tasks_per_worker: int = TASKS_PER_WORKER,
        largest_worker: int = LARGEST_WORKER,
        folder: Path | None = None,
    ) -> None:
        self.jobs = jobs or processors()
        # A worker goes on with the next task while what it has just made is put in place.
        self.capacity = 2 * self.jobs
        self._tasks_per_worker, self._largest_worker = tasks_per_worker, largest_worker
        self._folder = folder
        self._answers: queue.SimpleQueue[tuple[_Worker, str | None]] = queue.SimpleQueue()
        self._workers: list[_Worker] = []
        self._waiting: deque[Order] = deque()

    def submit(self, order: Order) -> None:
        self._waiting.append(order)
        self._distribute()

    def wait(self, tell: Callable[[Message], object], seconds: float) -> None:
        try:
            worker, line = self._answers.get(timeout=seconds)
            while True:
                self._take(worker, line, tell)
                worker, line = self._answers.get_nowait()
        except queue.Empty:
            return

    def stop(self) -> None:
        self._waiting.clear()
        workers, self._workers = self._workers, []
        for worker in workers:
            worker.process.kill()
        for worker in workers:
            worker.close()
        self._answers = queue.SimpleQueue()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            for worker in self._workers:
                worker.dismiss()
        self.stop()

    @property
    def processes(self) -> list[int]:
        """The ids of the processes there are."""
        return [worker.process.pid for worker in self._workers]

    def _distribute(self) -> None:
        """Give orders that are waiting to workers that are not, and start these where there may be more."""
        idle = [worker for worker in self._workers if worker.order is None]
        while self._waiting and (idle or len(self._workers) < self.jobs):
            if not idle:
                idle = [_Worker(self._answers, max(1, processors() // self.jobs), self._folder)]
                self._workers += idle
            idle.pop().begin(self._waiting.popleft())

    def _take(self, worker: _Worker, line: str | None, tell: Callable[[Message], object]) -> None:
        """Take a line of a worker, None for its end."""
        if worker not in self._workers:
            return  # It was stopped, or dismissed, and says its last words.
        if line is None:
            self._workers.remove(worker)
            worker.close()
            self._distribute()
            if worker.order:
                tell(Lost(worker.order.name, worker.last_words()))
            return
        if not line.startswith(PREFIX):
            return  # Blender greets on the standard output before the worker has a say in it.
        content = json.loads(line.removeprefix(PREFIX))
        peak = content.pop("peak", None)
        if peak is not None:
            worker.order = None
            worker.tasks += 1
            if worker.tasks >= self._tasks_per_worker or peak > self._largest_worker:
                self._workers.remove(worker)
                worker.dismiss()
                worker.close()
            self._distribute()
        tell(from_json(content))


class _Worker:
    """A process, its pipes, and the order that it is at."""

    def __init__(
        self, answers: queue.SimpleQueue[tuple[_Worker, str | None]], threads: int, folder: Path | None
    ) -> None:
        self.order: Order | None = None
        self.tasks = 0
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the worker lives
        self.process = subprocess.Popen(
            _command(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env=_environment(threads),
            cwd=folder,
            encoding="ascii",
            errors="replace",
        )
        self._reader = threading.Thread(target=self._read, args=(answers,), daemon=True)
        self._reader.start()

    def begin(self, order: Order) -> None:
        self.order = order
        with suppress(OSError):  # Where it has died; its end is on its way, and takes the order along.
            self.process.stdin.write(json.dumps(order.as_json()) + "\n")
            self.process.stdin.flush()

    def dismiss(self) -> None:
        """Let it end by itself, which it does when there can be no more orders."""
        try:
            self.process.stdin.close()
            self.process.wait(GRACE)
        except (OSError, subprocess.TimeoutExpired):
            self.process.kill()

    def close(self) -> None:
        """Take leave of a process that is at its end."""
        self.process.wait()
        self._reader.join()
        with suppress(OSError):  # What it was not able to take any more.
            self.process.stdin.close()
        self.process.stdout.close()
        self._words = _end_of(self._errors)
        self._errors.close()

    def last_words(self) -> str:
        """How it ended."""
        code = self.process.returncode
        how = f"exit code {code}"
        if code < 0:
            how = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
            how += ", perhaps for want of memory" if how == "SIGKILL" else ""
        return f"its process died ({how})" + (f": {self._words}" if self._words else "")

    def _read(self, answers: queue.SimpleQueue[tuple[_Worker, str | None]]) -> None:
        for line in self.process.stdout:
            answers.put((self, line))
        answers.put((self, None))


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _command() -> list[str]:
    """How another process like this one is started: with Python, or with Blender where this is Blender's own."""
    blender = getattr(getattr(sys.modules.get("bpy"), "app", None), "binary_path", "")
    if blender:
        return [blender, "--background", "--factory-startup", "--python-exit-code", "1", "--python", str(WORKER)]
    return [sys.executable, str(WORKER)]


def _environment(threads: int) -> dict[str, str]:
    """Every worker has its share of the processors: NumPy's threads, and those of OpenGL in software."""
    share = {name: str(threads) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "LP_NUM_THREADS")}
    return {**share, **os.environ}


def _end_of(errors: IO[bytes]) -> str:
    """What a process died of by its standard error: how Python puts it, or the last line."""
    errors.seek(0, os.SEEK_END)
    errors.seek(max(0, errors.tell() - 4096))
    lines = errors.read().decode("utf-8", "replace").strip().splitlines()
    # Behind that, Python lists where it was, and all modules that were loaded.
    fatal = [line for line in lines if line.startswith("Fatal Python error: ")]
    return (fatal or lines or [""])[-1].strip()
