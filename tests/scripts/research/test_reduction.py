"""Tests of the reduction study: figures of reduced keys and of Decimate match Blender's evaluation."""

import bpy
import numpy as np
import pytest

from research import reduction
from research.decimating import PARTS_PER_FRAME, DecimatedBody, bend, decimate
from rigid_motion import animation
from rigid_motion.motion import interpolate, reduce_keys, shell_error
from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.analysis.needed import part_of
from rigid_motion_batch.analysis.reconstructions import reconstruct
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from tests.balls import largest_displacements
from tests.scripts.bvh_bodies import write_body
from tests.scripts.research.keeping import written
from tests.world_poses import read_poses

# Blender's BVH importer leaves it to Python to close the file.
LEFT_OPEN = "ignore::pytest.PytestUnraisableExceptionWarning"
pytestmark = [pytest.mark.blender, pytest.mark.any_blender, pytest.mark.filterwarnings(LEFT_OPEN)]

TOLERANCE, RADIUS = 0.005, 0.1


@pytest.fixture(scope="module")
def clip() -> Clip:
    """Return the first two seconds of a clip."""
    whole = reduction.read(reduction.ASSETS / "reach.csv", 30.0)
    return part_of(whole, 0, 59 * PARTS_PER_FRAME)


@pytest.mark.parametrize("rotation_mode", reduction.ROTATION_MODES)
def test_each_row_has_what_it_was_asked_for(extension, clip, rotation_mode):
    result = reduction.measure(clip, rotation_mode, TOLERANCE, RADIUS)
    reduced, as_good = result["reduced"], result["decimate"]
    channels = 7 if rotation_mode == "QUATERNION" else 6
    for poses in (reduced, result["curves"], result["curves_between"]):
        assert poses["error_mm"] <= 1e3 * TOLERANCE * 1.05
        assert poses["numbers"] == poses["frames"] * (1 + channels) == poses["key_count"] * (1 + channels)
    assert as_good["error_mm"] <= reduced["error_mm"]
    assert as_good["numbers"] == round(6 * channels * as_good["key_count"])


def reduced(obj):
    animation.reduce_keys_of(obj, "motor_spline", TOLERANCE, RADIUS)


def decimated(obj):
    decimate(obj, mode="RATIO", factor=0.8)


@pytest.mark.parametrize("change", [reduced, bend, decimated])
@pytest.mark.parametrize("rotation_mode", reduction.ROTATION_MODES)
def test_curves_are_measured_as_the_scene_shows_them(extension, clip, rotation_mode, change):
    obj = reduction.import_clip(clip, rotation_mode)
    change(obj)
    one = reduction.outcome(obj, clip.poses, RADIUS)
    shown = read_poses(obj, reduction.frames_of(clip))
    assert one.largest == pytest.approx(shell_error(shown, clip.poses, RADIUS).max(), abs=1e-6)
    assert {len(fcurve.keyframe_points) for fcurve in animation.channelbag_of(obj).fcurves} == {round(one.keys)}


def test_fewest_keys_of_blenders_curves_are_those_of_the_search(extension, clip):
    frames, poses = reduction.frames_of(clip)[::PARTS_PER_FRAME], clip.poses[::PARTS_PER_FRAME]
    keys = reduce_keys(frames, poses, "bezier", TOLERANCE, RADIUS)
    left, within = reduction.blenders_curves(clip, clip.poses, "QUATERNION", TOLERANCE, RADIUS, 2.0 * TOLERANCE)
    assert left == within
    assert left.frames == left.keys == len(keys)
    shown = interpolate(frames[keys], poses[keys], reduction.frames_of(clip), "bezier")
    assert left.largest == pytest.approx(shell_error(shown, clip.poses, RADIUS).max(), abs=1e-6)


TIMES = np.arange(24) / 30.0


@pytest.fixture
def body(tmp_path) -> Clip:
    clip, *_ = read_clips([str(write_body(tmp_path / "body.bvh", TIMES))])[0]
    return reduction.of_height(clip)


def shown(body: DecimatedBody) -> np.ndarray:
    """Return the world matrices of all bones, frame by frame, shape (n, joints, 4, 4)."""
    result = []
    for frame in body.frames:
        bpy.context.scene.frame_set(int(frame), subframe=frame - int(frame))
        rig = body.rig.obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
        result.append([np.array(rig.matrix_world @ rig.pose.bones[name].matrix) for name in body.rig.bones])
    return np.array(result)


def test_errors_of_decimated_curves_are_those_of_what_blender_shows(body):
    made = reconstruct(body, Tolerance("1cm"), ["motor_spline"], 0.03)
    decimated = DecimatedBody(made)
    assert decimated.errors().max() < 2e-6
    recorded = shown(decimated)
    decimate(decimated.rig.obj, mode="ERROR", remove_error_margin=0.05)
    off = shown(decimated) - recorded
    errors = [largest_displacements(one[:, :3, 3], 0.03 * one[:, :3, :3]) for one in off.swapaxes(0, 1)]
    np.testing.assert_allclose(decimated.errors(), errors, atol=5e-6)
    assert decimated.left().largest > 1e-3


def test_rivals_are_as_good(body):
    rows = {way: reduction.beside(body, way) for way in reduction.WAYS}
    for own, curves, decimated in rows.values():
        for row in (own, curves):
            assert row["on_frames_mm"] <= 10.0 + 1e-6
            assert row["on_frames_mm"] <= row["error_mm"] + 1e-6
        assert decimated["error_mm"] <= own["error_mm"]
        assert decimated["numbers"] == 6 * decimated["key_count"]
    (own, *_), (shared, *_) = rows.values()
    assert own["key_count"] <= shared["key_count"]


def test_the_study_writes_what_its_page_reads(tmp_path, monkeypatch):
    path = write_body(tmp_path / "body.bvh", TIMES)
    recording = reduction.read(reduction.ASSETS / "reach.csv", 15.0)
    monkeypatch.setattr(reduction, "ASSETS", tmp_path)
    (tmp_path / "reach.csv").touch()
    monkeypatch.setattr(reduction, "read", lambda _path, _rate: recording)
    assert reduction.main(["--bodies", str(path), "--root", str(tmp_path)]) == 0
    result = written(tmp_path, "reduction")
    assert str(tmp_path) not in str(result)
    own, curves, decimate = result["beside"][:3]
    means = result["beside_means"][own["how"]]
    for row in (curves, decimate):
        assert means[row["how"]]["numbers"] == pytest.approx(row["numbers"] / own["numbers"], 1e-5)
