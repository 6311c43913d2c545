"""Tests of held objects, sent in the space of the holding joint: they neither slip nor hover between two hands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion.motion import Poses, shell_error
from rigid_motion.motion.poses import joined, placed
from rigid_motion.streams import Receiver, Sender, Shown, StreamBody
from rigid_motion.streams.bodies import LEVER_LEVELS, Forest
from rigid_motion.streams.coding import BASES_TABLE, HANDS_TABLE, Coder
from rigid_motion.streams.messages import Codec
from rigid_motion.streams.wire import WIRE_VERSION, Terms
from tests.thoroughness import combined, tried

from .links import body, dance, run, talk

SLACK, SLIP = 1.02, 0.003
TURNED = np.array((0.8, 0.3, -0.4, 0.3316624790355400))
IN_HAND = Poses([[0.05, 0.16, 0.24]], [TURNED])
"""The tool's pose in a hand."""

LEFT, RIGHT, TOOL = (StreamBody.rigid(name, radius=0.1) for name in ("left", "right", "tool"))
SPEED = 3.0


def hands(seconds: float, rate: float = 60.0) -> tuple[np.ndarray, Poses, Poses]:
    """Return moments (n,), and the poses (n,) of two hands a metre apart."""
    times, left = dance(StreamBody.rigid("left"), seconds, rate, SPEED, seed=1)
    _, right = dance(StreamBody.rigid("right"), seconds, rate, SPEED, seed=2)
    right.positions[..., 0] += 1.0
    return times, left[0], right[0]


def in_hand(hand: Poses) -> Poses:
    """Return the poses of a tool held by a hand (n,)."""
    return placed(hand, IN_HAND[np.zeros(len(hand), dtype=int)])


def places(shown: Sequence[Shown], name: str) -> Poses:
    """Return the shown poses (n,) of a rigid body."""
    return joined([what.poses[name] for what in shown])


def slips(shown: Sequence[Shown], hand: str) -> np.ndarray:
    """Return how far the tool was shown from its place in a hand (n,), in metres."""
    own, there = places(shown, "tool"), in_hand(places(shown, hand))
    return shell_error(own, there, 0.1)


@pytest.mark.parametrize(("loss", "answers"), combined([0.0, 0.05], [True, False]))
def test_what_is_held_does_not_slip_and_costs_next_to_nothing(loss: float, answers: bool) -> None:
    times, left, _ = hands(6.0)
    both = joined((left[None], in_hand(left)[None]))
    settings = {"loss": loss, "answers": answers, "rate": 60.0}
    held = run([LEFT, TOOL], times, both, says={0: ("tool", "left")}, **settings)
    assert slips(held.shown, "left").max() <= SLIP
    in_world = run([LEFT, TOOL], times, both, **settings)
    assert slips(in_world.shown, "left").max() > 2.0 * SLIP
    assert held.size < in_world.size
    # As much as the hand alone costs, with a ball that the tool is within.
    reach = float(np.linalg.norm(IN_HAND.positions)) + 0.1
    alone = run([StreamBody.rigid("left", radius=reach)], times, left[None], **settings)
    assert held.size <= alone.size + 10.0
    assert loss or held.errors.max() <= 0.005 * SLACK


@pytest.mark.parametrize("seed", range(tried(4)))
@pytest.mark.parametrize(("loss", "answers"), combined([0.0, 0.2], [True, False]))
def test_at_a_hand_over_it_is_in_the_one_hand_or_the_other(loss: float, answers: bool, seed: int) -> None:
    times, left, right = hands(4.0)
    taken = 100 + 7 * seed
    tool = joined((in_hand(left)[:taken], in_hand(right)[taken:]))
    poses, says = joined((left[None], right[None], tool[None])), {0: ("tool", "left"), taken: ("tool", "right")}
    jitter = 0.03 if loss else 0.0
    outcome = run(
        [LEFT, RIGHT, TOOL], times, poses, says=says, loss=loss, answers=answers, jitter=jitter, seed=seed, rate=60.0
    )
    off = np.stack([slips(outcome.shown, hand) for hand in ("left", "right")])
    assert off.min(axis=0).max() <= SLIP
    where = np.argmin(off, axis=0)
    assert np.count_nonzero(np.diff(where)) == 1
    assert [what.held["tool"].body for what in outcome.shown] == [("left", "right")[hand] for hand in where]
    # Never later than the first message that came.
    late = outcome.moments[np.argmax(where)] - times[taken]
    assert -1e-3 <= late <= (1.0 / 100.0 if not loss else 1.2)


@pytest.mark.parametrize(("rate", "answers"), combined([30.0, 60.0, 90.5], [True, False]))
def test_what_is_taken_up_and_thrown_is_within_the_tolerance(rate: float, answers: bool) -> None:
    times, left, _ = hands(3.0, rate)
    taken, thrown = round(1.0 * rate), round(2.0 * rate)
    tool = in_hand(left)
    tool.positions[:taken], tool.quaternions[:taken] = tool.positions[taken], tool.quaternions[taken]
    flight = (times[thrown:] - times[thrown])[:, None]
    tool.positions[thrown:] = tool.positions[thrown] + flight * (1.0, -1.5, 2.0) - flight**2 * (0.0, 0.0, 4.9)
    tool.quaternions[thrown:] = tool.quaternions[thrown]
    says = {taken: ("tool", "left"), thrown: ("tool", None)}
    poses = joined((left[None], tool[None]))
    outcome = run([LEFT, TOOL], times, poses, says=says, answers=answers, fps=500.0, rate=rate)
    moments = outcome.moments
    # Between the two samples around it nobody knows when it was.
    known = ~np.any([(moments > times[row - 1]) & (moments < times[row]) for row in says], axis=0)
    assert outcome.errors[known].max() <= 0.005 * SLACK
    held = (moments > times[taken]) & (moments < times[thrown - 1])
    assert slips(outcome.shown, "left")[held].max() <= SLIP


def test_keys_are_in_the_world_and_do_not_go_between_two_hands() -> None:
    times, left, right = hands(4.0)
    taken = 120
    tool = joined((in_hand(left)[:taken], in_hand(right)[taken:]))
    sender, receiver = Sender([LEFT, RIGHT, TOOL], rate=60.0), Receiver()
    came = []
    for row, now in enumerate(times.tolist()):
        if row in (0, taken):
            sender.hold("tool", "left" if row == 0 else "right")
        talk(sender, receiver, now, joined((left[row : row + 1], right[row : row + 1], tool[row : row + 1])))
        came += receiver.keys()
    moments = np.concatenate([keys.moments for keys in came])
    poses = {name: joined([keys.poses[name][0] for keys in came]) for name in ("left", "right", "tool")}
    assert np.diff(moments).min() > 0.0
    for hand, now in (("left", moments < times[taken]), ("right", moments >= times[taken])):
        assert shell_error(poses["tool"][now], in_hand(poses[hand][now]), 0.1).max() <= SLIP
    assert 0.0 < times[taken] - moments[moments < times[taken]][-1] < 0.001
    holders = [holder for keys in came for holder in keys.held["tool"][0]]
    assert holders == [(hand, hand) for hand in np.where(moments < times[taken], "left", "right").tolist()]
    inside = joined([keys.held["tool"][1][0] for keys in came])
    for hand in ("left", "right"):
        at = [holder[0] == hand for holder in holders]
        assert shell_error(placed(poses[hand][at], inside[at]), poses["tool"][at], 0.1).max() < 1e-9


@pytest.mark.parametrize(
    ("tool", "holder", "joint", "what"),
    [
        ("axe", "left", None, "axe: no such body; there are left, tool, performer"),
        ("tool", "nobody", None, "nobody: no such body"),
        ("tool", "performer", "tail", "performer: tail\\? It has joint 0, joint 1"),
        ("tool", "performer", None, "performer: which joint\\? It has joint 0, joint 1, joint 2"),
        ("tool", "tool", None, "tool cannot be held by tool: .* hangs on itself"),
        ("performer", "performer", "joint 2", "performer cannot be held by performer: .* hangs on itself"),
        ("left", "tool", None, "left cannot be held by tool: .* hangs on itself"),
        ("post", "left", None, "post cannot be held by left: post: what never changes its place cannot be held"),
    ],
)
def test_what_cannot_be_held_is_refused(tool: str, holder: str, joint: str | None, what: str) -> None:
    post = StreamBody("post", ("post",), np.array([-1]), LEFT.rest, sliding=np.array([False]))
    bodies = [LEFT, TOOL, body(3), post]
    sender, other = Sender(bodies), Sender(bodies)
    other.identity = sender.identity
    for each in (sender, other):
        each.hold("tool", "left")
    with pytest.raises(ValueError, match=what):
        sender.hold(tool, holder, joint)
    # A refusal changes nothing.
    rest = joined([own.rest for own in bodies])
    assert sender.add(0.0, rest) == other.add(0.0, rest)


WHO = st.sampled_from([("left", None), ("right", None), ("performer", "joint 2"), (None, None)])


@settings(max_examples=tried(60))
@given(
    st.lists(st.tuples(st.integers(0, 50), st.sampled_from(["tool", "cup", "right"]), WHO), max_size=8),
    st.sampled_from([0.0, 0.1, 0.5]),
    st.booleans(),
    st.integers(0, 1 << 30),
)
def test_whoever_takes_what_whenever_all_is_shown_where_it_is_in_the_end(
    says: list, loss: float, answers: bool, seed: int
) -> None:
    """Datagrams are lost, come twice and in any order until then.

    Afterwards there is time for a message that builds on nothing, and for what is shown to get there, which is as late
    as anything came.
    """
    bodies = [LEFT, RIGHT, TOOL, StreamBody.rigid("cup"), body(4)]
    forest, rng = Forest(bodies), np.random.default_rng(seed)
    sender, receiver, late = Sender(bodies, rate=60.0), Receiver(), []
    dances = [dance(own, 2.7, 60.0, SPEED, number) for number, own in enumerate(bodies)]
    poses = joined([own for _, own in dances])
    for row, now in enumerate(dances[0][0].tolist()):
        for when, tool, holder in says:
            if when == row:
                try:
                    sender.hold(tool, *holder)
                except ValueError as error:
                    assert "hangs on itself" in str(error)  # noqa: PT017
        lossy = row < 40
        came = sender.add(now, poses[:, min(row, 40)]) + (sender.poll(sender.next) if lossy and row % 7 == 0 else [])
        late += [datagram for datagram in came if rng.random() >= loss or not lossy]
        if lossy and loss:
            rng.shuffle(late)
            late, came = late[: len(late) // 2], late[len(late) // 2 :]
            late += came[:1]
        else:
            late, came = [], late
        for datagram in came:
            receiver.take(datagram, now, "sender")
        for _, answer in receiver.answers() if answers else ():
            if rng.random() >= loss or not lossy:
                for datagram in sender.take_answer(answer, now):
                    receiver.take(datagram, now, "sender")
        receiver.keys()
        for shown in receiver.show(now).values():
            assert all(np.isfinite(own.positions).all() for own in shown.poses.values())
    (shown,) = receiver.show(now).values()
    truth = forest.skeleton.in_root_space(poses[:, 40:41])
    there = forest.skeleton.in_root_space(joined([shown.poses[own.name] for own in bodies])[:, None])
    assert shell_error(there, truth, forest.radii[:, None]).max() <= 0.0051
    holders = sender._codec.forest.holders
    assert {name: (held.body, held.joint) for name, held in shown.held.items()} == forest.held(holders)


# Arbitrary datagrams


def forged(codec: Codec, rng: np.random.Generator, holds: list[tuple[int, int, int]]) -> bytes:
    """Return a message that builds on nothing, with the given holds, followed by random bytes."""
    coder = Coder()
    coder.symbol(BASES_TABLE, 0)
    coder.digits(48, int(rng.integers(1 << 20)))
    coder.symbol(HANDS_TABLE, 1)
    coder.flat(codec.terms.delay, int(rng.integers(codec.terms.delay)))
    coder.flat(len(codec.forest.bodies) + 1, len(holds))
    for owned, joint, level in holds:
        coder.flat(len(codec.forest.bodies), owned)
        coder.flat(len(codec.forest), joint)
        coder.flat(LEVER_LEVELS, level)
    return coder.finish()


def test_what_holds_itself_is_no_message() -> None:
    bodies = [LEFT, RIGHT, TOOL, body(3)]
    codec, rng = Codec(Forest(bodies), Terms(0.005, 360, 60)), np.random.default_rng(1)

    def known(holds: list[tuple[int, int, int]]) -> bool:
        return codec.code(Coder(forged(codec, rng, holds)), lambda _: None) is not None

    assert known([(2, 0, 80)])
    assert known([(0, 2, 80), (2, 3, 0)])
    for wrong in (
        [(2, 2, 80)],
        [(0, 1, 80), (1, 0, 80)],
        [(3, 4, 80)],
        [(2, 0, 80), (2, 1, 80)],
        [(2, 0, 80), (0, 1, 80)],
    ):
        assert not known(wrong)


def test_another_version_is_one_line_with_the_way_out() -> None:
    receiver, sender = Receiver(), Sender([LEFT])
    said = [*sender.describe(), *sender.add(0.0, LEFT.rest)]
    for version, datagram in [
        (version, datagram) for version in (WIRE_VERSION - 1, WIRE_VERSION + 1) for datagram in said
    ]:
        receiver.take(bytes([version << 4 | datagram[0] & 15]) + datagram[1:], 0.0, f"version {version}")
    receiver.take(b"", 0.0)
    receiver.take(b"#bundle\0", 0.0)
    assert receiver.complaints() == [
        f"version {version} sends version {version} of the wire, not {WIRE_VERSION}: update {what}"
        for version, what in ((WIRE_VERSION - 1, "the sender"), (WIRE_VERSION + 1, "this program"))
    ]
    assert receiver.complaints() == []
    rng, old = np.random.default_rng(1), bytes([(WIRE_VERSION - 1) << 4])
    for number in range(2000):
        receiver.take(rng.bytes(40), 0.0, f"noise {number}")
        receiver.take(bytes([int(rng.integers(1, WIRE_VERSION)) << 4]) + rng.bytes(40), 0.0, f"noise {number}")
    assert len(receiver.complaints()) < 10
    for number in range(1000):
        receiver.take(old + said[0][1:], 0.0, number)
    assert len(receiver.complaints()) <= 64
