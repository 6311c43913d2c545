"""When what is between frames is asked for, and where drafts of it can be finished: on Blender's main thread."""

from __future__ import annotations

import threading
from collections.abc import Callable

import bpy

PATIENCE = 10.0
"""Seconds to wait for the main thread, which may be waiting itself: for a render to be cancelled."""


def shows_between_frames() -> bool:
    """Return whether a scene is shown between frames of its Actions, or one is being rendered."""
    return bpy.app.is_job_running("RENDER") or any(
        scene.frame_subframe or scene.render.frame_map_old != scene.render.frame_map_new for scene in bpy.data.scenes
    )


def on_main_thread(work: Callable[[], object]) -> None:
    """Do something on Blender's main thread, and wait for it.

    A render that is watched begins on a thread of its own, while the main thread evaluates and draws what would be
    changed.
    """
    if threading.current_thread() is threading.main_thread():
        work()
        return
    waiting, done = [work], threading.Event()

    def run() -> None:
        try:
            if waiting:
                waiting.pop()()
        finally:
            done.set()

    bpy.app.timers.register(run)
    if not done.wait(PATIENCE):
        if bpy.app.timers.is_registered(run):
            bpy.app.timers.unregister(run)
        run()
