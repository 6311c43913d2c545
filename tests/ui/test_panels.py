"""What the panel shows of an object, without a window: the segment under the playhead, and what there is to know."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix, Quaternion, Vector

from rigid_motion.animation import bake, set_enabled, set_mode, unbake
from rigid_motion.ui.panels import facts_and_notes
from rigid_motion.ui.wording import BAKED, DELTA_EDITED, OUT_OF_DATE, STRIPS
from tests.animation.keyed import curves_of
from tests.animation.scenes import give_own_deltas, key, new_object
from tests.ui.conftest import keyed

IN_THE_FIRST_SEGMENT = 5.0


def notes_on(obj, frame=IN_THE_FIRST_SEGMENT):
    """What the panel says on a frame, and the mode of the segment it shows."""
    bpy.context.scene.frame_set(int(frame))
    segment, notes = facts_and_notes(obj, frame)
    return [text for _, text in notes], segment and segment.mode


def test_of_a_plain_segment_its_facts_are_shown_and_no_more(tool):
    assert notes_on(tool) == ([], "BLENDER")
    set_mode(tool, "dq_sclerp")
    assert notes_on(tool) == ([], "dq_sclerp")
    segment, _ = facts_and_notes(tool, 15.0)
    assert (segment.first, segment.last) == (11.0, 21.0)
    assert segment.turn == pytest.approx(math.pi / 2, abs=1e-6)
    assert segment.distance == pytest.approx(2.0)


def test_a_refusal_is_shown_with_the_way_out_and_without_a_segment(tool):
    set_mode(tool, "dq_sclerp")
    tool.driver_add("delta_location", 2)
    (text,), mode = notes_on(tool)
    assert "Delta Location Z is driven" in text
    assert mode is None


def test_what_is_baked_can_be_un_baked(tool):
    set_mode(tool, "dq_sclerp")
    bake(tool)
    assert notes_on(tool) == ([BAKED], "BLENDER")
    unbake(tool)
    assert notes_on(tool) == ([], "dq_sclerp")


def test_an_edit_that_nobody_follows_is_noted_until_it_is_refreshed(tool):
    set_mode(tool, "dq_sclerp")
    set_enabled(False)
    curves_of(tool)["location", 0].keyframe_points[1].co.y += 1.0
    assert notes_on(tool) == ([OUT_OF_DATE], "dq_sclerp")
    bpy.ops.rigid_motion.refresh()
    assert notes_on(tool) == ([], "dq_sclerp")


def test_an_object_that_strips_move_has_its_keys_in_there(tool):
    action = tool.animation_data.action
    tool.animation_data.action = None
    tool.animation_data.nla_tracks.new().strips.new("Strip", 1, action)
    assert notes_on(tool) == ([STRIPS], None)


def on_screen(obj):
    """Where an object would be seen with its own delta transforms alone, if it had the values of the panel."""
    seen, turned = bpy.context.window_manager.rigid_motion_shown, obj.rotation_mode
    rotation = Quaternion(seen.rotation_quaternion) if turned == "QUATERNION" else Euler(seen.rotation_euler, turned)
    if turned == "QUATERNION":
        rotation.normalize()
    return Matrix.LocRotScale(Vector(seen.location), rotation, Vector(seen.scale))


@pytest.mark.parametrize("order", ["QUATERNION", "XYZ", "ZXY"])
@pytest.mark.parametrize("mode", ["dq_sclerp", "cga_slerp"])
@pytest.mark.parametrize("own_deltas", [False, True])
def test_the_transform_on_screen_is_what_the_object_looks_like(extension, order, mode, own_deltas):
    obj = key(new_object(rotation_mode=order), scale="even")
    bpy.context.view_layer.objects.active = obj
    own = give_own_deltas(obj) if own_deltas else None
    set_mode(obj, mode)
    for frame in (1, 6, 17, 40, 60):
        bpy.context.scene.frame_set(frame)
        shown = np.array(on_screen(obj))
        if own is not None:
            turned = Quaternion(own.quaternion).to_matrix().to_4x4() @ Matrix(shown).to_3x3().to_4x4()
            shown[:3, :3] = np.array(turned)[:3, :3] * np.array(own.scale)
            shown[:3, 3] += own.location
        assert shown == pytest.approx(np.array(obj.matrix_basis), abs=1e-5), frame


def test_euler_angles_on_screen_are_those_next_to_the_keyed_ones(extension):
    obj = keyed("Tool", "XYZ")
    obj.delta_rotation_euler = (0.0, 0.0, 2.0)
    set_mode(obj, "dq_sclerp")
    bpy.context.scene.frame_set(36)
    assert obj.rotation_euler.z > math.pi
    assert bpy.context.window_manager.rigid_motion_shown.rotation_euler[2] == pytest.approx(
        obj.rotation_euler.z, abs=0.5
    )


@pytest.mark.parametrize("order", ["QUATERNION", "AXIS_ANGLE"])
def test_without_in_betweens_there_is_nothing_to_show_and_no_error(extension, caplog, order):
    obj = keyed("Tool")
    set_mode(obj, "dq_sclerp")
    obj.rotation_mode = order
    if order == "QUATERNION":
        set_mode(obj, "BLENDER")
    assert len(bpy.context.window_manager.rigid_motion_shown.location) == 3
    assert not caplog.records
    bpy.context.view_layer.objects.active = None
    assert tuple(bpy.context.window_manager.rigid_motion_shown.scale) == (1.0, 1.0, 1.0)


@pytest.mark.parametrize("clear", ["location_clear", "rotation_clear"])
def test_a_cleared_delta_transform_that_comes_back_is_no_surprise(tool, clear):
    tool.delta_location, tool.delta_rotation_quaternion = (1.0, 2.0, 3.0), (0.8, 0.6, 0.0, 0.0)
    set_mode(tool, "dq_sclerp")
    assert notes_on(tool) == ([], "dq_sclerp")
    getattr(bpy.ops.object, clear)(clear_delta=True)
    bpy.context.view_layer.update()
    notes = [text for _, text in facts_and_notes(tool, IN_THE_FIRST_SEGMENT)[1]]
    assert notes == [DELTA_EDITED]
    assert notes_on(tool, 6.0) == ([], "dq_sclerp")


def test_a_second_user_of_a_slot_that_differs_has_a_note_until_the_two_are_alike(tool):
    other = new_object("Other")
    data = other.animation_data_create()
    data.action, data.action_slot = tool.animation_data.action, tool.animation_data.action_slot
    set_mode(tool, "dq_sclerp")
    assert notes_on(other) == ([], "dq_sclerp")
    other.rigid_motion.own_location.y = 1.0
    bpy.context.view_layer.update()
    messages = notes_on(tool)[0] + notes_on(other)[0]
    assert len(messages) == 1
    assert "Make Single User" in messages[0]
    tool.rigid_motion.own_location.y = 1.0
    bpy.context.view_layer.update()
    assert notes_on(tool) == notes_on(other) == ([], "dq_sclerp")
