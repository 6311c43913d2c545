"""What a stream costs: a recording sent over loopback, and what a receiver in another process shows.

The receiver has a socket, and knows nothing of the recording but when its display draws: once for every sample, at the
moment at which that sample is to be shown. Both processes go by the clock of the recording, which stands still while
they work: what is measured does not depend on how busy the machine is.
"""

from __future__ import annotations

import heapq
import multiprocessing
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from struct import Struct
from typing import Any

import numpy as np

from rigid_motion.live.sockets import Outlet, Port
from rigid_motion.motion import Poses, rms
from rigid_motion.motion.poses import joined
from rigid_motion.motion.quaternions import normalise
from rigid_motion.streams import Body, Receiver, Sender
from rigid_motion.streams.bodies import Forest
from rigid_motion.streams.paths import Path
from rigid_motion.streams.wire import Description, read

from .sending import even_rate

LOOPBACK = "127.0.0.1"

HEADERS = 28
"""Bytes of UDP and IPv4 in front of every datagram."""

PATIENCE, AFTER = 30.0, 0.5
"""Seconds in which the other process has to be there; and for which it goes on behind the last sample and the delay."""

MISSING = f"the receiver's process did not answer within {PATIENCE:g} s"

ARRIVAL = Struct("<d")
"""In front of every datagram: by the clock of the recording."""


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


def measure(
    body: Body,
    times: np.ndarray,
    poses: Poses,
    tolerance: float,
    delay: float,
    link: Link = Link(),
    answers: bool = True,
    seed: int = 1,
) -> tuple[Cost, Poses]:
    """Send samples (n,) of a body's poses (joints, n), and return what it costs and what is shown at their moments.

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
        with Outlet(LOOPBACK, _given(here)) as outlet:

            def carry(datagram: bytes, arrival: float) -> bytes:
                outlet.say(ARRIVAL.pack(arrival) + datagram)
                for answer, _ in outlet.received(PATIENCE):
                    return answer
                raise RuntimeError(MISSING)

            run = _Run(Sender([body], tolerance, delay, even_rate(times)), carry, link, seed)
            run.play(times, poses, delay + link.latency + AFTER)
            outlet.say(b"")
            moments, drawn, lags, answered = _given(here)
    finally:
        here.close()
        process.join(AFTER)
        process.terminate()
    if not len(moments):
        raise RuntimeError("nothing was shown: no datagram came through")
    moments, first = np.unique(moments, return_index=True)
    shown = Path(moments, Poses(drawn.positions[:, first], normalise(drawn.quaternions[:, first]))).at(times)
    compared = times >= moments[0] - 1e-6
    off = errors(body, shown[:, compared], poses[:, compared]).max(axis=0)
    seconds = float(times[-1] - times[0])
    joining = [datagram for datagram in run.sent if isinstance(read(datagram), Description)]
    joining_bytes = sum(map(len, joining))
    a_second = (sum(map(len, run.sent)) - joining_bytes) / seconds
    cost = Cost(
        seconds=seconds,
        datagrams=len(run.sent),
        lost=run.lost,
        joining_bytes=joining_bytes + HEADERS * len(joining),
        bytes_a_second=a_second,
        bytes_a_second_with_headers=a_second + HEADERS * (len(run.sent) - len(joining)) / seconds,
        answers_a_second=answered / seconds,
        rms_mm=1000.0 * rms(off),
        largest_mm=1000.0 * float(off.max()),
        share_within_tolerance=float(np.mean(off <= tolerance)),
        share_within_20_mm=float(np.mean(off <= 0.02)),
        delay_s=float(np.median(lags)),
    )
    return cost, shown


def errors(body: Body, shown: Poses, truth: Poses) -> np.ndarray:
    """Return how far off any point of each joint's ball is at most, of poses (joints, n), shape (joints, n)."""
    forest = Forest([body])
    return forest.errors(shown, forest.skeleton.in_root_space(truth))


def _given(pipe: Connection) -> Any:
    try:
        if pipe.poll(PATIENCE):
            return pipe.recv()
    except EOFError:
        raise RuntimeError("the receiver's process ended") from None
    raise RuntimeError(MISSING)


class _Run:
    """A sender, and a link to what carries datagrams on and returns the answer, in the time of the recording."""

    def __init__(self, sender: Sender, carry: Callable[[bytes, float], bytes], link: Link, seed: int) -> None:
        self._sender, self._carry, self._link = sender, carry, link
        self._random = np.random.default_rng(seed)
        self._on_the_way: list[tuple[float, int, bytes, bool]] = []
        self._count = self.lost = 0
        self.sent: list[bytes] = []
        """All, whether or not they arrive."""

    def play(self, times: np.ndarray, poses: Poses, after: float) -> None:
        """Play samples, by the clock of the recording."""
        for sample, moment in enumerate(times.tolist()):
            while (due := self._sender.next) < moment:
                self._until(due)
                self._post(self._sender.poll(due), due)
            self._until(moment)
            self._post(self._sender.add(moment, poses[:, sample]), moment)
            self._until(moment)
        self._post(self._sender.finish(), float(times[-1]))
        self._until(float(times[-1]) + after)

    def _post(self, datagrams: list[bytes], now: float, back: bool = False) -> None:
        """Give datagrams to the link, to the receiver or back."""
        for datagram in datagrams:
            self.sent += [] if back else [datagram]
            if self._random.random() < self._link.loss:
                self.lost += not back
                continue
            takes = self._link.latency + self._link.jitter * self._random.random()
            self._count += 1
            heapq.heappush(self._on_the_way, (now + takes, self._count, datagram, back))

    def _until(self, now: float) -> None:
        """Let come what comes by a time."""
        while self._on_the_way and self._on_the_way[0][0] <= now:
            arrival, _, datagram, back = heapq.heappop(self._on_the_way)
            if back:
                self._post(self._sender.hear(datagram, arrival), arrival)
            elif answer := self._carry(datagram, arrival):
                self._post([answer], arrival, back=True)


def _receive(pipe: Connection, times: np.ndarray, answers: bool) -> None:
    """Show what comes, in a process of its own: whenever a sample's moment is due, draw."""
    receiver, frames = Receiver(), list[tuple[Any, ...] | None]()
    answered, now = 0, float(times[0])

    def draw(until: float) -> None:
        due = now
        while len(frames) < len(times):
            due = max(due, receiver.due(times[len(frames)]))
            if due > until:
                return
            # Nothing where the motion of that moment was over when the first datagram came.
            shown = next(iter(receiver.show(due).values()), None)
            frames.append((shown.moment, due - shown.moment, *shown.poses.values()) if shown else None)

    with Port() as port:
        pipe.send(port.number)
        while (came := port.received(PATIENCE)[0])[0]:
            data, source = came
            (arrival,) = ARRIVAL.unpack_from(data)
            draw(arrival)
            receiver.take(data[ARRIVAL.size :], arrival, source)
            now, replies = max(now, arrival), receiver.answers() if answers else []
            answered += sum(HEADERS + len(answer) for _, answer in replies)
            port.send(b"".join(answer for _, answer in replies), source)
        draw(np.inf)
    drawn = [frame for frame in frames if frame]
    shown = joined([poses[:, None] for *_, poses in drawn], axis=1) if drawn else None
    pipe.send((np.array([frame[0] for frame in drawn]), shown, [frame[1] for frame in drawn], answered))
