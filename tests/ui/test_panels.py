"""The panel's content without a window: the segment under the playhead, notes, cautions, summaries and line breaks."""

from __future__ import annotations

import math
from dataclasses import replace
from math import radians

import bpy
import numpy as np
import pytest

from rigid_motion.animation import Reduction, bake, hold_in, pass_frames, set_enabled, set_mode, unbake, write_channel
from rigid_motion.ui import notes
from rigid_motion.ui.notes import cautions, facts_and_notes
from rigid_motion.ui.wording import reduction_summary, wrapped
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


@pytest.fixture
def plain(tool):
    """A segment of a quarter turn, of which there is nothing to say."""
    set_mode(tool, "dq_sclerp")
    return facts_and_notes(tool, 15.0)[0]


@pytest.mark.parametrize(
    ("facts", "words"),
    [
        ({"turn": radians(178.0)}, "178.0° is nearly half a turn"),
        ({"long_way": True}, "takes the short way"),
        ({"two_axes": True}, "about the axis of the larger one"),
        ({"scales_unevenly": True}, "scale is not uniform"),
    ],
)
def test_what_one_may_not_expect_is_said_but_not_of_blenders_own(plain, facts, words):
    (caution,) = cautions(replace(plain, **facts))
    assert words in caution
    assert cautions(replace(plain, mode="BLENDER", **facts)) == []


def test_angles_and_turns_leave_no_doubt_which_way_round(plain):
    assert cautions(replace(plain, turn=radians(178.0), is_sure=True)) == []
    assert cautions(replace(plain, turn=radians(898.0), turns=2)) == []
    assert cautions(replace(plain, turns=-1, long_way=True)) == []


def test_lines_are_as_full_as_they_fit_and_lose_no_word():
    text = "Cube turns by axis and angle, which has no rigid in-betweens"
    lines = wrapped(text, lambda line: len(line) <= 20)
    assert lines == ["Cube turns by axis", "and angle, which has", "no rigid in-betweens"]
    assert " ".join(lines) == text


@pytest.mark.parametrize(
    ("system", "scale", "said"),
    [("METRIC", 1.0, "0.93 mm"), ("METRIC", 0.01, "9.3 µm"), ("NONE", 1.0, "0.00093"), ("IMPERIAL", 1.0, "36.6 thou")],
)
def test_a_reduction_is_summed_up_in_the_units_of_the_scene(empty_file, system, scale, said):
    settings = bpy.context.scene.unit_settings
    settings.system, settings.scale_length = system, scale
    reduction = Reduction(before=251, after=18, largest_error=0.00093)
    assert reduction_summary(bpy.context.scene, reduction) == f"251 keys became 18, largest error {said}"
