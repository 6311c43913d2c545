"""The film: a stage rendered to a video that any browser plays, and saved as the .blend it was rendered from.

Either file is written beside its place and moved into it when it is whole.
"""

from __future__ import annotations

import ctypes
import io
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path

import bpy

from .files import written_beside


def render_film(scene: bpy.types.Scene, path: Path, progress: Callable[[int, int], None] | None = None) -> float:
    """Render all frames of the scene to its MP4.

    Parameters
    ----------
    scene : bpy.types.Scene
        Set up for video, as `stage.build_stage` leaves it.
    path : Path
        Ending in .mp4. A file that is there is replaced, once the new one is whole.
    progress : callable, optional
        Called after every frame with the number of frames that are done, and of all.

    Returns
    -------
    float
        The seconds that Blender's renderer and encoder took.

    Raises
    ------
    RuntimeError
        Where Blender cannot render.
    OSError
        Where the file cannot be put in its place.
    KeyboardInterrupt
        After Ctrl-C, once the frame at hand is done; there is no film then.
    """
    total = scene.frame_end - scene.frame_start + 1
    with written_beside(path) as beside, _interruptible(), _counting(progress, total):
        kept, scene.render.filepath = scene.render.filepath, str(beside)
        started = time.perf_counter()
        try:
            with _hushed():
                ended = bpy.ops.render.render(animation=True, scene=scene.name)
        finally:
            scene.render.filepath = kept
        seconds = time.perf_counter() - started
        if "CANCELLED" in ended:
            raise KeyboardInterrupt
        if not beside.is_file():
            raise RuntimeError(f"{path}: Blender rendered no video; is the resolution even, and the disk not full?")
    return seconds


def save_blend(path: Path) -> None:
    """Save the open file as a compressed .blend. A file that is there is replaced."""
    with written_beside(path) as beside, _hushed():
        bpy.ops.wm.save_as_mainfile(filepath=str(beside), compress=True, copy=True, check_existing=False)


@contextmanager
def _counting(progress: Callable[[int, int], None] | None, total: int) -> Iterator[None]:
    if progress is None:
        yield
        return
    done = 0

    def count(*_: object) -> None:
        nonlocal done
        done += 1
        progress(done, total)

    bpy.app.handlers.render_post.append(count)
    try:
        yield
    finally:
        bpy.app.handlers.render_post.remove(count)


@contextmanager
def _interruptible() -> Iterator[None]:
    """Let Ctrl-C end the rendering after the frame at hand, and raise KeyboardInterrupt then.

    Blender swallows what is raised in its handlers, and renders on. So the scene is put on its last frame, and
    Blender's own loop skips the rest. The Blender program, unlike the module, has an answer to Ctrl-C of its own, which
    Python cannot see: it cancels the rendering.
    """
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is None:
        yield
        return
    interrupted = False

    def interrupt(*_: object) -> None:
        nonlocal interrupted
        interrupted = True

    def skip(scene: bpy.types.Scene, *_: object) -> None:
        if interrupted:
            scene.frame_current = scene.frame_end

    before = signal.signal(signal.SIGINT, interrupt)
    bpy.app.handlers.render_post.append(skip)
    try:
        yield
    finally:
        bpy.app.handlers.render_post.remove(skip)
        signal.signal(signal.SIGINT, before)
    if interrupted:
        raise KeyboardInterrupt


@contextmanager
def _hushed() -> Iterator[None]:
    """Keep what Blender says of every frame and file off the standard output: it goes by Python and by C.

    The standard error stays open: where Blender has to abort, its last words are there.
    """
    _flush_output()
    kept = os.dup(1)
    nothing = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nothing, 1)
        with redirect_stdout(io.StringIO()):
            yield
    finally:
        _flush_output()
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nothing)


def _flush_output() -> None:
    """Write out what Python and C have been holding back."""
    if sys.stdout is not None:  # A windowed Python has none.
        sys.stdout.flush()
    (ctypes.CDLL("ucrtbase") if os.name == "nt" else ctypes.CDLL(None)).fflush(None)
