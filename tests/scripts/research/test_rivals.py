"""Tests of the comparison with Blender's curves: rigid connections stay rigid, and the page's figures are written."""

import json
from pathlib import Path

import pytest

from research import rivals
from research.pages import FIGURES, ROOT
from research.paper.motions import assets
from rigid_motion_batch.places import ASSETS
from tests.scripts.research.keeping import names


def test_a_tool_stays_in_the_hand_and_a_door_on_its_hinge_by_screws_alone():
    slips = rivals.slips(assets().values())
    for levers in slips.values():
        for row in levers.values():
            assert row["bezier"] > 1.0
            assert row["lerp_slerp"] > 1.0
            assert row["dq_sclerp"] == row["motor_spline"] == 0.0
    for degrees, off in ((60.0, 107.18), (120.0, 400.0)):
        door = rivals.door(degrees)
        # The distance from the middle of the chord to the arc.
        assert door["lerp_slerp"] == pytest.approx(off, abs=0.01)
        assert door["dq_sclerp"] == 0.0


def test_the_sign_of_a_quaternion_turns_blenders_curves_the_long_way_alone():
    off = rivals.other_sign(assets().values())
    assert off["bezier"] > 150.0
    assert off["motor_spline"] < 30.0


def test_the_figures_are_those_of_the_page(tmp_path: Path):
    assert rivals.main(["--recordings", str(ASSETS), "--root", str(tmp_path)]) == 0
    new, kept = (json.loads((root / FIGURES / "rivals.json").read_text(encoding="utf-8")) for root in (tmp_path, ROOT))
    assert len(new.pop("recordings")) == 6
    assert new.pop("left_out") == ["models"]
    assert names(new) == names({name: kept[name] for name in new})
