"""Tests of rewriting: new numbers in place of those read; the file reads as intended and is otherwise unchanged."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import Poses, shell_error
from rigid_motion.motion.differences import turned_in_world
from rigid_motion.motion.quaternions import normalise
from rigid_motion_batch.recordings import ReadingOptions, read_trajectories
from rigid_motion_batch.recordings.euler import quaternions_from_intrinsic_eulers
from rigid_motion_batch.recordings.rewriting import eulers_near
from tests.scripts.bvh_bodies import write_body
from tests.scripts.recordings.test_layouts import EVERY

NOT_WRITTEN = {"Record3D", "rows of positions and of rotations in turn"}
"""Layouts that `clean` refuses to write: lists without names, and numbers that are not stored in the file as read."""


def moved(poses: Poses) -> Poses:
    """Return the poses, each moved a little in a different way."""
    random = np.random.default_rng(1)
    noise, turns = random.normal(size=(2, *poses.positions.shape)) * 0.02
    if noise.ndim > 2:
        noise[1:] = 0.0  # Joints have no channels for it.
    return replace(
        poses, positions=poses.positions + noise, quaternions=turned_in_world(normalise(poses.quaternions), turns)
    )


def written(source: str, path: Path, options: ReadingOptions, every: int) -> None:
    """Move one in `every` samples of all bodies, and check what the written file reads as."""
    before = read_trajectories(source, options).trajectories
    cells = before[0].cells
    assert cells
    numbers = np.full(cells.shape, np.nan)
    file = Path(source.partition(":")[0])
    if file.suffix != ".json":
        cells.write(path, numbers)
        assert path.read_bytes() == file.read_bytes()
    for body in before:
        assert body.cells
        for column, values in body.cells.numbers(moved(body.poses)).items():
            numbers[body.cells.rows[::every], column] = values[::every]
    cells.write(path, numbers)
    again = read_trajectories(source.replace(str(file), str(path)), options).trajectories
    for body, reread in zip(before, again, strict=True):
        np.testing.assert_allclose(body.times, reread.times, atol=1e-9)
        expected = Poses(body.poses.positions.copy(), normalise(body.poses.quaternions))
        expected[..., ::every] = moved(body.poses)[..., ::every]
        read = Poses(reread.poses.positions, normalise(reread.poses.quaternions))
        assert shell_error(read, expected).max() < 1e-6


@pytest.mark.parametrize("name", [name for name in EVERY if name not in NOT_WRITTEN])
def test_every_layout_is_written_as_it_is_read(write, tmp_path, name: str) -> None:
    layout = EVERY[name]
    source = write(layout.name, layout.text)
    target = tmp_path / "other" / layout.name
    target.parent.mkdir()
    written(f"{source}:*", target, ReadingOptions(**layout.said), 3)


@pytest.mark.parametrize("unit", [1.0, 100.0])
def test_bodies_are_written_as_they_are_read(tmp_path, unit: float) -> None:
    source, target = write_body(tmp_path / "body.bvh", unit=unit), tmp_path / "other.bvh"
    poses = read_trajectories(str(source)).trajectories[0].poses
    written(str(source), target, ReadingOptions(), 3)
    frames = source.read_text().index("MOTION")
    assert target.read_text()[:frames] == source.read_text()[:frames]
    assert poses.shape == (3, 61)


@pytest.mark.parametrize("order", ["XYZ", "ZXY", "YXZ"])
def test_angles_are_those_near_to_others(order: str) -> None:
    random = np.random.default_rng(3)
    angles = random.uniform(-4.0, 4.0, (500, 3))
    turned = quaternions_from_intrinsic_eulers(angles, order)
    np.testing.assert_allclose(
        eulers_near(turned, order, angles + random.normal(size=(500, 3)) * 1e-3), angles, atol=1e-6
    )
