"""Benchmark of a crowded room: each user is a process that sends the codec's datagrams to all others by Zenoh."""

from __future__ import annotations

import json
import multiprocessing
import socket
import struct
import time
from multiprocessing.connection import Connection

import numpy as np

DATAGRAMS_PER_S = 20.0  # datagrams per second of each user
STAMP = struct.Struct("<d")
SETTLING_S = 5.0  # uncounted seconds at the start, in which all users connect


def measured(users: int, seconds: float) -> dict[str, float]:
    """Run a room for this many seconds, and return its figures.

    Processor times are fractions of one processor; `rate` is the number of datagrams heard per second by all.
    """
    context = multiprocessing.get_context("spawn")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        place = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    datagrams, pipes = _datagrams(), []
    for user in (None, *range(users)):
        here, there = context.Pipe()
        context.Process(target=_run_process, args=(there, user, place, datagrams, seconds), daemon=True).start()
        pipes.append(here)
        here.recv()
    start = time.time() + 1.0
    for pipe in pipes:
        pipe.send(start)
    (router, _), *listeners = [pipe.recv() for pipe in pipes]
    for process in multiprocessing.active_children():
        process.join()
    latencies = np.concatenate([latencies for _, latencies in listeners])
    return {
        "users": users,
        "seconds": seconds,
        "bytes": float(np.mean([len(datagram) for datagram in datagrams])),
        "heard": len(latencies),
        "expected": round(users * (users - 1) * DATAGRAMS_PER_S * seconds),
        "rate": len(latencies) / seconds,
        "median_ms": 1e3 * float(np.median(latencies)),
        "p99_ms": 1e3 * float(np.percentile(latencies, 99.0)),
        "router": router / seconds,
        "listeners": sum(spent for spent, _ in listeners) / seconds,
    }


def _datagrams() -> list[bytes]:
    """Return the datagrams of a hand that swings, updated at every sample."""
    from rigid_motion.motion import Poses
    from rigid_motion.streams import Sender, StreamBody

    times = np.arange(400) / DATAGRAMS_PER_S
    sender, result = (
        Sender([StreamBody.rigid("hand")], 0.002, 0.1, DATAGRAMS_PER_S, keepalive=0.9 / DATAGRAMS_PER_S),
        [],
    )
    for moment, position in zip(times.tolist(), np.sin(times[:, None] * (3.0, 4.1, 2.3)), strict=True):
        result += sender.add(moment, Poses(position[None], np.array(((1.0, 0.0, 0.0, 0.0),))))
    return [datagram for datagram in result if len(datagram) < 200]


def _run_process(pipe: Connection, user: int | None, place: str, datagrams: list[bytes], seconds: float) -> None:
    """Run a user, or the router, in a separate process."""
    import zenoh

    role, side = ("router", "listen") if user is None else ("client", "connect")
    config = zenoh.Config()
    for key, value in {
        "mode": role,
        f"{side}/endpoints": [place],
        "scouting/multicast/enabled": False,
        "transport/link/tx/queue/size/data": 16,
    }.items():
        config.insert_json5(key, json.dumps(value))
    taken: list[tuple[float, float]] = []

    def hear(sample: zenoh.Sample) -> None:
        taken.append((time.time(), *STAMP.unpack_from(sample.payload.to_bytes())))

    with zenoh.open(config) as session:
        if user is not None:
            express = {"congestion_control": zenoh.CongestionControl.DROP, "express": True}
            publisher = session.declare_publisher(f"room/{user}/motion", **express)
            session.declare_subscriber("room/*/motion", hear, allowed_origin=zenoh.Locality.REMOTE)
        pipe.send(None)
        start, begun = pipe.recv(), 0.0
        for number in range(round((seconds + SETTLING_S) * DATAGRAMS_PER_S)):
            due = start + (number + (user or 0) / 30.0) / DATAGRAMS_PER_S
            time.sleep(max(due - time.time(), 0.0))
            if number == SETTLING_S * DATAGRAMS_PER_S:
                begun = time.process_time()
            if user is not None:
                publisher.put(STAMP.pack(time.time()) + datagrams[number % len(datagrams)])
        spent = time.process_time() - begun
        time.sleep(2.0)
        times = np.array(taken).reshape(-1, 2)
        pipe.send((spent, (times[:, 0] - times[:, 1])[times[:, 1] >= start + SETTLING_S]))
        time.sleep(2.0)
