"""What a stream costs: a recording sent over loopback, and what a receiver in another process shows of it.

The receiver has a socket, and knows nothing of the recording but when its display draws: once for every sample, a delay
after it. Both processes go by the clock of the recording, which stands still while they work: what is measured does not
depend on how busy the machine is.

Beside it stands what else one would send of a body: every joint, at an even rate, as floats or as the smallest three
components. A receiver goes straight from one to the next. Errors are the largest displacement of any point of the
joints' balls, at every sample; bytes a second are those of the motion, without what joining takes.
"""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
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

PATIENCE = 30.0
"""Seconds in which the other process has to answer."""

ARRIVAL = Struct("<d")
"""In front of every datagram: by the clock of the recording."""

WAYS: dict[str, tuple[float, int | None]] = {
    "float32 at 30 Hz": (30.0, None),
    "smallest three (32 bits) at 20 Hz": (20.0, 10),
    "29 bits at 30 Hz": (30.0, 9),
    "29 bits at 12 Hz": (12.0, 9),
}
"""How often all joints are sent, and the bits of each component of a quaternion; None for floats."""

STAMP = 5
"""Bytes of a datagram that say whose it is, and when: as few as will do."""

PLACE_BITS, CUBE = 16, 8.0
"""The bits of each coordinate of a place that is packed, over a cube of so many metres."""


def measure(
    body: Body, times: np.ndarray, poses: Poses, tolerance: float, delay: float, loss: float = 0.0, seed: int = 1
) -> tuple[dict[str, float], Poses]:
    """Send samples (n,) of a body's poses (joints, n), and return what it costs and what is shown at their moments.

    Datagrams take no time, and a part of them never arrives, in both directions. `joining_bytes`, with headers, are
    those of descriptions: names, parents and rest poses. `answers_a_second` are bytes with headers, too.

    Raises
    ------
    OSError
        Where there is no loopback.
    RuntimeError
        Where the other process ended.
    """
    sender, random = Sender([body], tolerance, delay, even_rate(times)), np.random.default_rng(seed)
    sent, lost, answers = list[bytes](), list[bytes](), list[bytes]()
    with Port(LOOPBACK) as port, ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as processes:
        receiving = processes.submit(_receive, port.number, times, delay)
        _, receiver = _received(port)

        def say(datagrams: list[bytes], now: float) -> None:
            for datagram in datagrams:
                sent.append(datagram)
                if random.random() < loss:
                    lost.append(datagram)
                    continue
                port.send(ARRIVAL.pack(now) + datagram, receiver)
                answer, _ = _received(port)
                if answer:
                    answers.append(answer)
                if answer and random.random() >= loss:
                    say(sender.hear(answer, now), now)

        try:
            for sample, moment in enumerate(times.tolist()):
                while (due := sender.next) < moment:
                    say(sender.poll(due), due)
                say(sender.add(moment, poses[:, sample]), moment)
            say(sender.finish(), float(times[-1]))
        finally:
            port.send(ARRIVAL.pack(np.inf), receiver)
        frames = receiving.result(PATIENCE)
    if not frames:
        raise RuntimeError("nothing was shown: no datagram came through")
    moments, first = np.unique([moment for moment, _ in frames], return_index=True)
    drawn = joined([frames[row][1][:, None] for row in first.tolist()], axis=1)
    shown = Path(moments, Poses(drawn.positions, normalise(drawn.quaternions))).at(times)
    compared = times >= moments[0] - 1e-6
    off = body.errors(shown[:, compared], poses[:, compared]).max(axis=0)
    seconds = float(times[-1] - times[0])
    joining = [datagram for datagram in sent if isinstance(read(datagram), Description)]
    joining_bytes, motions = sum(map(len, joining)), len(sent) - len(joining)
    return {
        "seconds": seconds,
        "datagrams": len(sent),
        "lost": len(lost),
        "joining_bytes": joining_bytes + HEADERS * len(joining),
        "answers_a_second": (sum(map(len, answers)) + HEADERS * len(answers)) / seconds,
        "share_within_tolerance": float(np.mean(off <= tolerance)),
        "share_within_20_mm": float(np.mean(off <= 0.02)),
        **_cost((sum(map(len, sent)) - joining_bytes) / seconds, HEADERS * motions / seconds, off),
    }, shown


def _cost(size: float, headers: float, off: np.ndarray) -> dict[str, float]:
    """Return what all ways have, of bytes a second, those of headers, and errors (n,) in metres."""
    return {
        "bytes_a_second": size,
        "bytes_a_second_with_headers": size + headers,
        "rms_mm": 1000.0 * rms(off),
        "largest_mm": 1000.0 * float(off.max()),
    }


def _received(port: Port) -> tuple[bytes, Address]:
    if came := port.received(PATIENCE):
        return came[0]
    raise RuntimeError(f"the receiver's process did not answer within {PATIENCE:g} s")


def _receive(to: int, times: np.ndarray, delay: float) -> list[tuple[float, Poses]]:
    """Show what comes from a port a delay behind each sample, answer, and return the moments and poses (joints,)."""
    receiver, frames, draws = Receiver(), list[tuple[float, Poses]](), (times + delay).tolist()
    with Outlet(LOOPBACK, to) as outlet:
        outlet.say(b"")
        while draws:
            data, _ = outlet.received(PATIENCE)[0]
            (arrival,) = ARRIVAL.unpack_from(data)
            while draws and draws[0] <= arrival:
                # Nothing where the motion of that moment was over when the first datagram came.
                for shown in receiver.show(draws.pop(0)).values():
                    frames += [(shown.moment, poses) for poses in shown.poses.values()]
            receiver.take(data[ARRIVAL.size :], arrival, to)
            outlet.say(b"".join(answer for _, answer in receiver.answers()))
    return frames


def packed(body: Body, times: np.ndarray, poses: Poses) -> dict[str, dict[str, float]]:
    """Return what each way costs of samples (n,) of poses (joints, n), and how far off they are."""
    result, sliding, step = {}, np.asarray(body.sliding), CUBE / (2**PLACE_BITS - 1)
    for label, (rate, bits) in WAYS.items():
        moments = np.arange(times[0], times[-1] + 1.0 / rate, 1.0 / rate)
        # Floats are as good as exact.
        sent, turn, place = Path(times, poses).at(np.minimum(moments, times[-1])), 4 * 32, 3 * 32
        if bits:
            turn, place = 2 + 3 * bits, 3 * PLACE_BITS
            rounded = np.where(sliding[:, None, None], np.rint(sent.positions / step) * step, sent.positions)
            sent = Poses(rounded, smallest_three(sent.quaternions, bits))
        size = -(-(len(body.joints) * turn + np.count_nonzero(sliding) * place) // 8)
        off = body.errors(Path(moments, sent).at(times), poses).max(axis=0)
        result[label] = _cost(rate * size, rate * (STAMP + HEADERS), off)
    return result


def smallest_three(quaternions: np.ndarray, bits: int) -> np.ndarray:
    """Return unit quaternions (..., 4) as they come back from three components of so many bits each."""
    largest = np.argmax(np.abs(quaternions), axis=-1)[..., None]
    step = np.sqrt(2.0) / (2**bits - 2)
    rounded = np.rint(quaternions / step) * step
    np.put_along_axis(rounded, largest, 0.0, axis=-1)
    rest = np.sqrt(np.maximum(1.0 - np.sum(rounded**2, axis=-1, keepdims=True), 0.0))
    rest = np.copysign(rest, np.take_along_axis(quaternions, largest, axis=-1))
    np.put_along_axis(rounded, largest, rest, axis=-1)
    return rounded
