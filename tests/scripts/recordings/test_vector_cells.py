"""Vectors and quaternions in one cell, as programs print them."""

import re

import numpy as np
import pytest

from rigid_motion_batch.recordings import ReadingOptions, read_trajectories

ROWS = np.random.default_rng(8).normal(size=(20, 7)).round(3)
"""Positions and quaternions, not of length 1."""


def csv(vector: str, *, separator: str = ",", decimal: str = ".", header: str = "Time;Position;Rotation") -> str:
    """A log whose cells are written so: {} is what stands between the numbers."""
    before, between, behind = re.split(r"[{}]", vector)

    def cell(numbers: np.ndarray) -> str:
        return before + between.join(str(x).replace(".", decimal) for x in numbers.tolist()) + behind

    lines = [
        separator.join((str(0.01 * row).replace(".", decimal), cell(numbers[:3]), cell(numbers[3:])))
        for row, numbers in enumerate(ROWS)
    ]
    return "\n".join([header.replace(";", separator), *lines])


@pytest.mark.parametrize(
    ("vector", "separator", "decimal"),
    [
        ("({, })", ",", "."),
        ('"({, })"', ",", "."),
        ('"{, }"', ",", "."),
        ("({, })", ";", "."),
        ("({, })", ";", ","),
        ("({; })", "\t", ","),
        ('"{ }"', ",", "."),
        ("[{ }]", ",", "."),
    ],
)
def test_vectors_in_cells_are_read_however_they_are_written(write, vector, separator, decimal) -> None:
    (trajectory,) = read_trajectories(write("log.csv", csv(vector, separator=separator, decimal=decimal))).trajectories
    np.testing.assert_array_equal(trajectory.poses.positions, ROWS[:, :3])
    np.testing.assert_array_equal(trajectory.poses.quaternions, ROWS[:, [6, 3, 4, 5]])


def test_three_numbers_in_a_cell_of_rotations_are_euler_angles_and_ask_for_their_order(write, refusal) -> None:
    source = write("log.csv", "Time,Position,Rotation\n0,(0, 0, 0),(30, 0, 0)\n.1,(0, 0, 0),(30, 0, 0)\n")
    assert refusal(source)[1].startswith("rotations are Euler angles here (Rotation.x, Rotation.y, Rotation.z), and")
    (trajectory,) = read_trajectories(source, ReadingOptions(euler="YXZ", degrees=True)).trajectories
    assert trajectory.poses.quaternions[0] == pytest.approx((np.cos(np.pi / 12), np.sin(np.pi / 12), 0, 0))


def test_a_cell_that_lacks_a_number_is_told_with_its_line(write, refusal) -> None:
    row = "(0, 0, 0),(0, 0, 0, 1)"
    source = write("log.csv", f"Time,Position,Rotation\n0,{row}\n.1,(0, 0),(0, 0, 0, 1)\n")
    line, _ = refusal(source)
    assert line == 3
