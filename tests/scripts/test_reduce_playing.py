"""Tests of reduce.py in every Blender: what it writes plays within the tolerance in a Blender without the extension."""

import bpy
import numpy as np
import pytest

from rigid_motion.animation import key_frames, modes_of
from rigid_motion_batch.recordings.clip_reading import read_source
from tests.animation.farm import played_on_a_farm
from tests.scripts.baking import extension, frames_of_keys, open_again
from tests.scripts.bvh_bodies import write_body
from tests.scripts.reducing import (
    FRAMES,
    ROUNDING,
    displacement,
    heads_at,
    joints_in_metres,
    listed,
    object_file,
    played,
    read_table,
    reduced_name,
    rig_file,
    run,
    worlds_of,
    write_csv,
)


@pytest.mark.parametrize("mode", ["motor_spline", "lerp_slerp", "BLENDER"])
def test_an_object_with_few_keys_plays_within_the_tolerance_in_any_blender(tmp_path, mode):
    path = object_file(tmp_path / "shot.blend")
    before = path.read_bytes()
    assert run(path, "--tolerance", "5mm", *(["--curves"] if mode == "BLENDER" else ["--mode", mode])) == 0
    assert path.read_bytes() == before
    assert listed(tmp_path) == ["shot-reduced.blend", "shot.blend"]
    assert 0.0 < displacement(played(reduced_name(path), "Tool"), played(path, "Tool")) <= 5e-3 + ROUNDING
    with extension():
        open_again(reduced_name(path))
        tool = bpy.data.objects["Tool"]
        assert 2 < len(frames_of_keys(tool)) < len(FRAMES) / 2
        assert set(modes_of(tool, key_frames(tool)[:-1])) == {mode}


@pytest.mark.parametrize("options", [(), ("--curves",)])
def test_a_rig_with_few_keys_plays_within_the_tolerance_in_any_blender(tmp_path, capsys, options):
    path = rig_file(tmp_path / "shot.blend")
    before, probes = path.read_bytes(), ("at Root", "at Arm", "at Hand")
    assert run(path, "--tolerance", "5mm", *options) == 0
    assert path.read_bytes() == before
    # The end of a bone is as far from its head as its radius.
    assert 0.0 < displacement(played(reduced_name(path), *probes), played(path, *probes), 0.0) <= 5e-3 + ROUNDING
    open_again(reduced_name(path))
    counts = [len(frames_of_keys(bone)) for bone in bpy.data.objects["Rig"].pose.bones]
    assert sum(counts) < 3 * len(FRAMES) / 2
    assert f"Rig: 3 bones reduced, {3 * len(FRAMES)} -> {sum(counts)} keys" in capsys.readouterr().err


@pytest.mark.parametrize("fps", [None, 30])
def test_as_a_blend_file_it_plays_like_the_recording_in_any_blender(tmp_path, fps):
    path = tmp_path / "hand.csv"
    times, poses = write_csv(path)
    assert run(path, "--tolerance", "5mm", "--blend", *(("--fps", fps) if fps else ())) == 0
    blend, step = tmp_path / "hand-keys.blend", 1 if fps is None else 90 // fps
    frames = np.arange(1.0, len(times[::step]) + 1.0)
    worlds = played_on_a_farm(blend, ["hand"], frames)[1][0]
    assert displacement(worlds, worlds_of(poses)[::step]) <= 5e-3 + ROUNDING
    with extension():
        open_again(blend)
        scene, obj = bpy.context.scene, bpy.data.objects["hand"]
        assert (scene.render.fps, scene.frame_start, scene.frame_end) == (fps or 90, 1, len(frames))
        assert len(frames_of_keys(obj)) == len(read_table(tmp_path / "hand-keys.csv")[0])
        assert set(modes_of(obj, key_frames(obj)[:-1])) == {"motor_spline"}


@pytest.mark.parametrize("options", [("--mode", "motor_spline", "--shared"), (), ("--curves", "--shared")])
def test_a_whole_body_becomes_a_rig_that_plays_like_it_in_any_blender(tmp_path, capsys, options):
    source = write_body(tmp_path / "body.bvh")
    assert run(source, "--tolerance", "5mm", "--output", tmp_path / "keyed", *options) == 0
    made = tmp_path / "keyed" / "body-keys.blend"
    assert listed(made.parent) == [made.name]
    ((clip,), _) = read_source(str(source), None)
    shown = heads_at(made, clip.times - clip.times[0])
    x, y, z = np.moveaxis(joints_in_metres(clip)[np.argsort(clip.rest_body.joints)], -1, 0)
    assert 0.0 < np.linalg.norm(shown - np.stack((x, -z, y), axis=-1), axis=-1).max() <= 5e-3 + ROUNDING
    with extension():
        open_again(made)
        (rig,) = bpy.data.objects
        keyed = [bone for bone in rig.pose.bones if len(key_frames(bone))]
        assert sum(len(key_frames(bone)) for bone in keyed) < len(keyed) * len(clip.times)
        modes = {mode for bone in keyed for mode in modes_of(bone, key_frames(bone)[:-1])}
        assert modes == {"motor_spline" if "--mode" in options else "BLENDER"}
        assert len(bpy.data.actions) == 1, "the recording has the dense keys, and this file need not"

    told = "curves of Blender's own, as motor_spline would leave" in capsys.readouterr().err
    assert told == (options == ()), "which needed fewer keys is said where neither was asked for"
