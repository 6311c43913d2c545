"""What an edit makes the extension look at: what has to do with modes, and nothing twice."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.animation.live import refreshing
from tests.animation.oracle import assert_shown
from tests.animation.scenes import key, new_object


@pytest.fixture
def read(live_file, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of what the channels were read of, in a file of three objects that have no mode."""
    for name in ("A", "B", "C"):
        key(new_object(name))
    bpy.context.view_layer.update()
    names: list[str] = []

    def keyed_in(places):
        names.extend(place.name for place in places)
        return of_places(places)

    of_places = refreshing.keyed_in
    monkeypatch.setattr(refreshing, "keyed_in", keyed_in)
    return names


def key_on_the_way(tmp_path: Path) -> None:
    obj = bpy.data.objects["B"]
    for frame in range(1, 5):
        bpy.context.scene.frame_set(frame)
        obj.location.x = frame
        obj.keyframe_insert("location")


def pose_on_the_way(tmp_path: Path) -> None:
    for frame in range(1, 5):
        bpy.data.objects["B"].location.x = frame
        bpy.context.scene.frame_set(frame)


def change_the_range(tmp_path: Path) -> None:
    bpy.context.scene.frame_end += 10


def save(tmp_path: Path) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"), copy=True)


def undo(tmp_path: Path) -> None:
    bpy.ops.ed.undo_push(message="before")
    bpy.data.objects["B"].location.x += 1.0
    bpy.ops.ed.undo_push(message="moved")
    bpy.ops.ed.undo()


DEEDS = [key_on_the_way, pose_on_the_way, change_the_range, save, undo]


@pytest.mark.parametrize("deed", DEEDS, ids=lambda deed: deed.__name__)
def test_beside_an_object_with_a_mode_others_are_not_read(read, deed: Callable[[Path], None], tmp_path):
    set_mode(bpy.data.objects["A"], "dq_sclerp")
    read.clear()
    deed(tmp_path)
    bpy.context.view_layer.update()
    assert set(read) <= {"A"}


def test_a_key_set_on_the_way_from_frame_to_frame_shows_on_the_next_one(read):
    obj = bpy.data.objects["B"]
    set_mode(obj, "dq_sclerp")
    for frame, x in ((5, 3.0), (15, -2.0), (30, 1.0)):
        bpy.context.scene.frame_set(frame)
        fcurve = bpy.data.objects["B"].animation_data.action.layers[0].strips[0].channelbags[0].fcurves.find("location")
        fcurve.keyframe_points[1].co_ui.y += x
    bpy.context.scene.frame_set(7)
    assert_shown([obj], np.arange(-3.0, 46.0))
