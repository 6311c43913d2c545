"""While a large rig is edited in a window it is right on whole frames, and between them wherever that matters."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation.live import edited, follower
from rigid_motion.animation.writers import filling
from tests.animation.bones.rigs import moving_rig
from tests.animation.bones.test_between_frames import EIGHTHS, PROMISE, largest_error
from tests.animation.keyed import curves_of
from tests.animation.scenes import push_down


@pytest.fixture
def window(live_file, monkeypatch) -> Iterator[bpy.types.Context]:
    """A new file that is edited as in a window, in which every rig is large."""
    monkeypatch.setattr(filling, "LARGE", 0)
    follower.set_drafts(True)
    yield live_file
    follower.set_drafts(False)


@pytest.fixture
def rig(window) -> bpy.types.Object:
    rig = moving_rig()
    bpy.context.view_layer.update()
    return rig


def is_draft(rig: bpy.types.Object) -> bool:
    return rig.animation_data.action.rigid_motion.is_draft


def rates(rig: bpy.types.Object) -> set[int]:
    return rates_in(rig.animation_data.action)


def rates_in(action: bpy.types.Action) -> set[int]:
    return {record.rate for record in action.rigid_motion.slots}


def edit(rig: bpy.types.Object, by: float = 0.3) -> None:
    curves_of(rig.pose.bones["Hand"])["location", 0].keyframe_points[1].co_ui.y += by
    bpy.context.view_layer.update()


def is_exact_by_itself(rig: bpy.types.Object) -> bool:
    """Whether bones are exact between frames in what the file has without being followed."""
    follower.follower.enabled = False
    try:
        return max(largest_error(rig, EIGHTHS).values()) < PROMISE
    finally:
        follower.follower.enabled = True


def test_what_is_taken_out_is_what_is_computed_on_whole_frames(rig):
    def samples() -> list[np.ndarray]:
        result = []
        for fcurve in follower.slots_in([rig.animation_data.action])[0].bones_channelbag.fcurves:
            result.append(np.empty(2 * len(fcurve.sampled_points), np.float32))
            fcurve.sampled_points.foreach_get("co", result[-1])
        return result

    computed = samples()
    follower.follower.finish_drafts()
    assert max(rates(rig)) > 1
    edit(rig, 0.3)
    edit(rig, -0.3)
    for one, other in zip(samples(), computed, strict=True):
        assert np.allclose(one, other, atol=1e-6)


def test_a_file_that_is_saved_is_exact(rig, tmp_path):
    name, path = rig.name, tmp_path / "saved.blend"
    edit(rig)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    assert not is_draft(rig)
    follower.follower.enabled = False
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert is_exact_by_itself(bpy.data.objects[name])


def test_a_file_that_blender_saved_by_itself_is_exact_in_the_background(rig, tmp_path):
    name, path = rig.name, tmp_path / "autosave.blend"
    edit(rig)
    follower.follower.enabled = False
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    follower.follower.enabled = True
    follower.set_drafts(False)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert is_exact_by_itself(bpy.data.objects[name])


def test_a_render_is_exact(rig):
    edit(rig)
    for handler in bpy.app.handlers.render_init:
        handler(bpy.context.scene, None)
    assert is_exact_by_itself(rig)


BETWEEN = {"scale": 2.0}, {"frame_start_ui": 1.5}, {"use_reverse": True}, {"repeat": 1.5}, {"use_animated_time": True}


@pytest.mark.parametrize("settings", BETWEEN, ids=lambda settings: next(iter(settings)))
def test_strips_that_show_what_is_between_frames_are_exact(rig, settings):
    edit(rig)
    action = rig.animation_data.action
    strip = push_down(rig)
    edit_in(action)
    assert action.rigid_motion.is_draft
    for name, value in settings.items():
        setattr(strip, name, value)
    bpy.context.view_layer.update()
    for _ in range(2):
        assert not action.rigid_motion.is_draft
        assert max(rates_in(action)) > 1
        edit_in(action)


def edit_in(action: bpy.types.Action) -> None:
    action.layers[0].strips[0].channelbags[0].fcurves[0].keyframe_points[1].co_ui.y += 0.2
    bpy.context.view_layer.update()


def test_nothing_is_left_in_draft_where_edits_are_not_followed(rig):
    edit(rig)
    animation.set_enabled(False)
    assert is_exact_by_itself(rig)


def test_an_action_in_draft_that_nothing_had_for_a_while_is_exact(rig):
    edit(rig)
    data = rig.animation_data
    action, slot = data.action, data.action_slot
    data.action = None
    bpy.context.view_layer.update()
    follower.follower.finish_drafts()
    assert not action.rigid_motion.is_draft
    follower.set_drafts(False)
    data.action, data.action_slot = action, slot
    bpy.context.view_layer.update()
    assert is_exact_by_itself(rig)


def test_the_error_that_is_told_is_not_that_of_a_draft(rig):
    follower.follower.finish_drafts()
    before = animation.error_between_frames(rig.pose.bones["Hand"])
    edit(rig)
    assert animation.error_between_frames(rig.pose.bones["Hand"]) == before > 0.0


def test_small_rigs_are_exact_at_once(window, monkeypatch):
    monkeypatch.undo()
    rig = moving_rig()
    edit(rig)
    assert not is_draft(rig)
    assert is_exact_by_itself(rig)


def test_a_render_waits_for_the_main_thread_but_not_for_ever(monkeypatch):
    monkeypatch.setattr(edited, "PATIENCE", 0.0)
    done: list[str] = []
    thread = threading.Thread(target=edited.on_main_thread, args=(lambda: done.append("done"),))
    thread.start()
    thread.join()
    assert done == ["done"]
