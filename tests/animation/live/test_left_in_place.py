"""What takes the animation away between two keys leaves an object or a bone where it is seen, as Blender does."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

from rigid_motion.animation import set_exact, set_mode
from tests.animation.bones.poses import placed
from tests.animation.bones.rig_editing import own_constraints
from tests.animation.bones.rigs import in_turn, key_all, new_rig, pose_mode, select_only
from tests.animation.oracle import world_now
from tests.animation.scenes import editor, give_own_deltas, key, new_object, own_deltas

BETWEEN = 15
ORDERS = ("QUATERNION", "XYZ", "ZXY")


def clear_keyframes(obj: bpy.types.Object) -> None:
    select_only(obj)
    with editor("VIEW_3D"):
        assert bpy.ops.anim.keyframe_clear_v3d() == {"FINISHED"}


def unlink_in_the_editor(obj: bpy.types.Object) -> None:
    select_only(obj)
    with editor("DOPESHEET_EDITOR", "ACTION"):
        assert bpy.ops.action.unlink() == {"FINISHED"}


def delete_channels(obj: bpy.types.Object) -> None:
    action, slot = obj.animation_data.action, obj.animation_data.action_slot
    channelbag = action.layers[0].strips[0].channelbag(slot)
    for fcurve in [fcurve for fcurve in channelbag.fcurves if fcurve.keyframe_points]:
        channelbag.fcurves.remove(fcurve)


ENDS: dict[str, Callable[[bpy.types.Object], None]] = {
    "unlinked": lambda obj: setattr(obj.animation_data, "action", None),
    "unlinked in the editor": unlink_in_the_editor,
    "animation data cleared": lambda obj: obj.animation_data_clear(),
    "keyframes cleared": clear_keyframes,
    "channels deleted": delete_channels,
    "slot unlinked": lambda obj: setattr(obj.animation_data, "action_slot", None),
    "Action deleted": lambda obj: bpy.data.actions.remove(obj.animation_data.action),
    "slot deleted": lambda obj: obj.animation_data.action.slots.remove(obj.animation_data.action_slot),
}


@pytest.mark.parametrize(("own", "exact"), [(False, False), (True, False), (True, True)])
@pytest.mark.parametrize(("end", "order"), in_turn(ENDS, ORDERS))
def test_an_object_stays_where_it_is_seen(live_file, end, order, own, exact):
    obj = new_object("Tool", order)
    before = give_own_deltas(obj) if own else own_deltas(obj)
    key(obj, scale="even")
    set_mode(obj, "cga_lerp")
    set_exact(obj, exact)
    live_file.scene.frame_set(BETWEEN)
    seen = world_now()
    ENDS[end](obj)
    assert np.abs(world_now() - seen).max() < 1e-5
    for frame in (BETWEEN + 5, BETWEEN):
        live_file.scene.frame_set(frame)
        assert np.abs(world_now() - seen).max() < 1e-5
    assert not any(obj.rigid_motion.filled)
    assert own_deltas(obj) == before


@pytest.mark.parametrize("order", ORDERS)
def test_where_its_action_is_deleted_an_object_has_its_own_delta_transforms_again(live_file, order):
    obj = new_object("Tool", order)
    own = give_own_deltas(obj)
    key(obj, scale="even")
    set_mode(obj, "cga_slerp")
    live_file.scene.frame_set(BETWEEN)
    bpy.data.actions.remove(obj.animation_data.action)
    bpy.context.view_layer.update()
    assert own_deltas(obj) == own
    assert not any(obj.rigid_motion.filled)


@pytest.mark.parametrize(("end", "order"), in_turn(ENDS, ORDERS))
def test_the_bones_of_a_rig_stay_where_they_are_seen(live_file, end, order):
    rig = key_all(new_rig(rotation_mode=order))
    set_mode(list(rig.pose.bones), "dq_sclerp")
    live_file.scene.frame_set(BETWEEN)
    seen = placed(rig)
    ENDS[end](rig)
    assert np.abs(placed(rig) - seen).max() < 2e-5
    for frame in (BETWEEN + 5, BETWEEN):
        live_file.scene.frame_set(frame)
        assert np.abs(placed(rig) - seen).max() < 2e-5
    assert not any(own_constraints(bone) for bone in rig.pose.bones)


def test_keyframes_cleared_of_the_selected_bones_leave_these_in_place(live_file):
    rig = key_all(new_rig())
    set_mode(list(rig.pose.bones), "dq_sclerp")
    live_file.scene.frame_set(BETWEEN)
    pose_mode(rig, "Upper", "Hand")
    seen = placed(rig)
    with editor("VIEW_3D"):
        assert bpy.ops.anim.keyframe_clear_v3d() == {"FINISHED"}
    assert np.abs(placed(rig) - seen).max() < 2e-5
    assert [bone.name for bone in rig.pose.bones if own_constraints(bone)] == ["Body", "Lower"]


@pytest.mark.parametrize("path", ["location", "rotation_quaternion"])
def test_channels_of_one_property_deleted_leave_that_in_place(live_file, path):
    obj = key(new_object("Tool"))
    set_mode(obj, "dq_sclerp")
    live_file.scene.frame_set(BETWEEN)
    seen = world_now()
    channelbag = obj.animation_data.action.layers[0].strips[0].channelbag(obj.animation_data.action_slot)
    for channel in [channel for channel in channelbag.fcurves if channel.data_path == path]:
        channelbag.fcurves.remove(channel)
    now = world_now()
    own = np.s_[:3, 3:] if path == "location" else np.s_[:3, :3]
    assert np.abs(now[own] - seen[own]).max() < 1e-5


# -- set in the same go -----------------------------------------------------------------------------------------------


def test_a_matrix_that_is_set_in_the_same_go_is_where_it_lands(live_file):
    obj = key(new_object("Tool"))
    set_mode(obj, "dq_sclerp")
    live_file.scene.frame_set(BETWEEN)
    matrix = Matrix.LocRotScale((1.0, 5.0, -2.0), Euler((0.3, 0.2, 0.1)), (1.0, 1.0, 1.0))
    obj.animation_data_clear()
    obj.matrix_world = matrix
    assert np.abs(world_now() - np.array(matrix)).max() < 1e-5
