"""Timer of live motion: ticks one object at most, until it is stopped, fails, or another file is loaded."""

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
"""Ticks per second."""


class Ticking:
    """Calls `tick(now)` of an object by a timer, and `close()` at the end. `failure` is logged if a tick fails.
    `handlers` are Blender's handlers, active while an object is ticked.
    """

    def __init__(self, failure: str, handlers: Mapping[str, Callable] | None = None) -> None:
        self.thing: Any = None
        """The object being ticked, or None."""
        self.trouble = ""
        """The error that ended the ticking."""
        self._failure = failure

        @persistent
        def on_load(*_: object) -> None:
            self.stop()

        self._handlers = {"load_pre": on_load, **(handlers or {})}
        self._timer = self.look

    def start(self, make: Callable[[], Any]) -> Any:
        """Make an object, tick it in place of any earlier one, and return it."""
        self.stop()
        self.thing, self.trouble = make(), ""
        append_handlers(self._handlers)
        bpy.app.timers.register(self._timer)
        return self.thing

    def stop(self) -> None:
        """Stop ticking, and close the object."""
        if self.thing is not None:
            self.thing.close()
            self.thing = None
            remove_handlers(self._handlers)
            if bpy.app.timers.is_registered(self._timer):
                bpy.app.timers.unregister(self._timer)

    def look(self) -> float | None:
        """Tick once, as the callback of the timer. Return the seconds until the next tick, None to end the timer."""
        if self.thing is None:
            return None
        try:
            self.thing.tick(time.monotonic())
        except Exception as error:
            # Blender would only remove the timer, and leave the port open.
            log.exception(self._failure)
            self.stop()
            self.trouble = str(error)
            return None
        return 1.0 / TICKS_PER_S
