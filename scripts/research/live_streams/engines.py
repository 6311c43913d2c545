"""Models of game engines that show a hand and its tool over a bad link, compared with our codec.

Small models of how each engine handles arriving poses, after its source code and at its defaults:

- Mirror (`SnapshotInterpolation.cs`): a buffer of two intervals that grows with jitter; time runs 2 % faster or 4 %
  slower if the buffer drifts; no extrapolation.
- Netcode for GameObjects (`BufferedLinearInterpolator.cs`): interpolates between two poses, an interval and 50 ms late,
  extrapolates by up to three intervals, and moves towards the result by dt / 0.1 s per frame ("lerp of lerp").
- Godot (`MultiplayerSynchronizer`): the newest pose at each of 60 physics ticks per second, with physics interpolation.

All receive the poses of hand and tool in separate datagrams, 30 times per second, and drop overtaken ones. Errors are
those of a ball of 10 cm, at the constant delay that fits the shown motion best. Seconds and metres.
"""

from __future__ import annotations

import heapq
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import accumulate, count

import numpy as np

from rigid_motion.motion import Poses, rms, shell_error
from rigid_motion.motion.poses import joined
from rigid_motion.motion.quaternions import align_signs, conjugate, normalise, rotate, turned, turns_between
from rigid_motion.streams import Receiver, Sender, StreamBody
from rigid_motion.streams.paths import KnotPath
from rigid_motion_batch.streaming.measuring import HEADER_BYTES

POSES_PER_S, PICTURES_PER_S, PHYSICS_TICK_S = 30.0, 72.0, 1.0 / 60.0
"""Poses per second sent by an engine, pictures per second, and Godot's physics tick."""

RADIUS_M = 0.1
GRIP_M = np.array((0.0, 0.3, 0.0))  # the tool's centre in the hand's space
SETTLED_S = 3.0  # shown poses before this time do not count

MIN_HAND_SPEED_M_PER_S, MAX_FROZEN_SPEED_RATIO, MIN_FROZEN_S = 0.2, 0.1, 0.1
"""A shown hand is frozen if the true one moves faster than this (m/s), but it moves at less than this fraction of the
speed, for at least this many seconds."""

MIN_JUMP_BACK_M = 0.005  # metres against the hand's direction from one picture to the next: a jump back
LAGS_S = np.arange(0.0, 0.8, 0.005)

Pose = tuple[np.ndarray, np.ndarray]
"""Position (3,) and quaternion (4,)."""

Arrivals = list[tuple[float, float, Pose]]
"""Arrival time, sending time and pose, in the order of arrivals."""


@dataclass(frozen=True)
class Way:
    """A link: delays are uniformly distributed between two numbers of seconds, and a fraction of datagrams is lost."""

    shortest: float
    longest: float
    loss: float

    def arrival(self, sent: float, rng: np.random.Generator) -> float:
        lost, takes = rng.random() < self.loss, rng.uniform(self.shortest, self.longest)
        return np.inf if lost else sent + takes


# -- engines -----------------------------------------------------------------------------------------------------------


def mix(first: Pose, second: Pose, share: float) -> Pose:
    """Return a pose between two poses or beyond: linear, and about one axis."""
    turn = turned(first[1], share * turns_between(first[1], second[1]))
    return first[0] + share * (second[0] - first[0]), normalise(turn)


def arriving(arrivals: Arrivals, moments: np.ndarray) -> Iterator[tuple[float, Arrivals]]:
    """Yield each moment, and the arrivals since the previous moment."""
    ends = np.searchsorted([arrival for arrival, _, _ in arrivals], moments, side="right").tolist()
    for moment, begin, end in zip(moments.tolist(), [0, *ends], ends, strict=False):
        yield moment, arrivals[begin:end]


def without_overtaken(arrivals: Arrivals) -> Arrivals:
    """Return the arrivals that were not preceded by a later-sent one."""
    newest = [-np.inf, *accumulate((sent for _, sent, _ in arrivals), max)]
    return [it for it, latest in zip(arrivals, newest, strict=False) if it[1] > latest]


def mirror(arrivals: Arrivals, frames: np.ndarray) -> list[Pose]:
    """Return the poses shown by snapshot interpolation with dynamic adjustment."""
    interval, buffer, shown = 1.0 / POSES_PER_S, [], []
    local, scale, multiple, last_arrival, before = 0.0, 1.0, 2.0, None, frames[0]
    drift, taken = _Average(POSES_PER_S), _Average(2.0 * POSES_PER_S)
    for now, come in arriving(arrivals, frames):
        elapsed, before = now - before, now
        for arrival, sent, pose in come:
            if not buffer:
                local = sent - interval * multiple
            at = bisect_right(buffer, sent, key=lambda known: known[0])
            if buffer and (sent < buffer[0][0] or len(buffer) >= 32):
                continue
            buffer.insert(at, (sent, pose))
            if last_arrival is not None:
                taken.add(arrival - last_arrival)
            last_arrival = arrival
            multiple = (interval + float(np.sqrt(taken.variance))) / interval + 1.0
            aim = buffer[-1][0] - interval * multiple
            local = min(max(local, aim - interval * multiple), aim + interval * multiple)
            drift.add(buffer[-1][0] - local)
            off = drift.value - interval * multiple
            scale = 1.02 if off > interval else 0.96 if off < -interval else 1.0
        if not buffer:
            shown.append(arrivals[0][2])
            continue
        local += scale * elapsed
        at = bisect_right(buffer, local, key=lambda known: known[0])
        if 0 < at < len(buffer):
            (begin, first), (end, second) = buffer[at - 1 : at + 1]
            shown.append(mix(first, second, (local - begin) / (end - begin)))
        else:
            shown.append(buffer[max(at - 1, 0)][1])
        del buffer[: max(at - 1, 0)]
    return shown


@dataclass
class _Average:
    """An exponential moving average over about `count` values, and their variance."""

    count: float
    value: float | None = None
    variance: float = 0.0

    def add(self, value: float) -> None:
        part, before = 2.0 / (self.count + 1.0), value if self.value is None else self.value
        delta = value - before
        self.value = before + part * delta
        self.variance = (1.0 - part) * (self.variance + part * delta * delta)


def netcode(arrivals: Arrivals, frames: np.ndarray) -> list[Pose]:
    """Return the poses shown by lerp of lerp."""
    offset = float(np.mean([arrival - sent for arrival, sent, _ in arrivals])) + 0.05 + 1.0 / POSES_PER_S
    waiting, shown, before = [], [], frames[0]
    current = arrivals[0][2]
    start = end = (0.0, current)
    for now, come in arriving(without_overtaken(arrivals), frames):
        waiting += [(sent, pose) for _, sent, pose in come]
        render = now - offset
        while waiting and render >= end[0]:
            start, end = end, waiting.pop(0)
        span = end[0] - start[0]
        share = max((render - start[0]) / span, 0.0) if span > 0.0 else 1.0
        aim = mix(start[1], end[1], share if share <= 3.0 else 1.0)
        current, before = mix(current, aim, min((now - before) / 0.1, 1.0)), now
        shown.append(current)
    return shown


def godot(arrivals: Arrivals, frames: np.ndarray) -> list[Pose]:
    """Return the poses shown: the newest at each physics tick, interpolated between the last two ticks."""
    pose, ticks = arrivals[0][2], []
    for tick, come in arriving(
        without_overtaken(arrivals),
        np.arange(frames[0] - 2.0 * PHYSICS_TICK_S, frames[-1] + PHYSICS_TICK_S, PHYSICS_TICK_S),
    ):
        pose = come[-1][2] if come else pose
        ticks.append((tick, pose))
    shown = []
    for now in frames:
        at = bisect_right(ticks, now, key=lambda known: known[0]) - 1
        (_, first), (moment, second) = ticks[at - 1 : at + 1]
        shown.append(mix(first, second, (now - moment) / PHYSICS_TICK_S))
    return shown


ENGINES: dict[str, Callable[[Arrivals, np.ndarray], list[Pose]]] = {
    "Mirror": mirror,
    "Netcode for GameObjects": netcode,
    "Godot": godot,
}


# -- results -----------------------------------------------------------------------------------------------------------


def truth_of(times: np.ndarray, hand: Poses) -> KnotPath:
    """Return the path of the hand (n,) and the tool in it, as two joints."""
    tool = Poses(hand.positions + rotate(hand.quaternions, GRIP_M), hand.quaternions)
    turns = align_signs(np.stack((hand.quaternions, tool.quaternions)))
    return KnotPath(times - times[0], Poses(np.stack((hand.positions, tool.positions)), turns))


def by_engine(engine: str, truth: KnotPath, way: Way, frames: np.ndarray) -> Poses:
    """Return the poses that an engine shows at each frame (n,), shape (2, n)."""
    rng, shown = np.random.default_rng(7), []
    sent = np.arange(0.0, truth.moments[-1], 1.0 / POSES_PER_S)
    for body in truth.at(sent):
        poses = zip(body.positions, body.quaternions, strict=True)
        arrivals = [(way.arrival(time, rng), time, pose) for time, pose in zip(sent.tolist(), poses, strict=True)]
        arrivals = sorted((it for it in arrivals if np.isfinite(it[0])), key=lambda arrived: arrived[0])
        shown.append(ENGINES[engine](arrivals, frames))
    return Poses(*(np.array([[pose[part] for pose in body] for body in shown]) for part in (0, 1)))


def by_codec(truth: KnotPath, way: Way, frames: np.ndarray, tolerance: float, delay: float) -> tuple[Poses, float]:
    """Return the poses that a receiver shows of one sender of both bodies, and bytes per second with headers."""
    rng = np.random.default_rng(7)
    bodies = [StreamBody.rigid("hand", radius=RADIUS_M), StreamBody.rigid("tool", radius=RADIUS_M)]
    sender, receiver = Sender(bodies, tolerance, delay), Receiver()
    pending, numbers, size = [], count(), 0
    samples = truth.at(truth.moments)
    current, shown = truth.at(frames[:1])[:, 0], []

    def post(datagrams: list[bytes], now: float, back: bool = False) -> None:
        nonlocal size
        for datagram in datagrams:
            size += 0 if back else len(datagram) + HEADER_BYTES
            if np.isfinite(arrival := way.arrival(now, rng)):
                heapq.heappush(pending, (arrival, next(numbers), back, datagram))

    def come(until: float) -> None:
        while pending and pending[0][0] <= until:
            now, _, back, datagram = heapq.heappop(pending)
            if back:
                post(sender.take_answer(datagram, now), now)
            else:
                receiver.take(datagram, now)
                post([answer for _, answer in receiver.answers()], now, back=True)

    events = [(time, 0, row) for row, time in enumerate(truth.moments.tolist())]
    for now, frame, row in sorted([*events, *((time, 1, 0) for time in frames.tolist())]):
        while not frame and row and (due := sender.next) < now:
            come(due)
            post(sender.poll(due), due)
        come(now)
        if frame:
            for it in receiver.show(now).values():
                current = joined(list(it.poses.values()))
            shown.append(current[:, None])
        else:
            post(sender.add(now, samples[:, row]), now)
    return joined(shown, axis=1), size / float(truth.moments[-1])


def seen(shown: Poses, truth: KnotPath, frames: np.ndarray) -> dict[str, float]:
    """Compare the poses shown at frames (n,) with the truth; slip is the tool's displacement in the hand."""
    kept = frames > SETTLED_S
    shown, frames = shown[:, kept], frames[kept]
    hand, tool = shown
    errors = [shell_error(hand, truth.at(frames - lag)[0], RADIUS_M) for lag in LAGS_S]
    best = int(np.argmin([rms(error) for error in errors]))
    went, goes = (np.diff(it.positions, axis=0) for it in (hand, truth.at(frames - LAGS_S[best])[0]))
    speed = np.linalg.norm(goes, axis=-1)
    moving = speed * PICTURES_PER_S > MIN_HAND_SPEED_M_PER_S
    stands = moving & (np.linalg.norm(went, axis=-1) < MAX_FROZEN_SPEED_RATIO * speed)
    along = np.einsum("ij,ij->i", went, goes) / np.maximum(speed, 1e-9)
    runs = np.diff(np.flatnonzero(np.diff(np.pad(stands, 1).astype(int))))[::2]
    slips = np.linalg.norm(rotate(conjugate(hand.quaternions), tool.positions - hand.positions) - GRIP_M, axis=-1)
    off = 1e3 * errors[best]
    return {
        "delay": float(LAGS_S[best]),
        "rms_mm": rms(off),
        "p98_mm": float(np.percentile(off, 98.0)),
        "largest_mm": float(off.max()),
        "freezes": int(np.sum(runs >= MIN_FROZEN_S * PICTURES_PER_S)),
        "jumps_back": int(np.sum(moving & (along < -MIN_JUMP_BACK_M))),
        "slip_mm": 1e3 * float(np.percentile(slips, 98.0)),
    }
