"""Packing loses what it says it loses, and refuses what it cannot say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from research.paper.streaming import PACKINGS, smallest_three
from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import angle_between, normalise

ONE = np.array([[1.0, 0.0, 0.0, 0.0]])
HALF = np.sqrt(0.5)

every_packing = pytest.mark.parametrize("packing", PACKINGS.values(), ids=PACKINGS)


def assert_within_bounds(packing, poses: Poses) -> None:
    back = packing.unpack(packing.pack(poses))
    distance, angle = packing.bounds(poses)
    assert np.all(np.linalg.norm(back.positions - poses.positions, axis=-1) <= distance)
    assert np.all(angle_between(normalise(back.quaternions), normalise(poses.quaternions)) <= angle)


@every_packing
@given(
    positions=arrays(float, (5, 3), elements=st.floats(-8.0, 8.0)),
    quaternions=arrays(float, (5, 4), elements=st.floats(-1.0, 1.0)),
)
@example(positions=np.zeros((5, 3)), quaternions=np.full((5, 4), 0.5))
@example(positions=np.full((5, 3), 8.0), quaternions=np.full((5, 4), -0.5))
@example(positions=np.full((5, 3), -8.0), quaternions=np.tile((0.0, HALF, 0.0, -HALF), (5, 1)))
@example(positions=np.full((5, 3), 1e-300), quaternions=np.tile((-HALF, HALF, 1e-9, -1e-200), (5, 1)))
def test_nothing_is_off_by_more_than_stated(packing, positions, quaternions):
    lengths = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    assume(np.all(lengths > 1e-3))
    assert_within_bounds(packing, Poses(positions, quaternions / lengths))


@every_packing
def test_a_hundred_thousand_poses_are_within_the_bounds_and_some_come_near(packing):
    random = np.random.default_rng(1)
    poses = Poses(random.uniform(-8.0, 8.0, (100_000, 3)), normalise(random.normal(size=(100_000, 4))))
    assert_within_bounds(packing, poses)
    back = packing.unpack(packing.pack(poses))
    distance, angle = packing.bounds(poses)
    if distance.any():
        assert np.max(np.linalg.norm(back.positions - poses.positions, axis=-1) / distance) > 0.9
        assert np.max(angle_between(normalise(back.quaternions), poses.quaternions) / angle) > 0.5


def test_the_rotation_bound_of_the_smallest_three_is_nearly_reached_where_all_components_are_equal():
    random = np.random.default_rng(2)
    quaternions = normalise(0.5 + random.uniform(-1e-4, 1e-4, (100_000, 4)))
    poses = Poses(np.zeros((100_000, 3)), quaternions)
    assert_within_bounds(PACKINGS["smallest_three"], poses)
    back = PACKINGS["smallest_three"].unpack(PACKINGS["smallest_three"].pack(poses))
    assert angle_between(back.quaternions, quaternions).max() > 0.9 * PACKINGS["smallest_three"].bounds(poses)[1][0]


def test_components_of_equal_size_all_serve_as_the_largest():
    signs = np.stack(np.meshgrid(*[(-1.0, 0.0, 1.0)] * 4), axis=-1).reshape(-1, 4)
    signs = signs[signs.any(axis=1)]
    assert_within_bounds(PACKINGS["smallest_three"], Poses(np.zeros((80, 3)), normalise(signs)))


def test_a_quaternion_and_its_negative_are_the_same_bytes():
    random = np.random.default_rng(3)
    q = normalise(random.normal(size=(1000, 4)))
    pack = PACKINGS["smallest_three"].pack
    assert np.array_equal(pack(Poses(np.zeros((1000, 3)), q)), pack(Poses(np.zeros((1000, 3)), -q)))


def test_doubles_come_back_to_the_bit():
    random = np.random.default_rng(4)
    poses = Poses(random.normal(size=(1000, 3)) * 1e6, normalise(random.normal(size=(1000, 4))))
    back = PACKINGS["double"].unpack(PACKINGS["double"].pack(poses))
    assert np.array_equal(back.positions, poses.positions)
    assert np.array_equal(back.quaternions, poses.quaternions)


@every_packing
def test_the_middle_at_rest_comes_back_exact(packing):
    back = packing.unpack(packing.pack(Poses([[0.0, 0.0, 0.0]], ONE)))
    assert np.array_equal(back.positions, [[0.0, 0.0, 0.0]])
    assert np.array_equal(back.quaternions, ONE)


@pytest.mark.parametrize(("packing", "size"), [("double", 56), ("single", 28), ("smallest_three", 14)])
@pytest.mark.parametrize("count", [0, 1, 7])
def test_a_pose_has_so_many_bytes(packing, size, count):
    poses = Poses(np.zeros((count, 3)), np.tile(ONE, (count, 1)))
    data = PACKINGS[packing].pack(poses)
    assert PACKINGS[packing].size == size
    assert (data.dtype, data.shape) == (np.uint8, (count, size))
    assert len(PACKINGS[packing].unpack(data)) == count


def test_the_bytes_are_little_endian_and_in_the_stated_order():
    pose = Poses([[1.0, -2.0, 3.0]], ONE)
    assert PACKINGS["double"].pack(pose).tobytes() == np.array([1.0, -2.0, 3.0, 1, 0, 0, 0], dtype="<f8").tobytes()
    assert PACKINGS["single"].pack(pose).tobytes() == np.array([1.0, -2.0, 3.0, 1, 0, 0, 0], dtype="<f4").tobytes()
    middle = 2**20 - 1
    place = middle + (middle << 21) + (middle << 42)
    turn = 0 + (2**14 - 1) * ((1 << 2) + (1 << 17) + (1 << 32))
    expected = place.to_bytes(8, "little") + turn.to_bytes(6, "little")
    assert PACKINGS["smallest_three"].pack(Poses([[0.0, 0.0, 0.0]], ONE)).tobytes() == expected


def test_a_box_of_ones_own_is_resolved_in_proportion():
    poses = Poses(
        np.random.default_rng(5).uniform((10.0, 0.0, -1.0), (11.0, 500.0, 1.0), (1000, 3)), np.tile(ONE, (1000, 1))
    )
    packing = smallest_three((10.0, 0.0, -1.0), (11.0, 500.0, 1.0))
    assert_within_bounds(packing, poses)
    assert packing.bounds(poses)[0][0] == pytest.approx(250.0 / (2**21 - 2), rel=1e-3)


@every_packing
@pytest.mark.parametrize(
    ("position", "quaternion", "complaint"),
    [
        ((0.0, np.nan, 0.0), (1.0, 0.0, 0.0, 0.0), "pose 1 has a position that is not finite"),
        ((0.0, 0.0, np.inf), (1.0, 0.0, 0.0, 0.0), "pose 1 has a position that is not finite"),
        ((0.0, 0.0, 0.0), (np.nan, 0.0, 0.0, 0.0), "pose 1 has a quaternion that is not finite"),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), "pose 1 has a quaternion of length zero"),
    ],
)
def test_what_is_no_pose_is_refused(packing, position, quaternion, complaint):
    with pytest.raises(ValueError, match=complaint):
        packing.pack(Poses([(0.0, 0.0, 0.0), position], [(1.0, 0.0, 0.0, 0.0), quaternion]))


@every_packing
def test_scales_and_several_objects_are_refused(packing):
    with pytest.raises(ValueError, match="no room for scales"):
        packing.pack(Poses([[0.0, 0.0, 0.0]], ONE, [1.0]))
    with pytest.raises(ValueError, match="a stream is of one object"):
        packing.pack(Poses(np.zeros((2, 1, 3)), np.tile(ONE, (2, 1, 1))))


def test_positions_that_a_packing_has_no_numbers_for_are_refused():
    with pytest.raises(
        ValueError, match=r"pose 0 has a position outside the box .* give a larger box, or poses in metres"
    ):
        PACKINGS["smallest_three"].pack(Poses([[0.0, 8.001, 0.0]], ONE))
    with pytest.raises(ValueError, match="pose 0 has a number beyond single precision"):
        PACKINGS["single"].pack(Poses([[0.0, 1e39, 0.0]], ONE))


@pytest.mark.parametrize(
    ("low", "high"),
    [((0, 0, 0), (1, 0, 1)), ((0, 0, 0), (1, 1, np.inf)), ((0, 0, 0), (1, np.nan, 1)), ((0, 0), (1, 1))],
)
def test_a_box_needs_an_inside(low, high):
    with pytest.raises(ValueError, match="box"):
        smallest_three(low, high)
