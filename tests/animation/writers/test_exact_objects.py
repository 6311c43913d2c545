"""Objects that are exact between frames: a constraint adds their differences, and delta transforms stay theirs."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import error_between_frames, refresh, set_exact, set_mode
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.rigs import ORDERS, in_turn
from tests.animation.bones.test_between_frames import EIGHTHS, PROMISE
from tests.animation.keyed import curves_of
from tests.animation.oracle import Own, expected_worlds, shown_worlds
from tests.animation.scenes import key, new_object, push_down

POINTS = np.concatenate((np.zeros((1, 3)), 0.1 * np.eye(3)))


def largest_error(obj: bpy.types.Object, frames: np.ndarray, own: Own | None = None) -> float:
    """How far the object's origin, or a point ten centimetres away along its axes, is off."""
    (shown,), expected = shown_worlds([obj], frames), expected_worlds(obj, frames, {obj.name: own or Own()})
    one, other = (m[:, None, :3, :3] @ POINTS[:, :, None] + m[:, None, :3, 3:] for m in (shown, expected))
    return float(np.linalg.norm(one - other, axis=2).max())


@pytest.mark.parametrize(("mode", "order"), in_turn(KEYFRAME_MODES, ORDERS))
@pytest.mark.parametrize("parent", [False, True], ids=["no parent", "parent"])
def test_an_object_is_right_between_frames(live_file, mode, order, parent):
    obj = key(new_object("Tool", order))
    if parent:
        obj.parent = new_object("Parent", "XYZ")
        obj.parent.location, obj.parent.rotation_euler = (1.0, 2.0, -0.5), (0.3, -0.4, 1.0)
        obj.matrix_parent_inverse = obj.parent.matrix_basis.inverted() @ obj.parent.matrix_basis.inverted()
    set_mode(obj, mode)
    bpy.context.view_layer.update()
    assert largest_error(obj, EIGHTHS) > 10.0 * PROMISE
    assert error_between_frames(obj) > 10.0 * PROMISE
    set_exact(obj)
    bpy.context.view_layer.update()
    assert largest_error(obj, EIGHTHS) < PROMISE
    assert not any(path.startswith("delta_") for path, _ in curves_of(obj))
    assert refresh() == 0
    set_exact(obj, False)
    bpy.context.view_layer.update()
    assert len(obj.constraints) == 0
    assert len(obj.animation_data.action.slots) == 1
    assert largest_error(obj, np.arange(1.0, 41.0)) < 1e-4
    assert any(path.startswith("delta_") for path, _ in curves_of(obj))


def test_who_comes_to_share_the_action_is_exact_as_well(live_file):
    obj, other = (set_up(name) for name in ("Tool", "Other"))
    set_exact(obj)
    other.animation_data.action = obj.animation_data.action
    other.animation_data.action_slot = obj.animation_data.action_slot
    bpy.context.view_layer.update()
    for item in (obj, other):
        assert largest_error(item, EIGHTHS) < PROMISE
    set_exact(other, False)
    bpy.context.view_layer.update()
    for item in (obj, other):
        assert not len(item.constraints)
        assert largest_error(item, np.arange(1.0, 41.0)) < PROMISE
    assert refresh() == 0


def set_up(name: str) -> bpy.types.Object:
    obj = key(new_object(name), seed=sum(map(ord, name)))
    set_mode(obj, "dq_sclerp")
    bpy.context.view_layer.update()
    return obj


def test_it_is_saved_undone_and_slowed_down(live_file, tmp_path):
    set_up("Tool")
    bpy.ops.ed.undo_push()
    set_exact(bpy.data.objects["Tool"])
    bpy.ops.ed.undo_push()
    bpy.ops.ed.undo()
    assert not len(bpy.data.objects["Tool"].constraints)
    assert largest_error(bpy.data.objects["Tool"], np.arange(1.0, 41.0)) < PROMISE
    bpy.ops.ed.redo()
    assert largest_error(bpy.data.objects["Tool"], EIGHTHS) < PROMISE
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "exact.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "exact.blend"))
    obj = bpy.data.objects["Tool"]
    assert refresh() == 0
    assert largest_error(obj, EIGHTHS) < PROMISE
    assert tuple(obj.animation_data.action.frame_range) == (1.0, 40.0)
    expected = expected_worlds(obj, EIGHTHS)
    push_down(obj, scale=4.0)
    (shown,) = shown_worlds([obj], 1.0 + 4.0 * (EIGHTHS - 1.0))
    assert np.abs(shown - expected).max() < PROMISE


def test_a_driver_of_the_rotation_may_come_and_go(live_file):
    obj = key(new_object("Tool"))
    set_mode(obj, "cga_slerp")
    set_exact(obj)
    frames = np.arange(1.0, 41.0)
    (before,) = shown_worlds([obj], frames)
    obj.driver_add("rotation_quaternion", 2).driver.expression = "0.3"
    bpy.context.view_layer.update()
    (driven,) = shown_worlds([obj], frames)
    assert np.abs(driven - before).max() > 0.1
    obj.driver_remove("rotation_quaternion", 2)
    bpy.context.view_layer.update()
    (after,) = shown_worlds([obj], frames)
    assert np.abs(after - before).max() < 1e-4
