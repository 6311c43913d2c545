"""Tests of file layouts: one motion, written as many programs do, reads back as it, and is rewritten in its place."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import Poses, shell_error
from rigid_motion.motion.differences import turned_in_world
from rigid_motion.motion.quaternions import normalise, rotate
from rigid_motion_batch.cli.inspect import main as inspect_main
from rigid_motion_batch.cli.reduce import main as reduce_main
from rigid_motion_batch.recordings import ReadingOptions, read_trajectories
from rigid_motion_batch.recordings.clip_reading import read_source
from rigid_motion_batch.recordings.euler import quaternions_from_intrinsic_eulers
from rigid_motion_batch.recordings.inspecting import inspect
from rigid_motion_batch.recordings.rewriting import eulers_near
from tests.scripts.bvh_bodies import write_body
from tests.scripts.recordings.layouts import LAYOUTS, LEFT, RIGHT, assert_is_the_motion
from tests.scripts.recordings.written_layouts import WRITTEN

EVERY = LAYOUTS | WRITTEN


@pytest.mark.parametrize("name", EVERY)
def test_every_layout_is_the_motion(write, name: str) -> None:
    layout = EVERY[name]
    recording = read_trajectories(f"{write(layout.name, layout.text)}:*", ReadingOptions(**layout.said))
    assert tuple(one.name for one in recording.trajectories) == layout.bodies
    for one, motion in zip(recording.trajectories, (LEFT, RIGHT), strict=False):
        assert_is_the_motion(one, motion, layout.seconds, clock=layout.within)
        assert bool(one.warnings) == layout.warned, one.warnings


SAID = {
    "two clocks, of which one stands": "times are those of 'device_time_s' and not of 'wall_time':",
    "bagpy": "times are those of 'Time' and not of 'header.stamp.secs and header.stamp.nsecs'",
    "OpenVINS under names": "'q4' is taken for w",
    "PX4": "'q[0]' is taken for w; times are those of 'timestamp' and not of 'timestamp_sample'",
    "rows of positions and of rotations in turn": "positions and rotations stand in different rows",
    "a body that lacks an axis": "'left' is left out, as it has no column y",
    "VINS": "the first of the four of a rotation is taken for w; if it is the other way round: --columns qx=5,",
}


@pytest.mark.parametrize("name", SAID)
def test_what_is_guessed_or_left_is_said(write, name: str) -> None:
    recording = read_trajectories(write(EVERY[name].name, EVERY[name].text))
    assert SAID[name] in "; ".join([recording.note, *map(str, recording.trajectories[0].warnings)])


CAMERAS = {
    "COLMAP": ("opencv", (0, 0, 1), (0, -1, 0), (0, -1, 0)),
    "NeRF": ("nerf", (0, 0, -1), (0, 1, 0), (0, 0, 1)),
    "Nuke": ("opengl", (0, 0, -1), (0, 1, 0), (0, 1, 0)),
    "Record3D": ("opengl", (0, 0, -1), (0, 1, 0), (0, 1, 0)),
    "whole matrices by columns": ("opengl", (0, 0, -1), (0, 1, 0), (0, 1, 0)),
    "KITTI": ("opencv", (0, 0, 1), (0, -1, 0), (0, -1, 0)),
}
"""Axes; the view direction and up direction of a camera in its own space; the up direction of the file's world.

The last two are ARKit's matrices, and KITTI's, which do not say so."""


@pytest.mark.parametrize("name", CAMERAS)
def test_cameras_look_along_y_of_the_object_with_z_above(write, name: str) -> None:
    """A Blender camera looks along its -z; as a child turned by 90 degrees about x it looks as recorded."""
    layout, (axes, forward, above, up) = LAYOUTS[name], CAMERAS[name]
    source, options = write(layout.name, layout.text), ReadingOptions(**layout.said)
    said = None if name in list(CAMERAS)[:4] else axes
    (clip,), note = read_source(source, said, options)
    assert (clip.axes, f"its axes are {axes} (" in note) == (axes, said is None)
    assert inspect(source, said, options).axes.name == axes
    shown, child = clip.in_blender(clip.poses), np.array((np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0))
    for own, faced, lens in ((forward, (0, 1, 0), (0, 0, -1)), (above, (0, 0, 1), (0, 1, 0))):
        there = LEFT.turns.apply(own)
        here = clip.in_blender(Poses(there, clip.poses.quaternions)).positions
        np.testing.assert_allclose(rotate(shown.quaternions, np.array(faced, dtype=float)), here, atol=1e-7)
        np.testing.assert_allclose(rotate(child, np.array(lens, dtype=float)), faced, atol=1e-15)
    still = Poses(np.array([up], dtype=float), clip.poses.quaternions[:1])
    np.testing.assert_array_equal(clip.in_blender(still).positions / clip.metres_per_unit, [(0.0, 0.0, 1.0)])


def test_of_motive_bones_are_taken_by_name_and_poses_in_the_space_of_a_parent_are_told(write) -> None:
    both = str(LAYOUTS["Motive"].text).replace("Meters\n", "Meters,Coordinate Space,Local\n").splitlines()
    for row, name in {2: "Bone", 3: "Hip", 4: "7", 5: None, 6: None}.items():
        cells = both[row].split(",")
        both[row] += "," + ",".join(cells[2:9] if name is None else [name] * 7)
    both[7:] = [line + "," + ",".join(line.split(",")[2:9]) for line in both[7:]]
    source = write("take.csv", "\n".join(both))
    (hip,), (tool,) = (read_trajectories(f"{source}{body}").trajectories for body in (":Hip", ""))
    assert (hip.name, tool.name) == ("Hip", "Tool")
    np.testing.assert_array_equal(hip.poses.positions, tool.poses.positions)
    assert "Coordinate Space: Global" in str(tool.warnings)


SOME = ("TUM", "KITTI", "w first, by numbers", "PlotJuggler", "COLMAP", "A-Frame", "Qualisys", "angles zxy in rad")


@pytest.mark.parametrize("name", SOME)
def test_what_is_compared_can_be_looked_into_and_reduced(write, tmp_path, name: str, capsys) -> None:
    layout = EVERY[name]
    source = write(layout.name, layout.text)
    assert inspect_main([source, *layout.options]) == 0
    reducing = ["--dry-run", "--tolerance", "1mm", "--output", str(tmp_path / "less")]
    assert reduce_main([f"{source}:*", *reducing, *layout.options]) == 0
    told = capsys.readouterr().out
    assert all(body in told for body in layout.bodies if len(layout.bodies) > 1), told


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


def written(source: str, path: Path, options: ReadingOptions) -> None:
    """Move every third sample of all bodies, and check what the written file reads as."""
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
            numbers[body.cells.rows[::3], column] = values[::3]
    cells.write(path, numbers)
    again = read_trajectories(source.replace(str(file), str(path)), options).trajectories
    for body, reread in zip(before, again, strict=True):
        np.testing.assert_allclose(body.times, reread.times, atol=1e-9)
        expected = Poses(body.poses.positions.copy(), normalise(body.poses.quaternions))
        expected[..., ::3] = moved(body.poses)[..., ::3]
        read = Poses(reread.poses.positions, normalise(reread.poses.quaternions))
        assert shell_error(read, expected).max() < 1e-6


@pytest.mark.parametrize("name", [name for name in EVERY if name not in NOT_WRITTEN])
def test_every_layout_is_written_as_it_is_read(write, tmp_path, name: str) -> None:
    layout = EVERY[name]
    source = write(layout.name, layout.text)
    target = tmp_path / "other" / layout.name
    target.parent.mkdir()
    written(f"{source}:*", target, ReadingOptions(**layout.said))


@pytest.mark.parametrize("unit", [1.0, 100.0])
def test_bodies_are_written_as_they_are_read(tmp_path, unit: float) -> None:
    source, target = write_body(tmp_path / "body.bvh", unit=unit), tmp_path / "other.bvh"
    poses = read_trajectories(str(source)).trajectories[0].poses
    written(str(source), target, ReadingOptions())
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
