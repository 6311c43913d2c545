"""Files that are damaged while edits are not followed, saved and opened again, beside a whole object."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np

from rigid_motion import animation
from rigid_motion.animation import MODE_IDS, modes_of, problem_of, set_mode
from rigid_motion.animation.actions.marks import write_marks
from tests.animation.keyed import WIDTHS, curves_of
from tests.animation.modified import is_term
from tests.animation.scenes import FRAMES, key, new_object
from tests.blank import blank

SEEN = range(-2, 46)

SECONDS = 10.0
"""Far more than any file here needs, and far less than an animator would wait for."""

NAN, INF = float("nan"), float("inf")
LARGEST = float(np.finfo(np.float32).max)

TRANSFORMS = ("location", "rotation_quaternion", "scale")
LOCATION_Y, TURN_W = ("location", 1), ("rotation_quaternion", 0)

Damage = Callable[[bpy.types.Object], None]


# Files and what happens to them


def make(damage: Damage, mode: str = "dq_sclerp", name: str = "Broken") -> None:
    """A new file with an object that gets damaged, and one that does not."""
    animation.set_enabled(True)
    blank()
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 40
    broken, whole = key(new_object(name), seed=1, scale="even"), key(new_object("Whole"), seed=2)
    set_mode(broken, mode)
    set_mode(whole, mode, FRAMES)
    animation.set_enabled(False)
    damage(broken)


def reopened(folder: Path, *, followed: bool = True) -> tuple[bpy.types.Object, bpy.types.Object]:
    """The damaged and the whole object of the file, saved and opened again; followed by the extension or not."""
    path = str(folder / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    animation.set_enabled(followed)
    with soon():
        bpy.ops.wm.open_mainfile(filepath=path)
        bpy.context.view_layer.update()
    whole = bpy.data.objects["Whole"]
    return next(obj for obj in bpy.data.objects if obj != whole), whole


@contextmanager
def soon() -> Iterator[None]:
    began = time.perf_counter()
    yield
    assert time.perf_counter() - began < SECONDS


def use(obj: bpy.types.Object) -> None:
    """What an animator does next, and what the panel asks for."""
    with soon():
        for (path, _), fcurve in curves_of(obj).items():
            if path == "location" and len(fcurve.keyframe_points):
                fcurve.keyframe_points[-1].select_control_point = True
                fcurve.keyframe_points[-1].co_ui.y += 1.0
                fcurve.update()
        bpy.context.view_layer.update()
        obj.location.x += 1.0
        bpy.context.view_layer.update()
        for frame in (5, 30, 12):
            bpy.context.scene.frame_set(frame)
        assert set(modes_of(obj, np.array(FRAMES))) <= set(MODE_IDS)
        problem_of(obj)
        animation.refresh()


# Damage


def numbers(channel: tuple[str, int], field: str, value: float, *at: int) -> Damage:
    """One number of these keys of a channel is another, of all without any; nothing else follows."""
    name, _, axis = field.partition(".")

    def damage(obj: bpy.types.Object) -> None:
        points = curves_of(obj)[channel].keyframe_points
        width, dtype = (2, np.float32) if axis else (1, np.int32 if name in ("interpolation", "easing") else np.float32)
        result = np.empty(width * len(points), dtype)
        points.foreach_get(name, result)
        result.reshape(-1, width)[list(at) or slice(None), int(axis == "y")] = value
        points.foreach_set(name, result)

    return damage


def everywhere(field: str, value: float) -> Damage:
    return each(*(numbers((path, index), field, value) for path in TRANSFORMS for index in range(WIDTHS[path])))


def each(*damages: Damage) -> Damage:
    def damage(obj: bpy.types.Object) -> None:
        for item in damages:
            item(obj)

    return damage


def marks(*of_keys: int) -> Damage:
    """The keys of all channels say these, of which those above the modes that there are mean nothing."""

    def damage(obj: bpy.types.Object) -> None:
        for fcurve in curves_of(obj).values():
            write_marks(fcurve, np.array(of_keys))

    return damage


def terms(change: Callable[[bpy.types.FCurve, bpy.types.FModifierGenerator], None]) -> Damage:
    """The terms of all channels are changed, one after the other."""

    def damage(obj: bpy.types.Object) -> None:
        for fcurve in curves_of(obj).values():
            for modifier in [item for item in fcurve.modifiers if is_term(item)]:
                change(fcurve, modifier)

    return damage
