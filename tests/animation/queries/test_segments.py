"""What is told of the segment at a frame."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import refresh, repeat, set_enabled, set_mode, set_turns, write_channel
from rigid_motion.animation.queries.keyed import source_of
from rigid_motion.animation.queries.segments import frame_in_action, is_up_to_date, segment_at
from tests.animation.scenes import new_object

FRAMES = np.array((1.0, 11.0, 31.0))


def turned(angles, rotation_mode="QUATERNION", frames=FRAMES, sign=1.0):
    """An object turned about z by these degrees, and moved 2 along x, from key to key."""
    obj = new_object("Tool", rotation_mode)
    angles, zero = np.radians(np.array(angles, dtype=float)), np.zeros(len(angles))
    write_channel(obj, "location", frames, np.outer(np.arange(len(frames)), (2.0, 0.0, 0.0)))
    if rotation_mode == "QUATERNION":
        quaternions = np.stack((np.cos(0.5 * angles), zero, zero, np.sin(0.5 * angles)), axis=1)
        quaternions[1::2] *= sign
        write_channel(obj, "rotation_quaternion", frames, quaternions)
    else:
        write_channel(obj, "rotation_euler", frames, np.outer(angles, (0.0, 0.0, 1.0)))
    return obj


def at(obj, frame):
    return segment_at(source_of(obj), frame)


@pytest.mark.parametrize("rotation_mode", ["QUATERNION", "XYZ", "ZXY"])
def test_a_segment_has_its_frames_its_turn_and_its_distance(live_file, rotation_mode):
    segment = at(turned((0, 90, 120), rotation_mode), 5)
    assert (segment.first, segment.last, segment.key) == (1.0, 11.0, 1.0)
    assert np.degrees(segment.turn) == pytest.approx(90.0, abs=1e-4)
    assert segment.distance == pytest.approx(2.0)
    assert not segment.long_way
    assert not segment.scales_unevenly


def test_a_key_is_in_the_segment_it_begins_and_the_last_one_in_the_one_it_ends(live_file):
    obj = turned((0, 90, 120))
    assert [at(obj, frame).first for frame in (1, 10.9, 11, 30, 31)] == [1, 1, 11, 11, 11]


def test_there_is_no_segment_outside_of_the_keys_nor_with_a_single_one(live_file):
    obj = turned((0, 90, 120))
    assert at(obj, 0) is None
    assert at(obj, 32) is None
    assert at(turned((0,), frames=FRAMES[:1]), 1) is None


def test_euler_keys_turn_as_far_as_their_angles_say(live_file):
    obj = turned((0, 350, 380), "XYZ")
    assert not at(obj, 5).long_way
    assert [at(obj, frame).turns for frame in (5, 20)] == [1, 0]
    assert np.degrees(at(obj, 5).turn) == pytest.approx(350.0, abs=1e-3)
    assert [at(obj, frame).is_sure for frame in (5, 20)] == [True, False]


def test_two_euler_angles_over_half_a_turn_are_told(live_file):
    obj = turned((0, 350, 380), "XYZ")
    assert not at(obj, 5).two_axes
    write_channel(obj, "rotation_euler", FRAMES, np.radians([(0, 0, 0), (200, 0, 350), (250, 0, 380)]))
    assert at(obj, 5).two_axes
    assert not at(obj, 20).two_axes


def test_turns_of_the_channel_are_told(live_file):
    obj = turned((0, 90, 120))
    set_mode(obj, "dq_sclerp")
    set_turns(obj, -2, [1.0])
    assert [at(obj, frame).turns for frame in (5, 20)] == [-2, 0]
    assert np.degrees(at(obj, 5).turn) == pytest.approx(630.0, abs=1e-3)


def test_quaternions_of_opposite_signs_go_the_long_way_in_blender(live_file):
    assert at(turned((0, 90, 120), sign=-1.0), 5).long_way
    assert not at(turned((0, 0, 0), sign=-1.0), 5).long_way, "a full turn through nothing is no way at all"


def test_a_scale_that_differs_from_axis_to_axis_is_told_where_it_changes(live_file):
    obj = turned((0, 90, 120))
    write_channel(obj, "scale", FRAMES, [(1, 1, 1), (1, 2, 1), (1, 2, 1)])
    assert at(obj, 5).scales_unevenly
    assert not at(obj, 20).scales_unevenly
    write_channel(obj, "scale", FRAMES, [(1, 1, 1), (2, 2, 2), (1, 1, 1)])
    assert not at(obj, 5).scales_unevenly


@pytest.mark.parametrize(("mode", "ends"), [("REPEAT", (41.0, 61.0)), ("MIRROR", (31.0, 51.0))])
def test_a_segment_that_a_cycle_repeats_hangs_on_the_key_it_is_a_copy_of(live_file, mode, ends):
    obj = turned((0, 90, 120))
    repeat(obj, mode)
    assert (at(obj, 5).first, at(obj, 5).last) == (1.0, 11.0)
    again = at(obj, 30 + 20)
    assert (again.first, again.last, again.key) == (*ends, 11.0)
    assert np.degrees(again.turn) == pytest.approx(30.0, abs=0.1)
    assert again.distance == pytest.approx(2.0, abs=0.01)


def test_in_tweak_mode_frames_are_those_of_the_strip(live_file):
    obj = turned((0, 90, 120))
    assert frame_in_action(obj, 5.0) == 5.0
    data = obj.animation_data
    action, slot = data.action, data.action_slot
    data.action = None
    strip = data.nla_tracks.new().strips.new("Strip", 101, action)
    strip.action_slot = slot
    data.nla_tracks[0].select = strip.select = True
    data.nla_tracks.active = data.nla_tracks[0]
    data.use_tweak_mode = True
    assert frame_in_action(obj, 105.0) == pytest.approx(5.0)


def test_in_betweens_are_out_of_date_while_an_edit_is_not_followed(live_file):
    obj = turned((0, 90, 120))
    assert is_up_to_date(obj, source_of(obj))
    set_mode(obj, "dq_sclerp")
    assert is_up_to_date(obj, source_of(obj))
    set_enabled(False)
    try:
        write_channel(obj, "location", FRAMES, np.eye(3))
        bpy.context.view_layer.update()
        assert not is_up_to_date(obj, source_of(obj))
    finally:
        set_enabled(True)
    refresh()
    assert is_up_to_date(obj, source_of(obj))
