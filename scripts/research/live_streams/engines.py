"""A hand and the tool in it over a bad link, as game engines show them and as we do.

Small models of what each engine does with the poses that arrive, after its source code and at its defaults:

- Mirror (`SnapshotInterpolation.cs`): a buffer of two intervals that grows with jitter, time 2 % faster or 4 % slower
  where the buffer drifts, no extrapolation.
- Netcode for GameObjects (`BufferedLinearInterpolator.cs`): between two poses, an interval and 50 ms behind, on beyond
  the second by up to three intervals, and towards that by dt / 0.1 s at every frame ("lerp of lerp").
- Godot (`MultiplayerSynchronizer`): the newest pose at each of 60 physics ticks, between two by physics interpolation.

All get the poses of hand and tool in datagrams of their own, 30 times a second, and drop those that are overtaken. An
error is that of a ball of 10 cm, at the constant delay that suits what was shown best. Seconds and metres.
"""

from __future__ import annotations

import heapq
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import Poses, rms, shell_error
from rigid_motion.motion.quaternions import align_signs, conjugate, normalise, rotate
from rigid_motion.streams import Body, Receiver, Sender
from rigid_motion.streams.paths import Path, turned, turns_between

RATE, FPS, TICK = 30.0, 72.0, 1.0 / 60.0
"""Poses a second that an engine sends, pictures a second, and Godot's physics tick."""

RADIUS = 0.1

GRIP = np.array((0.0, 0.3, 0.0))
"""The tool's middle in the hand's space."""

SETTLED = 3.0
"""Seconds after which it counts what is shown."""

MOVES, STANDS, FROZEN = 0.2, 0.1, 0.1
"""A hand that moves by more than this (m/s) is frozen where it is shown with less than this part of it for so long."""

BACK = 0.005
"""Metres against the way of the hand from one picture to the next: a jump back."""

LAGS = np.arange(0.0, 0.8, 0.005)

Pose = tuple[np.ndarray, np.ndarray]
"""Place (3,) and turn (4,)."""

Arrivals = list[tuple[float, float, Pose]]
"""Arrival, time of the sender, and pose, in the order of arrivals."""


@dataclass(frozen=True)
class Way:
    """A link: datagrams take from one to another number of seconds, as likely, and a part never arrives."""

    shortest: float
    longest: float
    loss: float

    def arrival(self, sent: float, rng: np.random.Generator) -> float:
        lost, takes = rng.random() < self.loss, rng.uniform(self.shortest, self.longest)
        return np.inf if lost else sent + takes


@dataclass(frozen=True)
class Seen:
    """What came out."""

    delay: float
    rms_mm: float
    p98_mm: float
    largest_mm: float
    freezes: int
    jumps_back: int
    slip_mm: float
    """The 98th percentile of how far the tool's middle is from its place in the hand."""


def mix(first: Pose, second: Pose, share: float) -> Pose:
    """Between two poses or beyond: straight, and about one axis."""
    turn = turned(first[1], share * turns_between(first[1], second[1]))
    return first[0] + share * (second[0] - first[0]), normalise(turn)


def mirror(arrivals: Arrivals, frames: np.ndarray) -> list[Pose]:
    """Snapshot interpolation with dynamic adjustment."""
    interval, buffer, shown = 1.0 / RATE, [], []
    local, scale, multiple, last_arrival = 0.0, 1.0, 2.0, None
    drift, taken, came = _Average(RATE), _Average(2.0 * RATE), 0
    for frame, now in enumerate(frames):
        while came < len(arrivals) and arrivals[came][0] <= now:
            arrival, sent, pose = arrivals[came]
            came += 1
            if not buffer:
                local = sent - interval * multiple
            at = bisect_right(buffer, sent, key=lambda known: known[0])
            if buffer and (sent < buffer[0][0] or len(buffer) >= 32):
                continue
            buffer.insert(at, (sent, pose))
            if last_arrival is not None:
                taken.add(arrival - last_arrival)
            last_arrival = arrival
            multiple = (interval + taken.deviation) / interval + 1.0
            aim = buffer[-1][0] - interval * multiple
            local = min(max(local, aim - interval * multiple), aim + interval * multiple)
            drift.add(buffer[-1][0] - local)
            off = drift.value - interval * multiple
            scale = 1.02 if off > interval else 0.96 if off < -interval else 1.0
        if not buffer:
            shown.append(arrivals[0][2])
            continue
        local += scale * (frames[frame] - frames[max(frame - 1, 0)])
        at = bisect_right(buffer, local, key=lambda known: known[0])
        if 0 < at < len(buffer):
            (begin, first), (end, second) = buffer[at - 1 : at + 1]
            shown.append(mix(first, second, (local - begin) / (end - begin)))
        else:
            shown.append(buffer[max(at - 1, 0)][1])
        del buffer[: max(at - 1, 0)]
    return shown


class _Average:
    """An exponential moving average over so many values, and the deviation from it."""

    def __init__(self, count: float) -> None:
        self._part = 2.0 / (count + 1.0)
        self.value, self._variance, self._begun = 0.0, 0.0, False

    def add(self, value: float) -> None:
        if not self._begun:
            self.value, self._begun = value, True
            return
        delta = value - self.value
        self.value += self._part * delta
        self._variance = (1.0 - self._part) * (self._variance + self._part * delta * delta)

    @property
    def deviation(self) -> float:
        return float(np.sqrt(self._variance))


def netcode(arrivals: Arrivals, frames: np.ndarray) -> list[Pose]:
    """Lerp of lerp."""
    offset = float(np.mean([arrival - sent for arrival, sent, _ in arrivals])) + 0.05 + 1.0 / RATE
    waiting, came, newest = [], 0, -np.inf
    start = end = (0.0, arrivals[0][2])
    current, shown, before = arrivals[0][2], [], frames[0]
    for now in frames:
        while came < len(arrivals) and arrivals[came][0] <= now:
            _, sent, pose = arrivals[came]
            came += 1
            if sent > newest:
                newest = sent
                waiting.append((sent, pose))
        render = now - offset
        while waiting and render >= end[0]:
            start, end = end, waiting.pop(0)
        span = end[0] - start[0]
        share = max((render - start[0]) / span, 0.0) if span > 0.0 else 1.0
        aim = mix(start[1], end[1], share if share <= 3.0 else 1.0)
        current = mix(current, aim, min((now - before) / 0.1, 1.0))
        before = now
        shown.append(current)
    return shown


def godot(arrivals: Arrivals, frames: np.ndarray) -> list[Pose]:
    """The newest at each physics tick, and between the last two ticks."""
    came, newest, ticks = 0, -np.inf, []
    pose = arrivals[0][2]
    for tick in np.arange(frames[0] - 2.0 * TICK, frames[-1] + TICK, TICK):
        while came < len(arrivals) and arrivals[came][0] <= tick:
            _, sent, arrived = arrivals[came]
            came += 1
            if sent > newest:
                newest, pose = sent, arrived
        ticks.append((tick, pose))
    shown = []
    for now in frames:
        at = bisect_right(ticks, now, key=lambda known: known[0]) - 1
        (_, first), (moment, second) = ticks[at - 1 : at + 1]
        shown.append(mix(first, second, (now - moment) / TICK))
    return shown


ENGINES: dict[str, Callable[[Arrivals, np.ndarray], list[Pose]]] = {
    "Mirror": mirror,
    "Netcode for GameObjects": netcode,
    "Godot": godot,
}


def truth_of(times: np.ndarray, hand: Poses) -> Path:
    """The hand (n,) and the tool in it, as two joints."""
    tool = Poses(hand.positions + rotate(hand.quaternions, GRIP), hand.quaternions)
    turns = align_signs(np.stack((hand.quaternions, tool.quaternions)))
    return Path(times - times[0], Poses(np.stack((hand.positions, tool.positions)), turns))


def by_engine(engine: str, truth: Path, way: Way, frames: np.ndarray) -> Poses:
    """What an engine shows at each frame (n,), shape (2, n)."""
    rng, shown = np.random.default_rng(7), []
    sent = np.arange(0.0, truth.moments[-1], 1.0 / RATE)
    poses = truth.at(sent)
    for body in range(2):
        come = [
            (way.arrival(time, rng), time, (poses.positions[body, row], poses.quaternions[body, row]))
            for row, time in enumerate(sent.tolist())
        ]
        come = sorted((one for one in come if np.isfinite(one[0])), key=lambda one: one[0])
        shown.append(ENGINES[engine](come, frames))
    return Poses(np.array([[p for p, _ in own] for own in shown]), np.array([[q for _, q in own] for own in shown]))


def by_codec(truth: Path, way: Way, frames: np.ndarray, tolerance: float, delay: float) -> tuple[Poses, float]:
    """What a receiver shows of one sender of both bodies, and the bytes a second with headers."""
    rng = np.random.default_rng(7)
    bodies = [Body.rigid("hand", radius=RADIUS), Body.rigid("tool", radius=RADIUS)]
    sender, receiver = Sender(bodies, tolerance, delay), Receiver()
    pending, count, size = [], 0, 0
    first = truth.at(frames[:1])[:, 0]
    samples, shown = truth.at(truth.moments), []

    def post(datagrams: list[bytes], now: float, back: bool = False) -> None:
        nonlocal count, size
        for datagram in datagrams:
            size += 0 if back else len(datagram) + 28
            count += 1
            if np.isfinite(arrival := way.arrival(now, rng)):
                heapq.heappush(pending, (arrival, count, back, datagram))

    def come(until: float) -> None:
        while pending and pending[0][0] <= until:
            now, _, back, datagram = heapq.heappop(pending)
            if back:
                post(sender.hear(datagram, now), now)
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
                first = Poses(
                    np.concatenate([part.positions for part in it.poses.values()]),
                    np.concatenate([part.quaternions for part in it.poses.values()]),
                )
            shown.append(first)
        else:
            post(sender.add(now, samples[:, row]), now)
    poses = Poses(
        np.stack([own.positions for own in shown], axis=1), np.stack([own.quaternions for own in shown], axis=1)
    )
    return poses, size / float(truth.moments[-1])


def seen(shown: Poses, truth: Path, frames: np.ndarray) -> Seen:
    """Compare what was shown at frames (n,) with the truth."""
    kept = frames > SETTLED
    shown, frames = shown[:, kept], frames[kept]
    errors = [shell_error(shown[0], truth.at(frames - lag)[0], RADIUS) for lag in LAGS]
    best = int(np.argmin([rms(own) for own in errors]))
    true = truth.at(frames - LAGS[best])[0].positions
    went, goes = np.diff(shown[0].positions, axis=0), np.diff(true, axis=0)
    true_speed = np.linalg.norm(goes, axis=-1)
    moving = true_speed * FPS > MOVES
    stands = moving & (np.linalg.norm(went, axis=-1) < STANDS * true_speed)
    along = np.einsum("ij,ij->i", went, goes) / np.maximum(true_speed, 1e-9)
    runs = np.diff(np.flatnonzero(np.diff(np.concatenate(((0,), stands.astype(int), (0,))))))[::2]
    hand, tool = shown[0], shown[1]
    slips = np.linalg.norm(rotate(conjugate(hand.quaternions), tool.positions - hand.positions) - GRIP, axis=-1)
    return Seen(
        delay=float(LAGS[best]),
        rms_mm=1e3 * rms(errors[best]),
        p98_mm=1e3 * float(np.percentile(errors[best], 98.0)),
        largest_mm=1e3 * float(errors[best].max()),
        freezes=int(np.sum(runs >= FROZEN * FPS)),
        jumps_back=int(np.sum(moving & (along < -BACK))),
        slip_mm=1e3 * float(np.percentile(slips, 98.0)),
    )
