"""Bodies for the paper: which joints are taken, and errors, keys and differences worked out again by other means."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from research.paper import bodies
from research.paper.bodies import ALONE, BODY, THROUGH, Limb
from research.studies import files_in
from rigid_motion.motion import Poses, interpolate, rms, shell_error
from rigid_motion_batch.analysis.bodies import moving
from rigid_motion_batch.recordings.clips import Clip
from tests.motion.bodies import body_errors, in_root_space
from tests.scripts.bvh_bodies import write_body
from tests.scripts.clips.bodies import JOINTS, PARENTS, swinging_body

NAMES = ("Hips", "Spine", "Head", "LeftArm", "LeftHand", "Glove", "RightLeg", "RightFoot")

BODY_CLIP = swinging_body("walk", seconds=2.0, rate=30.0, seed=3, joints=NAMES)

RADII = np.full(len(NAMES), 0.03)

METRES = Poses(BODY_CLIP.poses.positions * 0.01, BODY_CLIP.poses.quaternions)


def named(*joints: str) -> Clip:
    """The body with these names, and what they leave called by numbers."""
    return swinging_body(joints=(*joints, *map(str, range(len(JOINTS) - len(joints)))))


def places(poses: Poses) -> np.ndarray:
    """Where joints are (joints, n, 3), by matrices."""
    return in_root_space(poses, PARENTS)[..., :3, 3]


# -- names -------------------------------------------------------------------------------------------------------------


def test_hands_feet_and_heads_are_told_by_their_names() -> None:
    clip = named("Hips", "mixamorig:RightHand", "hand.L", "Foot_Right", "Head", "LeftHandIndex1", "LeftForeArm")
    assert [(limb.kind, limb.joint) for limb in bodies.limbs_of(clip)] == [
        ("hands", 2),
        ("hands", 1),
        ("feet", 3),
        ("heads", 4),
    ]


def test_a_limb_says_how_many_moving_joints_carry_it() -> None:
    chains = {NAMES[limb.joint]: limb.chain for limb in bodies.limbs_of(BODY_CLIP)}
    moves = dict(zip(NAMES, moving(BODY_CLIP), strict=True))
    assert not moves["Glove"]
    assert chains == {"LeftHand": 4, "RightFoot": 3, "Head": 3}


# -- errors ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def limbs() -> list[Limb]:
    return bodies.limbs_of(BODY_CLIP)


def test_errors_of_the_body_are_those_of_matrices(limbs: list[Limb]) -> None:
    rows = {(mode, rate): error for of, _, mode, rate, error, _ in bodies.errors_of(BODY_CLIP, limbs) if of == BODY}
    for mode in bodies.MODES:
        for rate in bodies.ERROR_RATES:
            keys = np.arange(0, 61, 30 // rate)
            errors = body_errors(BODY_CLIP.times, METRES, PARENTS, (keys,) * len(NAMES), mode, RADII)
            assert rows[mode, rate] == pytest.approx(np.sqrt(np.mean(errors**2)), rel=1e-6)


@pytest.mark.parametrize("mode", bodies.MODES)
def test_errors_of_a_limb_in_both_ways_are_those_of_matrices(limbs: list[Limb], mode: str) -> None:
    # One of each kind here.
    rows = {row[:2]: row[4] for row in bodies.errors_of(BODY_CLIP, limbs) if row[2:4] == (mode, 5)}
    keys, times = np.arange(0, 61, 6), BODY_CLIP.times
    truth = BODY_CLIP.rest_body.skeleton.in_root_space(METRES)
    through = BODY_CLIP.rest_body.skeleton.in_root_space(interpolate(times[keys], METRES[:, keys], times, mode))
    for limb in limbs:
        filled = interpolate(times[keys], truth[limb.joint][keys], times, mode)
        for way, shown in ((THROUGH, through[limb.joint]), (ALONE, filled)):
            error = rms(shell_error(shown, truth[limb.joint], 0.1))
            assert rows[limb.kind, way] == pytest.approx(error, rel=1e-6)


# -- a screw beside SLERP ----------------------------------------------------------------------------------------------


def test_the_difference_is_that_of_the_two_modes_by_matrices() -> None:
    poses = BODY_CLIP.poses.copy()
    hand = NAMES.index("LeftHand")
    poses.positions[hand] += 30.0 * np.sin(9.0 * BODY_CLIP.times)[:, None] * (1.0, 0.5, 0.0)
    clip = replace(BODY_CLIP, poses=poses)
    metres, times, keys = Poses(poses.positions * 0.01, poses.quaternions), clip.times, np.arange(0, 61, 3)
    straight, screw = (interpolate(times[keys], metres[:, keys], times, mode) for mode in ("lerp_slerp", "dq_sclerp"))
    result = bodies.apart_of(clip)[10]
    own = np.linalg.norm(straight.positions - screw.positions, axis=-1).max(axis=1)
    assert result["parents"] == pytest.approx(own[hand])
    assert result["roots"] == pytest.approx(own[0])
    apart = np.linalg.norm(places(straight) - places(screw), axis=-1)
    assert result["all"] == pytest.approx(apart.max())
    screw.positions[0] = straight.positions[0]
    carried = np.linalg.norm(places(straight) - places(screw), axis=-1)
    assert result["carried"] == pytest.approx(carried[1:].max())
    errors = np.linalg.norm(places(straight) - places(metres), axis=-1)
    assert result["error"] == pytest.approx(errors.max())


# -- keys needed -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_figures_say_everything_of_each_body() -> None:
    short = swinging_body("short", seconds=1.0, rate=30.0, seed=4, joints=NAMES)
    result = bodies.measure([(BODY_CLIP, 0), (short, 1)])
    assert result["bodies"]["short"]["skipped"] == 1
    assert result["bodies"]["walk"]["limbs"] == ["LeftHand", "RightFoot", "Head"]
    assert tuple(result["needed"]) == bodies.KINDS
    assert result["chains"]["hands"] == [4, 4]
    assert result["errors"][BODY][THROUGH]["pga_lerp"][5]["velocity"] > 0.0
    errors = [result["by_body"][name]["lerp_slerp"][10] for name in ("walk", "short")]
    mean = result["errors"][BODY][THROUGH]["lerp_slerp"][10]["shell"]
    assert mean == pytest.approx(np.sqrt(np.prod(errors)))


# -- files -------------------------------------------------------------------------------------------------------------


def test_a_folder_stands_for_the_bodies_in_it_and_each_file_comes_once(tmp_path: Path) -> None:
    for name in ("b.bvh", "a.FBX", "notes.txt", "hand.csv"):
        (tmp_path / name).touch()
    files = files_in([tmp_path, tmp_path / "b.bvh"], bodies.EXTENSIONS)
    assert [path.name for path in files] == ["a.FBX", "b.bvh"]


def test_a_first_sample_from_which_the_body_jumps_is_no_motion(tmp_path: Path) -> None:
    write_body(tmp_path / "walk.bvh")
    walk, skipped = bodies.read_body(tmp_path / "walk.bvh")
    assert skipped == 0
    lines = (tmp_path / "walk.bvh").read_text(encoding="utf-8").splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    lines[first] = " ".join(["0 2 0", *["90"] * 9])
    (tmp_path / "t_pose.bvh").write_text("\n".join([*lines, ""]), encoding="utf-8")
    clip, skipped = bodies.read_body(tmp_path / "t_pose.bvh")
    assert (skipped, len(clip.times)) == (1, len(walk.times) - 1)
    np.testing.assert_allclose(clip.poses.positions, walk.poses.positions[:, 1:])
    np.testing.assert_array_equal(clip.times, walk.times[1:])
