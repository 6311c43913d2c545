"""Writes test vectors of the wire format: datagrams with their decoded contents.

    PYTHONPATH=addon python -m tests.streams.make_vectors

writes tests/streams/vectors.json, for authors of senders and receivers in other languages (docs/wire.md).
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.streams import Receiver, Sender, StreamBody
from rigid_motion.streams.coding import Coder, standard_tables
from rigid_motion.streams.messages import Message
from rigid_motion.streams.wire import WIRE_VERSION

from .links import body, dance

VECTORS = Path(__file__).parent / "vectors.json"
IDENTITY, RECEIVER = bytes((1, 2, 3)), bytes((7, 8, 9))


def coding() -> list[dict]:
    """Return cases of the coder: symbols with their table numbers, or with the size of a flat range; and the bytes."""
    rng, cases, tables = np.random.default_rng(1), [], standard_tables()
    for length in (0, 1, 5, 40):
        encoder, steps = Coder(), []
        for _ in range(length):
            if rng.random() < 0.3:
                count = int(rng.integers(1, 1 << 12))
                steps.append({"flat": count, "symbol": int(rng.integers(count))})
                encoder.flat(count, steps[-1]["symbol"])
            else:
                table = int(rng.integers(len(tables)))
                steps.append({"table": table, "symbol": int(rng.integers(len(tables[table]) - 1))})
                encoder.symbol(table, steps[-1]["symbol"])
        cases.append({"steps": steps, "bytes": encoder.finish().hex()})
    return cases


def noted_of(message: Message) -> dict:
    """Return the contents of a message in whole numbers; `cells` are those of the knots other than the end."""
    said = {name: getattr(message, name) for name in ("back", "end", "start", "finer", "kind")}
    said["holds"] = [list(hold) for hold in message.codec.forest.holds]
    numbers = [own.tolist() for own in message.numbers]
    return said | {"cells": message.cells[1:], "groups": numbers, "memory": list(message.memory)}


def stream() -> dict:
    """Return the datagrams of two bodies for 1.2 seconds, and the contents of each message."""
    own, tool = body(6), StreamBody.rigid("tool", radius=0.1)
    times, poses = dance(own, 1.2, 30.0)
    sender, receiver, messages = Sender([own, tool], rate=30.0), Receiver(), []
    sender.identity, receiver.own = IDENTITY, RECEIVER
    write = sender.codec.write

    def noted(message: Message, base: Message) -> bytes:
        data = write(message, base)
        messages.append(noted_of(message) | {"data": data.hex()})
        return data

    sender.codec.write = noted
    datagrams, answers, polled = [], [], False
    for row, time in enumerate(times.tolist()):
        # The hand takes the tool and lets go of it; then the tool goes far, and then further than the tables can code.
        if row in (5, 12):
            sender.hold(tool.name, own.name if row == 5 else None, own.joints[-1] if row == 5 else None)
        end, away = poses[-1:, row], (0.0, 40.0 * (row > 15) + 9000.0 * (row > 24), 0.0)
        sample = {own.name: poses[:, row], tool.name: Poses(end.positions + away, end.quaternions)}
        # A needed sample does not come.
        overdue = row > 12 and math.isfinite(sender.next) and not polled
        polled, time = polled or overdue, sender.next if overdue else time
        for datagram in sender.poll(time) if overdue else sender.add(time, sample):
            receiver.take(datagram, time)
            datagrams.append({"time": time, "bytes": datagram.hex()})
        for _, answer in receiver.answers():
            answers.append({"time": time, "bytes": answer.hex()})
            sender.take_answer(answer, time)
    (keys,) = receiver.keys()
    return {
        "datagrams": datagrams,
        "messages": messages,
        "answers": answers,
        "moments": keys.moments.tolist(),
        "positions": {name: np.round(part.positions.swapaxes(0, 1), 9).tolist() for name, part in keys.poses.items()},
        "quaternions": {
            name: np.round(part.quaternions.swapaxes(0, 1), 9).tolist() for name, part in keys.poses.items()
        },
    }


if __name__ == "__main__":
    VECTORS.write_text(json.dumps({"version": WIRE_VERSION, "coding": coding(), "stream": stream()}), encoding="utf-8")
