"""Which recordings count, found out by measuring."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from research.paper.motions import RECORDINGS, REST, read_motion, recordings_in, spread
from rigid_motion_batch.recordings import TrajectoryError, read_trajectories
from tests.recordings import RECORDINGS as FOLDER
from tests.scripts.recordings.test_damaged_bvh_bodies import seed


def write(path: Path, positions: np.ndarray) -> None:
    rows = [f"{i / 50},{x},{y},{z},0,0,0,1" for i, (x, y, z) in enumerate(positions.tolist())]
    path.write_text("\n".join(["t,x,y,z,qx,qy,qz,qw", *rows, ""]), encoding="utf-8")


def swinging(amplitude: float) -> np.ndarray:
    return amplitude * np.sin(np.linspace(0.0, 9.0, 200))[:, None] * (1.0, 0.0, 0.0)


def test_a_body_that_moves_counts(tmp_path: Path):
    write(tmp_path / "moves.csv", swinging(3.0 * REST))
    motion, clip = read_motion(str(tmp_path / "moves.csv"), "moves", RECORDINGS)
    assert clip is not None
    assert (clip.name, motion.left_out, motion.samples) == ("moves", "", 200)
    assert motion.samples_per_s == pytest.approx(50.0)


def test_a_body_that_stays_within_a_centimetre_of_its_mean_is_at_rest(tmp_path: Path):
    write(tmp_path / "rests.csv", swinging(REST))
    motion, clip = read_motion(str(tmp_path / "rests.csv"), "rests", RECORDINGS)
    assert clip is None
    assert motion.left_out.startswith("at rest")
    assert 0.0 < motion.spread_m < REST


def test_a_body_that_turns_on_the_spot_moves(tmp_path: Path):
    angles = np.linspace(0.0, 2.0, 100)
    rows = [f"{i / 50},0,0,0,0,0,{np.sin(a / 2)},{np.cos(a / 2)}" for i, a in enumerate(angles)]
    (tmp_path / "turns.csv").write_text("\n".join(["t,x,y,z,qx,qy,qz,qw", *rows, ""]), encoding="utf-8")
    assert read_motion(str(tmp_path / "turns.csv"), "turns", RECORDINGS)[1] is not None


def test_a_skeleton_is_represented_by_its_root(tmp_path: Path):
    path = tmp_path / "walk.bvh"
    path.write_text(seed("ZXY", 60), encoding="utf-8")
    motion, clip = read_motion(str(path), "walk", RECORDINGS)
    (root,) = read_trajectories(f"{path}:Hips").trajectories
    assert (clip.figure, motion.samples) == (None, 60)
    np.testing.assert_allclose(clip.poses.positions, root.poses.positions, atol=1e-12)
    assert motion.spread_m == pytest.approx(spread(root.poses))


def test_a_file_that_is_no_recording_is_left_out_and_says_why_without_its_folder(tmp_path: Path):
    (tmp_path / "notes.csv").write_text("dear diary\n", encoding="utf-8")
    motion, clip = read_motion(str(tmp_path / "notes.csv"), "notes", RECORDINGS)
    assert clip is None
    assert "notes.csv" in motion.left_out
    assert str(tmp_path) not in motion.left_out


def test_a_folder_without_recordings_is_refused(tmp_path: Path):
    with pytest.raises(TrajectoryError, match="no recording in this folder"):
        recordings_in(tmp_path)
    with pytest.raises(TrajectoryError, match="no such folder"):
        recordings_in(tmp_path / "missing")


@pytest.mark.recordings
def test_of_other_peoples_recordings_the_one_at_rest_is_left_out():
    left = [path.name for path in recordings_in(FOLDER) if read_motion(str(path), path.stem, RECORDINGS)[1] is None]
    assert left == ["optitrack_rigid_body.csv"]


SWINGING_LEG = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Leg
  {
    OFFSET 0.1 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT Foot
    {
      OFFSET 0 -0.8 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET 0 0 0.1
      }
    }
  }
}
MOTION
Frames: 40
Frame Time: 0.025
"""


def test_of_a_whole_body_it_is_the_root(tmp_path: Path):
    rows = [f"{0.01 * i} 0.9 0 0 0 {i} 0 {3 * i} 0 0 0 0" for i in range(40)]
    (tmp_path / "walks.bvh").write_text(SWINGING_LEG + "\n".join([*rows, ""]), encoding="utf-8")
    motion, clip = read_motion(str(tmp_path / "walks.bvh"), "walks", RECORDINGS)
    assert motion.left_out == ""
    assert clip.figure is None
    assert clip.poses.shape == (40,)
    np.testing.assert_allclose(clip.poses.positions[:, 0], 0.01 * np.arange(40), atol=1e-12)
    np.testing.assert_allclose(clip.poses.positions[:, 1], 0.9)
