"""A sender that sends when it must keeps its promise, knows nothing of what is to come, and sends little."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from research.paper.streaming import PACKINGS, TWISTS, Link, Packets, Playback, PlayOut, What, receive
from research.paper.streaming.needed import Key, NeededSender, send_when_needed
from rigid_motion.motion import MODES, Poses, decimate, interpolate, rms, shell_error
from tests.scripts.research.paper.streaming.motions import FRAME, clips, steps, swinging
from tests.thoroughness import sample, tried

RADIUS = 0.1
DELAY = 0.1

STREAMED = [TWISTS, "lerp_slerp", "dq_sclerp", "motor_spline_causal"]
"""What a sender that sends when it must may fill in with, but for modes that differ from these in nothing it sees."""

every_mode = pytest.mark.parametrize("mode", STREAMED)


def shown(times: np.ndarray, packets: Packets, play_out: PlayOut, mode: str, delay: float = DELAY) -> Playback:
    """What a receiver shows at the moments of the samples, over a link that takes no time."""
    return receive(packets, np.maximum.accumulate(packets.sent), times + delay, mode, play_out)


def errors(times: np.ndarray, poses: Poses, playback: Playback) -> np.ndarray:
    """How far off that is, at those of the samples that are shown."""
    return shell_error(playback.poses, poses[len(times) - len(playback.times) :], RADIUS)


def cut(keys: list[Key]) -> list[tuple]:
    return [
        (
            key.stamp,
            key.sent,
            *key.pose.positions[0],
            *key.pose.quaternions[0],
            *(() if key.twist is None else key.twist),
        )
        for key in keys
    ]


@every_mode
@pytest.mark.parametrize("packing", ["smallest_three"])
def test_no_sample_is_shown_further_off_than_the_tolerance(mode, packing):
    for seed, (tolerance, delay) in enumerate([(0.004, 0.05), (0.02, 0.3), (0.02, 0.02)]):
        times, poses = swinging(seed)
        packets, play_out = send_when_needed(times, poses, tolerance, delay, mode, RADIUS, PACKINGS[packing])
        playback = shown(times, packets, play_out, mode, delay)
        assert errors(times, poses, playback).max() <= tolerance * (1.0 + 1e-6)
        assert playback.counts[What.LATE] == playback.counts[What.DAMAGED] == playback.counts[What.REORDERED] == 0
        assert 3 < len(packets) < len(times)


@settings(max_examples=tried(40))
@given(
    seed=st.integers(0, 10_000),
    mode=st.sampled_from(STREAMED),
    share=st.floats(1.0, 8.0),
    delay=st.floats(0.015, 0.4),
    start=st.sampled_from([0.0, -1e4, 1.7e9]),
)
def test_the_tolerance_holds_if_no_sample_is_further_from_the_one_before(seed, mode, share, delay, start):
    times, poses = swinging(seed, seconds=1.5)
    tolerance = share * float(shell_error(poses[1:], poses[:-1], RADIUS).max())
    packets, play_out = send_when_needed(times + start, poses, tolerance, delay, mode, RADIUS)
    playback = shown(times + start, packets, play_out, mode, delay)
    # Clocks that count from 1970 tell no less than 0.2 microseconds apart.
    assert errors(times, poses, playback).max() <= tolerance * (1.0 + 1e-4)


@settings(max_examples=tried(16))
@given(seed=st.integers(0, 10_000), mode=st.sampled_from(STREAMED))
def test_samples_may_come_one_by_one_or_many_together(seed, mode):
    random, (times, poses) = np.random.default_rng(seed), swinging(seed, seconds=1.5)
    whole = NeededSender(0.003, DELAY, mode)
    at_once = cut([*whole.push(times, poses), *whole.finish()])
    sender, keys, at = NeededSender(0.003, DELAY, mode), [], 0
    while at < len(times):
        count = int(random.integers(0, 2 if seed % 2 else 40))
        keys += sender.push(times[at : at + count], poses[at : at + count])
        at += count
    keys += sender.finish()
    assert np.array_equal(cut(keys), at_once)


@every_mode
def test_a_key_depends_on_no_sample_that_is_recorded_after_it_was_sent(mode):
    times, poses = swinging(3)
    keys = [*(sender := NeededSender(0.003, DELAY, mode)).push(times, poses), *sender.finish()]
    other = Poses(poses.positions + 0.5 * (times > 1.5)[:, None], poses.quaternions)
    others = [*(sender := NeededSender(0.003, DELAY, mode)).push(times, other), *sender.finish()]
    early = [key for key in keys if key.sent <= 1.5]
    assert len(early) > 5
    assert np.array_equal(cut(early), cut(others)[: len(early)])


@every_mode
def test_keys_are_sent_in_order_and_before_the_play_out_gets_to_them(mode):
    times, poses = swinging(5)
    keys = [*(sender := NeededSender(0.003, DELAY, mode)).push(times, poses), *sender.finish()]
    stamps, sent = np.array([(key.stamp, key.sent) for key in keys]).T
    assert np.all(np.diff(stamps) > 0.0)
    assert np.all(np.diff(sent) >= 0.0)
    assert np.all(stamps <= sent + 1e-9)
    assert np.all(sent - DELAY <= stamps + 1e-9)


@pytest.mark.parametrize("mode", [TWISTS, "lerp_slerp"])
def test_a_clock_tells_a_sender_as_much_as_the_next_sample(mode):
    """A key is due when the play-out gets to it, and not only with the next sample."""
    times, poses = swinging(2)
    keys = [*(sender := NeededSender(0.003, DELAY, mode)).push(times, poses), *sender.finish()]
    sender, found = NeededSender(0.003, DELAY, mode), []
    for place in range(len(times)):
        found += sender.push(times[place : place + 1], poses[place : place + 1])
        if place + 1 < len(times):
            soon = np.nextafter(times[place + 1], 0.0)
            due = sender.push(times[:0], poses[:0], soon)
            assert all(times[place] < key.sent <= soon for key in due)
            found += due
    assert np.array_equal(cut([*found, *sender.finish()]), cut(keys))


@every_mode
def test_a_body_at_rest_costs_one_key(mode):
    times, poses = swinging(1)
    packets, play_out = send_when_needed(times, poses[[4] * len(times)], 0.002, DELAY, mode)
    assert len(packets) == 1
    assert errors(times, poses[[4] * len(times)], shown(times, packets, play_out, mode)).max() < 1e-9


@pytest.mark.parametrize("mode", [TWISTS, "dq_sclerp"])
def test_a_body_on_one_screw_costs_next_to_nothing(mode):
    times, poses = swinging(1)
    turning = interpolate([0.0, 3.0], poses[[0, 20]], times, "dq_sclerp")
    packets, play_out = send_when_needed(times, turning, 0.002, 0.3, mode)
    assert errors(times, turning, shown(times, packets, play_out, mode, 0.3)).max() <= 0.002
    assert len(packets) < 12


@every_mode
def test_a_body_that_jumps_is_followed_as_soon_as_the_picture_may(mode):
    times, poses = swinging(8)
    jumped = Poses(poses.positions + 1.0 * (times > 1.503)[:, None], poses.quaternions)
    packets, play_out = send_when_needed(times, jumped, 0.005, DELAY, mode)
    off = errors(times, jumped, shown(times, packets, play_out, mode))
    within = off <= 0.005 * (1.0 + 1e-6)
    assert within[times < 1.48].all()
    assert within[times > 1.503 + 2.0 * DELAY].all()
    assert not within.all()


@every_mode
def test_uneven_samples_and_gaps_are_taken_as_they_come(mode):
    random, (times, poses) = np.random.default_rng(4), swinging(4)
    kept = np.sort(random.choice(len(times), len(times) // 2, replace=False))
    kept = kept[(times[kept] < 1.0) | (times[kept] > 1.4)]
    packets, play_out = send_when_needed(times[kept], poses[kept], 0.01, DELAY, mode)
    off = errors(times[kept], poses[kept], shown(times[kept], packets, play_out, mode))
    settled = (times[kept] < 1.0) | (times[kept] > 1.4 + 2.0 * DELAY)
    assert np.mean(off[settled] <= 0.01) > 0.97
    assert np.isfinite(off).all()


@every_mode
@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_hardly_any_samples_are_hardly_any_keys(mode, count):
    times, poses = swinging(6)
    far = np.arange(count) * 40
    packets, play_out = send_when_needed(times[far], poses[far], 0.001, DELAY, mode)
    assert len(packets) == count
    if count:
        assert errors(times[far], poses[far], shown(times[far], packets, play_out, mode)).min() < 1e-9


def test_memory_does_not_grow_with_the_stream():
    times, poses = swinging(0, seconds=20.0)
    sender, largest = NeededSender(0.01, DELAY), 0
    for first in range(0, len(times), 10):
        sender.push(times[first : first + 10], poses[first : first + 10])
        largest = max(largest, len(sender._times))
    assert largest < 200


@pytest.mark.parametrize("loss", [0.1, 0.3, 0.5])
@every_mode
def test_after_the_link_recovers_the_error_is_back_within_the_tolerance(mode, loss):
    """A few keys after the last that was lost, once the difference has faded."""
    times, poses = swinging(9, seconds=6.0)
    packets, play_out = send_when_needed(times, poses, 0.005, DELAY, mode, RADIUS)
    sent = np.maximum.accumulate(packets.sent)
    lost = (np.random.default_rng(3).random(len(packets)) < loss) & (sent > 0.5) & (sent < 3.0)
    lost[0] = False
    playback = receive(packets, np.where(lost, np.inf, sent), times + DELAY, mode, play_out)
    off = errors(times, poses, playback)
    after = np.flatnonzero(~lost & (sent > 3.0))[2 + max(MODES[mode].behind if mode in MODES else 0, 1)]
    assert off[times > sent[after] + DELAY].max() <= 0.005 * (1.0 + 1e-6)
    assert off.max() > 0.005


def test_over_a_bad_link_nothing_jumps_and_nothing_is_raised():
    """A picture that jumps has a longest step that does not shrink with the time between frames."""
    for seed in range(tried(24)):
        mode = STREAMED[seed % len(STREAMED)]
        times, poses = swinging(seed, seconds=2.0)
        packets, play_out = send_when_needed(times, poses, 0.005, DELAY, mode, RADIUS)
        sent = np.maximum.accumulate(packets.sent)
        link = Link(latency=0.05, jitter=0.3 if seed % 2 else 0.05, loss=0.5 if seed % 3 else 0.2)
        random = np.random.default_rng(seed)
        arrivals = link.arrivals(sent, np.full(len(sent), packets.data.shape[1]), random)
        again = random.random(len(sent)) < 0.2
        both = Packets(
            np.concatenate((packets.data, packets.data[again])), packets.packing, packets.interval, packets.twisted
        )
        arrivals = np.concatenate((arrivals, arrivals[again] + random.exponential(0.1, again.sum())))
        both.data[random.random(len(both)) < 0.1, 30] ^= 16
        longest = [
            steps(receive(both, arrivals, np.arange(0.0, 2.5, frame), mode, play_out).poses).max(axis=1, initial=0.0)
            for frame in (FRAME, FRAME / 16.0)
        ]
        assert np.all(longest[1] <= longest[0] / 6.0), f"{mode}, {seed}"


def even_error(times: np.ndarray, poses: Poses, rate: float) -> float:
    keys = decimate(times, rate)
    filled = interpolate(times[keys], poses[keys], times[: keys[-1] + 1], "lerp_slerp")
    return rms(shell_error(filled, poses[: keys[-1] + 1], RADIUS))


def fewest(times: np.ndarray, poses: Poses, wanted: float, delay: float, mode: str) -> float:
    """Keys a second that are as good, of a few tolerances."""
    rates = [np.inf]
    for tolerance in wanted * np.array([1.6, 2.2]):
        packets, play_out = send_when_needed(times, poses, tolerance, delay, mode, RADIUS)
        if rms(errors(times, poses, shown(times, packets, play_out, mode, delay))) <= wanted:
            rates.append((len(packets) - 1) / (times[-1] - times[0]))
    return min(rates)


@pytest.mark.recordings
@pytest.mark.parametrize("rate", sample([12.0, 15.0, 20.0, 30.0]))
def test_a_live_hand_needs_half_the_updates_at_two_intervals_of_delay(rate):
    (clip,) = clips("vive_index_left.csv")
    poses = clip.in_metres(clip.poses)
    wanted = even_error(clip.times, poses, rate)
    assert fewest(clip.times, poses, wanted, 2.0 / rate, TWISTS) <= 0.45 * rate
    assert fewest(clip.times, poses, wanted, 3.0 / rate, "lerp_slerp") <= 0.8 * rate


def test_what_cannot_be_is_said():
    times, poses = swinging()
    with pytest.raises(ValueError, match="motor_spline takes a key after the segment"):
        NeededSender(0.01, 0.1, "motor_spline")
    with pytest.raises(ValueError, match=r"there is no mode .bezier.; the modes are lerp_slerp.*motor_twists"):
        NeededSender(0.01, 0.1, "bezier")
    for tolerance, delay, radius, named in [
        (0.0, 0.1, 0.1, "tolerance"),
        (0.1, np.nan, 0.1, "delay"),
        (0.1, 0.1, -1.0, "radius"),
    ]:
        with pytest.raises(ValueError, match=f"a {named} of .* is not a positive number"):
            NeededSender(tolerance, delay, radius=radius)
    sender = NeededSender(0.01, 0.1)
    sender.push(times[:5], poses[:5])
    with pytest.raises(ValueError, match="each later than the one before"):
        sender.push(times[4:6], poses[4:6])
    broken = Poses(poses.positions * np.nan, poses.quaternions)
    with pytest.raises(ValueError, match="pose 0 has a position that is not finite"):
        sender.push(times[5:7], broken[5:7])
    # What was refused has left no trace.
    rest = [*sender.push(times[5:], poses[5:]), *sender.finish()]
    whole = NeededSender(0.01, 0.1)
    assert np.array_equal(cut(rest), cut([*whole.push(times, poses), *whole.finish()])[1:])
