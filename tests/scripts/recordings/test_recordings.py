"""Other people's recordings, beside the repository where they are kept: every one can be read."""

from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion.quaternions import angle_between
from rigid_motion_batch.recordings import read_trajectories
from tests.recordings import RECORDINGS

FILES = sorted(path for path in RECORDINGS.glob("*") if path.suffix != ".md")

pytestmark = pytest.mark.recordings


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_recording_is_read_whole(path: Path) -> None:
    for trajectory in read_trajectories(f"{path}:*").trajectories:
        count = len(trajectory.times)
        assert count > 100
        assert trajectory.poses.shape == (count,)
        assert 1.0 < trajectory.times[-1] - trajectory.times[0] < 60.0
        lengths = np.linalg.norm(trajectory.poses.quaternions, axis=1)
        assert np.count_nonzero(np.abs(lengths - 1.0) > 1e-3) <= 1, "the first pose of some is all zeros"
        assert np.abs(trajectory.poses.positions).max() < 5.0
        steps = angle_between(trajectory.poses.quaternions[1:-1], trajectory.poses.quaternions[2:])
        assert np.median(steps) < 0.1, "successive rotations are near one another"
