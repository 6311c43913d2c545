"""Texts of the panel: cautions, summaries, and line breaks."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import bpy
import pytest

from rigid_motion.animation import Reduction
from rigid_motion.animation.queries.segments import SegmentFacts
from rigid_motion.ui.notes import cautions
from rigid_motion.ui.wording import reduction_summary, wrapped

pytestmark = pytest.mark.any_blender

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


@pytest.mark.parametrize(
    ("facts", "words"),
    [
        ({"turn": radians(178.0)}, "178.0° is nearly half a turn"),
        ({"long_way": True}, "takes the short way"),
        ({"two_axes": True}, "about the axis of the larger one"),
        ({"scales_unevenly": True}, "scale is not uniform"),
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
