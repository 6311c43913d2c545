"""The range coder: what is written is read, in as few bytes as tables say, and any bytes can be read."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rigid_motion.streams.coding import FLAGS, KNOT_COUNTS, LARGEST, TOTAL, Coder, bucket
from rigid_motion.streams.tables import TABLES


def table(rng: np.random.Generator, symbols: int) -> tuple[int, ...]:
    cuts = np.sort(rng.choice(np.arange(1, TOTAL), symbols - 1, replace=False))
    return (0, *cuts.tolist(), TOTAL)


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
            # The rarest and the most frequent symbols are where carries come from.
            symbol = int(rng.choice([0, last, rng.integers(last + 1)]))
            written.append((None, number, encoder.symbol(number, symbol)))
    decoder = Coder(encoder.finish(), tables)
    read = [decoder.flat(count) if count else decoder.symbol(number) for count, number, _ in written]
    assert read == [symbol for *_, symbol in written]


@pytest.mark.parametrize("count", [0, 1, 16, 17, 48, 51])
def test_numbers_of_many_digits_are_read(count: int) -> None:
    numbers, encoder = [0, (1 << count) - 1, (1 << count) // 3], Coder()
    for number in numbers:
        encoder.digits(count, number)
    decoder = Coder(encoder.finish())
    assert [decoder.digits(count) for _ in numbers] == numbers


def test_symbols_cost_what_their_frequencies_say() -> None:
    rng, own = np.random.default_rng(1), (0, 3500, 4000, TOTAL)
    symbols = rng.choice(3, 4000, p=np.diff(own) / TOTAL)
    encoder = Coder(tables=[own])
    for symbol in symbols.tolist():
        encoder.symbol(0, symbol)
    ideal = -np.log2(np.diff(own) / TOTAL)[symbols].sum() / 8.0
    assert ideal <= len(encoder.finish()) <= ideal * 1.002 + 2.0


def test_nothing_said_is_no_bytes() -> None:
    assert Coder().finish() == b""


@pytest.mark.parametrize("seed", range(50))
def test_any_bytes_are_some_symbols(seed: int) -> None:
    rng = np.random.default_rng(seed)
    decoder = Coder(rng.bytes(int(rng.integers(0, 60))), [table(rng, 7)])
    assert all(0 <= decoder.symbol(0) < 7 and 0 <= decoder.flat(1000) < 1000 for _ in range(300))


def test_the_tables_are_whole() -> None:
    symbols = [len(own) - 1 for own in TABLES]
    assert symbols[:KNOT_COUNTS] == [2] * FLAGS + [LARGEST + 1] * (KNOT_COUNTS - FLAGS)
    for own in TABLES:
        assert (own[0], own[-1]) == (0, TOTAL)
        assert all(low < high for low, high in itertools.pairwise(own))
    assert symbols[KNOT_COUNTS:] == [32, 21, 4, 4, 3, 2, 2]


def test_buckets() -> None:
    assert [bucket(value, 8) for value in (0, 1, 2, 3, 4, 5, 8, 9, 16, 17, 10**6)] == [0, 1, 2, 3, 3, 4, 4, 5, 5, 6, 7]
