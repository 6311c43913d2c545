"""What a timer of Blender's ticks: one thing at most, until it is stopped, it fails, or another file is loaded."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping
from typing import Any

import bpy

from ..blender import persistent
from ..handlers import append_handlers, remove_handlers

log = logging.getLogger(__package__)

TICKS_PER_S = 60
"""Ticks a second."""


class Ticking:
    """What is ticked, by `tick(now)`, until it is closed, by `close()`. `failure` says what is wrong where it fails;
    `handlers` are called while there is something.
    """

    def __init__(self, failure: str, handlers: Mapping[str, Callable] | None = None) -> None:
        self.thing: Any = None
        """What is ticked, or None."""
        self.trouble = ""
        """The reason why it ended by itself."""
        self._failure = failure

        @persistent
        def on_load(*_: object) -> None:
            self.stop()

        self._handlers = {"load_pre": on_load, **(handlers or {})}
        self._timer = self.look

    def start(self, make: Callable[[], Any]) -> Any:
        """Tick what is made, and nothing else any more, and return it."""
        self.stop()
        self.thing, self.trouble = make(), ""
        append_handlers(self._handlers)
        bpy.app.timers.register(self._timer)
        return self.thing

    def stop(self) -> None:
        """Tick no more, and close it."""
        if self.thing is not None:
            self.thing.close()
            self.thing = None
            remove_handlers(self._handlers)
            if bpy.app.timers.is_registered(self._timer):
                bpy.app.timers.unregister(self._timer)

    def look(self) -> float | None:
        """Return what the timer calls: one tick, and after how many seconds there is another."""
        if self.thing is None:
            return None
        try:
            self.thing.tick(time.monotonic())
        except Exception as error:
            # Blender would only drop the timer, and leave the port open.
            log.exception(self._failure)
            self.stop()
            self.trouble = str(error)
            return None
        return 1.0 / TICKS_PER_S
