"""The figures of reduced keys and of Blender's Decimate are those of what Blender shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from research import reduction
from rigid_motion import animation
from rigid_motion.motion import shell_error
from rigid_motion_batch.recordings import TrajectoryError
from tests.scripts.recordings.test_damaged_bvh_bodies import seed

TOLERANCE, RADIUS = 0.005, 0.1


@pytest.fixture
def live():
    animation.register()
    yield
    animation.unregister()


@pytest.fixture(scope="module")
def clip() -> reduction.Recording:
    """The first two seconds of a clip."""
    whole = reduction.read(reduction.ASSETS / "reach.csv", 30.0)
    return reduction.Recording(whole.name, whole.frames[:60], whole.poses[:60])


@pytest.mark.parametrize("rotation_mode", reduction.ROTATION_MODES)
def test_each_row_has_what_it_was_asked_for(live, clip, rotation_mode):
    reduced, as_good, as_few = reduction.measure(clip, rotation_mode, TOLERANCE, RADIUS)
    channels = 7 if rotation_mode == "QUATERNION" else 6
    assert reduced.largest <= TOLERANCE * (1.0 + 1e-5)
    assert reduced.numbers == reduced.frames * (1 + channels) == reduced.keys * (1 + channels)
    assert as_few.frames <= reduced.frames
    assert as_few.largest > reduced.largest
    assert as_good.largest <= reduced.largest
    assert as_good.numbers == round(6 * channels * as_good.keys)


def test_decimated_curves_are_measured_in_the_scene(live, clip):
    obj = reduction.import_recording(clip, "QUATERNION")
    reduction.decimate(obj, mode="RATIO", factor=0.8)
    shown = animation.read_poses(obj, clip.frames)
    one = reduction.outcome(obj, clip, clip.poses, RADIUS)
    assert one.largest == pytest.approx(shell_error(shown, clip.poses, RADIUS).max())
    assert {len(fcurve.keyframe_points) for fcurve in animation.channelbag_of(obj).fcurves} == {round(one.keys)}
    assert one.keys < 0.3 * len(clip.frames)


def test_an_imported_recording_shows_its_poses(live, clip):
    obj = reduction.import_recording(clip, "XYZ")
    assert shell_error(animation.read_poses(obj, clip.frames), clip.poses, RADIUS).max() < 1e-6


def test_of_a_skeleton_the_root_is_read(tmp_path):
    path = tmp_path / "walk.bvh"
    path.write_text(seed("ZXY", 60), encoding="utf-8")
    whole, root = (reduction.read(source, 30.0) for source in (path, Path(f"{path}:Hips")))
    assert np.array_equal(whole.poses.positions, root.poses.positions)
    assert shell_error(whole.poses, root.poses, RADIUS).max() < 1e-9


def test_means_are_geometric(clip):
    def outcome(frames, largest):
        return reduction.Left("Decimate", frames, 10.0, 80, largest)

    rows = [
        reduction.row(clip, outcome(10, 1.0), outcome(frames, 1.0), outcome(10, ratio))
        for frames, ratio in ((20, 2.0), (80, 8.0))
    ]
    rows.append(reduction.row(clip, outcome(10, 1.0), None, None))
    assert (rows[-1]["decimate"], rows[-1]["few_mm"]) == (None, None)
    assert reduction.means(rows) == pytest.approx(
        {"frames": 4.0, "key_count": 1.0, "numbers": 1.0, "error_mm": 1.0, "few_mm": 4.0}
    )


def test_a_recording_of_too_few_poses_is_refused(tmp_path):
    path = tmp_path / "still.csv"
    path.write_text("t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n0,0,0,0,0,0,0,1\n", encoding="utf-8")
    with pytest.raises(TrajectoryError, match=r"still\.csv: 1 usable poses are left"):
        reduction.read(path, 60.0)


def test_all_clips_of_the_project_are_measured():
    assert np.all(np.diff(reduction.read(reduction.ASSETS / "pivot.csv", 60.0).frames) == 1.0)
