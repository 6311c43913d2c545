"""Executors: who does the tasks. What an executor must be able to do, and the one that does them here and now.

An executor is given orders, as many as its capacity, and passes on what becomes of them. Whether it has processes,
machines or nothing at all behind it, is its own affair: it needs the output folder, and `performing.perform`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Protocol, Self

from .performing import Message, Order, perform


class ExecutorError(Exception):
    """Why an executor can do nothing, in one line, and the way out."""


class Executor(Protocol):
    """Does orders. A context: leaving it ends all that it started."""

    capacity: int
    """How many orders it wants to have at a time."""

    def submit(self, order: Order) -> None:
        """Take an order."""

    def wait(self, tell: Callable[[Message], object], seconds: float) -> None:
        """Pass on what has happened, and where nothing has, wait for it, so long at most.

        Every order ends with one of `Made`, `Failed` and `Lost`.
        """

    def stop(self) -> None:
        """Drop all orders and end what is at work, within a second, whatever it does. It can be used again."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...


class SerialExecutor:
    """Does one order after the other, in this process."""

    capacity = 1

    def __init__(self) -> None:
        self._orders: deque[Order] = deque()

    def submit(self, order: Order) -> None:
        self._orders.append(order)

    def wait(self, tell: Callable[[Message], object], seconds: float) -> None:
        if self._orders:
            tell(perform(self._orders.popleft(), tell))

    def stop(self) -> None:
        self._orders.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
