"""What the benchmark's page says follows from what was measured."""

from __future__ import annotations

import numpy as np
import pytest

from research.benchmark import cases, changed, report
from rigid_motion.motion import MODES


@pytest.mark.parametrize(
    ("ratio", "words"),
    [(0.8, "20% less time a pose"), (1.25, "25% more time a pose"), (1.001, "as much time a pose")],
)
def test_time_is_less_or_more_as_it_was_measured(ratio, words):
    assert changed(ratio) == words


def test_the_page_compares_the_blend_with_both_rotations_by_sine():
    case = next(cases(2000))
    seconds = {(mode, "Rigid Motion"): [0.002, 0.003] for mode in MODES}
    seconds["lerp_slerp", "Rigid Motion"] = [0.004, 0.001]
    seconds["dq_sclerp", "Rigid Motion"] = [0.004]
    seconds["dq_sclerp", "pytransform3d"] = [0.4, 0.3]
    page = list(report(case, seconds))
    assert "| `dq_sclerp` | pytransform3d | 0.01 | 75.0 times |" in page
    assert (
        "`pga_lerp` takes 100% more time a pose than `lerp_slerp` and 50% less time a pose than `dq_sclerp`, "
        "all in their fast form."
    ) in page


def test_every_case_has_as_many_in_betweens_as_it_says():
    for case in cases(2000):
        first, shares = case.pairs()
        assert len(first) == len(shares) == case.in_betweens
        assert np.all((shares >= 0.0) & (shares <= 1.0))
