"""TUM trajectories."""

import numpy as np
import pytest

from rigid_motion_batch.recordings import read_trajectories

COMMENTS = "# ground truth trajectory\n# file: 'dataset.bag'\n# timestamp tx ty tz qx qy qz qw\n"
ROWS = "1305031098.6659 1.3 0.6 1.6 0.6132 0.5962 -0.3311 -0.3986\n1305031098.6758 1.4 0.7 1.7 0.1 0.2 0.3 0.4\n"


@pytest.mark.parametrize("name", ["walk.tum", "walk.txt", "walk.csv"])
@pytest.mark.parametrize("text", [COMMENTS + ROWS, ROWS, ROWS.replace(" ", "\t"), f"\n{ROWS}\n"])
def test_eight_numbers_in_a_line_are_time_position_and_scalar_last_quaternion(write, name: str, text: str) -> None:
    (trajectory,) = read_trajectories(write(name, text)).trajectories
    assert trajectory.name == "walk"
    np.testing.assert_array_equal(trajectory.times, [1305031098.6659, 1305031098.6758])
    np.testing.assert_array_equal(trajectory.poses.positions, [[1.3, 0.6, 1.6], [1.4, 0.7, 1.7]])
    np.testing.assert_array_equal(trajectory.poses.quaternions[0], [-0.3986, 0.6132, 0.5962, -0.3311])
    assert trajectory.poses.scales is None


def test_a_comment_that_names_another_order_is_believed(write) -> None:
    text = "# t x y z qw qx qy qz\n0 1 2 3 0.9 0.1 0.2 0.3\n1 1 2 3 0.9 0.1 0.2 0.3\n"
    (trajectory,) = read_trajectories(write("walk.txt", text)).trajectories
    np.testing.assert_array_equal(trajectory.poses.quaternions[0], [0.9, 0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ("text", "line", "problem"),
    [
        ("", None, "the file is empty"),
        (COMMENTS, None, "'walk' has 0 samples"),
        (f"{COMMENTS}0 1 2 3 0 0 0 1\n0.1 1 2\n", 5, "3 columns where 8 are needed"),
        (f"{COMMENTS}0 1 2 3 0 0 0 1 9\n", 4, "9 columns where 8 have a name"),
        (f"{COMMENTS}{ROWS}0.1 1 2 3 0 0 O 1\n", 6, "qz is 'O', not a number"),
        ("# t x y z\n0 1 2 3\n0.1 1 2 3\n", 2, "positions only, and rotations are needed"),
        ("0 1 2 3\n0.1 1 2 3\n", 1, "positions only, and rotations are needed; write t x y z qx qy qz qw"),
        (f"{ROWS}1,2,3\n", 3, "1 columns where 8 are needed"),
    ],
)
def test_a_wrong_file_is_told_with_its_line(write, refusal, text: str, line: int | None, problem: str) -> None:
    told_line, message = refusal(write("walk.tum", text))
    assert message.startswith(problem)
    assert told_line == line
