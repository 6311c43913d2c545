"""The panel's content for an object, without a window: the segment under the playhead, and notes."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, hold_in, pass_frames, set_enabled, set_mode, unbake, write_channel
from rigid_motion.ui import notes
from rigid_motion.ui.notes import facts_and_notes
from tests.animation.keyed import curves_of
from tests.animation.scenes import new_object
from tests.ui.conftest import keyed

IN_THE_FIRST_SEGMENT = 5.0


def notes_on(obj, frame=IN_THE_FIRST_SEGMENT):
    """Return the notes of the panel on a frame, and the mode of the segment it shows."""
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
    curves_of(tool)["location", 2].modifiers.new("ENVELOPE")
    (text,), mode = notes_on(tool)
    assert "Location Z has an Envelope" in text
    assert mode is None


def test_between_keys_in_different_hands_there_is_no_segment(tool):
    hand = keyed("Hand")
    bpy.context.scene.frame_set(21)
    hold_in(tool, hand)
    assert notes_on(tool, 15.0) == ([], "motor_spline")
    assert notes_on(tool, 20.5) == ([notes.RESTING_TEXT.format(frame=21)], None)
    assert notes_on(tool, 25.0) == ([notes.RESTING_TEXT.format(frame=41)], None)
    pass_frames(tool, 4)
    assert notes_on(tool, 38.0) == ([notes.PASSING_TEXT.format(frame=41)], None)


def test_what_is_baked_can_be_un_baked(tool):
    set_mode(tool, "dq_sclerp")
    bake(tool)
    assert notes_on(tool) == ([notes.BAKED_TEXT], "BLENDER")
    unbake(tool)
    assert notes_on(tool) == ([], "dq_sclerp")


def test_an_edit_that_nobody_follows_is_noted_until_it_is_refreshed(tool):
    set_mode(tool, "dq_sclerp")
    set_enabled(False)
    curves_of(tool)["location", 0].keyframe_points[1].co.y += 1.0
    assert notes_on(tool) == ([notes.OUT_OF_DATE], "dq_sclerp")
    bpy.ops.rigid_motion.refresh()
    assert notes_on(tool) == ([], "dq_sclerp")


def test_an_object_that_strips_move_has_its_keys_in_there(tool):
    action = tool.animation_data.action
    tool.animation_data.action = None
    tool.animation_data.nla_tracks.new().strips.new("Strip", 1, action)
    assert notes_on(tool) == ([notes.STRIPS_TEXT], None)


def test_where_a_component_is_keyed_alone_its_frames_are_noted(tool):
    set_mode(tool, "dq_sclerp")
    curves_of(tool)["location", 1].keyframe_points[1].co_ui.x = 15.0
    ((text,), mode) = notes_on(tool)
    assert text.startswith("Key all of Location (I) at 11, 15: only a part of it has a key there")
    assert mode == "dq_sclerp"
    set_mode(tool, "BLENDER")
    assert notes_on(tool) == ([], "BLENDER")


def test_where_modifiers_are_many_their_number_is_noted(extension):
    frames = np.arange(1.0, 102.0)
    obj = new_object()
    write_channel(obj, "location", frames, np.random.default_rng(5).normal(size=(len(frames), 3)))
    write_channel(obj, "rotation_quaternion", frames, np.random.default_rng(6).normal(size=(len(frames), 4)))
    set_mode(obj, "dq_sclerp")
    texts, _ = notes_on(obj)
    assert int(texts[-1].partition(" modifiers on a channel")[0]) > notes.MANY_MODIFIERS


def test_a_second_user_of_a_slot_that_differs_has_a_note_until_the_two_are_alike(tool):
    other = new_object("Other")
    data = other.animation_data_create()
    data.action, data.action_slot = tool.animation_data.action, tool.animation_data.action_slot
    set_mode(tool, "dq_sclerp")
    assert notes_on(other) == ([], "dq_sclerp")
    other.delta_rotation_quaternion = (0.5, 0.5, 0.5, 0.5)
    bpy.context.view_layer.update()
    messages = notes_on(tool)[0] + notes_on(other)[0]
    assert len(messages) == 1
    assert "Make Single User" in messages[0]
    tool.delta_rotation_quaternion = (0.5, 0.5, 0.5, 0.5)
    bpy.context.view_layer.update()
    assert notes_on(tool) == notes_on(other) == ([], "dq_sclerp")
