"""Tests of file layouts: one motion, written as many programs do, reads back as the same motion."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.cli.inspect import main as inspect_main
from rigid_motion_batch.cli.reduce import main as reduce_main
from rigid_motion_batch.recordings import ReadingOptions, read_trajectories
from rigid_motion_batch.recordings.clip_reading import read_source
from rigid_motion_batch.recordings.inspecting import inspect
from tests.scripts.recordings.layouts import LAYOUTS, LEFT, RIGHT
from tests.scripts.recordings.optical_layouts import OPTICAL
from tests.scripts.recordings.written_layouts import WRITTEN

EVERY = LAYOUTS | OPTICAL | WRITTEN


@pytest.mark.parametrize("name", EVERY)
def test_every_layout_is_the_motion(write, name: str) -> None:
    layout = EVERY[name]
    recording = read_trajectories(f"{write(layout.name, layout.text)}:*", ReadingOptions(**layout.said))
    assert tuple(one.name for one in recording.trajectories) == layout.bodies
    for one, motion in zip(recording.trajectories, (LEFT, RIGHT), strict=False):
        np.testing.assert_allclose(one.times - one.times[0], layout.seconds, atol=layout.within)
        np.testing.assert_allclose(one.poses.positions * one.metres_per_unit, motion.positions, atol=1e-9)
        turns = Rotation.from_quat(one.poses.quaternions, scalar_first=True)
        assert (turns.inv() * motion.turns).magnitude().max() < 1e-7
        assert one.poses.scales is None
        assert bool(one.warnings) == layout.warned, one.warnings


SAID = {
    "two clocks, of which one stands": "times are those of 'device_time_s' and not of 'wall_time':",
    "bagpy": "times are those of 'Time' and not of 'header.stamp.secs and header.stamp.nsecs'",
    "OpenVINS under names": "'q4' is taken for w",
    "PX4": "'q[0]' is taken for w; times are those of 'timestamp' and not of 'timestamp_sample'",
    "rows of positions and of rotations in turn": "positions and rotations stand in different rows",
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


def about(axis: int, angle: float) -> np.ndarray:
    """Return a rotation matrix in Qualisys's sense: clockwise when looking along the axis."""
    result, (one, other) = np.eye(3), [(axis + 1) % 3, (axis + 2) % 3]
    result[one, one] = result[other, other] = np.cos(angle)
    result[other, one], result[one, other] = np.sin(angle), -np.sin(angle)
    return result


@pytest.mark.parametrize("by_rows", [False, True])
def test_a_body_of_qualisys_is_turned_by_roll_then_pitch_then_yaw(write, by_rows: bool) -> None:
    """R = Rx Ry Rz takes points of the body to the room, as in QTM's manual, in either order of Rot[0] to Rot[8]."""
    angles = np.radians([[30.0, 20.0, 10.0], [-70.0, 40.0, 110.0], [5.0, -60.0, -20.0]])
    turns = np.array([about(0, roll) @ about(1, pitch) @ about(2, yaw) for roll, pitch, yaw in angles])
    header = "NO_OF_FRAMES\t3\nNO_OF_BODIES\t1\nFREQUENCY\t100\nBODY_NAMES\tTool\n"
    columns = "\t".join(["X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual", *(f"Rot[{place}]" for place in range(9))])
    written = (turns if by_rows else turns.transpose(0, 2, 1)).reshape(3, 9)
    table = np.hstack((np.arange(9.0).reshape(3, 3), np.degrees(angles), np.zeros((3, 1)), written))
    text = "".join("\t".join(map("{:.5f}".format, row)) + "\n" for row in table)
    (body,) = read_trajectories(write("take.tsv", f"{header}{columns}\n{text}")).trajectories
    found = Rotation.from_quat(body.poses.quaternions, scalar_first=True).as_matrix()
    np.testing.assert_allclose(found, turns, atol=2e-5)
    assert body.warnings == ()


SOME = ("TUM", "KITTI", "w first, by numbers", "PlotJuggler", "COLMAP", "A-Frame", "Qualisys", "angles zxy in rad")


@pytest.mark.parametrize("name", SOME)
def test_what_is_compared_can_be_looked_into_and_reduced(write, tmp_path, name: str, capsys) -> None:
    layout = EVERY[name]
    said = [f"--{option.replace('_', '-')}={as_typed(value)}" for option, value in layout.said.items()]
    source = write(layout.name, layout.text)
    assert inspect_main([source, *said]) == 0
    assert (
        reduce_main([f"{source}:*", "--dry-run", "--tolerance", "1mm", "--output", str(tmp_path / "less"), *said]) == 0
    )
    told = capsys.readouterr().out
    assert all(body in told for body in layout.bodies if len(layout.bodies) > 1), told


def as_typed(value: object) -> str:
    return ",".join(map("=".join, value)) if isinstance(value, list) else str(value)
