"""Tests of the paper's figures: their numbers, and that their text fits into the column."""

import pytest

from research.drawing import DOTS_PER_INCH, WIDTH_PX, Model
from research.paper import catching, strips, triangle
from tests.scripts.research.paper.clips import thrown

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
