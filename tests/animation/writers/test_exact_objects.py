"""Objects that are exact between frames: a constraint adds their differences, and delta transforms stay theirs."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import error_between_frames, refresh, set_exact, set_mode
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.rigs import ORDERS, in_turn
from tests.animation.oracle import Own, curves_of, expected_worlds, shown_worlds
from tests.animation.scenes import give_own_deltas, key, new_object, own_deltas

PROMISE = 1e-4
"""Metres."""

EIGHTHS = np.arange(8 * 1.0, 8 * 40.0 + 1.0) / 8.0

POINTS = np.concatenate((np.zeros((1, 3)), 0.1 * np.eye(3)))


def largest_error(obj: bpy.types.Object, frames: np.ndarray, own: Own | None = None) -> float:
    """How far the object's origin, or a point ten centimetres away along its axes, is off."""
    (shown,), wanted = shown_worlds([obj], frames), expected_worlds(obj, frames, {obj.name: own or Own()})
    one, other = (m[:, None, :3, :3] @ POINTS[:, :, None] + m[:, None, :3, 3:] for m in (shown, wanted))
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


@pytest.mark.parametrize("order", ["QUATERNION", "XYZ"])
def test_delta_transforms_of_its_own_stay_the_objects(live_file, order):
    obj = new_object("Tool", order)
    own = give_own_deltas(obj)
    set_mode(key(obj), "dq_sclerp")
    set_exact(obj)
    bpy.context.view_layer.update()
    assert own_deltas(obj) == own
    assert largest_error(obj, EIGHTHS, own) < PROMISE
    set_exact(obj, False)
    set_mode(obj, "BLENDER")
    assert own_deltas(obj) == own
