"""A simulated link between sender and receiver, in the time of the test."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rigid_motion.motion import Poses, shell_error
from rigid_motion.motion.poses import joined
from rigid_motion.motion.quaternions import turned
from rigid_motion.streams import Receiver, Sender, Shown, StreamBody
from rigid_motion.streams.bodies import Forest
from rigid_motion.streams.coding import BASES_TABLE, Coder
from rigid_motion.streams.paths import KnotPath
from rigid_motion.streams.wire import Description, EncodedMotion, read

AHEAD = 1000.0
"""How far the receiver's clock is ahead, in seconds."""


def body(joints: int = 5, radius: float = 0.03) -> StreamBody:
    """Return a chain of joints with two branches, each joint a quarter of a metre from its parent."""
    parents = np.array([-1, *(max(joint - 1 - (joint == joints - 2), 0) for joint in range(1, joints))])
    rest = Poses(np.tile((0.0, 0.0, 0.25), (joints, 1)), np.tile((1.0, 0.0, 0.0, 0.0), (joints, 1)))
    return StreamBody("performer", tuple(f"joint {joint}" for joint in range(joints)), parents, rest, radius)


BODY = body()


def dance(own: StreamBody, seconds: float = 6.0, rate: float = 60.0, speed: float = 1.0, seed: int = 1) -> tuple:
    """Return moments (n,) and poses (joints, n) of smooth motion."""
    rng = np.random.default_rng(seed)
    times, joints = np.arange(round(seconds * rate)) / rate, len(own.joints)
    phases, speeds = rng.uniform(0.0, 6.0, (2, 3, joints, 3))
    angles = sum(
        0.2 / (wave + 1) * np.sin(speed * speeds[wave][:, None] * times[:, None] + phases[wave][:, None])
        for wave in range(3)
    )
    still = np.tile((1.0, 0.0, 0.0, 0.0), (joints, len(times), 1))
    positions = np.repeat(own.rest.positions[:, None], len(times), axis=1)
    positions[0] += 0.4 * np.sin(speed * times[:, None] * (1.0, 1.3, 0.4))
    return times, Poses(positions, np.array(turned(still, angles)))


def backs_of(datagrams: Iterable[bytes]) -> list[int]:
    """Return what each message among datagrams builds on: 0 nothing, 1 the one before, 2 an earlier one."""
    messages = [it for it in map(read, datagrams) if isinstance(it, EncodedMotion)]
    return [Coder(message.data).symbol(BASES_TABLE) for message in messages]


@dataclass
class Outcome:
    """The motion shown in a run, and its errors."""

    sender: Sender
    receiver: Receiver
    datagrams: list[tuple[float, bytes]] = field(default_factory=list)
    """When they were sent."""
    shown: Sequence[Shown] = ()
    """What was drawn, from when the motion had begun."""
    now: np.ndarray | None = None
    """When each picture was drawn, by the sender's clock, shape (n,)."""
    moments: np.ndarray | None = None
    """The moments of the motion drawn then, shape (n,)."""
    errors: np.ndarray | None = None
    """The largest error of any joint, in metres, shape (n,)."""
    steps: np.ndarray | None = None
    """How far any joint moved from one picture to the next, in metres, shape (n - 1,)."""
    turned_back: np.ndarray | None = None
    """How far any joint moved against its previous step where the motion itself did not, in metres, shape (n - 2,)."""

    @property
    def size(self) -> float:
        """The bytes a second, with headers, of all that was sent but descriptions."""
        sizes = [len(datagram) + 28 for _, datagram in self.datagrams if not isinstance(read(datagram), Description)]
        return sum(sizes) / (self.datagrams[-1][0] - self.datagrams[0][0])

    def between(self, first: float, last: float) -> np.ndarray:
        """Return the errors of pictures drawn between two times."""
        return self.errors[(self.now >= first) & (self.now < last)]


def talk(sender: Sender, receiver: Receiver, now: float, sample: Poses, *, answers: bool = True) -> list[bytes]:
    """Say a sample, and hear the answers, where nothing is lost and it takes no time; what is said."""
    said = sender.add(now, sample)
    for datagram in said:
        receiver.take(datagram, now, "sender")
    for _, answer in receiver.answers() if answers else ():
        sender.take_answer(answer, now)
    return said


def run(
    bodies: list[StreamBody],
    times: np.ndarray,
    poses: Poses,
    *,
    says: Mapping[int, tuple] | None = None,
    delay: float = 0.1,
    tolerance: float = 0.005,
    latency: float | Callable[[float], float] = 0.02,
    jitter: float = 0.0,
    loss: float = 0.0,
    lost: Callable[[float, int], bool] = lambda now, number: False,
    answers: bool = True,
    clock: Callable[[float], float] = lambda now: now + AHEAD,
    set_by: Callable[[float], float] = lambda now: 0.0,
    drained: Callable[[float], float] = lambda now: now,
    fps: float = 100.0,
    copies: int = 1,
    rate: float | None = None,
    heard_from: float = 0.0,
    lag: float | None = None,
    seed: int = 1,
) -> Outcome:
    """Play samples (n,) of poses (joints, n), and draw the shown motion.

    `says` maps the number of a sample to the arguments of `Sender.hold` from then on. A fraction `loss` of all
    datagrams is lost, and those for which `lost` is true, given the time and the number of a datagram. `set_by` is an
    offset added to the sender's clock. `drained` gives the time when an arrived datagram is taken out of the receiver's
    socket. `heard_from` is when the receiver starts. With a `lag`, the shown motion is compared with the motion that
    long ago, instead of the motion at the moment that the receiver reports.
    """
    rng, sender, receiver = np.random.default_rng(seed), Sender(bodies, tolerance, delay, rate), Receiver()
    outcome, pending, count = Outcome(sender, receiver), [], 0

    def post(datagrams: list[bytes], now: float, back: bool = False) -> None:
        nonlocal count
        for datagram in datagrams:
            if not back:
                outcome.datagrams.append((now, datagram))
            count += 1
            if lost(now, count) or (loss and rng.random() < loss):
                continue
            for _ in range(copies):
                takes = (latency(now) if callable(latency) else latency) + jitter * rng.random()
                arrival = now + takes if back else drained(now + takes)
                heapq.heappush(pending, (arrival, count, back, datagram))

    def deliver(until: float) -> None:
        while pending and pending[0][0] <= until:
            now, _, back, datagram = heapq.heappop(pending)
            if back:
                post(sender.take_answer(datagram, now + set_by(now)), now)
            elif now >= heard_from:
                receiver.take(datagram, clock(now), "sender")
                if answers:
                    post([answer for _, answer in receiver.answers()], now, back=True)

    drawn, frames = [], np.arange(times[0], times[-1], 1.0 / fps)
    events = sorted([*((time, 0, row) for row, time in enumerate(times)), *((time, 1, 0) for time in frames)])
    before = -np.inf
    for now, frame, row in events:
        set_now = set_by(now)
        overdue = bool(not frame and row)
        while overdue and sender.next - set_now < now:
            due = max(sender.next - set_now, before)
            deliver(due)
            said = sender.poll(due + set_now)
            post(said, due)
            # Where its clock was set there is nothing to say, as the sample is going to tell.
            overdue = bool(said)
        deliver(now)
        if frame:
            drawn += [(now, shown) for shown in receiver.show(clock(now)).values() if shown.moment >= times[0]]
        else:
            if says and row in says:
                sender.hold(*says[row])
            post(sender.add(float(now + set_now), poses[:, row]), now)
            deliver(now)
            before = now
    if drawn:
        moments, outcome.shown = zip(*drawn, strict=True)
        outcome.now = np.array(moments)
        compare(outcome, Forest(bodies), KnotPath(times, poses), lag)
    return outcome


def danced(seconds: float, rate: float = 60.0, **conditions: object) -> Outcome:
    """Play the dance of a body, sampled at a rate, under the conditions of `run`."""
    return run([BODY], *dance(BODY, seconds, rate), **conditions)


def compare(outcome: Outcome, forest: Forest, truth: KnotPath, lag: float | None) -> None:
    """Record the errors of the pictures, from when the motion had begun."""
    outcome.moments = np.array([shown.moment for shown in outcome.shown])
    shown = joined([forest.joined(shown.poses)[:, None] for shown in outcome.shown], axis=1)
    there = forest.skeleton.in_root_space(shown)
    true = forest.skeleton.in_root_space(truth.at(outcome.moments if lag is None else outcome.now - lag))
    outcome.errors = shell_error(there, true, forest.radii[:, None]).max(axis=0)
    went, goes = np.diff(there.positions, axis=1), np.diff(true.positions, axis=1)
    outcome.steps = np.linalg.norm(went, axis=-1).max(axis=0)
    before = went[:, :-1] / np.maximum(np.linalg.norm(went[:, :-1], axis=-1, keepdims=True), 1e-9)
    back, is_true = -np.sum(went[:, 1:] * before, axis=-1), np.sum(went[:, 1:] * goes[:, 1:], axis=-1) > 0.0
    outcome.turned_back = np.where(is_true, 0.0, back).max(axis=0)
