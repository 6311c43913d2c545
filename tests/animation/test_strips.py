"""Actions in NLA strips: what the strip shows of a filled-in Action, however it is placed, scaled and repeated.

In-betweens are exact on the whole frames of the Action, so strips are looked at where they show those.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, key_frames, problem_of, refresh, set_mode, unbake
from tests.animation.keyed import curves_of
from tests.animation.oracle import Own, expected_bases, shown_worlds
from tests.animation.scenes import give_own_deltas, key, new_object, new_strip, own_deltas, push_down, tweak

KEYS = (1.0, 11.0, 21.0, 41.0)
ACTION_FRAMES = np.arange(1.0, 42.0)


def assert_at(obj: bpy.types.Object, scene_frames: np.ndarray, expected: np.ndarray) -> None:
    shown = shown_worlds([obj], scene_frames)[0]
    error = np.abs(shown - expected).max(axis=(1, 2)) / max(1.0, np.abs(expected).max())
    assert error.max() < 1e-5, f"off by {error.max():.3g} on frame {scene_frames[error.argmax()]}"


def filled(name: str = "Tool", order: str = "QUATERNION", mode: str = "dq_sclerp", seed: int = 0):
    """An object with keys and a mode, and where it has to be on each frame of its Action."""
    obj = key(new_object(name, order), KEYS, seed=seed)
    set_mode(obj, mode)
    return obj, expected_bases(obj, ACTION_FRAMES)


@pytest.mark.parametrize("order", ["QUATERNION", "ZYX"])
@pytest.mark.parametrize(
    ("start", "scale", "repeat", "reverse"),
    [
        *((1, 1.0, 1.0, False), (101, 1.0, 1.0, False), (31, 2.0, 1.0, False), (7, 0.5, 1.0, False)),
        *((11, 1.0, 2.5, False), (11, 2.0, 3.0, False), (21, 1.0, 1.0, True), (21, 0.5, 2.0, True)),
    ],
)
def test_a_strip_shows_the_in_betweens_of_its_action(live_file, order, start, scale, repeat, reverse):
    obj, expected = filled(order=order)
    strip = push_down(obj, start, scale=scale, repeat=repeat, use_reverse=reverse)
    frames = np.arange(strip.frame_start, strip.frame_end)
    place = ((frames - start) / scale) % 40.0
    # On a seam a reversed strip may be on the first frame or on the last.
    whole = (place % 1.0 == 0.0) & ((place > 0.0) | (not reverse))
    assert whole.sum() >= 19
    action_frames = place[whole].astype(int)
    assert_at(obj, frames[whole], expected[::-1][action_frames] if reverse else expected[action_frames])
    outside = np.array((strip.frame_start - 5.0, strip.frame_end + 5.0))
    held = shown_worlds([obj], np.array((strip.frame_start, strip.frame_end)))[0]
    assert_at(obj, outside, held)


def test_a_mode_is_chosen_for_an_action_that_is_in_a_strip_already(live_file):
    obj = key(new_object(), KEYS)
    action = obj.animation_data.action
    push_down(obj, 101)
    set_mode(obj, "pga_slerp")
    assert problem_of(obj) == ""
    obj.animation_data.action = action
    expected = expected_bases(obj, ACTION_FRAMES)
    obj.animation_data.action = None
    assert_at(obj, np.arange(101.0, 142.0), expected)


def two_strips(
    order: str = "QUATERNION",
    *,
    own: bool = True,
    modes: Sequence[str] = ("dq_sclerp", "BLENDER"),
    one_track: bool = False,
    extrapolations: Sequence[str] = ("NOTHING", "NOTHING"),
) -> tuple[bpy.types.Object, Own, list[bpy.types.Action], list[np.ndarray]]:
    """An object, its own delta transforms, the Actions of two strips with modes, and its place in each."""
    obj = new_object("Tool", order)
    deltas, actions, expected = give_own_deltas(obj) if own else Own(), [], []
    data = obj.animation_data_create()
    for seed, mode in enumerate(modes):
        data.action = None
        key(obj, KEYS, seed=seed)
        set_mode(obj, mode, KEYS)
        actions.append(data.action)
        expected.append(expected_bases(obj, ACTION_FRAMES, deltas))
    slots, data.action = [action.slots[0] for action in actions], None
    track = data.nla_tracks.new()
    for start, action, slot, extrapolation in zip((1, 101), actions, slots, extrapolations, strict=True):
        strip = track.strips.new("Strip", start, action)
        strip.action_slot, strip.extrapolation = slot, extrapolation
        track = track if one_track or start > 1 else data.nla_tracks.new()
    bpy.context.view_layer.update()
    return obj, deltas, actions, expected


@pytest.mark.parametrize("one_track", [True, False], ids=["one track", "two tracks"])
@pytest.mark.parametrize(
    ("modes", "own"),
    [
        (("dq_sclerp", "pga_lerp"), False),
        (("dq_sclerp", "pga_lerp"), True),
        (("dq_sclerp", "BLENDER"), False),
        (("BLENDER", "cga_slerp"), False),
        (("BLENDER", "cga_slerp"), True),
        (("dq_sclerp", "BLENDER"), True),
    ],
)
def test_two_strips_each_have_the_mode_that_is_keyed_in_their_action(live_file, modes, own, one_track):
    obj, _, _, expected = two_strips(own=own, modes=modes, one_track=one_track, extrapolations=("HOLD", "HOLD_FORWARD"))
    assert refresh() == 0
    for start, worlds in zip((1, 101), expected, strict=True):
        assert_at(obj, ACTION_FRAMES + start - 1, worlds)
    assert_at(obj, np.array((60.0, 90.0)), expected[0][[-1, -1]])


def fcurves_of(action: bpy.types.Action) -> bpy.types.ActionChannelbagFCurves:
    return action.layers[0].strips[0].channelbags[0].fcurves


def held_in(action: bpy.types.Action) -> set[str]:
    """The delta transforms that an Action has channels of."""
    return {fcurve.data_path for fcurve in fcurves_of(action) if fcurve.data_path.startswith("delta_")}


@pytest.mark.parametrize("order", ["QUATERNION", "ZYX"])
def test_a_strip_without_a_mode_keeps_the_own_delta_transforms_beside_one_with_a_mode(live_file, order):
    obj, _, actions, expected = two_strips(order)
    for start, worlds in zip((1, 101), expected, strict=True):
        assert_at(obj, ACTION_FRAMES + start - 1, worlds)
    rotation = "delta_rotation_quaternion" if order == "QUATERNION" else "delta_rotation_euler"
    assert held_in(actions[1]) == {"delta_location", rotation}, "and no other"
    assert tuple(actions[1].curve_frame_range) == (KEYS[0], KEYS[-1])


def test_what_a_strip_holds_goes_and_comes_with_the_mode_of_the_other(live_file):
    obj, own, actions, expected = two_strips()
    tweak(obj, obj.animation_data.nla_tracks[0].strips[0])
    set_mode(obj, "BLENDER", KEYS)
    assert held_in(actions[0]) == held_in(actions[1]) == set()
    assert tuple(obj.delta_location) == own.location
    set_mode(obj, "pga_lerp", KEYS)
    assert held_in(actions[0]) == held_in(actions[1]) != set()
    obj.animation_data.use_tweak_mode = False
    bpy.context.view_layer.update()
    assert_at(obj, ACTION_FRAMES + 100, expected[1])
    tweak(obj, obj.animation_data.nla_tracks[1].strips[0])
    set_mode(obj, "cga_slerp", KEYS)
    assert_at(obj, ACTION_FRAMES + 100, expected_bases(obj, ACTION_FRAMES, own))


def test_baking_the_other_strip_and_back_keeps_the_own_delta_transforms(live_file):
    obj, _, actions, expected = two_strips()
    strips = [track.strips[0] for track in obj.animation_data.nla_tracks]
    for act in (bake, unbake):
        act(obj)
        bpy.context.view_layer.update()
        for start, worlds in zip((1, 101), expected, strict=True):
            assert_at(obj, ACTION_FRAMES + start - 1, worlds)
        assert (held_in(actions[1]) == set()) == (act is bake)
        assert (strips[0].action == actions[0]) == (act is unbake)


def test_delta_keys_of_the_animators_are_left_alone_in_the_other_strip(live_file):
    _, _, actions, _ = two_strips()
    fcurves = fcurves_of(actions[1])
    for index in range(3):
        fcurves.remove(fcurves.find("delta_location", index=index))
    fcurves.new("delta_location", index=1).keyframe_points.insert(5.0, 0.25)
    bpy.context.view_layer.update()
    refresh()
    (kept,) = [fcurve for fcurve in fcurves if fcurve.data_path == "delta_location"]
    assert [tuple(point.co) for point in kept.keyframe_points] == [(5.0, 0.25)]


def test_a_strip_that_adds_holds_nothing(live_file):
    obj, _, actions, _ = two_strips()
    assert held_in(actions[1]) != set()
    obj.animation_data.nla_tracks[1].strips[0].blend_type = "ADD"
    bpy.context.view_layer.update()
    refresh()
    assert held_in(actions[1]) == set()


def test_where_there_are_no_own_delta_transforms_the_other_strip_holds_none(live_file):
    _, _, actions, _ = two_strips(own=False)
    assert held_in(actions[1]) == set()


def test_an_action_of_two_objects_with_other_delta_transforms_holds_those_of_neither(live_file):
    _, _, actions, _ = two_strips()
    other = new_object("Tool, too")
    strip = other.animation_data_create().nla_tracks.new().strips.new("Strip", 1, actions[1])
    strip.action_slot = actions[1].slots[0]
    bpy.context.view_layer.update()
    refresh()
    assert held_in(actions[1]) == set()


def test_an_action_that_is_in_two_strips_and_cycles_is_filled_in_as_far_as_either_shows_it(live_file):
    obj = key(new_object(), KEYS, interpolation="LINEAR")
    for fcurve in curves_of(obj).values():
        fcurve.modifiers.new("CYCLES")
    set_mode(obj, "dq_sclerp")
    expected = expected_bases(obj, ACTION_FRAMES)[:-1]
    push_down(obj, 1)
    data = obj.animation_data
    first = data.nla_tracks[0].strips[0]
    first.action_frame_end = 41.0
    second = data.nla_tracks.new().strips.new("Again", 201, first.action)
    second.action_slot, second.extrapolation = first.action_slot, "HOLD_FORWARD"
    second.action_frame_end = 121.0
    bpy.context.view_layer.update()
    refresh()
    assert_at(obj, ACTION_FRAMES[:-1], expected)
    for start in (201.0, 241.0, 281.0):
        assert_at(obj, start + np.arange(1.0, 40.0), expected[1:])


@pytest.mark.parametrize(("start", "scale"), [(101, 1.0), (31, 2.0)])
def test_in_tweak_mode_a_key_inserted_in_between_keeps_the_pose_on_the_screen(live_file, start, scale):
    obj, expected = filled()
    strip = push_down(obj, start, scale=scale)
    tweak(obj, strip)
    scene_frame = start + int(15 * scale)
    live_file.scene.frame_set(scene_frame)
    assert_at(obj, np.array((float(scene_frame),)), expected[[15]])
    obj.keyframe_insert("location")
    bpy.context.view_layer.update()
    assert 16.0 in key_frames(obj)
    assert_at(obj, np.array((float(scene_frame),)), expected[[15]])


def test_a_strip_without_an_action_to_set_keys_on_is_explained(live_file):
    obj = key(new_object(), KEYS)
    push_down(obj)
    before = obj.rigid_motion.mode
    with pytest.raises(ValueError, match=r"Tool.*enter a strip"):
        set_mode(obj, "dq_sclerp", KEYS)
    assert obj.rigid_motion.mode == before


def test_an_own_delta_transform_is_held_in_an_action_that_an_object_without_strips_plays_too(live_file):
    obj = new_object("B")
    own = give_own_deltas(obj, 3)
    data, plays = obj.animation_data_create(), []
    for seed in (5, 8):
        data.action = None
        key(obj, seed=seed)
        plays.append((data.action, data.action_slot))
    set_mode(obj, "dq_sclerp")
    data.action, data.action_slot = plays[0]
    bpy.context.view_layer.update()
    frames = np.arange(1.0, 40.0)
    expected = shown_worlds([obj], frames)[0]
    data.action = None
    other = new_object("A")
    give_own_deltas(other, 3)
    other.animation_data_create().action, other.animation_data.action_slot = plays[0]
    for start, (action, slot) in zip((1, 50), plays, strict=True):
        new_strip(obj, start, action, slot).extrapolation = "NOTHING"
    bpy.context.view_layer.update()
    assert np.abs(shown_worlds([obj], frames)[0] - expected).max() < 1e-5
    assert own_deltas(other) == own
