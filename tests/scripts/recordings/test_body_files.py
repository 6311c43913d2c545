"""Tests of body files found in practice: units, still roots, positions besides OFFSETs, names with spaces."""

from pathlib import Path

import numpy as np
import pytest

from rigid_motion_batch.recordings import ReadingOptions, Trajectory, read_clips, read_trajectories
from rigid_motion_batch.recordings.bvh_writing import write_bvh
from rigid_motion_batch.recordings.inspecting import inspect
from rigid_motion_batch.recordings.rest_bodies import carrying, part_of_body, unit_above_floor

FILES = Path(__file__).parent / "bodies"


def whole(name: str) -> tuple[Trajectory, np.ndarray]:
    """Return a body and its joint positions, shape (joints, n, 3)."""
    (body,) = read_trajectories(str(FILES / name)).trajectories
    return body, body.rest_body.skeleton.in_root_space(body.poses).positions


def test_a_root_that_stands_still_is_not_what_is_measured() -> None:
    (content,) = inspect(str(FILES / "static_root.bvh")).contents
    assert content.up == "y"
    assert content.unit.name == "centimetres"
    assert content.size.path == pytest.approx(3.51, abs=0.01), "of the hips, 3.51 m in a row"
    assert content.size.speed == pytest.approx(1.8, abs=0.02)
    for name, roots in (("static_root.bvh", [0]), ("upper_body_cm.bvh", [])):
        body, places = whole(name)
        assert np.flatnonzero(carrying(body.rest_body.parents, places)).tolist() == roots


# A root, hips with two legs and a spine, and two other children of the root.
PARENTS = np.array([-1, 0, 1, 1, 1, 0, 0])
STANDING = np.array([[0, 0, 0], [5, 0, 0.9], [5, 0.1, 0], [5, -0.1, 0], [5, 0, 1.7], [8, 3, 0], [-2, 0, 2]])


@pytest.mark.parametrize(
    ("moving", "aside"),
    [
        ([], []),
        ([1, 2, 3, 4], [0, 5, 6]),
        ([1, 2, 3, 4, 5, 6], [0]),
        ([0, 1, 2, 3, 4, 5, 6], []),
        ([2, 4], []),
    ],
    ids=["nothing", "one of several", "all of several", "the root too", "hips that stay"],
)
def test_a_root_that_stands_is_aside_with_what_stands_far_from_all_that_moves(
    moving: list[int], aside: list[int]
) -> None:
    places = np.repeat(STANDING[:, None], 100, axis=1)
    places[moving, :, 0] += np.linspace(0.0, 2.0, 100)
    assert np.flatnonzero(carrying(PARENTS, places)).tolist() == aside
    assert np.flatnonzero(~part_of_body(PARENTS, places)).tolist() == aside


def test_what_stands_near_to_a_body_is_seen_with_it() -> None:
    places = np.repeat(STANDING[:, None], 100, axis=1)
    places[5:] = [[[5.5, 0.0, 0.0]], [[4.5, 0.0, 0.5]]]
    places[1:5, :, 0] += np.linspace(-1.0, 1.0, 100)
    assert np.flatnonzero(carrying(PARENTS, places)).tolist() == [0]


def test_hips_that_sit_are_a_part_of_the_body_whose_arms_move() -> None:
    parents = np.array([-1, 0, 1, 0, 0])
    places = np.repeat(
        np.array([[0, 0, 0], [0, 0, 0.5], [0.3, 0, 0.6], [0.4, 0.1, 0], [0.4, -0.1, 0.0]])[:, None], 9, axis=1
    )
    places[2, :, 2] += np.linspace(0.0, 0.3, 9)
    assert not carrying(parents, places).any()


def test_the_upper_half_of_a_body_is_not_in_inches_where_its_hips_would_be_higher_than_those_of_giants() -> None:
    body, _ = whole("upper_body_cm.bvh")
    assert body.metres_per_unit == 0.01
    assert "in inches, all of it would be more than 2.24 m up" in body.remark
    (hand,) = read_trajectories(f"{FILES / 'upper_body_cm.bvh'}:LeftHand").trajectories
    assert (hand.metres_per_unit, hand.remark) == (0.01, body.remark), "a joint is in the unit of its body"
    assert (
        inspect(f"{FILES / 'upper_body_cm.bvh'}:LeftHand").contents[0].unit.known_from
        == "guessed from the size of the body"
    )
    (scaled,) = read_trajectories(f"{FILES / 'upper_body_cm.bvh'}:LeftHand", ReadingOptions(scale=0.1)).trajectories
    assert scaled.metres_per_unit == 0.1


@pytest.mark.parametrize(
    ("size", "lowest", "highest", "unit"),
    [
        (69.67, 88, 156, "centimetres"),
        (50, 90, 140, "centimetres"),
        (170, 0, 170, "centimetres"),
        (170, 500, 670, "centimetres"),
        (68, 0, 68, "inches"),
        (68, 2, 70, "inches"),
        (68, -34, 34, "inches"),
        (1.7, 8, 9.7, "metres"),
        (30, 0, 30, "units of CMU's motion capture, 1/0.45 inch"),
    ],
)
def test_what_is_above_the_floor_has_a_say_in_the_unit(size: float, lowest: float, highest: float, unit: str) -> None:
    assert unit_above_floor(size, lowest, highest)[0] == unit


def test_positions_that_are_meant_to_be_added_to_offsets_are() -> None:
    body, places = whole("zero_positions.bvh")
    assert str(body.warnings[0]).startswith(
        "positions of 3 joints below the root are near 0 and not near their OFFSETs"
    )
    lengths = np.linalg.norm(places[1:] - places[[0, 1, 0]], axis=-1)
    np.testing.assert_allclose(lengths, np.repeat([[40.0], [35.0], [np.hypot(9, 45)]], 40, axis=1))
    assert body.metres_per_unit == 0.01
    body, places = whole("positions_additive.bvh")
    np.testing.assert_allclose(np.linalg.norm(places[1] - places[0], axis=-1), 50.0)
    assert inspect(str(FILES / "positions_additive.bvh")).contents[0].up == "y"


def test_a_name_with_spaces_finds_its_joint_and_is_written_as_it_is(tmp_path: Path) -> None:
    source = str(FILES / "names_with_spaces.bvh")
    for name in ("Bip01 Neck", "bip01 neck", "Bip01_Neck"):
        (neck,) = read_trajectories(f"{source}:{name}").trajectories
        assert neck.name == "Bip01 Neck"
    (clip,), _ = read_clips([source])
    with (tmp_path / "again.bvh").open("w") as file:
        write_bvh(file, clip.rest_body, np.array([True, False]), clip.times, clip.poses)
    (again,), _ = read_clips([str(tmp_path / "again.bvh")])
    assert again.rest_body.joints == clip.rest_body.joints == ("Bip01 Pelvis", "Bip01 Neck")
    np.testing.assert_allclose(again.poses.positions, clip.poses.positions, atol=1e-5)
    np.testing.assert_allclose(again.poses.quaternions, clip.poses.quaternions, atol=1e-7)
