"""The figures of reduced keys and of Blender's Decimate are those of what Blender shows."""

import pytest

from research import reduction
from research.decimating import decimate
from rigid_motion import animation
from rigid_motion.motion import shell_error
from rigid_motion_batch.analysis.needed import part_of
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.world_poses import read_poses

TOLERANCE, RADIUS = 0.005, 0.1


@pytest.fixture
def live():
    animation.register()
    yield
    animation.unregister()


@pytest.fixture(scope="module")
def clip() -> Clip:
    """The first two seconds of a clip."""
    whole = reduction.read(reduction.ASSETS / "reach.csv", 30.0)
    return part_of(whole, 0, 59)


@pytest.mark.parametrize("rotation_mode", reduction.ROTATION_MODES)
def test_each_row_has_what_it_was_asked_for(live, clip, rotation_mode):
    result = reduction.measure(clip, rotation_mode, TOLERANCE, RADIUS)
    reduced, as_good = result["reduced"], result["decimate"]
    channels = 7 if rotation_mode == "QUATERNION" else 6
    assert reduced["error_mm"] <= 1e3 * TOLERANCE * (1.0 + 1e-5)
    assert reduced["numbers"] == reduced["frames"] * (1 + channels) == reduced["key_count"] * (1 + channels)
    assert as_good["error_mm"] <= reduced["error_mm"]
    assert as_good["numbers"] == round(6 * channels * as_good["key_count"])


def test_decimated_curves_are_measured_in_the_scene(live, clip):
    obj = reduction.import_clip(clip, "QUATERNION")
    decimate(obj, mode="RATIO", factor=0.8)
    shown = read_poses(obj, reduction.frames_of(clip))
    one = reduction.outcome(obj, clip, RADIUS)
    assert one.largest == pytest.approx(shell_error(shown, clip.poses, RADIUS).max())
    assert {len(fcurve.keyframe_points) for fcurve in animation.channelbag_of(obj).fcurves} == {round(one.keys)}
    assert one.keys < 0.3 * len(reduction.frames_of(clip))
