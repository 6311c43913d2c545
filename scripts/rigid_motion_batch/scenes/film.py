"""The film: a stage rendered to a video that any browser plays, and saved as the .blend it was rendered from.

A film may be rendered in pieces, by several processes, and joined; that costs it nothing. Every file is written beside
its place and moved into it when it is whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy

from rigid_motion import blender
from rigid_motion_batch.files import written_beside
from rigid_motion_batch.saving import save_copy
from rigid_motion_batch.silencing import silenced

LOSSLESS = "HUFFYUV", "MKV", ".mkv"
"""Codec, container and extension of pieces of a film: exact to the bit, and quicker than PNG or FFV1."""


def render_film(scene: bpy.types.Scene, path: Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Render all frames of the scene to its MP4.

    Parameters
    ----------
    scene : bpy.types.Scene
        Set up for video, as `scene.build_scene` leaves it.
    path : Path
        Ending in .mp4. A file that is there is replaced, once the new one is whole.
    progress : callable, optional
        Called after every frame with the number of frames that are done, and of all.

    Raises
    ------
    RuntimeError
        Where Blender cannot render.
    OSError
        Where the file cannot be put in its place.
    KeyboardInterrupt
        After Ctrl-C in a Blender program, which cancels; the module renders on.
    """
    total = scene.frame_end - scene.frame_start + 1
    with written_beside(path) as beside, _counting(progress, total):
        kept, scene.render.filepath = scene.render.filepath, str(beside)
        try:
            with silenced():
                ended = bpy.ops.render.render(animation=True, scene=scene.name)
        finally:
            scene.render.filepath = kept
        if "CANCELLED" in ended:
            raise KeyboardInterrupt
        if not beside.is_file():
            raise RuntimeError(f"{path}: Blender rendered no video; is the resolution even, and the disk not full?")


def render_piece(
    blend: Path, first: int, last: int, path: Path, progress: Callable[[int, int], None] | None = None
) -> None:
    """Render the frames from the first to the last of a saved stage, without loss.

    Parameters
    ----------
    blend : Path
        As `save_blend` left it.
    first, last : int
        Frames, both included.
    path : Path
        Ending as `LOSSLESS` says.
    progress : callable, optional
        As of `render_film`, and so is what is raised.
    """
    scene = _open(blend)
    scene.frame_start, scene.frame_end = first, last
    video: Any = scene.render.ffmpeg
    video.codec, video.format = LOSSLESS[:2]
    render_film(scene, path, progress)


def join_pieces(
    blend: Path, pieces: Sequence[Path], path: Path, progress: Callable[[int, int], None] | None = None
) -> None:
    """Encode a film from its pieces, as if it had been rendered in one: the frames are the same to the bit.

    Parameters
    ----------
    blend : Path
        The stage that they are of, which says how it wants to be encoded.
    pieces : sequence of Path
        In their order, without gaps.
    path : Path
        Ending in .mp4.
    progress : callable, optional
        As of `render_film`, and so is what is raised.

    Raises
    ------
    RuntimeError
        Also where the pieces have more or fewer frames than the stage.
    """
    scene = _open(blend)
    strips = scene.sequence_editor_create().strips
    frame = scene.frame_start
    for number, piece in enumerate(pieces):
        strip = strips.new_movie(f"Piece {number}", str(piece), 1, frame, fit_method="ORIGINAL")
        # Blender 5.2 warns of the name that it had before.
        frame += strip.content_duration if hasattr(strip, "content_duration") else strip.frame_duration
    if frame != scene.frame_end + 1:
        raise RuntimeError(f"{path}: its pieces have {frame - scene.frame_start} frames of {scene.frame_end}")
    scene.render.use_sequencer = True
    render_film(scene, path, progress)


def _open(blend: Path) -> bpy.types.Scene:
    """Return the scene of a saved stage, which is opened for it. Its scripts, if it has come by any, do not run."""
    with silenced():
        bpy.ops.wm.open_mainfile(filepath=str(blend), use_scripts=False, load_ui=False)
    return blender.scene()


def save_blend(path: Path) -> None:
    """Save the open file as a compressed .blend. A file that is there is replaced."""
    with written_beside(path) as beside, silenced():
        save_copy(beside, compress=True)


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
