"""EuRoC ground truth."""

import numpy as np
import pytest

from rigid_motion_batch.recordings import read_trajectories

HEADER = (
    "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], "
    "v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1]"
)
ROWS = (
    "1403636580838555648,4.688319,-1.786938,0.783338,0.534108,-0.153029,-0.827383,-0.082152,-0.027876,0.033207,0.8\n"
    "1403636580843555649,4.688177,-1.786770,0.787350,0.534640,-0.152990,-0.826976,-0.082863,-0.029272,0.033992,0.8\n"
    "1403636580848555652,4.688028,-1.786598,0.791382,0.535178,-0.152945,-0.826562,-0.083605,-0.030043,0.034999,0.8\n"
)


@pytest.mark.parametrize("header", [HEADER, HEADER.replace("#timestamp", "#timestamp [ns]"), HEADER.replace(", ", ",")])
def test_not_a_nanosecond_is_lost(write, header: str) -> None:
    (trajectory,) = read_trajectories(write("data.csv", f"{header}\n{ROWS}")).trajectories
    np.testing.assert_array_equal(trajectory.times, np.array([0, 5_000_001, 10_000_004]) / 1e9)
    np.testing.assert_array_equal(trajectory.poses.positions[0], [4.688319, -1.786938, 0.783338])
    np.testing.assert_array_equal(trajectory.poses.quaternions[0], [0.534108, -0.153029, -0.827383, -0.082152])
