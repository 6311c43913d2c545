"""The tables of the coder of streams: how often each symbol occurs, on recordings and on motions of our own.

    python scripts/research stream_tables FOLDER

counts in every body and every single body of the folder and in the generated motions of assets/, at two delays, with
receivers that answer soon, later, and not at all, and writes addon/rigid_motion/streams/tables.py. With --held-out it
writes nothing, and prints what each recording costs by tables that were counted without it, and by the shipped ones.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from math import log2
from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.streams import Body, Receiver, Sender
from rigid_motion.streams.coding import TOTAL
from rigid_motion.streams.messages import Said, State
from rigid_motion.streams.residuals import (
    COUNT,
    FLAGS,
    HISTORIES,
    KNOT_COUNTS,
    NEIGHBOURS,
    SIZES,
    symbols_of,
)
from rigid_motion_batch.cli.stream_measure import body_of, samples_of
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.streaming.measuring import even_rate

ROOT = Path(__file__).resolve().parents[3]

SETTINGS = ((0.1, 0.0), (0.2, 0.0), (0.1, 0.06), (0.1, 0.15), (0.2, 0.15), (0.1, None))
"""Delays, and seconds that a datagram takes; None where nobody answers."""

MOST_SECONDS = 15.0
"""Of a recording, so that long ones do not have all the say."""

RADII = {True: 0.03, False: 0.1}
"""Of the balls of bodies, and of single bodies."""

PRIOR = 12.0
"""What a table without any counts is worth beside them: as the mean over the kinds of knots."""

TABLE_FILE = ROOT / "addon/rigid_motion/streams/tables.py"

Message = tuple
"""A codec, and what it was given."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A motion to count in."""

    name: str
    body: Body
    times: np.ndarray
    poses: Poses


def samples(folder: Path) -> Iterator[Sample]:
    """The motions of a folder, and our own."""
    paths = sorted(path for path in folder.rglob("*") if path.suffix in {".bvh", ".fbx", ".csv", ".tum"})
    for path in [*paths, *sorted((ROOT / "assets").glob("*.csv"))]:
        for clip in read_clips([str(path)])[0]:
            times, poses = samples_of(clip)
            kept = times <= times[0] + MOST_SECONDS
            radius = RADII[clip.rest_body is not None]
            yield Sample(clip.name, body_of(clip, poses, radius), times[kept], poses[:, kept])


def messages(sample: Sample, delay: float, latency: float | None) -> list[Message]:
    """What a sender says of a motion."""
    result: list[Message] = []
    sender, receiver = Sender([sample.body], 0.005, delay, even_rate(sample.times)), Receiver()
    write = sender.codec.write

    def noted(said: Said, kind: int, state: State, is_late: bool) -> tuple:
        result.append((sender.codec, said, kind, state, is_late))
        return write(said, kind, state, is_late)

    sender.codec.write = noted
    on_the_way: list[tuple[float, bytes]] = []
    for number, moment in enumerate(sample.times.tolist()):
        while on_the_way and on_the_way[0][0] <= moment:
            sender.hear(on_the_way.pop(0)[1], moment)
        for datagram in sender.add(moment, sample.poses[:, number]):
            receiver.take(datagram, moment)
        if latency is not None:
            on_the_way += [(moment + 2.0 * latency, answer) for _, answer in receiver.answers()]
    return result


class Counting:
    """A coder that writes nothing, and counts how often each symbol of each table occurs."""

    def __init__(self) -> None:
        self.counts = [[0] * symbols_of(table) for table in range(COUNT)]
        self.raw = 0.0
        """Bits that no table is for."""

    def symbol(self, table: int, value: int) -> int:
        self.counts[table][value] += 1
        return value

    def flat(self, count: int, value: int) -> int:
        self.raw += log2(count)
        return value


def counted(all_messages: list[Message]) -> list[np.ndarray]:
    """How often each symbol of each table occurs."""
    coder = Counting()
    for codec, *message in all_messages:
        codec.through(coder, *message)
    return [np.array(own, dtype=np.float64) for own in coder.counts]


def probabilities(counts: list[np.ndarray]) -> list[np.ndarray]:
    """Of each symbol of each table: what was counted, and beside it what was counted for all kinds of knots."""
    result = []
    for table, own in enumerate(counts):
        if table < FLAGS:
            alike = range(table % (HISTORIES * NEIGHBOURS), FLAGS, HISTORIES * NEIGHBOURS)
        elif table < KNOT_COUNTS:
            alike = range(FLAGS + (table - FLAGS) % (HISTORIES * SIZES), KNOT_COUNTS, HISTORIES * SIZES)
        else:
            alike = [table]
        mean = sum(counts[other] for other in alike) + falling(len(own))
        result.append((own + PRIOR * mean / mean.sum()) / (own.sum() + PRIOR))
    return result


def falling(count: int) -> np.ndarray:
    """What is expected of symbols that were never seen: ever less."""
    return 4.0 * 0.6 ** np.arange(count)


def table_of(probability: np.ndarray) -> list[int]:
    """Cumulative frequencies that add up to `TOTAL`, none of them 0."""
    frequencies = 1 + np.floor(probability * (TOTAL - len(probability))).astype(int)
    frequencies[np.argmax(frequencies)] += TOTAL - frequencies.sum()
    return [0, *np.cumsum(frequencies).tolist()]


def bits(all_messages: list[Message], tables: list[list[int]]) -> float:
    """What messages cost by some tables."""
    counting = Counting()
    for codec, *message in all_messages:
        codec.through(counting, *message)
    cost = sum(
        float(np.dot(counts, -np.log2(np.diff(table) / TOTAL)))
        for counts, table in zip(counting.counts, tables, strict=True)
    )
    return cost + counting.raw


def written(tables: list[list[int]]) -> str:
    rows = "".join(f"    {tuple(table)},\n" for table in tables)
    head = (
        '"""Cumulative frequencies of the coder\'s symbols, in the order of `residuals`: made by stream_tables.py."""'
    )
    return f"{head}\n\n# fmt: off\n# ruff: noqa: E501\nTABLES: tuple[tuple[int, ...], ...] = (\n{rows})\n"


def main(arguments: list[str]) -> int:
    """Count, and write the tables or print what they cost; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--held-out", action="store_true", help="write nothing; tables without each recording in turn")
    options = parser.parse_args(arguments)
    motions, said = [], []
    for motion in samples(options.folder):
        motions.append(motion)
        said.append([messages(motion, *setting) for setting in SETTINGS])
        print(f"{motion.name}: {sum(map(len, said[-1]))} messages", flush=True)
    counts = [counted([message for some in own for message in some]) for own in said]
    whole = [sum(table) for table in zip(*counts, strict=True)]
    if not options.held_out:
        TABLE_FILE.write_text(written([table_of(own) for own in probabilities(whole)]), encoding="utf-8")
        return 0
    shipped = [table_of(own) for own in probabilities(whole)]
    print(
        f"{'bytes of payload a second':28}" + "".join(f"{f'{delay} s, {latency}':>20}" for delay, latency in SETTINGS)
    )
    for motion, own, counts_of_own in zip(motions, said, counts, strict=True):
        without = [table_of(rest) for rest in probabilities([a - b for a, b in zip(whole, counts_of_own, strict=True)])]
        seconds = motion.times[-1] - motion.times[0]
        costs = [tuple(bits(some, tables) / 8 / seconds for tables in (without, shipped)) for some in own]
        print(f"{motion.name:28}" + "".join(f"{f'{a:.0f} (shipped {b:.0f})':>20}" for a, b in costs), flush=True)
    return 0
