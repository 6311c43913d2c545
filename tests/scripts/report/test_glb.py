"""`comparison.glb`: where its lanes are, by matrices and the specification, against what the modes were measured by."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion_batch.analysis.choices import EVERYWHERE, Uniform
from rigid_motion_batch.analysis.reconstructions import Reconstruction, reconstruct
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.palette import colour_of, linear
from rigid_motion_batch.recordings.clip_reading import read_source
from rigid_motion_batch.report.glb import RECORDING, TOLERANCE, comparison_glb
from tests.gltf.oracle import File
from tests.scripts.bvh_bodies import write_body
from tests.scripts.reducing import write_csv

NAMES = {"lerp_slerp": "Vector + Quaternion", "motor_spline": "Smooth Screw"}
"""Of the lanes."""

MODES = tuple(NAMES)

SINGLE = 5e-6
"""Metres, of the single precision of the file."""


def made_of(source: Path, axes: str | None = None) -> Reconstruction:
    ((clip,), _) = read_source(str(source), axes)
    made = reconstruct(clip, Uniform("5"), MODES, EVERYWHERE.of(clip))
    assert made is not None
    return made


def written(made: Reconstruction, folder: Path) -> File:
    path = folder / "comparison.glb"
    path.write_bytes(comparison_glb(made, [(mode,) for mode in MODES]))
    return File(path)


def in_gltf(poses: Poses, axes: str) -> np.ndarray:
    """Positions in metres, y up."""
    x, y, z = np.moveaxis(to_blender(poses, axes).positions, -1, 0)
    return np.stack((x, z, -y), axis=-1)


def lanes_of(file: File) -> dict[str, tuple[int, list[int]]]:
    """The node of each lane, and those of what moves in it, by its name and in their order."""
    nodes = file.json["nodes"]

    def below(node: int) -> list[int]:
        children = nodes[node].get("children", [])
        return [*children, *(item for child in children for item in below(child))]

    return {nodes[lane]["name"]: (lane, sorted(below(lane))) for lane in nodes[0]["children"]}


def require_lanes(file: File, times: np.ndarray, truth: dict[str, np.ndarray]) -> None:
    """That what moves in each lane is where it should be at these times, shape (joints, n, 3), beside the others."""
    lanes, worlds = lanes_of(file), file.worlds(0, times - times[0])[..., :3, 3]
    assert list(lanes) == list(truth)
    for name, (lane, moving) in lanes.items():
        assert np.linalg.norm(worlds[moving] - worlds[lane] - truth[name], axis=-1).max() <= TOLERANCE + SINGLE
    sides = [worlds[moving][..., 0] for _, moving in lanes.values()]
    assert all(one.max() < other.min() for one, other in itertools.pairwise(sides))


@pytest.mark.parametrize("axes", ["blender", "unity"])
def test_lanes_of_a_rigid_body_move_as_the_modes_do(tmp_path, axes):
    write_csv(tmp_path / "hand.csv")
    made = made_of(tmp_path / "hand.csv", axes)
    file = written(made, tmp_path)
    truth = {
        RECORDING: made.clip.poses[made.samples],
        **{NAMES[mode]: made.filled_in(mode, made.times) for mode in MODES},
    }
    require_lanes(
        file, made.times, {name: in_gltf(made.clip.in_metres(poses), axes)[None] for name, poses in truth.items()}
    )
    colours = [material["pbrMetallicRoughness"]["baseColorFactor"][:3] for material in file.json["materials"]]
    np.testing.assert_allclose(colours[1:], [linear(colour_of(mode)) for mode in MODES])


def test_lanes_of_a_body_have_its_joints_where_the_modes_put_them(tmp_path):
    write_body(tmp_path / "body.bvh")
    made = made_of(tmp_path / "body.bvh")
    file = written(made, tmp_path)
    truth = {RECORDING: made.truth(made.samples), **{NAMES[mode]: made.shown(mode, made.times) for mode in MODES}}
    require_lanes(file, made.times, {name: in_gltf(poses, made.clip.axes) for name, poses in truth.items()})


def test_between_samples_that_are_far_apart_a_spline_is_a_spline(tmp_path):
    write_csv(tmp_path / "hand.csv", seconds=4.0, rate=10.0)
    made = made_of(tmp_path / "hand.csv")
    times = np.linspace(made.times[0], made.times[-1], 241)
    file = written(made, tmp_path)
    lane, moving = lanes_of(file)[NAMES["motor_spline"]]
    worlds = file.worlds(0, times - times[0])[..., :3, 3]
    truth = in_gltf(made.filled_in("motor_spline", times), "blender")
    assert np.linalg.norm(worlds[moving[0]] - worlds[lane] - truth, axis=-1).max() <= TOLERANCE + SINGLE
