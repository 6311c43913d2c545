"""Tests of whole bodies with few keys: which keys there are, and that their errors match independent computations."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_motion.motion import Poses, rms
from rigid_motion.motion.quaternions import normalise, rotate
from rigid_motion_batch.analysis import reconstructions
from rigid_motion_batch.analysis.choices import Budget, Choice, Tolerance, Uniform
from rigid_motion_batch.analysis.reconstructions import (
    Ground,
    MotionErrors,
    Reconstruction,
    errors_of,
    moving,
    reconstruct,
    still_point,
)
from rigid_motion_batch.recordings.clips import Clip
from tests.motion.bodies import body_errors
from tests.scripts.clips.bodies import JOINTS, PARENTS, still_body, swinging_body
from tests.scripts.clips.recordings import swinging_clip

MODES = ("lerp_slerp", "dq_sclerp", "motor_spline")

RADII = np.linspace(0.02, 0.12, len(JOINTS))

GLOVE = JOINTS.index("Glove")


def evenly(clip: Clip, rate: str = "5", modes: tuple[str, ...] = MODES) -> Reconstruction:
    return reconstruct(clip, Uniform(rate), modes, RADII)


def measured(made: Reconstruction, mode: str = "lerp_slerp") -> MotionErrors:
    return errors_of(made, mode, Ground.of(made))


def errors_by_matrices(made: Reconstruction, mode: str) -> np.ndarray:
    """Return the shell errors in metres, computed with matrices."""
    clip = made.clip
    metres = Poses(clip.poses.positions * clip.metres_per_unit, clip.poses.quaternions)
    keys = tuple(np.resize(own, max(len(own), 1)) for own in made.keys[mode])
    return body_errors(clip.times, metres, PARENTS, keys, mode, RADII)[:, made.samples]


def test_a_joint_that_stays_as_it_is_has_one_key_and_the_others_are_key_poses() -> None:
    made = evenly(swinging_body())
    assert made.shared
    for keys in made.keys.values():
        assert keys[GLOVE].tolist() == [0]
        assert {tuple(own) for joint, own in enumerate(keys) if joint != GLOVE} == {tuple(range(0, 61, 6))}
    assert np.flatnonzero(~moving(made.clip)).tolist() == [GLOVE]


@pytest.mark.parametrize("metres_per_unit", [0.001, 0.01, 1.0])
def test_how_little_a_joint_may_move_to_stay_does_not_depend_on_the_unit(metres_per_unit: float) -> None:
    clip = replace(still_body(), metres_per_unit=metres_per_unit)
    for micrometres, moves in ((0.9, False), (1.1, True)):
        clip.poses.positions[2, 5, 1] = clip.poses.positions[2, 4, 1] + 1e-6 * micrometres / metres_per_unit
        assert moving(clip).tolist() == [moves and joint == 2 for joint in range(len(JOINTS))]


@pytest.mark.parametrize("choice", [Uniform("5"), Budget("5"), Tolerance("1cm")], ids=str)
@pytest.mark.parametrize("shared", [False, True])
def test_a_body_of_which_nothing_moves_is_everywhere_as_it_was(choice: Choice, shared: bool) -> None:
    made = reconstruct(still_body(), choice, MODES, RADII, shared=shared)
    for mode in MODES:
        assert [len(own) for own in made.keys[mode]] == [1] * len(JOINTS)
        errors = measured(made, mode)
        assert errors.shell.shape == (len(JOINTS), len(made.times))
        assert errors.shell.max() == pytest.approx(0.0, abs=1e-12)
        assert errors.slide == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("shared", [False, True])
def test_keys_that_the_motion_chooses_keep_every_joint_within_the_tolerance(mode: str, shared: bool) -> None:
    made = reconstruct(swinging_body(), Tolerance("15mm"), (mode,), RADII, shared=shared)
    errors = measured(made, mode)
    assert errors.shell.max() <= 0.015 * (1.0 + 1e-9)
    np.testing.assert_allclose(errors.shell, errors_by_matrices(made, mode), atol=1e-9)
    moved = [tuple(own) for own in made.keys[mode] if len(own) > 1]
    assert (len(set(moved)) == 1) == shared
    assert all(own[0] == 0 and own[-1] == len(made.clip.times) - 1 for own in moved)


@pytest.mark.parametrize("block", [1, 7, 61])
def test_blocks_of_any_size_give_the_same_numbers(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    made = evenly(swinging_body())
    whole, ground = measured(made), Ground.of(made)
    monkeypatch.setattr(reconstructions, "BLOCK_SAMPLES", block)
    pieces, of_pieces = measured(made), Ground.of(made)
    for name in ("shell", "position", "rotation", "velocity", "slide"):
        np.testing.assert_allclose(getattr(pieces, name), getattr(whole, name), rtol=1e-9, atol=1e-15)
    assert pieces.worst == whole.worst
    assert np.array_equal(of_pieces.joints, ground.joints)
    assert np.array_equal(of_pieces.stands, ground.stands)
    assert rms(made.shell("lerp_slerp")) == pytest.approx(np.sqrt(np.mean(whole.shell**2)), rel=1e-12)


def test_a_foot_that_stands_is_seen_and_how_far_it_slides_is_the_farthest_from_where_it_began() -> None:
    clip = swinging_body()
    made = evenly(clip, "1.5")
    ground = Ground.of(made)
    foot = JOINTS.index("Foot")
    assert foot in ground.joints
    row = ground.joints.tolist().index(foot)
    stands = np.flatnonzero(ground.stands[row])
    assert stands[0] == 0
    assert 0.4 <= made.times[stands[-1]] - made.times[0] <= 0.7
    assert ground.slide < 0.01
    errors = measured(made)
    shown = made.shown("lerp_slerp", made.times).positions[foot, : stands[-1] + 1]
    assert errors.slide == pytest.approx(np.linalg.norm(shown - shown[0], axis=-1).max(), rel=1e-9)
    assert errors.slide > ground.slide


def test_the_point_that_stays_is_found_and_how_far_each_mode_moves_it() -> None:
    times, pivot = np.linspace(0.0, 2.0, 121), np.array((0.2, -0.1, 0.3))
    random = np.random.default_rng(2)
    # Arbitrary rotations about one point; then a hinge, on which every point stays.
    wild = normalise(np.array((1.0, 0.0, 0.0, 0.0)) + np.sin(np.outer(3.0 * times, random.normal(size=4))))
    half = 0.7 * np.sin(2.0 * times)
    hinge = np.stack((np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)), axis=1)
    for quaternions, nearest in ((wild, pivot), (hinge, pivot * (1.0, 1.0, 0.0))):
        poses = Poses(np.array((1.0, 2.0, 3.0)) - rotate(quaternions, pivot), quaternions)
        assert still_point(poses) == pytest.approx(nearest, abs=1e-9)
        clip = replace(swinging_clip(seconds=2.0, rate=60.0), times=times, poses=poses)
        made = reconstruct(clip, Uniform("5"), ("bezier", "lerp_slerp", "dq_sclerp"), 0.1)
        ground = Ground.of(made)
        off = {mode: errors_of(made, mode, ground).still_point for mode in made.keys}
        assert off["dq_sclerp"] < 1e-9
        assert min(off["bezier"], off["lerp_slerp"]) > 1e-3


@pytest.mark.parametrize("kind", ["flies", "rests", "jitters"])
def test_what_flies_or_rests_all_over_has_no_point_that_stays(kind: str) -> None:
    random, count = np.random.default_rng(0), 90
    rest = np.tile((1.0, 0.0, 0.0, 0.0), (count, 1))
    positions = {
        "flies": np.linspace((0.0, 0.0, 0.0), (3.0, 1.0, 0.0), count),
        "rests": np.zeros((count, 3)),
        "jitters": 1e-3 * random.normal(size=(count, 3)),
    }[kind]
    assert still_point(Poses(positions, rest)) is None
