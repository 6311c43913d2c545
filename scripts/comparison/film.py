"""The film: a stage rendered to a video that any browser plays, and saved as the .blend it was rendered from.

H.264 in an MP4, by Blender's own encoder. Either file is written beside its place and moved into it when it is whole.
"""

from __future__ import annotations

import ctypes
import io
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path

import bpy

QUALITY = "HIGH"
"""Of Blender's constant rate factors, the one that leaves thin lines and small letters sharp."""


def render_film(scene: bpy.types.Scene, path: Path, progress: Callable[[int, int], None] | None = None) -> float:
    """Render all frames of the scene to an MP4.

    Parameters
    ----------
    scene : bpy.types.Scene
        With an even width and height, which the codec needs.
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
    """
    total = scene.frame_end - scene.frame_start + 1
    with _written_beside(path) as beside, _counting(progress, total):
        _encode_as_mp4(scene, beside)
        started = time.perf_counter()
        with _hushed():
            bpy.ops.render.render(animation=True, scene=scene.name)
        seconds = time.perf_counter() - started
        if not beside.is_file():
            raise RuntimeError(f"{path}: Blender rendered no video; is the resolution even, and the disk not full?")
    return seconds


def save_blend(path: Path) -> None:
    """Save the open file as a compressed .blend. A file that is there is replaced."""
    with _written_beside(path) as beside, _hushed():
        bpy.ops.wm.save_as_mainfile(filepath=str(beside), compress=True, copy=True, check_existing=False)


def _encode_as_mp4(scene: bpy.types.Scene, path: Path) -> None:
    image = scene.render.image_settings
    if hasattr(image, "media_type"):  # Blender 5 asks for the kind of output first.
        image.media_type = "VIDEO"
    image.file_format = "FFMPEG"
    image.color_mode = "RGB"
    video = scene.render.ffmpeg
    video.format, video.codec, video.audio_codec = "MPEG4", "H264", "NONE"
    video.constant_rate_factor = QUALITY
    video.ffmpeg_preset = "REALTIME"
    video.gopsize = scene.render.fps
    scene.render.use_file_extension = True
    scene.render.filepath = str(path)


@contextmanager
def _written_beside(path: Path) -> Iterator[Path]:
    """A path for a new file next to `path`, which takes its place when the block ends well."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.resolve().with_name(f".{os.getpid()}.{path.name}")
    try:
        yield beside
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


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
def _hushed() -> Iterator[None]:
    """Keep what Blender says of every frame and file off the standard output: it goes by Python and by C."""
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
