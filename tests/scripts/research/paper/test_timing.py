"""Tests of the races: all engines do the same work, and the seconds are evaluated correctly. No test of the speed."""

import numpy as np
import pytest

from research.paper import timing
from research.paper.table import PAPER_RATES_PER_S, UPDATES
from rigid_motion.motion import MODES
from tests.scripts.research.paper.clips import circling

CLIP = circling(turns=0.7, rate=90.0, seconds=1.0)
EXACT = [mode for mode in MODES if not MODES[mode].is_smooth]


@pytest.mark.parametrize("mode", EXACT)
def test_all_readings_generate_the_same_frames(mode: str):
    case = timing.case_of(CLIP, 10.0)
    fast, arrays = (engine(mode).positions for engine in (case.filled_in, case.in_the_algebra))
    assert case.in_betweens == timing.USER_COUNT * 90
    np.testing.assert_allclose(arrays, fast.reshape(-1, 3), atol=1e-12)


def test_the_races_have_every_mode_at_the_rates_that_were_asked_for(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(timing, "USER_COUNT", 2)
    needed = {"lerp_slerp": {"updates": [29.0, 19.0, 14.0, 11.0]}, "pga_lerp": {"updates": [25.0, 16.0, 13.0, 11.5]}}
    result = timing.races(CLIP, needed, 2)

    def updates(pace: str, rate: int) -> dict[str, float]:
        return {mode: own[rate]["updates"] for mode, own in result[pace].items()}

    for place, rate in enumerate(UPDATES):
        assert updates("equal", rate) == dict.fromkeys(MODES, rate)
        assert updates("paper", rate) == dict.fromkeys(EXACT, PAPER_RATES_PER_S[rate]) | {"lerp_slerp": rate}
        as_good = {"lerp_slerp": rate, "pga_lerp": needed["pga_lerp"]["updates"][place]}
        assert updates("as good", rate) == as_good
        assert result["equal"]["lerp_slerp"][rate]["relative"] == 1.0
    assert set(result["algebra"]) == set(EXACT)
    assert all(item["processor"] > 0.0 for item in result["algebra"].values())
