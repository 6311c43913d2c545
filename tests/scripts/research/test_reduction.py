"""Tests of the reduction study: figures of reduced keys and of Decimate match Blender's evaluation."""

import pytest

from research import reduction
from research.decimating import PARTS_PER_FRAME, bend, decimate
from rigid_motion import animation
from rigid_motion.motion import interpolate, reduce_keys, shell_error
from rigid_motion_batch.analysis.needed import part_of
from rigid_motion_batch.recordings.clips import Clip
from tests.world_poses import read_poses

pytestmark = [pytest.mark.blender, pytest.mark.any_blender]

TOLERANCE, RADIUS = 0.005, 0.1


@pytest.fixture
def live():
    animation.register()
    yield
    animation.unregister()


@pytest.fixture(scope="module")
def clip() -> Clip:
    """Return the first two seconds of a clip."""
    whole = reduction.read(reduction.ASSETS / "reach.csv", 30.0)
    return part_of(whole, 0, 59 * PARTS_PER_FRAME)


@pytest.mark.parametrize("rotation_mode", reduction.ROTATION_MODES)
def test_each_row_has_what_it_was_asked_for(live, clip, rotation_mode):
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
def test_curves_are_measured_as_the_scene_shows_them(live, clip, rotation_mode, change):
    obj = reduction.import_clip(clip, rotation_mode)
    change(obj)
    one = reduction.outcome(obj, clip.poses, RADIUS)
    shown = read_poses(obj, reduction.frames_of(clip))
    assert one.largest == pytest.approx(shell_error(shown, clip.poses, RADIUS).max(), abs=1e-6)
    assert {len(fcurve.keyframe_points) for fcurve in animation.channelbag_of(obj).fcurves} == {round(one.keys)}


def test_fewest_keys_of_blenders_curves_are_those_of_the_search(live, clip):
    frames, poses = reduction.frames_of(clip)[::PARTS_PER_FRAME], clip.poses[::PARTS_PER_FRAME]
    keys = reduce_keys(frames, poses, "bezier", TOLERANCE, RADIUS)
    left, within = reduction.blenders_curves(clip, clip.poses, "QUATERNION", TOLERANCE, RADIUS, 2.0 * TOLERANCE)
    assert left == within
    assert left.frames == left.keys == len(keys)
    shown = interpolate(frames[keys], poses[keys], reduction.frames_of(clip), "bezier")
    assert left.largest == pytest.approx(shell_error(shown, clip.poses, RADIUS).max(), abs=1e-6)
