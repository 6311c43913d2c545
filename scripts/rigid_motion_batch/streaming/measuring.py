"""What a stream costs: a recording sent over loopback, and what a receiver in another process shows.

The receiver has a socket, and knows nothing of the recording but when its display draws: once for every sample, at the
moment at which that sample is to be shown. Both processes go by the clock of the recording, which stands still while
they work: what is measured does not depend on how busy the machine is.
"""

from __future__ import annotations

import heapq
import multiprocessing
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from rigid_motion.motion import Poses, rms, shell_error
from rigid_motion.motion.quaternions import normalise
from rigid_motion.streams import Body, Receiver, Sender
from rigid_motion.streams.bodies import Forest
from rigid_motion.streams.paths import Path

from .transports import HEADERS, LOOPBACK, Counted, Udp

PATIENCE = 30.0
"""Seconds in which the other process has to be there."""

AFTER = 0.5
"""Seconds for which the receiver goes on behind the last sample, beside the delay."""


@dataclass(frozen=True)
class Link:
    """What a network does to datagrams, in both directions."""

    latency: float = 0.0
    jitter: float = 0.0
    """Seconds up to which one takes longer than that."""
    loss: float = 0.0


@dataclass(frozen=True)
class Cost:
    """What came out. Bytes a second are of the motion, without what joining takes."""

    seconds: float
    datagrams: int
    lost: int
    joining_bytes: int
    """The bytes of descriptions: names, parents and rest poses; with headers."""
    bytes_a_second: float
    """Without headers of UDP and IP."""
    bytes_a_second_with_headers: float
    answers_a_second: float
    rms_mm: float
    largest_mm: float
    share_within_tolerance: float
    share_within_20_mm: float
    delay_s: float
    """By which the picture was behind."""


@dataclass(frozen=True, eq=False)
class Measured:
    """What it cost, and what was shown."""

    cost: Cost
    shown: Poses
    """At the moments of the samples, shape (joints, n)."""
    errors: np.ndarray
    """The error of every joint at every sample that was shown, in metres; NaN before the first picture. Shape
    (joints, n)."""


def measure(
    body: Body,
    times: np.ndarray,
    poses: Poses,
    tolerance: float,
    delay: float,
    link: Link = Link(),
    answers: bool = True,
    seed: int = 1,
) -> Measured:
    """Send samples (n,) of a body's poses (joints, n), and measure what is shown of them.

    Raises
    ------
    OSError
        Where there is no loopback.
    RuntimeError
        Where the other process ended.
    """
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_receive, args=(there, times, answers), daemon=True)
    process.start()
    there.close()
    try:
        port = _answer(here)
        with Udp((LOOPBACK, port)) as socket:
            wire = Counted(socket)
            sender = Sender([body], tolerance, delay, even_rate(times))
            _send(_Link(wire, socket, here, link, seed), sender, times, poses, delay + link.latency + AFTER)
            here.send(None)
        received = _answer(here)
    finally:
        here.close()
        process.join(AFTER)
        process.terminate()
    return _measured(body, times, poses, tolerance, wire, received)


def _answer(pipe: Connection) -> Any:
    try:
        if not pipe.poll(PATIENCE):
            raise RuntimeError(f"the receiver's process did not answer within {PATIENCE:g} s")
        return pipe.recv()
    except EOFError:
        raise RuntimeError("the receiver's process ended") from None


class _Link:
    """The way to the receiver's process and back: datagrams over UDP, and by a pipe what time it is."""

    def __init__(self, wire: Counted, socket: Udp, pipe: Connection, link: Link, seed: int) -> None:
        self._wire, self._socket, self._pipe, self._link = wire, socket, pipe, link
        self._random = np.random.default_rng(seed)
        self._on_the_way: list[tuple[float, int, bytes, bool]] = []
        self._count = 0

    def post(self, datagram: bytes, now: float, back: bool = False) -> None:
        """Give a datagram to the link, to the receiver or back."""
        if not back:
            self._wire.count(datagram)
        if self._random.random() < self._link.loss:
            self._wire.lost += not back
            return
        takes = self._link.latency + self._link.jitter * self._random.random()
        self._count += 1
        heapq.heappush(self._on_the_way, (now + takes, self._count, datagram, back))

    def until(self, now: float) -> Iterator[tuple[float, bytes]]:
        """Let come what comes by a time: what is for the receiver goes there, what comes back is returned."""
        while self._on_the_way and self._on_the_way[0][0] <= now:
            arrival, _, datagram, back = heapq.heappop(self._on_the_way)
            if back:
                yield arrival, datagram
                continue
            self._wire.send(datagram)
            self._pipe.send(arrival)
            for _ in range(_answer(self._pipe)):
                for answer in self._socket.awaited(PATIENCE):
                    self.post(answer, arrival, back=True)


def _send(link: _Link, sender: Sender, times: np.ndarray, poses: Poses, after: float) -> None:
    """Play samples, by the clock of the recording."""

    def hear(now: float) -> None:
        for arrival, answer in link.until(now):
            post(sender.hear(answer, arrival), arrival)

    def post(datagrams: list[bytes], now: float) -> None:
        for datagram in datagrams:
            link.post(datagram, now)

    for sample, moment in enumerate(times.tolist()):
        while (due := sender.next) < moment:
            hear(due)
            post(sender.poll(due), due)
        hear(moment)
        post(sender.add(moment, poses[:, sample]), moment)
        hear(moment)
    post(sender.finish(), float(times[-1]))
    hear(float(times[-1]) + after)


def _receive(pipe: Connection, times: np.ndarray, answers: bool) -> None:
    """Show what comes, in a process of its own: whenever a sample's moment is due, draw."""
    receiver, frames = Receiver(), list[tuple[Any, ...] | None]()
    answered, now = 0, float(times[0])

    def draw(until: float) -> None:
        due = now
        while len(frames) < len(times):
            following = times[len(frames)]
            due = max(due, min((receiver.due(stream, following) for stream in receiver.streams), default=np.inf))
            if due > until:
                return
            # Nothing where the motion of that moment was over when the first datagram came.
            shown = next(iter(receiver.show(due).values()), None)
            frames.append((shown.moment, due - shown.moment, *shown.poses.values()) if shown else None)

    with Udp() as socket:
        pipe.send(socket.port)
        while (arrival := pipe.recv()) is not None:
            draw(arrival)
            for datagram in socket.awaited(PATIENCE):
                receiver.take(datagram, arrival, LOOPBACK)
            now = max(now, arrival)
            replies = [answer for _, answer in receiver.answers()] if answers else []
            for answer in replies:
                socket.send(answer)
                answered += HEADERS + len(answer)
            pipe.send(len(replies))
        draw(np.inf)
    drawn = [frame for frame in frames if frame]
    moments, lags = (np.array([frame[number] for frame in drawn]) for number in (0, 1))
    positions = np.array([frame[2].positions for frame in drawn])
    quaternions = np.array([frame[2].quaternions for frame in drawn])
    pipe.send((moments, positions, quaternions, lags, answered))


def even_rate(times: np.ndarray) -> float | None:
    """Return samples a second, where they are even."""
    rate = 1.0 / float(np.median(np.diff(times)))
    return float(round(rate)) if abs(rate - round(rate)) < 0.01 else None


def straight(times: np.ndarray, poses: Poses) -> Path:
    """Return samples (joints, n) with the straight way between them."""
    still = np.zeros((poses.shape[0], 3))
    return Path(times, poses.positions.swapaxes(0, 1), poses.quaternions.swapaxes(0, 1), still, still)


def _measured(
    body: Body, times: np.ndarray, poses: Poses, tolerance: float, wire: Counted, received: tuple
) -> Measured:
    """Compare what was shown with what was recorded."""
    moments, positions, quaternions, lags, answered = received
    if not len(moments):
        raise RuntimeError("nothing was shown: no datagram came through")
    moments, first = np.unique(moments, return_index=True)
    still = np.zeros_like(positions[0])
    shown = Path(moments, positions[first], normalise(quaternions[first]), still, still).at(times)
    forest = Forest([body])
    skeleton = forest.skeleton
    errors = shell_error(skeleton.in_root_space(shown), skeleton.in_root_space(poses), forest.radii[:, None])
    errors[:, times < moments[0] - 1e-6] = np.nan
    drawn = np.nanmax(errors[:, times >= moments[0] - 1e-6], axis=0)
    seconds = float(times[-1] - times[0])
    motion = wire.datagrams - wire.joining_datagrams, wire.bytes - wire.joining_bytes
    cost = Cost(
        seconds=seconds,
        datagrams=wire.datagrams,
        lost=wire.lost,
        joining_bytes=wire.joining_bytes + HEADERS * wire.joining_datagrams,
        bytes_a_second=motion[1] / seconds,
        bytes_a_second_with_headers=(motion[1] + HEADERS * motion[0]) / seconds,
        answers_a_second=answered / seconds,
        rms_mm=1000.0 * rms(drawn),
        largest_mm=1000.0 * float(drawn.max()),
        share_within_tolerance=float(np.mean(drawn <= tolerance)),
        share_within_20_mm=float(np.mean(drawn <= 0.02)),
        delay_s=float(np.median(lags)),
    )
    return Measured(cost, shown, errors)
