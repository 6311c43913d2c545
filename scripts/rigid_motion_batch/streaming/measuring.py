"""Measuring a stream's cost: bytes and errors of a recording sent over loopback to a receiver in another process.

The receiver knows nothing of the recording except when its display draws: once for every sample, one delay after it.
Both processes use the clock of the recording, which stands still while they work, so a busy machine does not change the
results.

Errors are the largest displacement of any point of the joints' balls, at the moments shown. Bytes per second count the
motion without the bytes for joining. Slip is the distance of any point of a held body's ball from its mean place in its
holder, as in `analysis.held`.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from struct import Struct

import numpy as np

from rigid_motion.live.sockets import Address, Outlet, Port
from rigid_motion.motion import Poses, rms, shell_error
from rigid_motion.motion.poses import joined
from rigid_motion.motion.quaternions import normalise
from rigid_motion.streams import Receiver, Sender, StreamBody
from rigid_motion.streams.bodies import Forest
from rigid_motion.streams.paths import KnotPath
from rigid_motion.streams.wire import Description, read
from rigid_motion_batch.analysis.held import mean_pose, seen_from

from .sending import Hand, even_rate

LOOPBACK = "127.0.0.1"

HEADER_BYTES = 28
"""Bytes of UDP and IPv4 in front of every datagram."""

PATIENCE_S = 30.0
"""How long to wait for the other process, in seconds."""

ARRIVAL = Struct("<d")
"""The header of every datagram: its arrival time by the clock of the recording."""


def measure(
    bodies: Sequence[StreamBody],
    times: np.ndarray,
    poses: Poses,
    tolerance: float,
    delay: float,
    loss: float = 0.0,
    seed: int = 1,
    held: Sequence[tuple[str, Hand]] = (),
) -> tuple[dict[str, float], KnotPath]:
    """Send samples (n,) of poses (joints, n) of all bodies, and return the cost and the motion shown (joints,).

    Datagrams arrive at once, and a fraction `loss` of them is lost, in both directions. `joining_bytes`, with headers,
    are the bytes of descriptions: names, parents and rest poses. `answers_a_second` also counts bytes with headers.

    Raises
    ------
    OSError
        If there is no loopback.
    RuntimeError
        If the other process ended.
    """
    sender, random = Sender(bodies, tolerance, delay, even_rate(times)), np.random.default_rng(seed)
    for tool, hand in held:
        sender.hold(tool, *hand)
    sent, lost, answers = list[bytes](), list[bytes](), list[bytes]()
    with Port(LOOPBACK) as port, ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as processes:
        receiving = processes.submit(_run_receiver, port.number, times, delay, [body.name for body in bodies])
        _, receiver = _next_datagram(port)

        def say(datagrams: list[bytes], now: float) -> None:
            for datagram in datagrams:
                sent.append(datagram)
                if random.random() < loss:
                    lost.append(datagram)
                    continue
                port.send(ARRIVAL.pack(now) + datagram, receiver)
                answer, _ = _next_datagram(port)
                if answer:
                    answers.append(answer)
                if answer and random.random() >= loss:
                    say(sender.take_answer(answer, now), now)

        try:
            for sample, moment in enumerate(times.tolist()):
                while (due := sender.next) < moment:
                    say(sender.poll(due), due)
                say(sender.add(moment, poses[:, sample]), moment)
            say(sender.finish(), float(times[-1]))
        finally:
            port.send(ARRIVAL.pack(np.inf), receiver)
        frames = receiving.result(PATIENCE_S)
    if not frames:
        raise RuntimeError("nothing was shown: no datagram came through")
    moments, first = np.unique([moment for moment, _ in frames], return_index=True)
    drawn = joined([frames[row][1][:, None] for row in first.tolist()], axis=1)
    shown = KnotPath(moments, Poses(drawn.positions, normalise(drawn.quaternions)))
    off = Forest(bodies).errors(shown.poses, KnotPath(times, poses).at(moments)).max(axis=0)
    seconds = float(times[-1] - times[0])
    joining = [datagram for datagram in sent if isinstance(read(datagram), Description)]
    joining_bytes, motions = sum(map(len, joining)), len(sent) - len(joining)
    return {
        "seconds": seconds,
        "datagrams": len(sent),
        "lost": len(lost),
        "joining_bytes": joining_bytes + HEADER_BYTES * len(joining),
        "answers_a_second": (sum(map(len, answers)) + HEADER_BYTES * len(answers)) / seconds,
        "share_within_tolerance": float(np.mean(off <= tolerance)),
        "share_within_20_mm": float(np.mean(off <= 0.02)),
        **cost((sum(map(len, sent)) - joining_bytes) / seconds, HEADER_BYTES * motions / seconds, off),
    }, shown


def measure_held(
    bodies: Sequence[StreamBody],
    times: np.ndarray,
    poses: Poses,
    tolerance: float,
    delay: float,
    loss: float,
    tool: str,
    hand: Hand,
) -> dict[str, dict[str, float]]:
    """Return the cost of a tool and its holder, and how far the tool slips, for each way to send them. The arguments
    are those of `measure`. The last entry is the cost of the holder alone, as exact at the tool.

    Raises ValueError if there are no such bodies.
    """
    Sender(bodies).hold(tool, *hand)  # Raises ValueError if they do not fit.
    forest = Forest(bodies)
    pair = [bodies[forest.body(name)] for name in (hand[0], tool)]
    forest, poses = Forest(pair), joined([forest.parted(poses)[body.name] for body in pair])
    joint, root = forest.joint(*hand), len(pair[0].joints)
    radius = float(forest.radii[root])

    def place(shown: Poses) -> Poses:
        """Return the tool's pose in the hand (n,), from poses (joints, n)."""
        there = forest.skeleton.in_root_space(shown)
        return seen_from(there[joint], there[root])

    true = place(poses)
    mean = mean_pose(true)

    def sent(
        which: Sequence[StreamBody], seed: int = 1, held: Sequence[tuple[str, Hand]] = ()
    ) -> tuple[float, KnotPath]:
        own = joined([forest.parted(poses)[body.name] for body in which])
        numbers, shown = measure(which, times, own, tolerance, delay, loss, seed, held)
        return numbers["bytes_a_second_with_headers"], shown

    def result(size: float, *shown: KnotPath) -> dict[str, float]:
        seen = times[times >= max(path.moments[0] for path in shown)]
        off = shell_error(
            place(joined([path.at(seen) for path in shown])), mean[np.zeros(len(seen), dtype=int)], radius
        )
        return {"bytes_a_second_with_headers": size, "slip_mm": 1000.0 * float(off.max())}

    (first, of_hand), (second, of_tool) = (sent([body], seed) for seed, body in enumerate(pair, 1))
    radii = np.array(pair[0].radius)
    radii[joint] = max(radii[joint], float(np.linalg.norm(true.positions, axis=1).max()) + radius)
    return {
        "two streams": result(first + second, of_hand, of_tool),
        "one stream, the tool in the world": result(*sent(pair)),
        "one stream, the tool in the hand": result(*sent(pair, held=[(tool, hand)])),
        "the hand alone, as exact at the tool": {
            "bytes_a_second_with_headers": sent([replace(pair[0], radius=radii)])[0]
        },
    }


def cost(size: float, headers: float, off: np.ndarray) -> dict[str, float]:
    """Return the reported numbers, from bytes per second, header bytes per second, and errors (n,) in metres."""
    return {
        "bytes_a_second": size,
        "bytes_a_second_with_headers": size + headers,
        "rms_mm": 1000.0 * rms(off),
        "largest_mm": 1000.0 * float(off.max()),
    }


def _next_datagram(port: Port) -> tuple[bytes, Address]:
    if came := port.received(PATIENCE_S):
        return came[0]
    raise RuntimeError(f"the receiver's process did not answer within {PATIENCE_S:g} s")


def _run_receiver(to: int, times: np.ndarray, delay: float, names: Sequence[str]) -> list[tuple[float, Poses]]:
    """Show the motion received from a port one delay after each sample, send answers, and return the moments and poses
    (joints,) of the named bodies.
    """
    receiver, frames, draws = Receiver(), list[tuple[float, Poses]](), (times + delay).tolist()
    with Outlet(LOOPBACK, to) as outlet:
        outlet.say(b"")
        while draws:
            data, _ = outlet.received(PATIENCE_S)[0]
            (arrival,) = ARRIVAL.unpack_from(data)
            while draws and draws[0] <= arrival:
                # Nothing is shown if the motion of that moment was over when the first datagram came.
                for shown in receiver.show(draws.pop(0)).values():
                    frames.append((shown.moment, joined([shown.poses[name] for name in names])))
            receiver.take(data[ARRIVAL.size :], arrival, to)
            outlet.say(b"".join(answer for _, answer in receiver.answers()))
    return frames
