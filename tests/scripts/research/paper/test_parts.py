"""Tests of `python scripts/research paper` on the command line, and of a stream's cost."""

import json
from pathlib import Path

import numpy as np
import pytest

from research.paper import parts, sending, table
from research.paper.table import UPDATES
from rigid_motion_batch.streaming.measuring import HEADER_BYTES
from tests.scripts.research.paper.clips import circling

pytestmark = [pytest.mark.blender, pytest.mark.any_blender]

CLIP = circling(turns=0.7, rate=90.0, seconds=3.0)


def test_a_part_writes_its_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    modes = table.REFERENCE, "motor_spline"
    monkeypatch.setattr(parts.motions, "assets", lambda: {CLIP.name: CLIP})
    monkeypatch.setattr(table, "MODES", modes)
    monkeypatch.setattr(table, "ROW_CHOICES", {mode: (mode, table.DECIMATIONS[0]) for mode in modes})
    assert parts.main(["--only", "table", "--root", str(tmp_path)]) == 0
    (path,) = (tmp_path / "docs" / "figures").iterdir()
    assert path.name == "paper_table.json"
    result = json.loads(path.read_text(encoding="utf-8"))
    assert result["made_by"].startswith("`python scripts/research paper --only table")
    assert result["clips"] == {"assets": ["circling"]}
    assert result["needed"]["assets"]["lerp_slerp"]["updates"] == pytest.approx(UPDATES, rel=1e-3)
    assert result["by_clip"]["circling"]["motor_spline"][0] > 0.3
    assert set(result["bows"]["circling"]) == {"5", "8", "12", "15", "20", "30"}


@pytest.mark.network
def test_a_stream_costs_less_the_more_it_may_be_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sending, "DELAYS_S", (0.1,))
    monkeypatch.setattr(sending, "TOLERANCE_RANGE", (1.0, 5.0, 3))
    result = sending.costs([CLIP])
    own = result["needed"]["100"]
    assert own["bytes"].tolist() == sorted(own["bytes"], reverse=True)
    for datagrams, size in zip(own["datagrams"], own["bytes"], strict=True):
        assert size > HEADER_BYTES * datagrams > 0.0
    assert result["even"]["7 doubles"][0] == 30 * (56 + HEADER_BYTES + sending.STAMP_BYTES)
    assert own["saved_bytes"]["7 doubles"][0] == pytest.approx(1.0 - own["bytes"][0] / result["even"]["7 doubles"][0])


def test_a_cost_is_read_off_the_curve() -> None:
    errors, costs = np.array((0.5, 1.0, 4.0)), np.array((30.0, 20.0, 5.0))
    assert sending.lowest(costs, errors, 1.0) == pytest.approx(20.0)
    assert sending.lowest(costs, errors, 2.0) == pytest.approx(10.0)
    assert sending.lowest(costs, errors, 9.0) == pytest.approx(5.0)
    assert sending.lowest(costs, errors, 0.4) == np.inf
