"""What a stream costs: a recording sent over loopback, and what a receiver in another process shows.

The receiver has a socket, and knows nothing of the recording but when its display draws: once for every sample, at the
moment at which that sample is to be shown. Both processes go by the clock of the recording, which stands still while
they work: what is measured does not depend on how busy the machine is.
"""

from __future__ import annotations

import heapq
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from struct import Struct

import numpy as np

from rigid_motion.live.sockets import Address, Outlet, Port
from rigid_motion.motion import Poses, rms
from rigid_motion.motion.poses import joined
from rigid_motion.motion.quaternions import normalise
from rigid_motion.streams import Body, Receiver, Sender
from rigid_motion.streams.paths import Path
from rigid_motion.streams.wire import Description, read

from .sending import even_rate

LOOPBACK = "127.0.0.1"

HEADERS = 28
"""Bytes of UDP and IPv4 in front of every datagram."""

PATIENCE, AFTER = 30.0, 0.5
"""Seconds in which the other process has to answer; and for which it goes on behind the last sample and the delay."""

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
    with Port(LOOPBACK) as port, ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as processes:
        receiving = processes.submit(_receive, port.number, times, answers)

        def received() -> tuple[bytes, Address]:
            if came := port.received(PATIENCE):
                return came[0]
            raise RuntimeError(f"the receiver's process did not answer within {PATIENCE:g} s")

        def carry(datagram: bytes, arrival: float) -> bytes:
            port.send(ARRIVAL.pack(arrival) + datagram, receiver)
            return received()[0]

        _, receiver = received()
        run = _Run(Sender([body], tolerance, delay, even_rate(times)), carry, link, seed)
        try:
            run.play(times, poses, delay + link.latency + AFTER)
        finally:
            port.send(b"", receiver)
        frames, answered = receiving.result(PATIENCE)
    if not frames:
        raise RuntimeError("nothing was shown: no datagram came through")
    moments, first = np.unique([moment for moment, _, _ in frames], return_index=True)
    drawn = joined([frames[row][2][:, None] for row in first.tolist()], axis=1)
    shown = Path(moments, Poses(drawn.positions, normalise(drawn.quaternions))).at(times)
    compared = times >= moments[0] - 1e-6
    off = body.errors(shown[:, compared], poses[:, compared]).max(axis=0)
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
        delay_s=float(np.median([lag for _, lag, _ in frames])),
    )
    return cost, shown


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
        while self._on_the_way and self._on_the_way[0][0] <= now:
            arrival, _, datagram, back = heapq.heappop(self._on_the_way)
            if back:
                self._post(self._sender.hear(datagram, arrival), arrival)
            elif answer := self._carry(datagram, arrival):
                self._post([answer], arrival, back=True)


def _receive(to: int, times: np.ndarray, answers: bool) -> tuple[list[tuple[float, float, Poses]], int]:
    """Show what comes from a port: whenever a sample's moment is due, draw.

    Returns the moment of each frame, by how much it is behind, and poses (joints,); and the bytes of answers.
    """
    receiver, frames, sample, answered = Receiver(), list[tuple[float, float, Poses]](), 0, 0
    with Outlet(LOOPBACK, to) as outlet:
        outlet.say(b"")
        now = float(times[0])
        while True:
            data = outlet.received(PATIENCE)[0][0]
            arrival = ARRIVAL.unpack_from(data)[0] if data else np.inf
            while sample < len(times) and (due := max(now, receiver.due(times[sample]))) <= arrival:
                now, sample = due, sample + 1
                # Nothing where the motion of that moment was over when the first datagram came.
                for shown in receiver.show(due).values():
                    frames += [(shown.moment, due - shown.moment, poses) for poses in shown.poses.values()]
            if not data:
                return frames, answered
            receiver.take(data[ARRIVAL.size :], arrival, to)
            now, replies = max(now, arrival), receiver.answers() if answers else []
            answered += sum(HEADERS + len(answer) for _, answer in replies)
            outlet.say(b"".join(answer for _, answer in replies))
