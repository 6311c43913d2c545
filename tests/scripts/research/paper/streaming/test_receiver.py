"""A receiver shows what a mode makes of the packets that are there, and says what it did about the others."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from research.paper.streaming import PACKINGS, Link, Packets, Playback, PlayOut, What, receive, send
from research.paper.streaming.packets import HEADER, sealed
from rigid_motion.motion import MODES, Poses, interpolate, rms, shell_error
from rigid_motion.motion.quaternions import angle_between
from rigid_motion_batch.recordings.clips import Clip
from tests.scripts.research.paper.streaming.motions import FRAME, SOURCES, clips, swinging
from tests.thoroughness import sample, tried

RATE = 20.0
INTERVAL = 1.0 / RATE
DISPLAY = np.arange(0.0, 3.0, FRAME)

BAD = Link(latency=0.05, jitter=0.1, loss=0.2)

every_mode = pytest.mark.parametrize("mode", MODES)


def stream(seed: int = 0, rate: float = RATE, **way: float) -> tuple[Packets, np.ndarray]:
    """The packets of a motion, and when they arrive."""
    packets = send(*swinging(seed), rate)
    return packets, Link(**way).carry(packets, np.random.default_rng(seed))


def assert_same(poses: Poses, others: Poses, tolerance: float = 1e-12) -> None:
    assert poses.shape == others.shape
    assert np.abs(poses.positions - others.positions).max(initial=0.0) <= tolerance
    assert angle_between(poses.quaternions, others.quaternions).max(initial=0.0) <= tolerance


def happened(playback: Playback) -> dict[str, int]:
    return {what.value: count for what, count in playback.counts.items() if count}


def without(packets: Packets, arrivals: np.ndarray, *lost: int) -> tuple[Packets, np.ndarray]:
    """The same stream, some of it lost."""
    return packets, np.where(np.isin(packets.sequences, lost), np.inf, arrivals)


# Where nothing goes wrong


@every_mode
@pytest.mark.parametrize("packing", PACKINGS)
@pytest.mark.parametrize("rate", [5.0, 20.0, 30.0])
def test_without_loss_and_jitter_the_frames_are_those_of_interpolate(mode, packing, rate):
    packets = send(*swinging(), rate, PACKINGS[packing])
    playback = receive(packets, packets.stamps + 0.04, DISPLAY, mode)
    assert playback.delay == pytest.approx(0.04 + (1 + MODES[mode].ahead) / rate)
    assert playback.moments == pytest.approx(DISPLAY[-len(playback.times) :] - playback.delay)
    assert_same(playback.poses, interpolate(packets.stamps, packets.poses, playback.moments, mode))
    assert happened(playback) == {}
    assert not playback.ran_out.any()


@every_mode
@pytest.mark.parametrize("start", [-1e5, 1.7e9])
def test_times_may_count_from_anywhere(mode, start):
    times, poses = swinging()
    packets = send(times + start, poses, RATE)
    playback = receive(packets, packets.stamps + 0.04, DISPLAY + start, mode)
    assert_same(playback.poses, interpolate(packets.stamps, packets.poses, playback.moments, mode), 1e-5)
    assert happened(playback) == {}


@every_mode
def test_a_longer_wait_makes_up_for_jitter(mode):
    packets, arrivals = stream(latency=0.03, jitter=0.02)
    playback = receive(packets, arrivals, DISPLAY, mode, PlayOut(wait=8.0))
    assert_same(playback.poses, interpolate(packets.stamps, packets.poses, playback.moments, mode))
    assert set(happened(playback)) <= {"reordered"}


@every_mode
def test_keys_half_a_turn_apart_go_the_way_that_interpolate_goes(mode):
    angles = np.pi * np.arange(12.0) / 2.0
    zeros = np.zeros_like(angles)
    keys = Poses(np.zeros((12, 3)), np.stack((np.cos(angles), zeros, zeros, np.sin(angles)), axis=-1))
    packets = Packets.of(np.arange(12.0) * INTERVAL, keys, INTERVAL, PACKINGS["double"])
    playback = receive(packets, packets.stamps, np.arange(0.0, 0.55, FRAME), mode)
    assert_same(playback.poses, interpolate(packets.stamps, keys, playback.moments, mode))


def test_the_clocks_of_sender_and_receiver_may_differ():
    packets, arrivals = stream(latency=0.05, jitter=0.05, loss=0.1)
    playback = receive(packets, arrivals, DISPLAY)
    ahead = receive(packets, arrivals + 1000.0, DISPLAY + 1000.0)
    assert_same(ahead.poses, playback.poses, 1e-9)
    assert ahead.delay == pytest.approx(playback.delay + 1000.0)


def test_a_latency_that_is_known_need_not_be_guessed_from_the_first_packet():
    packets, arrivals = stream(latency=0.05)
    arrivals[0] += 0.2
    assert receive(packets, arrivals, DISPLAY).delay == pytest.approx(0.05 + INTERVAL)
    assert receive(packets[:1], arrivals[:1], DISPLAY).delay == pytest.approx(0.25 + INTERVAL)
    assert receive(packets, arrivals, DISPLAY, play_out=PlayOut(latency=0.1)).delay == pytest.approx(0.1 + INTERVAL)


# What every stream has in common


@every_mode
def test_the_same_seed_shows_the_same_frames(mode):
    first, second = (receive(*stream(5, latency=0.05, jitter=0.1, loss=0.2), DISPLAY, mode) for _ in range(2))
    assert np.array_equal(first.poses.positions, second.poses.positions)
    assert np.array_equal(first.poses.quaternions, second.poses.quaternions)
    assert first.events == second.events


@every_mode
@pytest.mark.parametrize("wait", [None, 3.0])
def test_no_frame_knows_what_is_yet_to_come(mode, wait):
    packets, arrivals = stream(7, latency=0.05, jitter=0.1, loss=0.2)
    whole = receive(packets, arrivals, DISPLAY, mode, PlayOut(wait=wait))
    for count in sample(range(10, len(DISPLAY), 2)):
        come = arrivals <= DISPLAY[count - 1]
        begun = receive(packets[come], arrivals[come], DISPLAY[:count], mode, PlayOut(wait=wait))
        assert_same(begun.poses, whole.poses[: len(begun.times)])


@settings(max_examples=tried(40))
@given(mode=st.sampled_from(list(MODES)), seed=st.integers(0, 1000))
def test_the_order_in_which_packets_are_listed_does_not_matter(mode, seed):
    packets, arrivals = stream(seed, latency=0.05, jitter=0.1, loss=0.2)
    shuffled = np.random.default_rng(seed).permutation(len(packets))
    listed, other = (
        receive(packets, arrivals, DISPLAY, mode),
        receive(packets[shuffled], arrivals[shuffled], DISPLAY, mode),
    )
    assert_same(other.poses, listed.poses, 0.0)
    assert other.events == listed.events


@settings(max_examples=tried(40))
@given(mode=st.sampled_from(list(MODES)), seed=st.integers(0, 1000))
def test_duplicates_are_dropped_and_said(mode, seed):
    packets, arrivals = stream(seed, latency=0.05, jitter=0.1)
    again = np.arange(len(packets)).repeat(2)
    later = arrivals[again] + np.where(np.arange(len(again)) % 2, np.random.default_rng(seed).random(len(again)), 0.0)
    once, twice = receive(packets, arrivals, DISPLAY, mode), receive(packets[again], later, DISPLAY, mode)
    assert_same(twice.poses, once.poses, 0.0)
    # The second of a packet that came too late comes too late as well.
    dropped = twice.counts[What.DUPLICATE] + twice.counts[What.TOO_LATE] - once.counts[What.TOO_LATE]
    assert dropped == np.count_nonzero(later[1::2] <= DISPLAY[-1])
    assert once.counts[What.DUPLICATE] == 0


@every_mode
def test_signs_of_quaternions_go_on_from_frame_to_frame(mode):
    packets = send(*swinging(3), RATE, PACKINGS["smallest_three"])
    assert np.any(np.einsum("ki,ki->k", packets.poses.quaternions[1:], packets.poses.quaternions[:-1]) < 0.0)
    q = receive(packets, BAD.carry(packets, np.random.default_rng(3)), DISPLAY, mode).poses.quaternions
    assert np.all(np.einsum("ki,ki->k", q[1:], q[:-1]) > 0.0)


@every_mode
def test_a_body_at_rest_stays_there_and_has_nothing_to_catch_up_with(mode):
    times, poses = swinging()
    packets = send(times, poses[[7] * len(times)], RATE)
    playback = receive(packets, BAD.carry(packets, np.random.default_rng(3)), DISPLAY, mode)
    assert_same(playback.poses, poses[[7] * len(playback.times)])
    assert playback.counts[What.LATE] > 0
    assert playback.counts[What.CAUGHT_UP] == 0


def test_events_come_in_the_order_of_time_and_none_after_the_last_frame():
    events = receive(*stream(2, latency=0.05, jitter=0.1, loss=0.2), DISPLAY).events
    times = [event.time for event in events]
    assert times == sorted(times)
    assert times[-1] <= DISPLAY[-1]
    assert {What.LATE, What.TOO_LATE, What.LOST, What.REORDERED, What.RAN_OUT, What.CAUGHT_UP} <= {
        event.what for event in events
    }


def test_every_packet_that_never_came_is_counted():
    packets, arrivals = stream(2, latency=0.05, jitter=0.1, loss=0.2)
    playback = receive(packets, arrivals, np.arange(0.0, 10.0, FRAME))
    # The first and the last one that arrive bound what a receiver can know of.
    came = np.flatnonzero(np.isfinite(arrivals))
    assert playback.counts[What.LOST] == np.count_nonzero(np.isinf(arrivals[came[0] : came[-1]]))


# One thing at a time


def test_over_a_lost_packet_the_motion_goes_on_and_from_the_next_key_on_is_the_old_one():
    packets, arrivals = stream()
    playback = receive(*without(packets, arrivals, 20), DISPLAY, play_out=PlayOut(wait=2.0))
    kept = np.delete(np.arange(len(packets)), 20)
    assert_same(playback.poses, interpolate(packets.stamps[kept], packets.poses[kept], playback.moments))
    assert happened(playback) == {"lost": 1}
    (lost,) = playback.events
    assert (lost.sequence, lost.amount) == (20, 1.0)
    assert lost.time == pytest.approx(packets.stamps[21] + playback.delay)


def test_where_the_next_is_not_there_either_the_motion_goes_on_slower_and_slower():
    packets, arrivals = stream()
    playback = receive(packets, np.where(packets.sequences > 20, np.inf, arrivals), DISPLAY)
    after = playback.moments > packets.stamps[20]
    assert np.array_equal(playback.ran_out, playback.moments > packets.stamps[20] + 1e-6)
    going = np.linalg.norm(np.diff(playback.poses.positions[after], axis=0), axis=1)
    assert np.all(np.diff(going) < 0.0)
    # The speed of the last segment, and less by a factor e in 0.3 s.
    speed = np.linalg.norm(np.diff(packets.poses.positions[19:21], axis=0)) / INTERVAL
    assert going[0] / FRAME == pytest.approx(speed, rel=0.15)
    assert going[9] / going[0] == pytest.approx(np.exp(-9 * FRAME / 0.3), rel=1e-2)
    (ran_out,) = playback.events
    assert (ran_out.what, ran_out.sequence) == (What.RAN_OUT, 20)
    assert ran_out.amount == pytest.approx(DISPLAY[-1] - ran_out.time)


def test_a_motion_may_be_stopped_dead_instead():
    packets, arrivals = stream()
    cut = np.where(packets.sequences > 20, np.inf, arrivals)
    playback = receive(packets, cut, DISPLAY, play_out=PlayOut(carry=0.0))
    assert_same(playback.poses, interpolate(packets.stamps[:21], packets.poses[:21], playback.moments))


def test_when_packets_come_back_the_picture_catches_up_within_the_fade():
    packets, arrivals = stream()
    playback = receive(*without(packets, arrivals, 20, 21, 22), DISPLAY)
    kept = np.delete(np.arange(len(packets)), [20, 21, 22])
    on_path = interpolate(packets.stamps[kept], packets.poses[kept], playback.moments)
    apart = np.linalg.norm(playback.poses.positions - on_path.positions, axis=1)
    # The play-out was three intervals from key 19 when key 23 came: three times as long a fade.
    back = packets.stamps[22] + playback.delay
    assert apart[playback.times < packets.stamps[19] + playback.delay].max() < 1e-12
    assert apart[np.abs(playback.times - back).argmin()] > 1e-3
    assert apart[playback.times > back + 9.0 * INTERVAL + FRAME].max() < 1e-12
    assert happened(playback) == {"lost": 3, "ran out": 1, "caught up": 1}


@every_mode
def test_a_late_packet_serves_from_there(mode):
    packets, arrivals = stream()
    ahead = MODES[mode].ahead
    arrivals[20] += 0.5 * INTERVAL
    playback = receive(packets, arrivals, DISPLAY, mode)
    (late,) = [event for event in playback.events if event.what is What.LATE]
    assert (late.sequence, late.time) == (20, arrivals[20])
    assert late.amount == pytest.approx(0.5 * INTERVAL)
    assert happened(playback).get("ran out", 0) == (0 if ahead else 1)
    assert playback.counts[What.CAUGHT_UP] == 1
    settled = playback.times > arrivals[20] + 4.0 * INTERVAL
    expected = interpolate(packets.stamps, packets.poses, playback.moments, mode)
    assert_same(playback.poses[settled], expected[settled])


@pytest.mark.parametrize(("intervals", "what"), [(2.9, What.LATE), (3.1, What.TOO_LATE)])
def test_a_late_packet_is_of_use_until_the_next_has_been_shown(intervals, what):
    packets, arrivals = stream()
    arrivals[20] += intervals * INTERVAL
    playback = receive(packets, arrivals, DISPLAY, play_out=PlayOut(wait=2.0))
    events = {event.what: event for event in playback.events}
    assert events[what].sequence == 20
    assert events[what].amount == pytest.approx((intervals - 1.0) * INTERVAL)
    assert events[What.REORDERED].amount == int(intervals)
    assert (What.CAUGHT_UP in events) == (what is What.LATE)


def test_a_packet_that_is_overtaken_but_in_time_makes_no_difference():
    packets, arrivals = stream()
    arrivals[20] += 1.5 * INTERVAL
    playback = receive(packets, arrivals, DISPLAY, play_out=PlayOut(wait=4.0))
    assert_same(playback.poses, interpolate(packets.stamps, packets.poses, playback.moments))
    (reordered,) = playback.events
    assert (reordered.what, reordered.sequence, reordered.amount) == (What.REORDERED, 20, 1.0)


def test_a_packet_is_dropped_when_a_later_one_has_been_shown():
    packets, arrivals = stream()
    arrivals[20] += 3.5 * INTERVAL
    playback = receive(packets, arrivals, DISPLAY)
    assert_same(playback.poses, receive(*without(packets, arrivals, 20), DISPLAY).poses, 0.0)
    (late,) = [event for event in playback.events if event.what is What.TOO_LATE]
    assert late.amount == pytest.approx(3.5 * INTERVAL)
    assert playback.counts[What.LOST] == 0


# Hardly anything, or nothing


@every_mode
def test_a_single_packet_is_shown_at_rest(mode):
    packets, arrivals = stream()
    playback = receive(packets[3:4], arrivals[3:4], DISPLAY, mode)
    assert playback.times[0] >= arrivals[3] > playback.times[0] - FRAME
    assert_same(playback.poses, packets.poses[[3] * len(playback.times)])


@every_mode
def test_before_the_play_out_begins_the_first_pose_that_arrived_is_shown(mode):
    packets, arrivals = stream()
    playback = receive(packets, arrivals, DISPLAY, mode)
    early = playback.moments < packets.stamps[0]
    assert early.any()
    assert_same(playback.poses[early], packets.poses[[0] * np.count_nonzero(early)])


@every_mode
@pytest.mark.parametrize("count", [0, 5])
def test_where_nothing_arrives_nothing_is_shown(mode, count):
    packets, _ = stream()
    playback = receive(packets[:count], np.full(count, np.inf), DISPLAY, mode)
    assert len(playback.times) == len(playback.poses) == len(playback.ran_out) == 0
    assert playback.delay == np.inf
    assert playback.events == ()


@every_mode
def test_without_frames_there_is_nothing_to_show(mode):
    packets, arrivals = stream()
    assert len(receive(packets, arrivals, [], mode).times) == 0
    assert len(receive(packets, arrivals + 100.0, DISPLAY, mode).times) == 0


@every_mode
def test_all_at_once_is_no_division_by_zero(mode):
    packets, _ = stream()
    playback = receive(packets, np.zeros(len(packets)), np.zeros(7), mode)
    assert_same(playback.poses, packets.poses[[0] * 7])
    playback = receive(packets, np.full(len(packets), 1.0), np.repeat(DISPLAY, 3), mode)
    assert np.isfinite(playback.poses.positions).all()
    assert np.isfinite(playback.poses.quaternions).all()


# Damage


def spoiled(packets: Packets, row: int, change: dict[str, float]) -> Packets:
    """The packets with other numbers in one of them, and checksums that fit."""
    data = packets.data.copy()
    layout = np.dtype([*HEADER.descr, ("x", "<f8", 3), ("w", "<f8", 4)])
    for name, value in change.items():
        data[row].view(layout)[name] = value
    return Packets(sealed(data), packets.packing, packets.interval)


@every_mode
@pytest.mark.parametrize(
    "change",
    [{"x": np.nan}, {"w": np.inf}, {"w": 0.0}, {"w": 1e-200}, {"x": 1e200}, {"stamp": np.nan}, {"stamp": 0.95}],
    ids=lambda change: " ".join(f"{name}={value}" for name, value in change.items()),
)
def test_a_damaged_packet_is_as_good_as_lost(mode, change):
    packets, arrivals = stream()
    playback = receive(spoiled(packets, 20, change), arrivals, DISPLAY, mode)
    assert_same(playback.poses, receive(*without(packets, arrivals, 20), DISPLAY, mode).poses, 0.0)
    (damaged,) = [event for event in playback.events if event.what is What.DAMAGED]
    assert (damaged.sequence, damaged.time) == (20, arrivals[20])


def test_packets_of_nothing_but_damage_show_nothing():
    packets, arrivals = stream()
    playback = receive(spoiled(packets[:1], 0, {"x": np.nan}), arrivals[:1], DISPLAY)
    assert len(playback.times) == 0
    assert happened(playback) == {"damaged": 1}


@settings(max_examples=tried(100))
@given(seed=st.integers(0, 10_000), mode=st.sampled_from(list(MODES)), packing=st.sampled_from(list(PACKINGS)))
def test_bytes_that_nobody_packed_do_no_harm(seed, mode, packing):
    random = np.random.default_rng(seed)
    sound = send(*swinging(seed), RATE, PACKINGS[packing])
    data = sound.data.copy()
    hit = random.random(len(data)) < 0.3
    data[hit] = random.integers(0, 256, (np.count_nonzero(hit), data.shape[1]), dtype=np.uint8)
    playback = receive(Packets(sealed(data), sound.packing, sound.interval), sound.stamps, DISPLAY, mode)
    assert np.isfinite(playback.poses.positions).all()
    assert np.linalg.norm(playback.poses.quaternions, axis=-1) == pytest.approx(1.0)


# What is no stream at all


@pytest.mark.parametrize("arrival", [np.nan, -np.inf])
def test_an_arrival_is_a_time_or_never(arrival):
    packets, arrivals = stream()
    arrivals[4] = arrival
    with pytest.raises(ValueError, match="packet 4 has no moment of arrival"):
        receive(packets, arrivals, DISPLAY)


@pytest.mark.parametrize("times", [[0.0, np.nan], [0.0, np.inf], [1.0, 0.5], [[0.0, 1.0]]])
def test_frames_need_times_that_do_not_fall(times):
    with pytest.raises(ValueError, match="times of display frames"):
        receive(*stream(), times)


def test_other_wrong_input_is_named():
    packets, arrivals = stream()
    with pytest.raises(ValueError, match="there is no mode 'bezier'; the modes are lerp_slerp"):
        receive(packets, arrivals, DISPLAY, "bezier")
    with pytest.raises(ValueError, match=r"arrivals of shape \(3,\) do not fit 61 packets"):
        receive(packets, arrivals[:3], DISPLAY)
    for setting, value in (("wait", -1.0), ("carry", np.nan), ("fade", np.inf), ("fade", 0.0), ("latency", np.nan)):
        with pytest.raises(ValueError, match=f"play-out with a {setting}"):
            PlayOut(**{setting: value})


# On recorded motion


def shell_errors(clip: Clip, rate: float, play_out: PlayOut) -> float:
    """The RMS shell error of what is shown, against the recording at the moments that it stands for."""
    packets = send(clip.times, clip.in_metres(clip.poses), rate)
    arrivals = Link(latency=0.05, jitter=0.05, loss=0.1).carry(packets, np.random.default_rng(0))
    playback = receive(packets, arrivals, np.arange(clip.times[0], clip.times[-1], FRAME), play_out=play_out)
    within = playback.moments >= clip.times[0]
    truth = interpolate(clip.times, clip.in_metres(clip.poses), playback.moments[within])
    return rms(shell_error(playback.poses[within], truth))


@pytest.mark.recordings
@pytest.mark.parametrize("rate", [5.0, 10.0, 20.0])
def test_to_carry_on_is_nearer_to_the_truth_than_to_stop_or_to_go_on_forever(rate):
    # One body of the 21 that moved together is enough.
    recorded = [clips(source)[0] for source in SOURCES]
    errors = {
        carry: np.mean([np.log(shell_errors(clip, rate, PlayOut(carry=carry))) for clip in recorded])
        for carry in (0.0, PlayOut().carry, 100.0)
    }
    assert min(errors, key=errors.get) == PlayOut().carry
