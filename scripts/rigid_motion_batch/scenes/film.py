"""Film rendering: renders a scene to a video that any browser plays, and saves the .blend it was rendered from.

Several processes may render a film in pieces, which are then joined without loss. Every file is written under a
temporary name and moved into place when complete.
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
"""Codec, container and extension of film pieces: lossless, and faster than PNG or FFV1."""


def render_film(scene: bpy.types.Scene, path: Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Render all frames of the scene to an MP4 file.

    Parameters
    ----------
    scene : bpy.types.Scene
        Set up for video, as `scene.build_scene` leaves it.
    path : Path
        Ends in .mp4. An existing file is replaced once the new one is complete.
    progress : callable, optional
        Called after every frame with the number of finished frames, and of all frames.

    Raises
    ------
    RuntimeError
        If Blender cannot render.
    OSError
        If the file cannot be moved into place.
    KeyboardInterrupt
        After Ctrl-C in a Blender program, which cancels rendering; the module keeps rendering.
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
    """Render frames `first` to `last` of a saved scene, without loss.

    Parameters
    ----------
    blend : Path
        Saved by `save_blend`.
    first, last : int
        Frames, both included.
    path : Path
        Has the extension of `LOSSLESS`.
    progress : callable, optional
        As in `render_film`, and so are the errors raised.
    """
    scene = _open(blend)
    scene.frame_start, scene.frame_end = first, last
    video: Any = scene.render.ffmpeg
    video.codec, video.format = LOSSLESS[:2]
    render_film(scene, path, progress)


def join_pieces(
    blend: Path, pieces: Sequence[Path], path: Path, progress: Callable[[int, int], None] | None = None
) -> None:
    """Encode a film from its pieces, bit-identical to a film rendered at once.

    Parameters
    ----------
    blend : Path
        The scene of the pieces, which has the encoder settings.
    pieces : sequence of Path
        In order, without gaps.
    path : Path
        Ends in .mp4.
    progress : callable, optional
        As in `render_film`, and so are the errors raised.

    Raises
    ------
    RuntimeError
        Also if the pieces have more or fewer frames than the scene.
    """
    scene = _open(blend)
    strips = scene.sequence_editor_create().strips
    frame = scene.frame_start
    for number, piece in enumerate(pieces):
        strip = strips.new_movie(f"Piece {number}", str(piece), 1, frame, fit_method="ORIGINAL")
        # Blender 5.2 warns about the old name.
        frame += strip.content_duration if hasattr(strip, "content_duration") else strip.frame_duration
    if frame != scene.frame_end + 1:
        raise RuntimeError(f"{path}: its pieces have {frame - scene.frame_start} frames of {scene.frame_end}")
    scene.render.use_sequencer = True
    render_film(scene, path, progress)


def _open(blend: Path) -> bpy.types.Scene:
    """Open a saved file and return its scene. Scripts in the file do not run."""
    with silenced():
        bpy.ops.wm.open_mainfile(filepath=str(blend), use_scripts=False, load_ui=False)
    return blender.scene()


def save_blend(path: Path) -> None:
    """Save the open file as a compressed .blend. An existing file is replaced."""
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
