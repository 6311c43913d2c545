"""Fixtures that write small recordings and scenes, and check that an error has the promised one-line form."""

import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from rigid_motion_batch.recordings import ReadingOptions, TrajectoryError, read_trajectories


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str, str | bytes], str]:
    """A function that writes a file with a given name and content, and returns its path."""

    def _write(name: str, content: str | bytes) -> str:
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return str(path)

    return _write


@pytest.fixture
def refusal() -> Callable[..., tuple[int | None, str]]:
    """A function that reads an unreadable source with given options, and returns the line and the rest of the error."""

    def _refusal(source: str, **options: object) -> tuple[int | None, str]:
        started = time.process_time()
        with pytest.raises(TrajectoryError) as caught:
            read_trajectories(source, ReadingOptions(**options))
        assert time.process_time() - started < 20.0
        message = str(caught.value)
        parts = re.fullmatch(r"(?P<path>.+?\.\w+)(:(?P<line>\d+))?: (?P<problem>.+?); (?P<way_out>.+)", message)
        assert parts, f"not of the form FILE:LINE: problem; way out: {message!r}"
        assert source.startswith(parts["path"])
        return (int(parts["line"]) if parts["line"] else None), message[parts.start("problem") :]

    return _refusal


@pytest.fixture
def scene() -> Iterator[object]:
    """An empty scene to fill, cleared afterwards."""
    blends = pytest.importorskip("tests.scripts.recordings.blends")
    scene = blends.blank().scene
    scene.render.fps, scene.frame_end = blends.FPS, 30
    yield scene
    blends.blank()


@pytest.fixture
def saved(scene: object, tmp_path: Path) -> Callable[..., str]:
    """A function that saves the scene, clears it, and returns the path."""
    blends = pytest.importorskip("tests.scripts.recordings.blends")
    return lambda name="scene.blend": str(blends.export(tmp_path / name))
