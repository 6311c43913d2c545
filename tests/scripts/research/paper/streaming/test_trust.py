"""A packet that lies does harm for a few packets, whatever it says, and bits that flip cost the packets they are in.

A liar has a checksum that fits, and a number, stamp or age that is off. What is shown is compared with the stream that
never had it, `recovery` after it arrived: no later than the lie is found out, and faded.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from research.paper.streaming import PACKINGS, TWISTS, Link, Packets, Playback, PlayOut, What, receive, send
from research.paper.streaming.admission import ENOUGH, FAR, NEAR
from research.paper.streaming.packets import HEADER, sealed
from research.paper.streaming.receiver import LONGEST_FADE
from research.paper.streaming.smooth import fitted, reach_of
from rigid_motion.motion import MODES
from rigid_motion.motion.quaternions import angle_between
from tests.scripts.research.paper.streaming.motions import FRAME, fastest, steps, swinging
from tests.scripts.research.paper.streaming.test_continuity import FACTOR
from tests.thoroughness import THOROUGH, sample, tried

RATE = 20.0
INTERVAL = 1.0 / RATE
LATENCY = 0.05
SECONDS = 12.0
DISPLAY = np.arange(0.0, SECONDS, FRAME)
COUNT = round(SECONDS * RATE) + 1

NEIGHBOURS = 3
"""Packets about a liar whose places it can take, or that a mode looks at, besides those that find it out."""

PICTURE = fastest(*swinging(seconds=SECONDS))

MANY = 1_000_000 if THOROUGH else 50_000

HARMFUL = 250_000 if THOROUGH else 50_000
"""Of packets that were thought out, which take two to three times as long as random ones."""

modes = st.sampled_from([*MODES, TWISTS])
numbers = st.integers(0, 2**32 - 1) | st.integers(0, 2 * COUNT)
stamps = st.floats(width=64) | st.floats(-20.0, 20.0)
ages = st.floats(width=32) | st.floats(-20.0, 20.0, width=32)
lies = st.fixed_dictionaries({}, optional={"sequence": numbers, "stamp": stamps, "age": ages})


def stream(mode: str = "dq_sclerp", seconds: float = SECONDS, rate: float = RATE) -> Packets:
    times, poses = swinging(seconds=seconds)
    if mode != TWISTS:
        return send(times, poses, rate)
    at = np.round(np.arange(round(seconds * rate) + 1) * 90.0 / rate).astype(np.int64)
    keys, twists = fitted(times, poses, at, len(times) - 1, 0.04)
    return Packets.of(times[at], keys, 1.0 / rate, PACKINGS["double"], twists=twists)


STREAMS = {mode: stream(mode) for mode in (*MODES, TWISTS)}


def with_lies(packets: Packets, told: dict[int, dict[str, float]]) -> Packets:
    """The packets, of which some say something else, a metre off, and have checksums that fit."""
    data = packets.data.copy()
    layout = np.dtype([*HEADER.descr, ("x", "<f8")])
    with np.errstate(invalid="ignore"):
        for row, lie in told.items():
            said = data[row, : layout.itemsize].view(layout)
            said["x"] += 1.0
            for name, value in lie.items():
                said[name] = value
    return Packets(sealed(data), packets.packing, packets.interval, packets.twisted)


def lost(arrivals: np.ndarray, *rows: int) -> np.ndarray:
    """The arrivals without some of them."""
    return np.where(np.isin(np.arange(len(arrivals)), rows), np.inf, arrivals)


def apart(playback: Playback, other: Playback, begin: float) -> float:
    """The largest distance and angle of two pictures from a time on."""
    late, other_late = playback.times >= begin, other.times >= begin
    assert np.count_nonzero(late) == np.count_nonzero(other_late) > 0
    poses, others = playback.poses[late], other.poses[other_late]
    turns = angle_between(poses.quaternions, others.quaternions)
    return max(np.abs(poses.positions - others.positions).max(), turns.max())


def lead(mode: str) -> float:
    """The wait of a play-out that is not told otherwise."""
    return (1 + reach_of(mode).ahead) * INTERVAL


def undisturbed(mode: str, delay: float) -> Playback:
    """What is shown of a stream that takes its latency, by any delay."""
    packets = STREAMS[mode]
    return receive(packets, packets.stamps + LATENCY, DISPLAY, mode, PlayOut(latency=delay, wait=0.0))


def recovery(mode: str, *, near: bool) -> float:
    """Seconds from a liar's arrival until nothing is left of it."""
    settling = (ENOUGH + NEIGHBOURS) * INTERVAL + 2.0 * lead(mode) + LONGEST_FADE
    return settling + near * (FAR + lead(mode))


def assert_shown(playback: Playback) -> None:
    assert np.isfinite(playback.poses.positions).all()
    assert np.isfinite(playback.moments).all()
    assert np.linalg.norm(playback.poses.quaternions, axis=-1) == pytest.approx(1.0)


def assert_no_jump(playback: Playback) -> None:
    """Of a way to a liar, a metre in an interval, and of differences that fade in three intervals, the quickest."""
    way, turn = steps(playback.poses)
    caught_up = max((event.amount for event in playback.events if event.what is What.CAUGHT_UP), default=0.0)
    quickest = FRAME / INTERVAL * np.array((1.0 + caught_up, np.pi))
    assert np.all((way.max(initial=0.0), turn.max(initial=0.0)) <= FACTOR * PICTURE + quickest)


# Bits that flip


@settings(max_examples=tried(200))
@given(mode=modes, data=st.data())
def test_a_flipped_bit_costs_its_packet_and_nothing_more(mode, data):
    packets = STREAMS[mode][:60]
    row = data.draw(st.integers(0, len(packets) - 1))
    bit = data.draw(st.integers(0, 8 * packets.data.shape[1] - 1))
    flipped = packets.data.copy()
    flipped[row, bit // 8] ^= 1 << bit % 8
    arrivals, display = packets.stamps + LATENCY, DISPLAY[DISPLAY < 3.5]
    hit = receive(Packets(flipped, packets.packing, INTERVAL, packets.twisted), arrivals, display, mode)
    without = receive(packets, lost(arrivals, row), display, mode)
    assert np.array_equal(hit.times, without.times)
    assert apart(hit, without, 0.0) == 0.0
    assert hit.delay == without.delay
    (damaged,) = [event for event in hit.events if event.what is What.DAMAGED]
    assert (damaged.time, damaged.amount) == (arrivals[row], 1.0)
    assert tuple(event for event in hit.events if event is not damaged) == without.events


@settings(max_examples=tried(100))
@given(mode=modes, seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 1.0))
def test_many_flipped_bits_cost_the_packets_that_they_are_in(mode, seed, share):
    random = np.random.default_rng(seed)
    packets = STREAMS[mode][:60]
    hit = np.flatnonzero(random.random(len(packets)) < share)
    flipped = packets.data.copy()
    for row in hit:
        for bit in random.choice(8 * flipped.shape[1], random.integers(1, 20), replace=False):
            flipped[row, bit // 8] ^= 1 << bit % 8
    arrivals = Link(LATENCY, jitter=0.1).carry(packets, random)
    display = DISPLAY[DISPLAY < 3.5]
    found = receive(Packets(flipped, packets.packing, INTERVAL, packets.twisted), arrivals, display, mode)
    without = receive(packets, lost(arrivals, *hit), display, mode)
    assert np.array_equal(found.times, without.times)
    assert np.array_equal(found.poses.positions, without.poses.positions)
    assert np.array_equal(found.poses.quaternions, without.poses.quaternions)
    assert tuple(event for event in found.events if event.what is not What.DAMAGED) == without.events


# One liar


def compared(mode: str, row: int, lie: dict[str, float], begin: float) -> tuple[float, Playback]:
    packets = STREAMS[mode]
    arrivals = packets.stamps + LATENCY
    playback = receive(with_lies(packets, {row: lie}), arrivals, DISPLAY, mode)
    assert_shown(playback)
    return apart(playback, receive(packets, lost(arrivals, row), DISPLAY, mode), arrivals[row] + begin), playback


@settings(max_examples=tried(400))
@given(mode=modes, row=st.integers(1, 100), lie=lies)
@example(mode="dq_sclerp", row=20, lie={"sequence": 2**31})
@example(mode="dq_sclerp", row=20, lie={"sequence": 2**31, "stamp": 1e6})
@example(mode="dq_sclerp", row=20, lie={"sequence": 22})
@example(mode="dq_sclerp", row=20, lie={"stamp": 1.125})
@example(mode="dq_sclerp", row=20, lie={"sequence": 60, "stamp": 2.9})
def test_nothing_is_left_of_a_liar_whatever_it_said(mode, row, lie):
    assert compared(mode, row, lie, recovery(mode, near=True))[0] < 1e-9


@settings(max_examples=tried(200))
@given(
    mode=modes,
    row=st.integers(0, 150),
    sequence=st.integers(2 * COUNT, 2**32 - 1) | st.none(),
    far=st.floats(FAR + 1.0, 1e12) | st.floats(-1e12, -FAR - 1.0) | st.none(),
    age=st.floats(FAR + 1.0, 2.0**40, width=32) | st.none(),
)
@example(mode="dq_sclerp", row=0, sequence=None, far=1e6, age=None)
@example(mode="dq_sclerp", row=0, sequence=None, far=-1e6, age=None)
@example(mode="dq_sclerp", row=0, sequence=None, far=None, age=64.0)
@example(mode="dq_sclerp", row=0, sequence=2**31, far=1e6, age=None)
@example(mode="dq_sclerp", row=0, sequence=2**31, far=-1e6, age=None)
def test_a_liar_that_is_far_off_is_found_out_within_a_few_packets_the_first_one_as_well(mode, row, sequence, far, age):
    lie = {"sequence": sequence, "stamp": None if far is None else row * INTERVAL + far, "age": age}
    lie = {name: value for name, value in lie.items() if value is not None}
    # A pose that is a metre off, at its own moment, is a motion and no lie.
    assume(lie)
    found, playback = compared(mode, row, lie, recovery(mode, near=False))
    assert found < 1e-9
    assert_no_jump(playback)
    withdrawn = [event.time for event in playback.events if event.what is What.WITHDRAWN]
    assert max(withdrawn, default=-np.inf) <= STREAMS[mode].stamps[row + ENOUGH] + LATENCY


@pytest.mark.parametrize("lie", [{"sequence": 2**31}, {"sequence": 60, "stamp": 1.6}, {"stamp": 1.4}, {"stamp": 100.0}])
@pytest.mark.parametrize("row", [0, 20])
def test_frames_that_follow_more_closely_are_closer_where_keys_are_withdrawn(lie, row):
    packets = with_lies(STREAMS["dq_sclerp"], {row: lie})
    arrivals = np.arange(COUNT) * INTERVAL + LATENCY
    shown = [receive(packets, arrivals, np.arange(0.0, 4.0, frame)) for frame in (FRAME, FRAME / 16.0)]
    assert (shown[0].counts[What.WITHDRAWN] == 0) == (row == 20 and lie.get("stamp") == 100.0)
    longest = [steps(playback.poses).max(axis=1) for playback in shown]
    assert np.all(longest[1] < longest[0] / 6.0)


@pytest.mark.parametrize("age", [NEAR + 0.1, 1.0, FAR, 100.0])
def test_a_latency_that_no_other_packet_agrees_with_is_taken_anew(age):
    packets = STREAMS["dq_sclerp"]
    arrivals = packets.stamps + LATENCY
    playback = receive(with_lies(packets, {0: {"age": age}}), arrivals, DISPLAY)
    assert playback.delays[0] == pytest.approx(LATENCY - age + INTERVAL)
    assert playback.delay == pytest.approx(LATENCY + INTERVAL)
    (delayed,) = [event for event in playback.events if event.what is What.DELAYED]
    assert delayed.time == arrivals[ENOUGH]
    assert delayed.amount == pytest.approx(age)
    assert playback.moments == pytest.approx(playback.times - playback.delays)
    assert_no_jump(playback)


@pytest.mark.parametrize("lie", [{"stamp": 1e6}, {"age": 100.0}, {"sequence": 2**31, "stamp": -1e6}])
@pytest.mark.parametrize("row", [0, 20])
def test_a_latency_that_is_given_is_kept(lie, row):
    packets = with_lies(STREAMS["dq_sclerp"], {row: lie})
    playback = receive(packets, np.arange(COUNT) * INTERVAL + LATENCY, DISPLAY, play_out=PlayOut(latency=0.1))
    assert np.all(playback.delays == 0.1 + INTERVAL)
    without = receive(STREAMS["dq_sclerp"][1:], packets.stamps[1:] + LATENCY, DISPLAY, play_out=PlayOut(latency=0.1))
    if row == 0:
        assert apart(playback, without, recovery("dq_sclerp", near=False)) < 1e-9


def test_what_was_withdrawn_is_said():
    packets = STREAMS["dq_sclerp"]
    arrivals = packets.stamps + LATENCY
    events = receive(with_lies(packets, {20: {"sequence": 4000}}), arrivals, DISPLAY).events
    (withdrawn,) = [event for event in events if event.what is What.WITHDRAWN]
    assert (withdrawn.time, withdrawn.sequence, withdrawn.amount) == (arrivals[20 + ENOUGH], 4000, 1.0)
    assert [event.sequence for event in events if event.what is What.DAMAGED] == [21, 22, 23]
    assert {event.what for event in events} == {
        What.WITHDRAWN, What.DAMAGED, What.LATE, What.CAUGHT_UP, What.LOST, What.RAN_OUT
    }  # fmt: skip


@pytest.mark.parametrize("count", [1, ENOUGH - 1])
def test_few_old_numbers_throw_no_good_key_away(count):
    packets = STREAMS["dq_sclerp"]
    arrivals = packets.stamps + LATENCY
    rows = range(60, 60 + count)
    told = {row: {"sequence": row - 40, "stamp": packets.stamps[row - 40] + 0.01} for row in rows}
    playback = receive(with_lies(packets, told), arrivals, DISPLAY)
    assert playback.counts[What.WITHDRAWN] == 0
    assert apart(playback, receive(packets, lost(arrivals, *rows), DISPLAY), 0.0) == 0.0


# Several


@settings(max_examples=tried(100))
@given(
    mode=modes,
    told=st.dictionaries(st.integers(0, 20), lies, max_size=12),
    seed=st.integers(0, 2**32 - 1),
    jitter=st.sampled_from([0.0, 0.02, 0.3]),
)
@example(mode="lerp_slerp", told={0: {"age": 3.0}, 1: {"sequence": 89, "age": 0.0, "stamp": 5.0}}, seed=0, jitter=0.0)
def test_of_several_liars_among_duplicates_that_overtake_one_another_nothing_is_left(mode, told, seed, jitter):
    """All that goes wrong has gone wrong by 2 s. The delay may be that of another packet than the first.

    A first packet that lies about the clock vouches for one that lies by `FAR` more.
    """
    random = np.random.default_rng(seed)
    packets, sent = STREAMS[mode], STREAMS[mode].stamps
    way = LATENCY + np.where(sent < 1.1, np.minimum(random.exponential(jitter, COUNT), 0.4), 0.0)
    again = np.flatnonzero((random.random(COUNT) < 0.5) & (sent < 1.1))
    rows = np.append(np.arange(COUNT), again)
    arrivals = np.append(sent + way, sent[again] + way[again] + 0.4 * random.random(len(again)))
    playback = receive(with_lies(packets, told)[rows], arrivals, DISPLAY, mode)
    assert_shown(playback)
    assert playback.delay <= LATENCY + FAR + 0.4 + 2.0 * lead(mode)
    begin = 2.0 + FAR + recovery(mode, near=True) + max(playback.delay, 0.0)
    assert apart(playback, undisturbed(mode, playback.delay), begin) < 1e-9


# A sender that begins again, and a clock that jumps


@pytest.mark.parametrize("mode", [*MODES, TWISTS])
@pytest.mark.parametrize("played", [5, 17, 60])
@pytest.mark.parametrize("start", [0.0, -1000.0, 1000.0, 1.7e9])
@pytest.mark.parametrize("first", [0, 1000])
def test_a_sender_may_begin_again_with_any_clock(mode, played, start, first):
    new = STREAMS[mode]
    old = with_lies(new[:played], {r: {"sequence": first + r, "stamp": start + r * INTERVAL} for r in range(played)})
    both = Packets(np.concatenate((old.data, new.data)), new.packing, INTERVAL, new.twisted)
    arrivals = np.arange(len(both)) * INTERVAL + LATENCY
    playback = receive(both, arrivals, DISPLAY, mode)
    alone = receive(new, arrivals[played:], DISPLAY, mode)
    assert apart(playback, alone, arrivals[played] + recovery(mode, near=False)) < 1e-6
    assert playback.delay == alone.delay
    assert_no_jump(playback)
    assert playback.counts[What.WITHDRAWN] == 1


@pytest.mark.parametrize("jump", [-1e9, -100.0, -1.0, FAR + 1.0, 100.0, 1e9])
def test_a_clock_may_jump(jump):
    packets = STREAMS["dq_sclerp"]
    arrivals = packets.stamps + LATENCY
    jumped = Packets.of(packets.stamps[60:] + jump, packets.poses[60:], INTERVAL, packets.packing, first=60)
    both = Packets(np.concatenate((packets.data[:60], jumped.data)), packets.packing, INTERVAL)
    playback = receive(both, arrivals, DISPLAY)
    undisturbed = receive(packets, arrivals, DISPLAY)
    assert apart(playback, undisturbed, arrivals[60] + recovery("dq_sclerp", near=False)) < 1e-5
    assert playback.delay == pytest.approx(LATENCY + INTERVAL - jump)
    assert_no_jump(playback)


def test_a_queue_that_is_let_go_does_not_change_the_delay():
    packets = STREAMS["dq_sclerp"]
    arrivals = np.maximum(packets.stamps + LATENCY, np.where(packets.stamps > 1.0, 6.0, 0.0))
    playback = receive(packets, arrivals, DISPLAY)
    assert np.all(playback.delays == playback.delays[0])
    assert playback.counts[What.DAMAGED] == playback.counts[What.WITHDRAWN] == 0


@pytest.mark.parametrize("mode", [*MODES, TWISTS])
def test_no_frame_knows_what_liars_are_yet_to_come(mode):
    told = {0: {"age": 50.0}, 9: {"sequence": 2**31}, 20: {"stamp": 2.0}, 33: {"sequence": 50, "stamp": 2.45}}
    told |= {row: {"sequence": row - 40, "stamp": (row - 40) * INTERVAL} for row in range(45, 60)}
    packets = with_lies(STREAMS[mode][:60], told)
    arrivals = Link(LATENCY, 0.02, 0.1).arrivals(np.arange(60) * INTERVAL, np.full(60, 82), np.random.default_rng(3))
    display = DISPLAY[DISPLAY < 3.5]
    whole = receive(packets, arrivals, display, mode)
    assert whole.counts[What.WITHDRAWN] > 1
    for count in sample(range(10, len(display), 2)):
        come = arrivals <= display[count - 1]
        begun = receive(packets[come], arrivals[come], display[:count], mode)
        frames = len(begun.times)
        assert np.array_equal(begun.delays, whole.delays[:frames])
        assert np.abs(begun.poses.positions - whole.poses.positions[:frames]).max(initial=0.0) < 1e-12
        assert angle_between(begun.poses.quaternions, whole.poses.quaternions[:frames]).max(initial=0.0) < 1e-12


# Random links


@settings(max_examples=tried(200))
@given(
    mode=modes,
    seed=st.integers(0, 2**32 - 1),
    loss=st.floats(0.0, 0.5),
    jitter=st.floats(0.0, 0.3),
    flips=st.floats(0.0, 0.3),
    wait=st.sampled_from([None, 0.5, 2.0, 6.0]),
)
def test_a_link_that_recovers_is_forgotten_when_its_last_difference_has_faded(mode, seed, loss, jitter, flips, wait):
    """From 4 s on every packet arrives at once, and those of before have all come by 4 s or never come."""
    random = np.random.default_rng(seed)
    packets = STREAMS[mode]
    bad = packets.stamps < 4.0
    arrivals = np.where(bad, Link(LATENCY, jitter, loss).carry(packets, random), packets.stamps + LATENCY)
    arrivals[bad & (arrivals > 4.0)] = np.inf
    again = np.flatnonzero(bad & (random.random(COUNT) < 0.2))
    rows = np.concatenate((np.arange(COUNT), again))
    arrivals = np.append(arrivals, np.minimum(arrivals[again] + random.exponential(0.1, len(again)), 4.0))
    arrivals[COUNT:][np.isinf(arrivals[again])] = np.inf
    data = packets.data[rows]
    hit = np.flatnonzero((random.random(len(data)) < flips) & (packets.stamps[rows] < 4.0))
    data[hit, random.integers(0, data.shape[1], len(hit))] ^= (1 << random.integers(0, 8, len(hit))).astype(np.uint8)
    sent = Packets(data, packets.packing, INTERVAL, packets.twisted)
    playback = receive(sent, arrivals, DISPLAY, mode, PlayOut(wait=wait))
    assert_shown(playback)
    assert np.all(steps(playback.poses).max(axis=1) <= FACTOR * PICTURE)
    begin = 4.0 + max(playback.delay, 0.0) + 2.0 * lead(mode) + NEIGHBOURS * INTERVAL + LONGEST_FADE
    assert apart(playback, undisturbed(mode, playback.delay), begin) < 1e-9


# Too much


@pytest.mark.parametrize("seal", [False, True])
@pytest.mark.parametrize("mode", ["motor_spline", TWISTS])
def test_any_number_of_random_packets_are_dealt_with(seal, mode):
    random = np.random.default_rng(1)
    one = STREAMS[mode][:1]
    data = random.integers(0, 256, (MANY, one.data.shape[1]), dtype=np.uint8)
    packets = Packets(sealed(data) if seal else data, one.packing, INTERVAL, one.twisted)
    playback = receive(packets, np.sort(random.random(MANY)) * SECONDS, DISPLAY, mode)
    assert_shown(playback)
    assert (len(playback.times) > 0) == seal


@pytest.mark.parametrize("kind", ["alternating", "falling", "far and near", "again"])
def test_any_number_of_packets_that_mean_harm_are_dealt_with(kind):
    """Senders that take turns, numbers that fall, liars among good packets, the same packet."""
    place = np.arange(HARMFUL)
    sequence = {
        "alternating": 3 * (place // 6) + place % 3 + 2**31 * (place // 3 % 2),
        "falling": HARMFUL - place,
        "far and near": np.where(place % 8 == 0, 2**31, 0) + place,
        "again": 0 * place,
    }[kind]
    data = np.tile(STREAMS["dq_sclerp"].data[:1], (HARMFUL, 1))
    headers = data[:, : HEADER.itemsize].copy().view(HEADER)[:, 0]
    headers["sequence"], headers["stamp"] = sequence, sequence % 2**31 * SECONDS / HARMFUL
    data[:, : HEADER.itemsize] = headers.view(np.uint8).reshape(HARMFUL, -1)
    packets = Packets(sealed(data), PACKINGS["double"], SECONDS / HARMFUL)
    playback = receive(packets, place * SECONDS / HARMFUL, DISPLAY, play_out=PlayOut(wait=HARMFUL / SECONDS))
    assert_shown(playback)
    assert playback.counts[What.DAMAGED] > 0 or kind == "again"
