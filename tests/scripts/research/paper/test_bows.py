"""How much of the screw's bow a path has, and that this decides."""

from __future__ import annotations

import numpy as np
import pytest

from research.paper.bows import FORMULA, RATES, bows_of
from tests.scripts.clips.recordings import swinging_clip
from tests.scripts.research.paper.clips import circling, spinning_straight


def test_a_pivot_has_all_of_the_bow_and_the_screw_no_error():
    found = bows_of(circling(turns=1.0))
    assert [one.updates for one in found] == list(RATES)
    assert all(one.share == pytest.approx(1.0, abs=1e-9) and one.error < 1e-9 for one in found)
    assert all(one.stake == pytest.approx(1.0, abs=1e-9) for one in found)


def test_a_circle_that_turns_the_other_way_has_less_than_none_of_it():
    assert all(one.share < 0.0 and one.error > 1.0 for one in bows_of(circling(turns=-1.0)))


def test_a_body_that_flies_straight_has_no_error_to_compare():
    assert bows_of(spinning_straight()) == []


@pytest.mark.parametrize("seed", range(8))
def test_the_screw_is_nearer_exactly_where_more_than_half_of_the_bow_is_there(seed: int):
    found = bows_of(swinging_clip(seed=seed))
    assert found
    for one in found:
        assert (one.share > 0.5) == (one.error < 1.0)
        assert one.error**2 == pytest.approx(1.0 - (2.0 * one.share - 1.0) * one.stake, abs=1e-9)


def test_the_formula_that_the_page_has_is_what_is_measured():
    random = np.random.default_rng(3)
    a, b = random.normal(size=(2, 50, 3))
    share = np.sum(a * b) / np.sum(b * b)
    assert FORMULA[0] == "k = sum a.b / sum |b|^2"
    assert FORMULA[1] == "sum |a - b|^2 = sum |a|^2 - (2 k - 1) sum |b|^2"
    assert np.sum((a - b) ** 2) == pytest.approx(np.sum(a * a) - (2.0 * share - 1.0) * np.sum(b * b))
