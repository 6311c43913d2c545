"""The shortest way from key to key, against all ways there are."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rigid_motion.motion import MODES, Poses, reduce_keys
from rigid_motion.motion.key_links import _links, _neighbours, _Ways, _with_neighbours, joined_keys, traded_keys
from rigid_motion.motion.key_search import Recording, Search, _spaced
from tests.motion.test_reduction import RADIUS, shell_errors, wandering

MEMORYLESS = [name for name, mode in MODES.items() if not mode.is_smooth]
TOLERANCES = (0.01, 0.03, 0.08)


def fewest_of_a_programme(times: np.ndarray, poses: Poses, mode: str, tolerance: float) -> int:
    """How many keys a recording needs where a segment is right or wrong by itself."""
    needed = [1]
    for end in range(1, len(times)):
        ways = []
        for start in range(end):
            part = slice(start, end + 1)
            errors = shell_errors(times[part], poses[part], np.array((0, end - start)), mode)
            if end - start == 1 or errors.max() <= tolerance:
                ways.append(needed[start] + 1)
        needed.append(min(ways))
    return needed[-1]


def fewest_of_all_sets(times: np.ndarray, poses: Poses, mode: str, tolerance: float) -> int:
    """The same by trying every set of keys, the small ones first."""
    inner = range(1, len(times) - 1)
    for count in range(len(times) - 1):
        for chosen in itertools.combinations(inner, count):
            keys = np.array((0, *chosen, len(times) - 1))
            if shell_errors(times, poses, keys, mode).max() <= tolerance * (1.0 + 1e-9):
                return count + 2
    raise AssertionError("all samples as keys are always right")


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("mode", MEMORYLESS)
def test_the_shortest_way_is_that_of_an_exhaustive_programme(mode, seed):
    times, poses = wandering(18, seed, (0.0, 0.01)[seed % 2], 40.0)
    search = Search(Recording(times, poses, mode, RADIUS, TOLERANCES[seed]))
    samples = np.arange(len(times))
    links = _links(search.costs, samples, [samples], 1.0, np.inf)
    keys = _Ways(links, samples).shortest()
    assert len(keys) == fewest_of_a_programme(times, poses, mode, TOLERANCES[seed])
    assert 2 < len(keys) < len(times)
    assert shell_errors(times, poses, keys, mode).max() <= TOLERANCES[seed] * (1.0 + 1e-9)
    # In 40 of 40 such recordings of 50 samples the search itself came to as few keys.
    assert len(reduce_keys(times, poses, mode, TOLERANCES[seed], RADIUS)) == len(keys)


def test_smooth_keys_are_as_few_as_any_that_keep_to_the_tolerance():
    """In 24 of 24 recordings of 11 samples they were."""
    as_few = 0
    for seed in range(6):
        times, poses = wandering(9, seed, 0.02, 60.0)
        found = len(reduce_keys(times, poses, "motor_spline", TOLERANCES[seed % 3], RADIUS))
        fewest = fewest_of_all_sets(times, poses, "motor_spline", TOLERANCES[seed % 3])
        assert fewest <= found <= fewest + 1
        as_few += found == fewest
    assert as_few >= 5


def least_square_of_a_programme(search: Search, keys: int) -> float:
    """The least sum of squares that so many keys leave, where a segment costs what it costs by itself."""
    count = len(search.recording.times)
    pairs = np.array(list(itertools.combinations(range(count), 2)))
    of_pairs = np.full((count, count), np.inf)
    of_pairs[tuple(pairs.T)] = search.costs.of(pairs)[0]
    least = np.where(np.arange(count) == 0, 0.0, np.inf)
    for _ in range(keys - 1):
        least = (least[:, None] + of_pairs).min(axis=0)
    return float(least[-1])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("mode", ["lerp_slerp", "dq_sclerp"])
def test_keys_with_a_price_are_the_best_of_their_number(mode, seed):
    """A price leaves the least error of all sets of as many keys; there is not one for every number of them."""
    times, poses = wandering(40, seed, 0.01, 40.0)
    search = Search(Recording(times, poses, mode, RADIUS, TOLERANCES[1]), rms=True)
    samples = np.arange(len(times))
    best = search.within(0)
    keys = traded_keys(search.costs, [best, samples, np.array((0, len(times) - 1))])
    assert search.measured(keys).cost.sum() <= len(times)
    assert 2 < len(keys) <= len(best)
    if len(keys) < len(best):
        fewest = least_square_of_a_programme(search, len(keys))
        assert search.measured(keys).cost.sum() == pytest.approx(fewest)
    assert least_square_of_a_programme(search, len(keys) - 2) > len(times)


@pytest.mark.parametrize("mode", ["lerp_slerp", "motor_spline"])
def test_more_searches_leave_fewer_keys_of_the_same_mean_square_error(mode):
    fewer = 0
    for seed in range(4):
        times, poses = wandering(150, seed, 0.01, 40.0)
        few, many = (reduce_keys(times, poses, mode, 0.02, RADIUS, rms=True, tries=tries) for tries in (3, 0))
        assert np.sqrt(np.mean(shell_errors(times, poses, few, mode) ** 2)) <= 0.02 * (1.0 + 1e-9)
        assert len(few) <= len(many)
        fewer += len(few) < len(many)
    assert fewer >= 2


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("mode", ["lerp_slerp", "motor_spline"])
def test_joined_keys_are_no_worse_than_any_that_were_found(mode, seed):
    times, poses = wandering(60, seed, 0.01, 40.0)
    costs = Search(Recording(times, poses, mode, RADIUS)).costs
    random = np.random.default_rng(seed)
    found = [np.array((0, *np.sort(random.choice(np.arange(1, 59), 8, replace=False)), 59)) for _ in range(4)]
    keys = joined_keys(costs, found, 10)
    assert len(keys) <= 10
    assert (keys[0], keys[-1]) == (0, 59)
    least = min(map(costs.peak, found))
    # Keys at random are often joined by too many links of smooth modes for them to be looked at.
    assert costs.peak(keys) < least if mode == "lerp_slerp" else costs.peak(keys) <= least


@pytest.mark.parametrize("seed", range(5))
def test_links_are_all_pairs_with_all_their_neighbours(seed):
    random = np.random.default_rng(seed)
    count = 9
    every = np.array([pair for pair in itertools.combinations(range(count), 2) if random.random() < 0.5])
    chain = np.stack((np.arange(count - 1), np.arange(1, count)), axis=1)
    pairs = np.unique(np.concatenate((every, chain)), axis=0)
    joined = {tuple(pair) for pair in pairs.tolist()}
    expected = {
        (before, first, second, after)
        for first, second in joined
        for before in range(-1, count)
        for after in range(-1, count)
        if ((before, first) in joined or (before < 0 and first == 0))
        and ((second, after) in joined or (after < 0 and second == count - 1))
    }
    links = [tuple(link) for link in _with_neighbours(pairs, count).tolist()]
    assert len(links) == len(set(links))
    assert set(links) == expected
    assert np.prod(_neighbours(pairs, count), axis=0).sum() == len(expected)


@pytest.mark.parametrize("seed", range(8))
def test_the_shortest_way_by_links_is_the_shortest_of_all_ways(seed):
    random = np.random.default_rng(seed)
    count = 9
    chain = list(range(count))
    every = np.array(list(itertools.combinations(chain, 2)))
    links = _with_neighbours(every, count)
    of_chain = {(a, b, c, d) for a, b, c, d in zip([-1, *chain], chain, chain[1:], [*chain[2:], -1], strict=False)}
    links = links[[random.random() < 0.3 or tuple(link) in of_chain for link in links.tolist()]]
    allowed = {tuple(link) for link in links.tolist()}

    def leads(way: tuple[int, ...]) -> bool:
        ended = (-1, *way, -1)
        return all(ended[place : place + 4] in allowed for place in range(len(way) - 1))

    ways = [(0, *inner, count - 1) for size in range(count - 1) for inner in itertools.combinations(chain[1:-1], size)]
    found = tuple(_Ways(links, np.arange(count)).shortest().tolist())
    assert leads(found)
    assert len(found) == min(len(way) for way in ways if leads(way))

    lengths = random.random(len(links))
    of_link = {tuple(link): length for link, length in zip(links.tolist(), lengths.tolist(), strict=True)}

    def length_of(way: tuple[int, ...]) -> float:
        ended = (-1, *way, -1)
        return sum(of_link[ended[place : place + 4]] for place in range(len(way) - 1))

    found = tuple(_Ways(links, np.arange(count)).shortest(lengths).tolist())
    assert length_of(found) == pytest.approx(min(length_of(way) for way in ways if leads(way)))


@pytest.mark.parametrize("seed", range(30))
def test_keys_that_are_changed_at_once_are_the_best_that_are_far_enough_apart(seed):
    random = np.random.default_rng(seed)
    count, distance = int(random.integers(1, 300)), int(random.integers(2, 8))
    # All of the same worth, as at rest, or few of it, or none.
    worth = random.integers(0, (1, 3, 1000)[seed % 3], count)
    order = np.argsort(worth, kind="stable")
    order = order[random.random(count) < random.random()]
    expected: list[int] = []
    for number in order.tolist():
        if all(abs(number - other) >= distance for other in expected):
            expected.append(number)
    assert _spaced(order, distance, count).tolist() == expected
