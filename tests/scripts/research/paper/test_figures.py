"""Tests of the paper's figures and parts: their numbers, and that their text fits into the column."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from research.drawing import DOTS_PER_INCH, WIDTH_PX, Model
from research.paper import catching, parts, sending, strips, table, triangle
from research.paper.catching import CATCH, GRIP_M, HELD, RELEASE, UPDATES_PER_S
from research.paper.table import UPDATES
from rigid_motion.motion.quaternions import angle_between, rotate
from rigid_motion_batch.streaming.measuring import HEADER_BYTES
from tests.scripts.research.paper.clips import circling, thrown

pytestmark = [pytest.mark.blender, pytest.mark.any_blender]


def test_the_tip_rests_under_screws_and_leaves_its_place_under_the_state_of_the_art():
    result = strips.figures()
    assert set(result) == set(strips.ENGINES)
    assert max(result["dq_sclerp"], result["pga_lerp"]) < 1e-9
    assert result["lerp_slerp"] > 0.05


@pytest.mark.parametrize("figure", ["triangle", "strips", "catching"])
def test_all_words_are_inside_of_the_picture_and_large_enough_to_read(figure: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(catching, "UPDATES_PER_S", (5, 20))
    monkeypatch.setattr(Model, "draw", lambda *_, **__: None)  # Drawing takes seconds, and adds no text.
    drawn = {"triangle": triangle.draw, "strips": strips.draw, "catching": lambda: catching.pictures(thrown())[1](90)}
    axes = drawn[figure]()
    assert (axes.figure.bbox.width, axes.figure.dpi) == (WIDTH_PX, DOTS_PER_INCH)
    axes.figure.draw_without_rendering()
    legend = axes.get_legend()
    words = [*axes.texts, *(legend.get_texts() if legend else ())]
    assert words
    for text in words:
        box = text.get_window_extent()
        assert 0.0 <= box.x0 < box.x1 <= axes.bbox.width, text
        assert 0.0 <= box.y0 < box.y1 <= axes.bbox.height, text
        assert text.get_fontsize() >= 6.0


@cache
def views() -> dict[str, dict[int, dict[str, float]]]:
    return catching.figures(thrown())


def test_a_hand_that_holds_the_tool_is_one_body_with_it():
    times, poses = catching.bodies(thrown())
    tool = poses["tool"]
    for hand, held in (("thrower", times <= RELEASE), ("catcher", times >= CATCH)):
        wrist = tool.positions + rotate(tool.quaternions, np.broadcast_to(GRIP_M, tool.positions.shape))
        np.testing.assert_allclose(poses[hand].positions[held], wrist[held], atol=1e-9)
        assert angle_between(poses[hand].quaternions, tool.quaternions)[held].max() < 1e-6


def test_a_screw_keeps_the_tool_in_the_hand_that_holds_it_and_the_state_of_the_art_does_not():
    for rate in UPDATES_PER_S:
        assert views()["lerp_slerp"][rate]["slip"] > 1e-3
        for mode in ("dq_sclerp", "pga_lerp", "motor_spline"):
            assert views()[mode][rate]["slip"] < 1e-9


def test_a_tool_in_the_space_of_the_hand_neither_slips_nor_is_caught_beside_the_hand():
    for view in views()[HELD].values():
        assert max(view["slip"], view["gap"], view["mean_gap"]) < 1e-9


def test_a_tool_in_the_space_of_the_hand_flies_as_its_updates_say():
    times, poses = catching.bodies(thrown())
    flying = times[(times > RELEASE) & (times < CATCH - catching.PASS_S)]
    held, moved = (catching.shown_of(times, poses, 20, mode, flying)["tool"] for mode in (HELD, catching.MOVED))
    inner = (flying > flying[0] + 0.05) & (flying < flying[-1] - 0.05)
    np.testing.assert_allclose(held.positions[inner], moved.positions[inner], atol=1e-9)


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
