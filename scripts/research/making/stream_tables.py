"""Make the symbol tables of the stream coder: frequencies of symbols, on recordings and on generated motions.

    python scripts/research stream_tables FOLDER

counts symbols for every body and single body of the folder, and for the motions of assets/, at two delays, with
receivers that answer soon, later, and not at all, and writes addon/rigid_motion/streams/tables.json.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from research.pages import ROOT
from research.studies import files_in, report
from rigid_motion.motion import Poses
from rigid_motion.streams import Receiver, Sender, StreamBody
from rigid_motion.streams.coding import (
    FLAG_TABLE_COUNT,
    FREQUENCY_TOTAL,
    HISTORY_COUNT,
    KNOT_COUNTS,
    NEIGHBOUR_COUNT,
    SIZE_COUNT,
    TABLE_FILE,
    standard_tables,
)
from rigid_motion.streams.messages import Message
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.streaming.sending import body_of, even_rate, samples_of

SETTINGS = ((0.1, 0.0), (0.2, 0.0), (0.1, 0.06), (0.1, 0.15), (0.2, 0.15), (0.1, None))
"""Delays in seconds, and the latency of datagrams; None if no receiver answers."""

MOST_SECONDS = 15.0  # used of a recording, so that long ones do not dominate
SINGLE_RADIUS = 0.1  # of the balls of single bodies, in metres
PRIOR_COUNT = 12.0  # the weight, in counts, of the mean over kinds of knots, which a table without counts falls back to


class Counting:
    """A coder that writes nothing, and counts the symbols of each table."""

    def __init__(self) -> None:
        self.counts = [np.zeros(len(table) - 1) for table in standard_tables()]

    def symbol(self, table: int, value: int = 0) -> int:
        self.counts[table][value] += 1
        return value

    def flat(self, _count: int, value: int = 0) -> int:
        return value


def samples(folder: Path) -> Iterator[tuple[StreamBody, np.ndarray, Poses]]:
    """Yield the motions of a folder and of assets/: a body, times (n,) and poses (joints, n)."""
    paths = [*files_in([folder], (".bvh", ".fbx", ".csv", ".tum")), *sorted((ROOT / "assets").glob("*.csv"))]
    for clip in (clip for path in paths for clip in read_clips([str(path)])[0]):
        report(clip.name)
        times, poses = samples_of(clip)
        kept = times <= times[0] + MOST_SECONDS
        yield body_of(clip, poses, None if clip.rest_body else SINGLE_RADIUS), times[kept], poses[:, kept]


def count(
    coder: Counting, body: StreamBody, times: np.ndarray, poses: Poses, delay: float, latency: float | None
) -> None:
    """Count the symbols of all messages that a sender sends about a motion."""
    sender, receiver = Sender([body], 0.005, delay, even_rate(times)), Receiver()
    write = sender.codec.write

    def counted(message: Message, base: Message) -> bytes:
        sender.codec.code(coder, lambda _: base, message)
        return write(message, base)

    sender.codec.write = counted
    on_the_way: list[tuple[float, bytes]] = []
    for number, moment in enumerate(times.tolist()):
        while on_the_way and on_the_way[0][0] <= moment:
            sender.take_answer(on_the_way.pop(0)[1], moment)
        for datagram in sender.add(moment, poses[:, number]):
            receiver.take(datagram, moment)
        if latency is not None:
            on_the_way += [(moment + 2.0 * latency, answer) for _, answer in receiver.answers()]


def probabilities(counts: list[np.ndarray]) -> Iterator[np.ndarray]:
    """Yield the symbol probabilities of each table: its own counts, smoothed by the counts over all kinds of knots."""
    for table, counted in enumerate(counts):
        if table < FLAG_TABLE_COUNT:
            alike = range(table % (HISTORY_COUNT * NEIGHBOUR_COUNT), FLAG_TABLE_COUNT, HISTORY_COUNT * NEIGHBOUR_COUNT)
        elif table < KNOT_COUNTS:
            alike = range(
                FLAG_TABLE_COUNT + (table - FLAG_TABLE_COUNT) % (HISTORY_COUNT * SIZE_COUNT),
                KNOT_COUNTS,
                HISTORY_COUNT * SIZE_COUNT,
            )
        else:
            alike = [table]
        # Unseen symbols get an ever smaller probability.
        mean = sum(counts[other] for other in alike) + 4.0 * 0.6 ** np.arange(len(counted))
        yield (counted + PRIOR_COUNT * mean / mean.sum()) / (counted.sum() + PRIOR_COUNT)


def table_of(probability: np.ndarray) -> tuple[int, ...]:
    """Return cumulative frequencies that add up to `FREQUENCY_TOTAL`, each symbol's above 0."""
    frequencies = 1 + np.floor(probability * (FREQUENCY_TOTAL - len(probability))).astype(int)
    frequencies[np.argmax(frequencies)] += FREQUENCY_TOTAL - frequencies.sum()
    return (0, *np.cumsum(frequencies).tolist())


def tables_of(counts: list[np.ndarray]) -> list[Sequence[int]]:
    """Return the tables for these counts. Tables never used here, such as those about holding, stay as they are."""
    tables: list[Sequence[int]] = [table_of(probability) for probability in probabilities(counts)]
    for table in range(KNOT_COUNTS, len(tables)):
        if not counts[table].any():
            tables[table] = standard_tables()[table]
    return tables


def text_of(tables: Iterable[Sequence[int]]) -> str:
    """Return the content of the table file."""
    return json.dumps(list(tables), separators=(",", ":")) + "\n"


def main(arguments: list[str]) -> int:
    """Count, and write the tables; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    coder = Counting()
    for motion in samples(parser.parse_args(arguments).folder):
        for setting in SETTINGS:
            count(coder, *motion, *setting)
    Path(str(TABLE_FILE)).write_text(text_of(tables_of(coder.counts)), encoding="utf-8")
    return 0
