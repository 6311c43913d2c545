"""Keys with twists: what is between them, what they are fitted to, and that packets carry them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation

from research.paper.streaming import PACKINGS, TWISTS, Packets, receive
from research.paper.streaming.smooth import between, fitted, moved
from rigid_motion.motion import Poses, interpolate
from rigid_motion.motion.quaternions import angle_between
from tests.scripts.research.paper.streaming.motions import swinging


def matrices(poses: Poses) -> np.ndarray:
    made = np.tile(np.eye(4), (len(poses), 1, 1))
    made[:, :3, :3] = Rotation.from_quat(np.roll(poses.quaternions, -1, axis=-1)).as_matrix()
    made[:, :3, 3] = poses.positions
    return made


def hat(twist: np.ndarray) -> np.ndarray:
    x, y, z = twist[:3]
    return np.array([[0, -z, y, twist[3]], [z, 0, -x, twist[4]], [-y, x, 0, twist[5]], [0, 0, 0, 0]])


def vee(matrix: np.ndarray) -> np.ndarray:
    return np.array([matrix[2, 1], matrix[0, 2], matrix[1, 0], *matrix[:3, 3]])


def test_between_keys_it_is_the_bent_screw_by_exponentials_of_matrices():
    random, (_, poses) = np.random.default_rng(0), swinging(2)
    first, second = poses[[0, 10, 20]], poses[[9, 22, 31]]
    leaving, arriving, durations = *random.normal(size=(2, 3, 6)), np.array([0.1, 0.2, 0.05])
    for u in (0.0, 0.2, 0.5, 0.9, 1.0):
        found = matrices(between(first, second, leaving, arriving, durations, np.full(3, u)))
        for row, (m, n) in enumerate(zip(matrices(first), matrices(second), strict=True)):
            way = vee(np.real(logm(np.linalg.inv(m) @ n)))
            bend = u * (1 - u) ** 2 * (durations[row] * leaving[row] - way)
            bend -= u**2 * (1 - u) * (durations[row] * arriving[row] - way)
            assert found[row] == pytest.approx(m @ expm(hat(u * way)) @ expm(hat(bend)), abs=1e-12)


def test_the_body_has_the_keys_poses_and_twists_at_the_keys():
    random, (_, poses) = np.random.default_rng(1), swinging(3)
    first, second, duration, step = poses[[0]], poses[[9]], np.array([0.1]), 1e-6
    leaving, arriving = random.normal(size=(2, 1, 6))

    def at(u: float) -> np.ndarray:
        return matrices(between(first, second, leaving, arriving, duration, np.array([u])))[0]

    assert at(0.0) == pytest.approx(matrices(first)[0], abs=1e-12)
    assert at(1.0) == pytest.approx(matrices(second)[0], abs=1e-12)
    assert vee(np.linalg.inv(at(0.0)) @ (at(step) - at(-step)) / (2e-7)) == pytest.approx(leaving[0], abs=1e-4)
    assert vee(np.linalg.inv(at(1.0)) @ (at(1.0 + step) - at(1.0 - step)) / (2e-7)) == pytest.approx(
        arriving[0], abs=1e-4
    )


@pytest.mark.parametrize("last", [12, 40])
def test_of_an_even_motion_pose_and_twist_are_found_again(last):
    times = np.sort(np.random.default_rng(5).uniform(0.0, 1.0, 41))
    twist = np.array([1.0, -2.0, 0.5, 0.3, 0.1, -0.4])
    start = swinging(1)[1][:1]
    poses = moved(
        Poses(np.repeat(start.positions, 41, axis=0), np.repeat(start.quaternions, 41, axis=0)), twist[:, None] * times
    )
    at = np.array([0, 5, 12])
    found, twists = fitted(times, poses, at, last, 0.1)
    assert np.abs(found.positions - poses.positions[at]).max() < 1e-9
    assert angle_between(found.quaternions, poses.quaternions[at]).max() < 1e-7
    assert twists == pytest.approx(np.tile(twist, (3, 1)), abs=1e-6)


def test_a_fit_knows_nothing_of_samples_after_the_last():
    times, poses = swinging(2)
    other = Poses(poses.positions + (np.arange(len(times)) > 20)[:, None], poses.quaternions)
    for some, others in zip(
        fitted(times, poses, np.arange(10, 21), 20, 0.05),
        fitted(times, other, np.arange(10, 21), 20, 0.05),
        strict=True,
    ):
        some, others = (part.positions if isinstance(part, Poses) else part for part in (some, others))
        assert np.array_equal(some, others)


def test_one_sample_is_at_rest_and_two_have_the_twist_from_one_to_the_other():
    times, poses = swinging(2)
    found, twists = fitted(times, poses, np.array([0]), 0, 0.05)
    assert np.array_equal(found.positions, poses.positions[:1])
    assert not twists.any()
    _, twists = fitted(times, poses, np.array([1]), 1, 0.05)
    back = moved(poses[[1]], -twists.T * (times[1] - times[0]))
    assert np.abs(back.positions - poses.positions[:1]).max() < 1e-12


@pytest.mark.parametrize(
    ("packing", "size", "within"), [("double", 104, 0.0), ("single", 52, 1e-6), ("smallest_three", 26, 2e-3)]
)
def test_packets_carry_twists(packing, size, within):
    times, poses = swinging(1)
    twists = np.random.default_rng(2).normal(size=(len(times), 6))
    packets = Packets.of(times, poses, 0.1, PACKINGS[packing], twists=twists, ages=0.25)
    assert packets.pose_bytes == size * len(times)
    assert packets.are_whole.all()
    assert packets.sent == pytest.approx(times + 0.25)
    assert np.abs(packets.twists - twists).max() <= within * np.abs(twists).max()
    with pytest.raises(ValueError, match="twist 3 has a number beyond"):
        Packets.of(
            times, poses, 0.1, PACKINGS[packing], twists=np.where(np.arange(len(times))[:, None] == 3, np.inf, twists)
        )


def test_keys_with_twists_are_shown_by_them_and_others_are_not():
    times, poses = swinging(1)
    packets = Packets.of(times[::9], poses[::9], 0.1, PACKINGS["double"], twists=np.zeros((len(times[::9]), 6)))
    playback = receive(packets, packets.stamps, times + 0.1, TWISTS)
    at_keys = np.isclose(playback.moments[:, None], packets.stamps, atol=1e-9).any(axis=1)
    expected = interpolate(packets.stamps, packets.poses, playback.moments, "dq_sclerp")
    assert np.abs(playback.poses.positions - expected.positions)[at_keys].max() < 1e-9
    with pytest.raises(ValueError, match="these packets have twists, for which dq_sclerp is not meant"):
        receive(packets, packets.stamps, times, "dq_sclerp")
    plain = Packets.of(times, poses, 0.1, PACKINGS["double"])
    with pytest.raises(ValueError, match="these packets have no twists"):
        receive(plain, times, times, TWISTS)


@pytest.mark.parametrize("bit", range(0, 8 * 82, 5))
def test_a_flipped_bit_is_seen(bit):
    packets = Packets.of(*(part[:3] for part in swinging(1)), 0.1, PACKINGS["double"])
    data = packets.data.copy()
    data[1, bit // 8] ^= 1 << bit % 8
    assert Packets(data, packets.packing, 0.1).are_whole.tolist() == [True, False, True]
