"""The figures of reduced keys and of Blender's Decimate are those of what Blender shows."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from research import reduction
from research.markdown_tables import numbers, tables
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


def test_the_page_names_what_was_measured(live, clip, monkeypatch, tmp_path):
    monkeypatch.setattr(reduction, "files", lambda _folder: [reduction.ASSETS / "reach.csv"])
    monkeypatch.setattr(reduction, "read", lambda _path, _rate: clip)
    monkeypatch.setattr(reduction, "ROTATION_MODES", {"XYZ": "Euler angles"})
    animation.unregister()
    try:
        assert reduction.main(["--output", str(tmp_path / "reduction.md")]) == 0
    finally:
        animation.register()
    page = (tmp_path / "reduction.md").read_text(encoding="utf-8")
    assert bpy.app.version_string in page
    (table,) = tables(page)
    assert table.section == "Turned by Euler angles"
    one, multiples = table.row("reach", "60"), table.rows[-1]
    ours, theirs = numbers(one[2])
    assert float(multiples[2]) == pytest.approx(theirs / ours, abs=0.005)
    assert f"keys on {multiples[2]} times as many frames (with Euler angles)" in " ".join(page.split())


def test_means_are_geometric():
    def outcome(frames, largest):
        return reduction.Outcome(10.0, frames, 80, largest)

    outcomes = [
        (outcome(10, 1.0), outcome(frames, 1.0), outcome(10, ratio)) for frames, ratio in ((20, 2.0), (80, 8.0))
    ]
    assert reduction.means(outcomes) == f"| {reduction.MULTIPLES} | | 4.00 | 1.00 | 1.00 | 1.00 | 4.00 |"


def test_what_decimate_cannot_do_leaves_its_cells_empty(clip):
    reduced = reduction.Outcome(2.0, 2, 14, 0.004)
    assert reduction.row(clip, reduced, None, None) == "| reach | 60 |  |  |  |  |  |"
    assert reduction.means([(reduced, None, None)]).endswith(" | |  |  |  |  |  |")


def test_a_recording_of_too_few_poses_is_refused(tmp_path):
    path = tmp_path / "still.csv"
    path.write_text("t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n0,0,0,0,0,0,0,1\n", encoding="utf-8")
    with pytest.raises(TrajectoryError, match=r"still\.csv: 1 usable poses are left"):
        reduction.read(path, 60.0)


def test_all_clips_of_the_project_are_measured():
    assert [path.name for path in reduction.files(None)] == ["pivot.csv", "reach.csv", "screw.csv", "throw.csv"]
    assert np.all(np.diff(reduction.read(reduction.ASSETS / "pivot.csv", 60.0).frames) == 1.0)
