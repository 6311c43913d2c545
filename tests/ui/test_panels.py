"""What the panel tells of an object, without a window: the segment under the playhead, and what there is to know."""

from __future__ import annotations

import math

import bpy
import pytest

from addon.animation import bake, set_enabled, set_mode, unbake
from addon.ui.notes import facts_and_notes
from addon.ui.wording import BAKED, NO_KEYS, NO_SEGMENT, OUT_OF_DATE, STRIPS
from tests.animation.oracle import curves_of
from tests.animation.scenes import new_object

IN_THE_FIRST_SEGMENT = 5.0


def told(obj, frame=IN_THE_FIRST_SEGMENT):
    """What the panel says on a frame, and the mode of the segment it shows."""
    bpy.context.scene.frame_set(int(frame))
    segment, notes = facts_and_notes(obj, frame)
    return [text for _, text in notes], segment and segment.mode


def test_of_a_plain_segment_its_facts_are_told_and_no_more(tool):
    assert told(tool) == ([], "BLENDER")
    set_mode(tool, "dq_sclerp")
    assert told(tool) == ([], "dq_sclerp")
    segment, _ = facts_and_notes(tool, 15.0)
    assert (segment.first, segment.last) == (11.0, 21.0)
    assert segment.turn == pytest.approx(math.pi / 2, abs=1e-6)
    assert segment.distance == pytest.approx(2.0)


def test_without_keys_it_says_so(extension):
    assert told(new_object()) == ([NO_KEYS], None)


def test_outside_the_keys_there_is_no_segment(tool):
    assert told(tool, 50.0) == ([NO_SEGMENT], None)


def test_a_refusal_is_told_with_the_way_out_and_without_a_segment(tool):
    set_mode(tool, "dq_sclerp")
    tool.driver_add("location", 2)
    (text,), mode = told(tool)
    assert "Location Z is driven" in text
    assert mode is None


def test_numbers_that_make_no_motion_are_told(tool):
    set_mode(tool, "dq_sclerp")
    curves_of(tool)["location", 0].keyframe_points[0].co.y = math.nan
    (text,), mode = told(tool)
    assert "Tool" in text
    assert mode is None


def test_what_is_baked_can_be_un_baked(tool):
    set_mode(tool, "dq_sclerp")
    bake(tool)
    assert told(tool) == ([BAKED], "BLENDER")
    unbake(tool)
    assert told(tool) == ([], "dq_sclerp")


def test_an_edit_that_nobody_follows_is_told_until_it_is_refreshed(tool):
    set_mode(tool, "dq_sclerp")
    set_enabled(False)
    curves_of(tool)["location", 0].keyframe_points[1].co.y += 1.0
    assert told(tool) == ([OUT_OF_DATE], "dq_sclerp")
    bpy.ops.rigid_motion.refresh()
    assert told(tool) == ([], "dq_sclerp")


def test_an_object_that_strips_move_has_its_keys_in_there(tool):
    action = tool.animation_data.action
    tool.animation_data.action = None
    tool.animation_data.nla_tracks.new().strips.new("Strip", 1, action)
    assert told(tool) == ([STRIPS], None)
