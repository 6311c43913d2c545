"""Helpers for tests of bake.py: running it, and files to run it on."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from rigid_motion import animation
from rigid_motion.animation import set_mode
from rigid_motion_batch.cli import bake
from tests.animation.keyed import curves_of
from tests.animation.scenes import key, new_object
from tests.blank import blank

LAST = 103
"""The last frame of the scenes: after the last key and the last NLA strip."""


def run(*arguments: object) -> int:
    return bake.main([*map(str, arguments), "--jobs", "0"])


@contextmanager
def extension() -> Iterator[None]:
    """Register the extension within the block, as an animator has it; bake.py registers its own."""
    animation.register()
    try:
        yield
    finally:
        animation.unregister()


def new_file() -> None:
    blank()
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 0, LAST


def save(path: Path, **options: object) -> Path:
    bpy.ops.wm.save_as_mainfile(filepath=str(path), **options)
    return path


def open_again(path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(path))


def one_object_file(path: Path, edit: Callable[[bpy.types.Object], object] = lambda obj: None, **options) -> Path:
    """Save a file with one live object, edited by `edit`."""
    with extension():
        new_file()
        obj = key(new_object("Tool"))
        set_mode(obj, "dq_sclerp")
        edit(obj)
        return save(path, **options)


def baked_name(path: Path) -> Path:
    return path.with_name(f"{path.stem}-baked.blend")


def frames_of_keys(obj: bpy.types.Object) -> list[float]:
    return [point.co.x for point in curves_of(obj)["location", 0].keyframe_points]


def with_version(path: Path, old_style: str, new_style: str) -> None:
    """Make a file say that another Blender saved it: up to 5.0 as in v405, later as in v0500."""
    content = path.read_bytes()
    place = content.index(b"v") + 1
    version = (old_style if content[7:9] == b"-v" else new_style).encode()
    path.write_bytes(content[:place] + version + content[place + len(version) :])
