"""Bodies for the paper: which joints are taken, and errors, keys and differences worked out again by other means."""

from pathlib import Path

import numpy as np
import pytest

from research.paper import bodies
from research.studies import files_in
from rigid_motion.motion import Poses
from rigid_motion_batch.recordings import TrajectoryError
from tests.motion.bodies import body_errors
from tests.scripts.bvh_bodies import write_body
from tests.scripts.clips.bodies import PARENTS, swinging_body

NAMES = ("Hips", "Spine", "Head", "LeftArm", "LeftHand", "Glove", "RightLeg", "RightFoot")

BODY_CLIP = swinging_body("walk", seconds=2.0, rate=30.0, seed=3, joints=NAMES)

RADII = np.full(len(NAMES), 0.03)

METRES = Poses(BODY_CLIP.poses.positions * 0.01, BODY_CLIP.poses.quaternions)


# -- errors ------------------------------------------------------------------------------------------------------------


def test_errors_of_the_body_are_those_of_matrices() -> None:
    rows = bodies.errors_of(BODY_CLIP)
    for mode in bodies.MODES:
        for rate in bodies.ERROR_RATES:
            keys = np.arange(0, 61, 30 // rate)
            errors = body_errors(BODY_CLIP.times, METRES, PARENTS, (keys,) * len(NAMES), mode, RADII)
            assert rows[mode][rate][0] == pytest.approx(np.sqrt(np.mean(errors**2)), rel=1e-6)


# -- keys needed -------------------------------------------------------------------------------------------------------


# -- files -------------------------------------------------------------------------------------------------------------


def test_a_folder_stands_for_the_bodies_in_it_and_each_file_comes_once(tmp_path: Path) -> None:
    for name in ("b.bvh", "a.FBX", "notes.txt", "hand.csv"):
        (tmp_path / name).touch()
    files = files_in([tmp_path, tmp_path / "b.bvh"], bodies.EXTENSIONS)
    assert [path.name for path in files] == ["a.FBX", "b.bvh"]


def test_what_is_no_whole_body_is_refused(tmp_path: Path) -> None:
    write_body(tmp_path / "walk.bvh")
    assert bodies.read_body(tmp_path / "walk.bvh").name == "walk"
    (tmp_path / "hand.csv").write_text("t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,1,0,0,0,0,0,1\n", encoding="utf-8")
    with pytest.raises(TrajectoryError, match="it is no whole body"):
        bodies.read_body(tmp_path / "hand.csv")
