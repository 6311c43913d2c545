"""Packets carry a number, a time and a pose, and their bytes are counted from what was packed."""

from __future__ import annotations

import numpy as np
import pytest

from research.paper.streaming import PACKINGS, Packets, bandwidth, send
from rigid_motion.motion import Poses, interpolate
from rigid_motion.motion.quaternions import angle_between
from tests.scripts.research.paper.streaming.motions import swinging


@pytest.mark.parametrize(("rate", "bytes_a_second"), [(20.0, 1120.0), (30.0, 1680.0)])
@pytest.mark.parametrize("seconds", [1.0, 10.0])
@pytest.mark.parametrize("users", [1, 7])
def test_users_of_the_paper_need_the_papers_bytes(rate, bytes_a_second, seconds, users):
    packets = send(*swinging(seconds=seconds), rate)
    assert bandwidth(packets, users) == pytest.approx(users * bytes_a_second, rel=1e-12)


def test_twenty_poses_of_seven_doubles_are_1120_bytes():
    second = send(*swinging(seconds=1.0), 20.0)[1:]
    assert len(second) == 20
    assert second.pose_bytes == 1120
    assert second.header_bytes == 520
    assert second.data.nbytes == 1640


@pytest.mark.parametrize(("packing", "size"), [("double", 56), ("single", 28), ("smallest_three", 14)])
def test_headers_are_counted_apart(packing, size):
    packets = send(*swinging(), 20.0, PACKINGS[packing])
    assert bandwidth(packets) == pytest.approx(20.0 * size)
    assert bandwidth(packets, headers=True) == pytest.approx(20.0 * (size + 26))


def test_a_single_packet_has_no_bandwidth():
    with pytest.raises(ValueError, match="1 packets have no time between them"):
        bandwidth(send(*swinging(), 20.0)[:1])


@pytest.mark.parametrize("packing", PACKINGS.values(), ids=PACKINGS)
def test_what_is_read_is_what_was_written(packing):
    times, poses = swinging()
    packets = Packets.of(times, poses, 1.0 / 90.0, packing)
    assert np.array_equal(packets.sequences, np.arange(len(times)))
    assert np.array_equal(packets.stamps, times)
    distance, angle = packing.bounds(poses)
    assert np.all(np.linalg.norm(packets.poses.positions - poses.positions, axis=-1) <= distance)
    assert np.all(angle_between(packets.poses.quaternions, poses.quaternions) <= angle + 1e-7)


def test_some_of_the_packets_keep_their_numbers():
    packets = send(*swinging(), 20.0)[[5, 2, 2]]
    assert packets.sequences.tolist() == [5, 2, 2]
    assert packets.stamps.tolist() == pytest.approx([0.25, 0.1, 0.1])


def test_a_sender_takes_poses_at_its_ticks():
    times, poses = swinging()
    packets = send(times, poses, 7.5)
    assert packets.interval == pytest.approx(1.0 / 7.5)
    assert packets.stamps == pytest.approx(np.arange(23) / 7.5)
    expected = interpolate(times, poses, packets.stamps, "dq_sclerp")
    assert np.array_equal(packets.poses.positions, expected.positions)


@pytest.mark.parametrize("rate", [3.0, 20.0, 30.0])
def test_the_last_tick_may_be_the_last_sample(rate):
    times, poses = swinging(seconds=2.0)
    assert send(times, poses, rate).stamps[-1] == pytest.approx(2.0, abs=1e-12)
    # In floating-point numbers, 0.29 s of 100 packets a second are 28.999999999999996.
    assert len(send(np.linspace(0.0, 0.29, 30), poses[:30], 100.0)) == 30
    # A recording that counts from 1970 has its ticks as well.
    assert len(send(times + 1.7e9, poses, rate)) == round(2.0 * rate) + 1


def test_a_trajectory_of_one_sample_is_one_packet_and_of_none_no_packet():
    times, poses = swinging()
    assert len(send(times[:1], poses[:1], 20.0)) == 1
    assert len(send(times[:0], poses[:0], 20.0)) == 0


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf])
def test_a_rate_is_a_positive_number(rate):
    with pytest.raises(ValueError, match="not a positive number"):
        send(*swinging(), rate)


def test_numbers_that_are_not_finite_are_not_sent():
    times, poses = swinging()
    broken = poses.positions.copy()
    broken[3, 1] = np.nan
    with pytest.raises(ValueError, match="3 has a position that is not finite"):
        send(times, Poses(broken, poses.quaternions), 20.0)


@pytest.mark.parametrize("times", [[0.0, 0.0], [1.0, 0.0], [0.0, np.nan]])
def test_times_that_do_not_rise_are_not_sent(times):
    _, poses = swinging()
    with pytest.raises(ValueError, match="each later than the one before"):
        Packets.of(times, poses[:2], 0.05, PACKINGS["double"])


@pytest.mark.parametrize("interval", [0.0, -0.05, np.nan, np.inf])
def test_an_interval_is_a_positive_number(interval):
    times, poses = swinging()
    with pytest.raises(ValueError, match="not a positive number"):
        Packets.of(times, poses, interval, PACKINGS["double"])


def test_every_pose_needs_a_time():
    times, poses = swinging()
    with pytest.raises(ValueError, match=r"times of shape \(5,\) do not fit poses of shape \(6,\)"):
        Packets.of(times[:5], poses[:6], 0.05, PACKINGS["double"])
