"""What is keyed, when, and what goes on outside of the keys: in each case the motion is that of the oracle."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from tests.animation.keyed import curves_of, snapshot
from tests.animation.oracle import assert_shown
from tests.animation.scenes import key, new_object

PLAYED = np.arange(-3.0, 46.0)


def is_filled_in(obj: bpy.types.Object) -> bool:
    return any(path.startswith("delta_") for path, _ in curves_of(obj))


@pytest.mark.parametrize("kind", ["LINK_COPY", "FULL_COPY"])
def test_linear_extrapolation_goes_on_to_where_a_scene_ends_that_was_made_anew(live_file, kind):
    obj = key(new_object(), (5.0, 11.0, 30.0), interpolation="LINEAR")
    live_file.scene.frame_start, live_file.scene.frame_end = 0, 45
    for fcurve in curves_of(obj).values():
        fcurve.extrapolation = "LINEAR"
    set_mode(obj, "dq_sclerp")
    bpy.context.view_layer.update()
    bpy.ops.scene.new(type=kind)
    bpy.context.view_layer.update()
    bpy.context.scene.frame_end = 70
    bpy.context.view_layer.update()
    assert_shown(bpy.context.scene.objects, np.arange(71.0))


def test_three_slots_of_one_action_have_modes_and_keys_of_their_own(live_file):
    objects = [new_object(name, order) for name, order in (("A", "QUATERNION"), ("B", "XYZ"), ("C", "ZYX"))]
    action = bpy.data.actions.new("Shared")
    for seed, obj in enumerate(objects):
        obj.animation_data_create().action = action
        obj.animation_data.action_slot = action.slots.new("OBJECT", obj.name)
        key(obj, (1.0 + seed, 10.0, 30.0 + seed), seed=seed)
    for obj, mode in zip(objects, ("dq_sclerp", "pga_lerp", "BLENDER"), strict=True):
        set_mode(obj, mode)
    assert len(action.slots) == 3
    assert [is_filled_in(obj) for obj in objects] == [True, True, False]
    assert_shown(objects, PLAYED)
    before = [snapshot(obj) for obj in objects]
    set_mode(objects[2], "lerp_slerp", [10.0])
    assert [snapshot(obj) for obj in objects[:2]] == before[:2]
    assert_shown(objects, PLAYED)
    action.slots.remove(objects[0].animation_data.action_slot)
    bpy.context.view_layer.update()
    assert_shown(objects[1:], PLAYED)
