"""Reduced keys, read back from the evaluated scene, keep to their tolerance; and what was there before comes back."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import (
    Refused,
    bake,
    bake_poses,
    discard_dense_keys,
    is_baked,
    is_reduced,
    key_frames,
    modes_of,
    read_poses,
    reduce_keys_of,
    reduction_of,
    restore_keys,
    set_mode,
    unbake,
    write_channel,
)
from rigid_motion.motion import Poses, interpolate, interpolate_by_segments, shell_error
from tests.animation.keyed import curves_of, rotation_path, snapshot
from tests.animation.oracle import shown_worlds
from tests.animation.reduced import RADIUS, TOLERANCE, keys_of, motion, off, recorded
from tests.animation.scenes import key, new_object


@pytest.mark.parametrize("count", [2, 5, 12])
def test_so_many_keys_have_less_of_an_error_than_as_many_evenly_in_time(live_file, count):
    obj = recorded("throw")
    frames = key_frames(obj)
    moments = np.arange(8.0 * frames[0], 8.0 * frames[-1] + 1.0) / 8.0
    truth, shown = read_poses(obj, frames), read_poses(obj, moments)
    reduction = reduce_keys_of(obj, "motor_spline", radius=RADIUS, count=count)
    assert len(key_frames(obj)) == reduction.after == count
    assert reduction.largest_error == pytest.approx(off(obj, moments, shown), abs=1e-5)
    evenly = frames[np.linspace(0, len(frames) - 1, count).round().astype(int)]
    even = interpolate(evenly, truth[np.searchsorted(frames, evenly)], moments, "motor_spline")
    even_error = shell_error(even, shown, RADIUS).max()
    assert reduction.largest_error <= even_error * (1.0 if count > 2 else 1.0 + 1e-4)
    restore_keys(obj)
    assert key_frames(obj).tolist() == frames.tolist()


@pytest.mark.parametrize(("count", "why"), [(1, "2 keys at least, not 1"), (100000, "keys: ask for fewer")])
def test_no_motion_has_fewer_keys_than_two_or_more_than_it_had(live_file, count, why):
    obj = recorded()
    with pytest.raises(Refused, match=why):
        reduce_keys_of(obj, count=count)
    assert not is_reduced(obj)


@pytest.mark.parametrize("rotation_mode", ["QUATERNION", "XZY"])
@pytest.mark.parametrize(
    ("name", "mode"),
    [("reach", "motor_spline"), ("throw", "motor_spline"), ("pivot", "lerp_slerp"), ("throw", "lerp_slerp")],
)
def test_the_best_mode_of_each_segment_is_keyed_and_blender_shows_it(live_file, name, mode, rotation_mode):
    obj = recorded(name, rotation_mode)
    frames = key_frames(obj)
    moments = np.arange(8.0 * frames[0], 8.0 * frames[-1] + 1.0) / 8.0
    truth, between = read_poses(obj, frames), read_poses(obj, moments)
    reduce_keys_of(obj, mode, TOLERANCE, RADIUS)
    single, expected = key_frames(obj), shell_error(read_poses(obj, frames), truth, RADIUS)
    restore_keys(obj)
    reduction = reduce_keys_of(obj, mode, TOLERANCE, RADIUS, best_of=True)
    kept = key_frames(obj)
    modes = modes_of(obj, kept[:-1])
    assert reduction.segments == {mode: modes.count(mode) for mode in modes}
    assert kept.tolist() == single.tolist()
    assert len(set(modes)) > 1
    shown = read_poses(obj, frames)
    keys = between[np.isin(moments, kept)]
    assert shell_error(shown, interpolate_by_segments(kept, keys, frames, modes), RADIUS).max() < 5e-6
    error = shell_error(shown, truth, RADIUS)
    assert np.mean(error**2) < np.mean(expected**2)
    assert off(obj, moments, between) <= TOLERANCE + 1e-5
    # Between frames it counts but for where the recording's lines cut corners.
    assert off(obj, frames, truth) - 1e-5 <= reduction_of(obj).largest_error <= off(obj, moments, between) + 1e-5


@pytest.mark.parametrize(
    ("interpolation", "step", "rotation_mode"),
    [
        ("BEZIER", 1.0, "QUATERNION"),
        ("BEZIER", 4.0, "XZY"),
        ("LINEAR", 0.7, "QUATERNION"),
        ("SINE", 1.0, "XZY"),
        ("BOUNCE", 1.0, "QUATERNION"),
        ("CONSTANT", 1.0, "QUATERNION"),
    ],
)
@pytest.mark.parametrize("mode", ["motor_spline", "lerp_slerp"])
def test_between_frames_the_tolerance_holds_as_well(live_file, mode, interpolation, step, rotation_mode):
    obj = new_object(rotation_mode=rotation_mode)
    frames = np.arange(1.0, 60.0, step)
    waves = np.sin(frames[:, None] * (0.11, 0.17, 0.13))
    # It rests for a while, so that there are keys to spare whatever is between them.
    waves[frames > 40.0] = waves[frames > 40.0][0]
    write_channel(obj, "location", frames, 0.02 * waves, interpolation=interpolation)
    turns = np.column_stack((np.ones(len(frames)), 0.04 * waves[:, ::-1]))
    values = turns / np.linalg.norm(turns, axis=1)[:, None] if rotation_mode == "QUATERNION" else 0.04 * waves
    write_channel(obj, rotation_path(obj), frames, values, interpolation=interpolation)
    moments = np.arange(8.0, 8.0 * frames[-1] + 1.0) / 8.0
    truth = read_poses(obj, moments)
    reduction = reduce_keys_of(obj, mode, TOLERANCE, RADIUS)
    assert reduction.after < reduction.before
    error = off(obj, moments, truth)
    assert error <= TOLERANCE * (1.0 + 1e-5)
    if step != 0.7 and interpolation != "CONSTANT":  # Those are looked at between eighths, too.
        assert reduction.largest_error == pytest.approx(error, abs=1e-6)


def test_the_tolerance_is_one_of_the_scene_also_under_a_parent_in_other_units(live_file):
    frames, poses = motion()
    alone, below, root = recorded(), new_object("Below"), new_object("Root")
    root.scale, root.rotation_euler = (0.01, 0.01, 0.01), (1.0, 2.0, 3.0)
    root.location = (1.0, 2.0, 3.0)
    below.parent = root
    bake_poses(below, frames, Poses(100.0 * poses.positions, poses.quaternions))
    below.scale = (100.0, 100.0, 100.0)
    truth = read_poses(below, frames)
    # To the last digit they are not the same numbers: of equally good keys one or two may be others.
    reductions = [reduce_keys_of(obj, "motor_spline", TOLERANCE, RADIUS) for obj in (alone, below)]
    assert abs(reductions[0].after - reductions[1].after) <= 2
    error = off(below, frames, truth)
    assert error <= TOLERANCE * (1.0 + 1e-4)
    assert reductions[1].largest_error == pytest.approx(error, rel=1e-3)


@pytest.mark.parametrize("rotation_mode", ["QUATERNION", "XZY"])
def test_all_that_was_there_comes_back_to_the_last_handle(live_file, rotation_mode):
    obj = key(new_object(rotation_mode=rotation_mode), np.arange(1.0, 120.0, 3.0), scale="uneven")
    obj["weight"] = 1.0
    write_channel(obj, '["weight"]', np.arange(1.0, 60.0), np.arange(59.0), interpolation="BOUNCE")
    recorded(obj=obj)
    curves_of(obj)['["weight"]', 0].mute = True
    set_mode(obj, "pga_lerp", [11.0])
    action, before, frames = obj.animation_data.action, snapshot(obj), np.arange(-3.0, 130.0)
    truth = read_poses(obj, frames)
    with pytest.raises(Refused):
        reduce_keys_of(obj, "motor_spline", 1e-6, RADIUS)
    assert snapshot(obj) == before
    assert list(bpy.data.actions) == [action]
    reduce_keys_of(obj, "motor_spline", 0.3, RADIUS)
    assert snapshot(obj) != before
    restore_keys(obj)
    assert obj.animation_data.action == action
    assert snapshot(obj) == before
    assert list(bpy.data.actions) == [action]
    assert off(obj, frames, truth) < 1e-6


@pytest.mark.parametrize("keyed", ["location", "rotation"])
def test_what_has_no_keys_gets_none(live_file, keyed):
    obj = recorded()
    obj.location = (1.0, 2.0, 3.0)
    path = "location" if keyed == "rotation" else rotation_path(obj)
    channelbag = obj.animation_data.action.layers[0].strips[0].channelbag(obj.animation_data.action_slot)
    for name, fcurve in list(curves_of(obj).items()):
        if name[0] == path or name == ("location", 1):
            channelbag.fcurves.remove(fcurve)
    expected = set(curves_of(obj))
    frames = np.arange(1.0, key_frames(obj)[-1] + 1.0)
    truth = read_poses(obj, frames)
    reduce_keys_of(obj, "motor_spline", TOLERANCE, RADIUS)
    assert off(obj, frames, truth) <= TOLERANCE * (1.0 + 1e-5)
    result = {name for name in curves_of(obj) if not name[0].startswith("delta_")}
    assert result == expected


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (2.0, 2.0, 2.0), (1.0, 2.0, 0.5), (-1.0, 1.0, 1.0)], ids=str)
def test_a_scale_that_only_stands_there_on_every_frame_goes_with_the_keys(live_file, scale):
    obj = recorded()
    frames = key_frames(obj)
    write_channel(obj, "scale", frames, np.repeat(np.array((scale,)), len(frames), axis=0))
    (before,) = shown_worlds([obj], frames)
    reduction = reduce_keys_of(obj, "motor_spline", TOLERANCE, RADIUS)
    assert keys_of(obj, "scale") == keys_of(obj, "location")
    assert reduction.after < 0.5 * reduction.before
    moved = (shown_worlds([obj], frames)[0] - before)[:, :3, 3]
    assert np.linalg.norm(moved, axis=1).max() <= TOLERANCE * (1.0 + 1e-5)


def test_a_scale_that_changes_alike_along_all_axes_goes_with_the_keys(live_file):
    obj = recorded()
    frames = key_frames(obj)
    write_channel(obj, "scale", frames, np.repeat(1.0 + 0.3 * np.sin(0.1 * frames[:, None]), 3, axis=1))
    (before,) = shown_worlds([obj], frames)
    reduce_keys_of(obj, "motor_spline", TOLERANCE, RADIUS)
    assert keys_of(obj, "scale") == keys_of(obj, "location")
    corners = np.vstack((RADIUS * np.eye(3), np.ones(3)))
    moved = ((shown_worlds([obj], frames)[0] - before) @ corners)[:, :3]
    assert 0.0 < np.linalg.norm(moved, axis=1).max() <= TOLERANCE * (1.0 + 1e-5)


def test_a_scale_that_differs_from_axis_to_axis_keeps_its_keys_and_the_motion_keeps_to_the_tolerance(live_file):
    obj = recorded()
    frames = key_frames(obj)
    write_channel(
        obj, "scale", frames[[0, 50, 90]], np.array(((1, 1, 1), (1, 2, 0.5), (1, 1, 3))), interpolation="SINE"
    )
    scales = {name: value for name, value in snapshot(obj).items() if name[0] == "scale"}
    (truth,) = shown_worlds([obj], frames)
    reduction = reduce_keys_of(obj, "motor_spline", TOLERANCE, RADIUS)
    assert scales.items() <= snapshot(obj).items()
    moved = (shown_worlds([obj], frames)[0] - truth)[:, :3, 3]
    assert np.linalg.norm(moved, axis=1).max() <= TOLERANCE * (1.0 + 1e-5)
    assert reduction.after == len(key_frames(obj)) < reduction.before


@pytest.mark.parametrize("best_of", [False, True])
def test_cycles_go_on_as_before(live_file, best_of):
    obj = new_object()
    frames, poses = motion("screw")
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 0, 500
    bake_poses(obj, frames + 170.0, poses)
    for fcurve in curves_of(obj).values():
        fcurve.modifiers.new("CYCLES")
    seen = np.arange(0.0, 501.0)
    truth = read_poses(obj, seen)
    reduction = reduce_keys_of(obj, "lerp_slerp" if best_of else "motor_spline", TOLERANCE, RADIUS, best_of=best_of)
    assert reduction.after < 0.5 * reduction.before
    assert (len(reduction.segments) > 1) == best_of
    assert off(obj, seen, truth) <= TOLERANCE * (1.0 + 1e-5)


def test_cycles_that_fewer_keys_would_change_are_refused(live_file):
    obj = recorded()
    path = curves_of(obj)["location", 0]
    while len(path.keyframe_points) > 60:
        path.keyframe_points.remove(path.keyframe_points[-1])
    path.modifiers.new("CYCLES")
    before = snapshot(obj)
    with pytest.raises(Refused, match=r"Tool goes on outside of its keys.*constant extrapolation"):
        reduce_keys_of(obj, "motor_spline", TOLERANCE, RADIUS)
    assert snapshot(obj) == before


def test_the_keys_of_a_strip_are_reduced_and_then_its_own_again(live_file):
    obj = recorded()
    action = obj.animation_data.action
    obj.animation_data.action = None
    strip = obj.animation_data.nla_tracks.new().strips.new("Strip", 31, action)
    frames = np.arange(31.0, strip.frame_end + 1.0)
    truth = read_poses(obj, frames)
    reduction = reduce_keys_of(obj, "motor_spline", TOLERANCE, RADIUS)
    assert reduction.after < 0.5 * reduction.before
    assert off(obj, frames, truth) <= TOLERANCE * (1.0 + 1e-5)
    restore_keys(obj)
    assert off(obj, frames, truth) < 1e-6


def test_the_file_keeps_the_dense_keys_until_they_are_let_go(live_file, tmp_path):
    obj = recorded()
    before = snapshot(obj)
    reduction = reduce_keys_of(obj, tolerance=TOLERANCE, radius=RADIUS)
    reopen(tmp_path / "kept.blend")
    assert reduction_of(bpy.data.objects["Tool"]).after == reduction.after
    restore_keys(bpy.data.objects["Tool"])
    assert snapshot(bpy.data.objects["Tool"]) == before

    obj = bpy.data.objects["Tool"]
    reduce_keys_of(obj, tolerance=TOLERANCE, radius=RADIUS)
    reduced = snapshot(obj)
    discard_dense_keys(obj)
    reopen(tmp_path / "let_go.blend")
    obj = bpy.data.objects["Tool"]
    assert not is_reduced(obj)
    assert [action.name for action in bpy.data.actions] == ["ToolAction"]
    assert snapshot(obj) == reduced
    assert reduction_of(obj).after == reduction.after
    with pytest.raises(Refused, match="Tool is not reduced, or has another Action by now"):
        restore_keys(obj)


def reopen(path: Path) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))


def test_what_was_done_last_is_taken_back_first(live_file):
    obj = recorded()
    dense = snapshot(obj)
    reduce_keys_of(obj, tolerance=TOLERANCE, radius=RADIUS)
    reduced = snapshot(obj)
    bake(obj)
    with pytest.raises(Refused, match="Tool was baked since it was reduced: Un-Bake first"):
        restore_keys(obj)
    baked = snapshot(obj)
    for tolerance in (0.5 * TOLERANCE, TOLERANCE):
        reduce_keys_of(obj, "dq_sclerp", tolerance, RADIUS)
    with pytest.raises(Refused, match="Tool was reduced since it was baked: Restore Keys first"):
        unbake(obj)
    restore_keys(obj)
    assert (snapshot(obj), is_baked(obj), is_reduced(obj)) == (baked, True, False)
    unbake(obj)
    assert (snapshot(obj), is_baked(obj), is_reduced(obj)) == (reduced, False, True)
    restore_keys(obj)
    assert (snapshot(obj), is_baked(obj), is_reduced(obj)) == (dense, False, False)
    assert len(bpy.data.actions) == 1
    reduce_keys_of(obj, tolerance=TOLERANCE, radius=RADIUS)
    bake(obj)
    reduce_keys_of(obj, "dq_sclerp", TOLERANCE, RADIUS)
    discard_dense_keys(obj)
    unbake(obj)
    assert snapshot(obj) == reduced
    assert (reduction_of(obj).before, is_reduced(obj)) == (len(dense["location", 0][-1]), False)
