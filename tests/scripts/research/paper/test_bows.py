"""How much of the screw's bow a path has, and that this decides."""

import pytest

from research.paper.bows import RATES, bows_of
from tests.scripts.clips.recordings import swinging_clip
from tests.scripts.research.paper.clips import circling, spinning_straight


def test_a_pivot_has_all_of_the_bow_and_the_screw_no_error():
    result = bows_of(circling(turns=1.0))
    assert list(result) == list(RATES)
    assert all(share == pytest.approx(1.0, abs=1e-9) and error < 1e-9 for share, error in result.values())


def test_a_body_that_flies_straight_has_no_error_to_compare():
    assert bows_of(spinning_straight()) == {}


@pytest.mark.parametrize("seed", range(8))
def test_the_screw_is_nearer_exactly_where_more_than_half_of_the_bow_is_there(seed: int):
    result = bows_of(swinging_clip(seed=seed))
    assert result
    for share, error in result.values():
        assert (share > 0.5) == (error < 1.0)
