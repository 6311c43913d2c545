"""One motion, written in the layouts of many programs, is that motion when it is read."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion_batch.recordings import ReadingOptions, read_trajectories
from tests.scripts.recordings.layouts import LAYOUTS, LEFT, RIGHT
from tests.scripts.recordings.optical_layouts import OPTICAL


@pytest.mark.parametrize("name", LAYOUTS | OPTICAL)
def test_every_layout_is_the_motion(write, name: str) -> None:
    layout = (LAYOUTS | OPTICAL)[name]
    recording = read_trajectories(f"{write(layout.name, layout.text)}:*", ReadingOptions(**layout.said))
    assert tuple(one.name for one in recording.trajectories) == layout.bodies
    for one, motion in zip(recording.trajectories, (LEFT, RIGHT), strict=False):
        np.testing.assert_allclose(one.times - one.times[0], layout.seconds, atol=layout.within)
        np.testing.assert_allclose(one.poses.positions * one.metres_per_unit, motion.positions, atol=1e-9)
        turns = Rotation.from_quat(one.poses.quaternions, scalar_first=True)
        assert (turns.inv() * motion.turns).magnitude().max() < 1e-7
        assert one.poses.scales is None
        assert bool(one.warnings) == layout.warned, one.warnings
