"""Bodies for the paper: which joints are taken, and errors, keys and differences worked out again by other means."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from research.paper import bodies
from research.paper.bodies import ALONE, BODY, IN_PARENTS, KeysOfBody, Limb
from rigid_motion.motion import MODES as ALL_MODES
from rigid_motion.motion import Poses, interpolate
from rigid_motion_batch.analysis.bodies import moving
from rigid_motion_batch.analysis.metrics import NOTHING
from rigid_motion_batch.analysis.needed import evenly_spaced
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clips import Clip
from tests.motion.bodies import body_errors, in_root_space
from tests.scripts.bvh_bodies import write_body
from tests.scripts.clips.bodies import JOINTS, PARENTS, still_body, swinging_body

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


@pytest.mark.parametrize(
    ("joint", "limb"),
    [
        ("LeftHand", "hands"),
        ("mixamorig:RightHand", "hands"),
        ("Lefthand", "hands"),
        ("Bip01 L Hand", "hands"),
        ("hand.L", "hands"),
        ("hand_r", "hands"),
        ("RHand", "hands"),
        ("Foot_Right", "feet"),
        ("rig:LeftFoot", "feet"),
        ("Head", "heads"),
        ("bip01_head", "heads"),
    ],
)
def test_hands_feet_and_heads_are_told_by_their_names(joint: str, limb: str) -> None:
    found = bodies.limbs_of(named("Hips", joint))
    assert [(one.limb, one.joint, one.number) for one in found] == [(limb, joint, 1)]


@pytest.mark.parametrize(
    "joint",
    [
        "LeftHandIndex1",
        "HeadTop_End",
        "Bip01HeadNub",
        "LeftFootThumb1",
        "Hand",
        "LeftForeArm",
        "",
        "手",
        "|`\n",
        "L",
        "5",
    ],
)
def test_what_is_near_a_hand_is_none(joint: str) -> None:
    assert bodies.limbs_of(named("Hips", joint)) == []


def test_of_several_the_plainest_name_is_taken() -> None:
    found = bodies.limbs_of(named("Hips", "IK_LeftHand", "LeftHand", "Left_Hand"))
    assert [one.joint for one in found] == ["LeftHand"]


def test_a_limb_says_how_many_moving_joints_carry_it() -> None:
    chains = {limb.joint: limb.chain for limb in bodies.limbs_of(BODY_CLIP)}
    moves = dict(zip(NAMES, moving(BODY_CLIP), strict=True))
    assert not moves["Glove"]
    assert chains == {"LeftHand": 4, "RightFoot": 3, "Head": 3}


def test_a_limb_that_does_not_move_is_left_out() -> None:
    clip = replace(still_body(), figure=BODY_CLIP.figure)
    assert {limb.left_out for limb in bodies.limbs_of(clip)} == {"it does not move"}


# -- errors ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def limbs() -> list[Limb]:
    return bodies.limbs_of(BODY_CLIP)


def test_errors_of_the_body_are_those_of_matrices(limbs: list[Limb]) -> None:
    rows = {(row.mode, row.rate): row for row in bodies.errors_of(BODY_CLIP, limbs) if row.of == BODY}
    for mode in bodies.MODES:
        for rate in bodies.ERROR_RATES:
            keys = np.arange(0, 61, 30 // rate)
            errors = body_errors(BODY_CLIP.times, METRES, PARENTS, (keys,) * len(NAMES), mode, RADII)
            assert rows[mode, rate].rms_shell_m == pytest.approx(np.sqrt(np.mean(errors**2)), rel=1e-6)
            assert rows[mode, rate].keys == len(keys)


@pytest.mark.parametrize("mode", bodies.MODES)
def test_errors_of_a_limb_in_both_ways_are_those_of_matrices(limbs: list[Limb], mode: str) -> None:
    rows = {(row.joint, row.way, row.rate): row for row in bodies.errors_of(BODY_CLIP, limbs) if row.mode == mode}
    keys, times = np.arange(0, 61, 6), BODY_CLIP.times
    truth = places(METRES)
    through = places(interpolate(times[keys], METRES[:, keys], times, mode))
    single = BODY_CLIP.figure.skeleton.in_root_space(METRES)
    for limb in limbs:
        filled = interpolate(times[keys], single[limb.number][keys], times, mode)
        for way, shown in ((IN_PARENTS, through[limb.number]), (ALONE, filled.positions)):
            far = np.linalg.norm(shown - truth[limb.number], axis=-1)
            row = rows[limb.joint, way, 5]
            assert row.rms_position_m == pytest.approx(np.sqrt(np.mean(far**2)), rel=1e-6)
            assert row.rms_shell_m >= row.rms_position_m


def test_a_recording_with_too_few_samples_to_a_key_pose_has_no_errors_there() -> None:
    slow = swinging_body(rate=12.0, joints=NAMES)
    assert {row.rate for row in bodies.errors_of(slow, [])} == {5}
    assert {row.rate for row in bodies.apart_of(slow)} == {5}
    assert bodies.rates_of(slow) == ["5"]


def test_a_rate_counts_though_the_file_rounds_the_time_of_a_frame() -> None:
    rounded = replace(BODY_CLIP, times=np.arange(len(BODY_CLIP.times)) * 0.03334)
    assert bodies.rates_of(rounded) == ["15", "12", "8", "5"]


# -- a screw beside SLERP ----------------------------------------------------------------------------------------------


def test_where_joints_only_turn_a_screw_is_slerp_but_for_the_root() -> None:
    for row in bodies.apart_of(BODY_CLIP):
        assert row.parents_m < NOTHING
        assert row.carried_m < NOTHING
        assert row.turned_deg < 1e-5
        assert row.roots_m > 1e-4
        assert row.all_m >= row.roots_m - NOTHING


def test_the_difference_is_that_of_the_two_modes_by_matrices() -> None:
    poses = BODY_CLIP.poses.copy()
    hand = NAMES.index("LeftHand")
    poses.positions[hand] += 30.0 * np.sin(9.0 * BODY_CLIP.times)[:, None] * (1.0, 0.5, 0.0)
    clip = replace(BODY_CLIP, poses=poses)
    metres, times, keys = Poses(poses.positions * 0.01, poses.quaternions), clip.times, np.arange(0, 61, 3)
    straight, screw = (interpolate(times[keys], metres[:, keys], times, mode) for mode in ("lerp_slerp", "dq_sclerp"))
    row = next(row for row in bodies.apart_of(clip) if row.rate == 10)
    own = np.linalg.norm(straight.positions - screw.positions, axis=-1).max(axis=1)
    assert row.joint == "LeftHand"
    assert row.parents_m == pytest.approx(own[hand])
    assert row.roots_m == pytest.approx(own[0])
    apart = np.linalg.norm(places(straight) - places(screw), axis=-1)
    assert row.all_m == pytest.approx(apart.max())
    screw.positions[0] = straight.positions[0]
    carried = np.linalg.norm(places(straight) - places(screw), axis=-1)
    assert row.carried_m == pytest.approx(carried[1:].max())
    errors = np.linalg.norm(places(straight) - places(metres), axis=-1)
    assert row.error_m == pytest.approx(errors.max())


# -- keys needed -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def needed(limbs: list[Limb]) -> list[KeysOfBody]:
    return bodies.needed_of(BODY_CLIP, limbs[:1])


def test_keys_are_counted_of_the_body_and_its_limbs_where_there_are_two_samples_to_each(
    needed: list[KeysOfBody],
) -> None:
    assert {(row.of, row.joint) for row in needed} == {(BODY, ""), ("hands", "LeftHand")}
    assert {row.rate for row in needed} == {15, 12, 8, 5}
    assert {row.mode for row in needed} == set(bodies.MODES)


def test_the_reference_needs_what_it_has(needed: list[KeysOfBody]) -> None:
    own = [row for row in needed if (row.mode, row.decimation) == ("lerp_slerp", "uniform")]
    assert len(own) == 8
    assert {row.share for row in own} == {1.0}


def test_with_the_keys_of_the_body_a_mode_is_as_good_and_with_one_fewer_it_is_not(needed: list[KeysOfBody]) -> None:
    def error(keys: np.ndarray, mode: str) -> float:
        errors = body_errors(BODY_CLIP.times, METRES, PARENTS, (keys,) * len(NAMES), mode, RADII)
        return float(np.sqrt(np.mean(errors**2)))

    wanted = error(np.arange(0, 61, 6), "lerp_slerp")
    for row in needed:
        if (row.of, row.rate, row.decimation) == (BODY, 5, "uniform") and row.mode != "lerp_slerp":
            assert error(evenly_spaced(BODY_CLIP, int(row.keys) - 1), row.mode) <= wanted * (1.0 + 1e-9)
            assert error(evenly_spaced(BODY_CLIP, int(row.keys) - 2), row.mode) > wanted


def test_of_a_long_body_the_beginning_is_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bodies, "SEARCHED", 1.0)
    found = {row.rate: row.reference_keys for row in bodies.needed_of(BODY_CLIP, [])}
    assert found == {15: 16, 12: 13, 8: 9, 5: 6}


def test_means_are_geometric_and_leave_out_what_no_keys_reach() -> None:
    rows = [
        KeysOfBody(name, BODY, "", "pga_lerp", "uniform", 5, 10, keys)
        for name, keys in zip("abc", (5, 20, np.inf), strict=True)
    ]
    mean = bodies.mean_share(rows, BODY, "pga_lerp", "uniform", 5)
    assert (mean.share, mean.reached, mean.asked) == (pytest.approx(1.0), 2, 3)
    assert bodies.mean_share(rows[2:], BODY, "pga_lerp", "uniform", 5).share == np.inf
    assert bodies.mean_share(rows, "hands", "pga_lerp", "uniform", 5) is None


def test_every_mode_studied_is_one() -> None:
    assert set(bodies.MODES) <= set(ALL_MODES)


# -- files -------------------------------------------------------------------------------------------------------------


def test_a_folder_stands_for_the_bodies_in_it_and_each_file_comes_once(tmp_path: Path) -> None:
    for name in ("b.bvh", "a.FBX", "notes.txt", "hand.csv"):
        (tmp_path / name).touch()
    assert [path.name for path in bodies.body_files([tmp_path, tmp_path / "b.bvh"])] == ["a.FBX", "b.bvh"]


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match="no such file or folder"):
        bodies.body_files([tmp_path / "nowhere.bvh"])
    with pytest.raises(TrajectoryError, match="no recording in this folder that may hold a body"):
        bodies.body_files([tmp_path])


def test_a_rigid_body_is_no_whole_one_and_a_damaged_file_says_so_without_its_folder(tmp_path: Path) -> None:
    rows = [f"{i / 50},{i},0,0,0,0,0,1" for i in range(9)]
    (tmp_path / "hand.csv").write_text("\n".join(["t,x,y,z,qx,qy,qz,qw", *rows, ""]), encoding="utf-8")
    (tmp_path / "torn.bvh").write_text("HIERARCHY\n", encoding="utf-8")
    body, clip = bodies.read_body(str(tmp_path / "hand.csv"), "hand")
    assert (body.left_out, clip) == (bodies.NO_BODY, None)
    body, clip = bodies.read_body(str(tmp_path / "torn.bvh"), "torn")
    assert clip is None
    assert "torn.bvh" in body.left_out
    assert str(tmp_path) not in body.left_out


def test_a_first_sample_from_which_the_body_jumps_is_no_motion(tmp_path: Path) -> None:
    write_body(tmp_path / "walk.bvh")
    _, walk = bodies.read_body(str(tmp_path / "walk.bvh"), "walk")
    lines = (tmp_path / "walk.bvh").read_text(encoding="utf-8").splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    lines[first] = " ".join(["0 2 0", *["90"] * 9])
    (tmp_path / "t_pose.bvh").write_text("\n".join([*lines, ""]), encoding="utf-8")
    body, clip = bodies.read_body(str(tmp_path / "t_pose.bvh"), "t_pose")
    assert (body.skipped, body.samples) == (1, len(walk.times) - 1)
    np.testing.assert_allclose(clip.poses.positions, walk.poses.positions[:, 1:])
    np.testing.assert_array_equal(clip.times, walk.times[1:])
