"""Tests of reduce.py on recordings: errors of the resulting tables, objects and rigs."""

import re

import bpy
import numpy as np
import pytest

from rigid_motion.animation import key_frames
from rigid_motion.motion import Poses, interpolate
from rigid_motion_batch.analysis.metrics import write_poses
from tests.animation.farm import played_on_a_farm
from tests.animation.keyed import curves_of
from tests.scripts.baking import extension, open_again
from tests.scripts.bvh_bodies import write_body
from tests.scripts.recordings.glbs import curved, mixed_rates
from tests.scripts.reducing import (
    ROUNDING,
    displacement,
    heads_at,
    listed,
    read_table,
    run,
    worlds_of,
    write_csv,
)

pytestmark = pytest.mark.any_blender


@pytest.mark.parametrize("mode", ["motor_spline", "dq_sclerp"])
def test_the_keys_of_a_recording_tell_its_motion_within_the_tolerance(tmp_path, capsys, mode):
    path = tmp_path / "hand.csv"
    times, poses = write_csv(path, 2.0)
    before = path.read_bytes()
    assert run(path, "--tolerance", "5mm", "--mode", mode) == 0
    assert path.read_bytes() == before
    key_times, keys = read_table(tmp_path / "hand-keys.csv")
    assert 2 < len(key_times) < len(times) / 5
    assert set(key_times) <= set(times)
    filled = interpolate(key_times, keys, times, mode)
    assert 0.0 < displacement(worlds_of(filled), worlds_of(poses)) <= 5e-3
    said = capsys.readouterr()
    assert f"{path}: reduced, {len(times)} -> {len(key_times)} keys, " in said.err
    assert said.out == f"{tmp_path / 'hand-keys.csv'}\n"


def test_so_many_keys_of_a_recording_and_key_poses_of_a_body(tmp_path, capsys):
    path, body = tmp_path / "hand.csv", write_body(tmp_path / "body.bvh")
    times, poses = write_csv(path)
    assert run(path, body, "--keys", "9", "--output", tmp_path / "keyed") == 0
    key_times, keys = read_table(tmp_path / "keyed" / "hand-keys.csv")
    assert len(key_times) == 9
    filled = interpolate(key_times, keys, times, "motor_spline")
    (off,) = re.findall(r"hand.csv: reduced, \d+ -> 9 keys, ([\d.]+) mm off at most\n", capsys.readouterr().err)
    assert displacement(worlds_of(filled), worlds_of(poses)) == pytest.approx(1e-3 * float(off), rel=0.01)
    with extension():
        open_again(tmp_path / "keyed" / f"{body.stem}-keys.blend")
        (rig,) = bpy.data.objects
        assert {len(key_frames(bone)) for bone in rig.pose.bones} <= {0, 9}


def test_frames_are_the_samples_of_a_recording_whose_rate_is_no_whole_number(tmp_path):
    path = tmp_path / "hand.csv"
    write_csv(path, rate=29.97)
    assert run(path, "--blend") == 0
    open_again(tmp_path / "hand-keys.blend")
    render, keys = bpy.context.scene.render, curves_of(bpy.data.objects["hand"])["location", 0].keyframe_points
    assert render.fps / render.fps_base == pytest.approx(29.97, rel=1e-6)
    assert all(key.co.x == round(key.co.x) for key in keys)


def test_a_rigid_motion_becomes_curves_in_a_file_alone(tmp_path, capsys):
    hand = tmp_path / "hand.csv"
    write_csv(hand)
    assert run(hand, "--curves", "--tolerance", "5mm") == 0
    assert listed(tmp_path) == ["hand-keys.blend", "hand.csv"]
    assert re.search(r"reduced, 91 -> \d keys, \S+ mm off at most \(5 mm allowed\) on frames", capsys.readouterr().err)
    assert run(hand, "--curves", "--output", tmp_path / "keys.csv") == 1
    assert "what has curves becomes a .blend file: name that with --output" in capsys.readouterr().err


@pytest.mark.parametrize("body", [mixed_rates(1.0), curved()], ids=["mixed rates", "curved"])
def test_the_tolerance_holds_at_every_key_of_every_curve_and_between_them(tmp_path, capsys, body):
    source = body.write(tmp_path / "walk.glb")
    assert run(source, "--blend", "--mode", "motor_spline") == 0
    told = re.search(r"(\S+) mm off at most \(5 mm allowed\)", capsys.readouterr().err)
    assert told is not None
    assert float(told[1]) <= 5.0
    names = [f"Joint{joint}" for joint in range(len(body.parents))]
    order = [names.index(name) for name in sorted(names)]
    keys = np.unique(np.concatenate([track.times for track in body.tracks]))
    for times, more in ((keys, 0.0), (body.moments, 1e-3)):
        result = heads_at(tmp_path / "walk-keys.blend", times)
        off = np.linalg.norm(result - body.places(times)[order], axis=-1).max()
        assert off <= 1e-3 * float(told[1]) + more + ROUNDING


def test_a_body_that_grows_has_its_size_in_the_table_and_in_the_file(tmp_path):
    path = tmp_path / "balloon.csv"
    times, poses = write_csv(path)
    sizes = 1.0 + 0.3 * np.sin(times)
    write_poses(path, times, Poses(poses.positions, poses.quaternions, sizes))
    assert run(path, "--tolerance", "5mm", "--blend") == 0
    assert (tmp_path / "balloon-keys.csv").read_text().startswith("t,x,y,z,qw,qx,qy,qz,s\n")
    worlds = worlds_of(poses)
    worlds[:, :3, :3] *= sizes[:, None, None]
    frames = np.arange(1.0, len(times) + 1.0)
    shown = played_on_a_farm(tmp_path / "balloon-keys.blend", ["balloon"], frames)[1][0]
    assert displacement(shown, worlds) <= 5e-3 + ROUNDING


def test_one_body_of_a_file_and_all_of_them_are_files_of_their_own(tmp_path):
    source = write_body(tmp_path / "body.bvh")
    assert run(f"{source}:LeftHand", "--tolerance", "1cm") == 0
    assert (tmp_path / "body-LeftHand-keys.csv").is_file()
    assert run(f"{source}:*", "--tolerance", "1cm", "--output", tmp_path / "all") == 0
    assert listed(tmp_path / "all") == [f"body-{name}-keys.csv" for name in ("Head", "Hips", "LeftHand")]


def test_what_is_far_away_is_refused_where_blender_could_not_hold_it(tmp_path, capsys):
    path = tmp_path / "hand.csv"
    times, poses = write_csv(path)
    write_poses(path, times, Poses(poses.positions + 1e6, poses.quaternions))
    assert run(path) == 0
    assert run(path, "--blend", "--overwrite") == 1
    assert f"{path}: this is up to 1e+06 m from its origin" in capsys.readouterr().err
