"""Which recordings count, found out by measuring."""

from pathlib import Path

import numpy as np
import pytest

from research.paper.motions import REST, read_all, read_motion
from research.studies import files_in
from rigid_motion_batch.recordings import TrajectoryError, read_trajectories
from tests.scripts.recordings.test_damaged_bvh_bodies import seed


def write(path: Path, positions: np.ndarray) -> None:
    rows = [f"{i / 50},{x},{y},{z},0,0,0,1" for i, (x, y, z) in enumerate(positions.tolist())]
    path.write_text("\n".join(["t,x,y,z,qx,qy,qz,qw", *rows, ""]), encoding="utf-8")


def swinging(amplitude: float) -> np.ndarray:
    return amplitude * np.sin(np.linspace(0.0, 9.0, 200))[:, None] * (1.0, 0.0, 0.0)


def test_a_body_that_stays_within_a_centimetre_of_its_mean_is_at_rest(tmp_path: Path):
    write(tmp_path / "rests.csv", swinging(REST))
    with pytest.raises(TrajectoryError, match="at rest"):
        read_motion(tmp_path / "rests.csv")


def test_a_skeleton_is_represented_by_its_root(tmp_path: Path):
    path = tmp_path / "walk.bvh"
    path.write_text(seed("ZXY", 60), encoding="utf-8")
    clip = read_motion(path)
    (root,) = read_trajectories(f"{path}:Hips").trajectories
    assert (clip.rest_body, len(clip.times)) == (None, 60)
    np.testing.assert_allclose(clip.poses.positions, root.poses.positions, atol=1e-12)


def test_a_file_that_is_no_recording_is_left_out_and_says_why_without_its_folder(tmp_path: Path):
    (tmp_path / "notes.csv").write_text("dear diary\n", encoding="utf-8")
    write(tmp_path / "moves.csv", swinging(3.0 * REST))
    result, left_out = read_all(files_in([tmp_path]), read_motion)
    assert [clip.name for clip in result] == ["moves"]
    assert list(left_out) == ["notes"]
    assert str(tmp_path) not in left_out["notes"]
