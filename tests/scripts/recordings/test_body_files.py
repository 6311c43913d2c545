"""Tests of bodies found in practice: units, still roots, positions besides OFFSETs, damaged rest poses, spaces."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigid_motion_batch.recordings import ReadingOptions, Trajectory, read_clips, read_trajectories
from rigid_motion_batch.recordings.bvh_writing import write_bvh
from rigid_motion_batch.recordings.clip_reading import make_clip
from rigid_motion_batch.recordings.inspecting import inspect
from rigid_motion_batch.recordings.rest_bodies import (
    Skin,
    carrying,
    part_of_body,
    repaired,
    size_of,
    unit_above_floor,
)
from tests.scripts.clips.bodies import JOINTS, swinging_body

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
PARENTS = [-1, 0, 1, 1, 1, 0, 0]
STANDING = [[0, 0, 0], [5, 0, 0.9], [5, 0.1, 0], [5, -0.1, 0], [5, 0, 1.7], [8, 3, 0], [-2, 0, 2]]
NEAR = [*STANDING[:5], [6.5, 0, 0], [5.5, 0, 0.5]]
SITTING = [-1, 0, 1, 0, 0], [[0, 0, 0], [0, 0, 0.5], [0.3, 0, 0.6], [0.4, 0.1, 0], [0.4, -0.1, 0.0]]


@pytest.mark.parametrize(
    ("parents", "standing", "moving", "aside"),
    [
        (PARENTS, STANDING, [], []),
        (PARENTS, STANDING, [1, 2, 3, 4], [0, 5, 6]),
        (PARENTS, STANDING, [1, 2, 3, 4, 5, 6], [0]),
        (PARENTS, STANDING, [0, 1, 2, 3, 4, 5, 6], []),
        (PARENTS, STANDING, [2, 4], []),
        (PARENTS, NEAR, [1, 2, 3, 4], [0]),
        (*SITTING, [2], []),
    ],
    ids=["nothing", "one of several", "all", "the root too", "hips that stay", "near what stands", "arms of who sits"],
)
def test_a_root_that_stands_is_aside_with_what_stands_far_from_all_that_moves(
    parents: list[int], standing: list[list[float]], moving: list[int], aside: list[int]
) -> None:
    places = np.repeat(np.array(standing, dtype=float)[:, None], 100, axis=1)
    places[moving, :, 0] += np.linspace(0.0, 2.0, 100)
    assert np.flatnonzero(carrying(np.array(parents), places)).tolist() == aside
    assert np.flatnonzero(~part_of_body(np.array(parents), places)).tolist() == aside


def test_the_upper_half_of_a_body_is_not_in_inches_where_its_hips_would_be_higher_than_those_of_giants() -> None:
    body, _ = whole("upper_body_cm.bvh")
    assert body.metres_per_unit == 0.01
    assert "in inches, all of it would be more than 2.24 m up" in body.remark
    hand = f"{FILES / 'upper_body_cm.bvh'}:LeftHand"
    for options, metres, known in (
        (ReadingOptions(), 0.01, "guessed from the size of the body"),
        (ReadingOptions(scale=0.1), 0.1, "as --scale says"),
    ):
        unit = inspect(hand, options=options).contents[0].unit
        assert (unit.metres, unit.known_from) == (metres, known), "a joint is in the unit of its body"


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


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf, 1e38])
def test_a_joint_that_is_nowhere_at_rest_has_no_bone_and_is_told(number: float) -> None:
    clip = swinging_body()
    skin = Skin(np.eye(3), np.array([[0, 1, 2]]), np.zeros((3, 4), dtype=int), np.eye(4)[[0, 0, 0]])
    damaged = replace(clip.rest_body, skin=skin, ends=np.full(len(JOINTS), 0.1))
    damaged.tails[2, 1] = damaged.rest.positions[5, 0] = damaged.skin.vertices[1, 1] = number
    sound, done = repaired(damaged)
    nowhere = np.isin(np.arange(len(JOINTS)), (2, 5))
    np.testing.assert_array_equal(sound.ends, np.where(nowhere, 0.0, 0.1))
    np.testing.assert_array_equal(sound.tails, np.where(nowhere[:, None], 0.0, damaged.tails))
    np.testing.assert_array_equal(sound.rest.positions, np.where(nowhere[:, None], 0.0, damaged.rest.positions))
    assert sound.skin is None
    assert done == (
        "drew no bones for joints that are nowhere at rest (2: Head, Glove)",
        "left out a skin with numbers that are missing, not finite or too large",
    )
    made = make_clip(Trajectory("walk", clip.times, clip.poses, rest_body=damaged), "walk.fbx", "walk", "blender")
    assert made.repairs == done
    np.testing.assert_array_equal(made.rest_body.tails, sound.tails)


def test_the_size_of_a_body_is_that_from_where_it_branches() -> None:
    # A reference on the ground, the root of the body as its child, and an arm and a leg.
    parents = np.array([-1, 0, 1, 1, 3])
    places = np.array([[0, 0, 0], [0, 50, 0], [0, 51, 0], [0, 49.5, 0], [0, 49.2, 0.4]])
    assert size_of(parents, places) == pytest.approx(1.8)
    chain = np.array([-1, 0, 1])
    assert size_of(chain, np.array([[0, 0, 0], [3.0, 0, 0], [3, 4, 0]])) == pytest.approx(4.0)
    assert size_of(np.array([-1]), np.zeros((1, 3))) == 0.0
