"""Tests of the game engines' models on a link with only a constant delay, and of the live cost study."""

import numpy as np
import pytest

from research import live_costs
from research.live_streams.engines import ENGINES, PICTURES_PER_S, Way, by_engine, seen, truth_of
from rigid_motion.motion import Poses
from rigid_motion_batch.places import ASSETS
from tests.scripts.bvh_bodies import TIMES, write_body
from tests.scripts.research.keeping import written


@pytest.mark.parametrize("engine", ENGINES)
def test_a_steady_hand_is_shown_steadily(engine: str) -> None:
    times = np.arange(900) / 90.0
    hand = Poses(times[:, None] * (0.5, 0.0, 0.0), np.tile((1.0, 0.0, 0.0, 0.0), (900, 1)))
    truth, frames = truth_of(times, hand), np.arange(0.5, 9.9, 1.0 / PICTURES_PER_S)
    result = seen(by_engine(engine, truth, Way(0.02, 0.02, 0.0), frames), truth, frames)
    # At most half an update's motion: an engine without a buffer holds each pose until the next.
    assert result["largest_mm"] < 1e3 * 0.5 / 30.0 + 3.0
    assert (result["freezes"], result["jumps_back"]) == (0, 0)
    assert 0.02 < result["delay"] < 0.3


def test_the_study_writes_what_the_page_reads(tmp_path, monkeypatch):
    write_body(tmp_path / "walk.bvh", TIMES[:20])
    monkeypatch.setattr(live_costs, "HAND", "pivot")
    monkeypatch.setattr(live_costs, "WAYS", {"20 ms": live_costs.WAYS["20 ms"]})
    figures = ("bytes", "heard", "expected", "rate", "median_ms", "p99_ms", "router", "listeners")
    result = {"users": 3, "seconds": 2.0, **dict.fromkeys(figures, 1.0)}
    monkeypatch.setattr(live_costs.room, "measured", lambda users, seconds: result)
    given = [str(tmp_path / "walk.bvh"), str(ASSETS / "pivot.csv")]
    assert live_costs.main([*given, "--users", "3", "--seconds", "2", "--root", str(tmp_path)]) == 0
    result = written(tmp_path, "live_costs")
    assert [row["by"] for row in result["engines"]] == [*ENGINES, "sent when needed"]
    single = result["single"]["rows"][0]["ways"]
    assert result["single"]["median"] == single
    saved = 1.0 - single["when needed, 100 ms"]["bytes"] / single[live_costs.FLOATS]["bytes"]
    assert result["single"]["saved"]["100 ms"] == pytest.approx(saved, abs=1e-5)
