"""What the panel says, and how it fits."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import bpy
import pytest

from rigid_motion.animation import Reduction
from rigid_motion.animation.queries.segments import SegmentFacts
from rigid_motion.ui.wording import cautions, degrees, length, listed, reduction_summary, turn, wrapped

PLAIN = SegmentFacts(
    first=1.0,
    last=20.0,
    key=1.0,
    mode="dq_sclerp",
    turn=radians(90.0),
    turns=0,
    distance=2.0,
    long_way=False,
    is_sure=False,
    two_axes=False,
    scales_unevenly=False,
)


def test_a_plain_segment_is_no_cause_for_caution():
    assert cautions(PLAIN) == []


@pytest.mark.parametrize(
    ("facts", "words"),
    [
        ({"turn": radians(178.0)}, "178.0° is nearly half a turn"),
        ({"long_way": True}, "takes the short way"),
        ({"two_axes": True}, "about the axis of the larger one"),
        ({"scales_unevenly": True}, "scale is not the same along all axes"),
    ],
)
def test_what_one_may_not_expect_is_said_but_not_of_blenders_own(facts, words):
    (caution,) = cautions(replace(PLAIN, **facts))
    assert words in caution
    assert cautions(replace(PLAIN, mode="BLENDER", **facts)) == []


def test_angles_and_turns_leave_no_doubt_which_way_round():
    assert cautions(replace(PLAIN, turn=radians(178.0), is_sure=True)) == []
    assert cautions(replace(PLAIN, turn=radians(898.0), turns=2)) == []
    assert cautions(replace(PLAIN, turns=-1, long_way=True)) == []


def test_a_spin_is_told_in_turns():
    assert turn(PLAIN) == "90.0°"
    assert turn(replace(PLAIN, turn=radians(1080.0), turns=3)) == "3 turns"
    assert turn(replace(PLAIN, turn=radians(810.0), turns=2)) == "2.25 turns"


def test_angles_are_given_in_degrees():
    assert degrees(radians(114.59)) == "114.6°"


def test_a_long_list_is_cut():
    assert listed(["1", "2", "3"]) == "1, 2, 3"
    assert listed(["1", "2", "3", "4", "5"]) == "1, 2, 3 and 2 more"


def test_lines_are_as_full_as_they_fit_and_lose_no_word():
    text = "Cube turns by axis and angle, which has no rigid in-betweens"
    lines = wrapped(text, lambda line: len(line) <= 20)
    assert lines == ["Cube turns by axis", "and angle, which has", "no rigid in-betweens"]
    assert " ".join(lines) == text


def test_a_word_that_is_too_long_has_a_line_of_its_own():
    assert wrapped("a Vergnuegungsdampferkapitaen b", lambda line: len(line) <= 5) == [
        "a",
        "Vergnuegungsdampferkapitaen",
        "b",
    ]


def test_no_text_has_no_lines():
    assert wrapped("", lambda line: True) == []


@pytest.mark.parametrize(
    ("system", "scale", "said"),
    [("METRIC", 1.0, "0.93 mm"), ("METRIC", 0.01, "9.3 µm"), ("NONE", 1.0, "0.00093"), ("IMPERIAL", 1.0, "36.6 thou")],
)
def test_a_reduction_is_summed_up_in_the_units_of_the_scene(empty_file, system, scale, said):
    settings = bpy.context.scene.unit_settings
    settings.system, settings.scale_length = system, scale
    reduction = Reduction(before=251, after=18, largest_error=0.00093, segments={"motor_spline": 17})
    assert reduction_summary(bpy.context.scene, reduction) == f"251 keys became 18, largest error {said}"


def test_lengths_are_in_the_units_of_the_scene(empty_file):
    bpy.context.scene.unit_settings.scale_length = 0.1
    assert length(bpy.context.scene, 20.0) == "2 m"


def test_modes_are_counted_where_there_are_several_most_of_them_first(empty_file):
    reduction = Reduction(before=9, after=5, largest_error=0.0, segments={"lerp_slerp": 1, "motor_spline": 3})
    summary = reduction_summary(bpy.context.scene, reduction)
    assert summary.endswith("; segments: 3 Smooth Screw, 1 Vector + Quaternion")
