"""`map` in several processes, for parts of one long input. The standard library alone: Blender brings no more."""

from __future__ import annotations

import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any

from rigid_motion.motion.skeleton_stretches import Run
from rigid_motion_batch.supervising import end_with_parent


@contextmanager
def side_by_side(processes: int) -> Iterator[Run]:
    """Give what is called as `map` is. Processes are started with its first call, arguments made as they are needed."""
    pool: ProcessPoolExecutor | None = None

    def run(function: Callable[[Any], Any], arguments: Iterable[Any]) -> Iterator[Any]:
        nonlocal pool
        pool = pool or ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), _begin)
        waiting: deque[Future[Any]] = deque()
        for argument in arguments:
            waiting.append(pool.submit(function, argument))
            if len(waiting) > processes:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()

    try:
        yield run if processes > 1 else map
    finally:
        if pool:
            pool.shutdown(cancel_futures=True)


def _begin() -> None:
    """Leave Ctrl-C to the parent, and end with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
