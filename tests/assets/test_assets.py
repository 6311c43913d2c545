"""The assets are what their script makes, and what they claim to be."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from assets import make_assets
from research.making.motions import (
    BIT_TIP_M,
    DOOR_EDGE_M,
    GRIP,
    HINGE_M,
    HOLD,
    MOTIONS,
    OTHER_MOTIONS,
    SCREW_PITCH_M,
    SITE_M,
)
from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import conjugate, multiply, rotate
from rigid_motion_batch.recordings.reading import read_trajectories

ASSETS = Path(make_assets.__file__).parent


def recorded(name: str) -> tuple[np.ndarray, Poses]:
    t, x, y, z, qx, qy, qz, qw = np.loadtxt(ASSETS / f"{name}.csv", delimiter=",", skiprows=1).T
    return t, Poses(np.stack((x, y, z), axis=1), np.stack((qw, qx, qy, qz), axis=1))


def recorded_in_hand() -> tuple[np.ndarray, Poses, Poses]:
    """The times, the hand and the tool of the recording of both."""
    hand, tool = read_trajectories(f"{ASSETS / HOLD}.csv:*").trajectories
    assert (hand.name, tool.name) == ("hand", "tool")
    np.testing.assert_array_equal(hand.times, tool.times)
    return hand.times, hand.poses, tool.poses


def place_of(point: ArrayLike, poses: Poses) -> np.ndarray:
    return poses.positions + rotate(poses.quaternions, np.broadcast_to(point, poses.positions.shape))


# ---- clips -----------------------------------------------------------------------------------------------------------


def test_the_folder_holds_the_clips_that_the_script_makes_and_no_other_table():
    assert {path.stem for path in ASSETS.glob("*.csv")} == {*MOTIONS, *OTHER_MOTIONS}


@pytest.mark.parametrize("name", [*MOTIONS, *OTHER_MOTIONS])
def test_the_script_makes_the_kept_clip_again(name):
    assert make_assets.clip(name) == (ASSETS / f"{name}.csv").read_text(encoding="utf-8")


def test_a_failure_while_writing_leaves_the_old_file_whole(tmp_path):
    old = tmp_path / "clip.csv"
    old.write_text("old", encoding="utf-8")

    def fail(path: Path) -> None:
        path.write_text("half", encoding="utf-8")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        make_assets.write(old, fail)
    assert old.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [old]


@pytest.mark.parametrize("name", [*MOTIONS, *OTHER_MOTIONS])
def test_a_clip_has_the_timer_of_a_90_hz_device(name):
    times = recorded(name)[0] if name != HOLD else recorded_in_hand()[0]
    steps = np.diff(times)
    assert times[0] == 0.0
    assert 4.0 <= times[-1] <= 5.0
    assert np.median(steps) == pytest.approx(1.0 / 90.0, abs=2e-4)
    assert steps.min() >= 0.007 - 1e-6
    assert steps.max() <= 0.017 + 1e-6
    assert 0.8e-3 < steps.std() < 2e-3
    assert np.mean(steps > 0.0125) > 0.02


def test_the_pivot_keeps_its_tip_in_place_while_the_handle_moves():
    _, poses = recorded("pivot")
    tip = place_of(BIT_TIP_M, poses)
    assert np.linalg.norm(tip - SITE_M, axis=1).max() < 3e-3
    assert np.ptp(poses.positions, axis=0).max() > 0.15


def test_the_screw_advances_by_its_pitch_with_every_turn():
    _, poses = recorded("screw")
    tip = place_of(BIT_TIP_M, poses)
    # The side of the tool goes round the line of the bit.
    start = poses.quaternions[:1]
    side = rotate(poses.quaternions, np.broadcast_to((1.0, 0.0, 0.0), tip.shape))
    right, forward, up = (rotate(start, np.eye(3)[axis][None])[0] for axis in range(3))
    turns = np.unwrap(np.arctan2(-side @ up, side @ right)) / (2.0 * np.pi)
    assert 2.0 < turns[-1] - turns[0] < 2.3
    advance = (tip - tip[0]) @ forward
    assert advance[-1] == pytest.approx(SCREW_PITCH_M * (turns[-1] - turns[0]), abs=1e-3)
    assert np.polyfit(turns, advance, 1)[0] == pytest.approx(SCREW_PITCH_M, rel=0.15)


def test_the_door_opens_wide_and_stays_in_its_hinge():
    _, poses = recorded("door")
    assert np.linalg.norm(place_of(DOOR_EDGE_M, poses) - HINGE_M, axis=1).max() < 5e-3
    opened = np.degrees(2.0 * np.arctan2(poses.quaternions[:, 3], poses.quaternions[:, 0]))
    assert opened.max() == pytest.approx(170.0, abs=0.5)
    assert np.abs(opened[[0, -1]]).max() < 0.5


def test_the_tool_stays_where_the_hand_holds_it_but_for_the_noise_of_both_devices():
    _, hand, tool = recorded_in_hand()
    off = np.linalg.norm(tool.positions - place_of(GRIP.positions, hand), axis=1)
    assert 0.2e-3 < off.mean() < off.max() < 2.5e-3
    assert np.ptp(hand.positions, axis=0).min() > 0.1
    turned = multiply(conjugate(multiply(hand.quaternions, GRIP.quaternions)), tool.quaternions)
    assert np.degrees(2.0 * np.linalg.norm(turned[:, 1:], axis=1).max()) < 0.6


# ---- models ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def models():
    """The objects of the kept file and those made anew: {name: (kept, made)}."""
    bpy = pytest.importorskip("bpy")
    from research.making.models import MODELS, build_models

    kinds = ("objects", "meshes", "materials")
    before = {kind: set(getattr(bpy.data, kind)) for kind in kinds}
    made = build_models()
    with bpy.data.libraries.load(str(ASSETS / "models.blend")) as (source, target):
        assert sorted(source.objects) == sorted(source.scenes) == sorted(MODELS)
        target.objects = list(MODELS)
    yield dict(zip(MODELS, zip(target.objects, made, strict=True), strict=True))
    bpy.data.batch_remove([data for kind in kinds for data in set(getattr(bpy.data, kind)) - before[kind]])


def vertices_of(model) -> np.ndarray:
    return np.array([vertex.co[:] for vertex in model.data.vertices])


def faces_of(model) -> list[tuple[list[int], str]]:
    """The corners of every face, and its material."""
    names = [slot.material.name.split(".")[0] for slot in model.material_slots]
    return [([*polygon.vertices], names[polygon.material_index]) for polygon in model.data.polygons]


def test_the_file_of_the_models_is_small():
    assert (ASSETS / "models.blend").stat().st_size < 300_000


def test_the_simple_drill_is_as_large_as_the_drill(models):
    drill = np.load(ASSETS / "drill.npz")
    vertices = vertices_of(models["Drill"][0])
    for edge in (np.min, np.max):
        np.testing.assert_allclose(edge(drill["vertices"], axis=0), edge(vertices, axis=0), atol=1e-3)
    assert len(drill["triangles"]) <= 1500


@pytest.mark.parametrize("name", ["Drill", "Controller"])
def test_the_script_makes_the_kept_model_again(models, name):
    kept, made = models[name]
    np.testing.assert_allclose(vertices_of(kept), vertices_of(made), atol=1e-7)
    assert faces_of(kept) == faces_of(made)
    kept_normals, made_normals = (
        np.array([corner.vector[:] for corner in m.data.corner_normals]) for m in (kept, made)
    )
    np.testing.assert_allclose(kept_normals, made_normals, atol=1e-3)


def test_the_bit_of_the_drill_ends_where_the_clips_have_the_tip(models):
    vertices = vertices_of(models["Drill"][0])
    foremost = vertices[vertices[:, 1] > vertices[:, 1].max() - 1e-6]
    np.testing.assert_allclose(foremost.mean(axis=0), BIT_TIP_M, atol=1e-7)


@pytest.mark.parametrize(("name", "length"), [("Drill", 0.22), ("Controller", 0.15)])
def test_a_model_has_its_true_size_is_held_at_its_origin_and_points_forward(models, name, length):
    kept, _ = models[name]
    low, high = vertices_of(kept).min(axis=0), vertices_of(kept).max(axis=0)
    assert np.argmax(high - low) == 1
    assert (high - low)[1] == pytest.approx(length, abs=0.01)
    assert (low < -0.01).all()
    assert (high > 0.01).all()
    np.testing.assert_array_equal(np.array(kept.matrix_world), np.eye(4))
