"""Tests of the range coder: it reads what it writes, in as few bytes as tables allow, and reads any bytes."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from research.making import stream_tables
from rigid_motion.streams.coding import (
    BASES_TABLE,
    FREQUENCY_TOTAL,
    KNOT_COUNTS,
    TABLE_FILE,
    Coder,
    standard_tables,
)
from rigid_motion.streams.wire import WIRE_VERSION

TABLES_OF_VERSION = 7, "f3f799397ecc2d1e8d24af7602704edb84e8a8217468658dbe4f8c863a7f7477"


def table(rng: np.random.Generator, symbols: int) -> tuple[int, ...]:
    cuts = np.sort(rng.choice(np.arange(1, FREQUENCY_TOTAL), symbols - 1, replace=False))
    return (0, *cuts.tolist(), FREQUENCY_TOTAL)


@pytest.mark.parametrize("seed", range(40))
def test_what_is_written_is_read(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tables = [table(rng, int(rng.integers(2, 20))) for _ in range(5)]
    written, encoder = [], Coder(tables=tables)
    for _ in range(int(rng.integers(0, 400))):
        if rng.random() < 0.2:
            count = int(rng.integers(1, 1 << 20))
            written.append((count, None, encoder.flat(count, int(rng.integers(count)))))
        else:
            number = int(rng.integers(5))
            last = len(tables[number]) - 2
            # Carries come from the rarest and the most frequent symbols.
            symbol = int(rng.choice([0, last, rng.integers(last + 1)]))
            written.append((None, number, encoder.symbol(number, symbol)))
    decoder = Coder(encoder.finish(), tables)
    read = [decoder.flat(count) if count else decoder.symbol(number) for count, number, _ in written]
    assert read == [symbol for *_, symbol in written]


def test_the_tables_are_those_of_this_version_of_the_wire() -> None:
    assert (
        WIRE_VERSION,
        hashlib.sha256(TABLE_FILE.read_text(encoding="utf-8").encode()).hexdigest(),
    ) == TABLES_OF_VERSION, (
        "whoever has other tables reads other numbers: give the wire another version, and its vectors"
    )


def test_the_maker_writes_the_file_as_it_is() -> None:
    assert stream_tables.text_of(standard_tables()) == TABLE_FILE.read_text(encoding="utf-8")


def test_the_maker_counts_into_tables_that_are_whole_and_keeps_those_without_counts() -> None:
    counts = [np.zeros(len(own) - 1) for own in standard_tables()]
    assert stream_tables.tables_of(counts)[KNOT_COUNTS:] == standard_tables()[KNOT_COUNTS:]
    counts[BASES_TABLE][1] = 1e6
    made = stream_tables.tables_of(counts)
    assert [len(own) for own in made] == [len(own) for own in standard_tables()]
    assert all((own[0], own[-1]) == (0, FREQUENCY_TOTAL) and min(np.diff(own)) > 0 for own in made)
    assert np.diff(made[BASES_TABLE]).tolist() == [1, FREQUENCY_TOTAL - 2, 1]
