"""The figures: what they show, in numbers, and that it fits into their column."""

import bpy
import numpy as np
import pytest

from research.drawing import DOTS_PER_INCH, WIDTH, Model, column, save
from research.paper import catching, strips, triangle
from rigid_motion.motion import Poses
from rigid_motion_batch.scenes.layout import AWAY
from tests.scripts.research.paper.clips import thrown


def test_the_tip_rests_under_screws_and_leaves_its_place_under_the_state_of_the_art():
    result = strips.figures()
    assert set(result) == set(strips.ENGINES)
    assert max(result["dq_sclerp"], result["pga_lerp"]) < 1e-9
    assert result["lerp_slerp"] > 0.05


@pytest.mark.parametrize("figure", ["triangle", "strips", "catching"])
def test_all_words_are_inside_of_the_picture_and_large_enough_to_read(figure: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(catching, "RATES", (5, 20))
    monkeypatch.setattr(Model, "draw", lambda *_, **__: None)  # it takes seconds, and no words are in it
    drawn = {"triangle": triangle.draw, "strips": strips.draw, "catching": lambda: catching.pictures(thrown())[1](90)}
    axes = drawn[figure]()
    assert (axes.figure.bbox.width, axes.figure.dpi) == (WIDTH, DOTS_PER_INCH)
    axes.figure.draw_without_rendering()
    legend = axes.get_legend()
    words = [*axes.texts, *(legend.get_texts() if legend else ())]
    assert words
    for text in words:
        box = text.get_window_extent()
        assert 0.0 <= box.x0 < box.x1 <= axes.bbox.width, text
        assert 0.0 <= box.y0 < box.y1 <= axes.bbox.height, text
        assert text.get_fontsize() >= 6.0


def test_a_picture_is_as_wide_as_a_column_and_has_both_colours(tmp_path):
    path = tmp_path / "triangle.png"
    save(triangle.draw(), path)
    image = bpy.data.images.load(str(path))
    assert tuple(image.size) == (WIDTH, 620)
    pixels = np.array(image.pixels[:]).reshape(-1, 4)[:, :3]
    for colour in triangle.COLOURS.values():
        expected = np.array([int(colour[start : start + 2], 16) / 255.0 for start in (1, 3, 5)])
        assert np.count_nonzero(np.abs(pixels - expected).max(axis=1) < 0.06) > 500
    assert np.all(pixels[::WIDTH] > 0.97)


def test_a_model_covers_what_is_behind_it_without_holes():
    """A triangle hides one behind it that is as large, wherever it is seen."""
    corners = np.array([[(-0.3, 0.0, -0.3), (0.4, 0.0, -0.2), (0.1, 0.0, 0.4)]])
    model = Model(np.concatenate((corners + 0.1 * AWAY, corners)), np.eye(3)[:2], np.zeros(2, dtype=bool))
    axes = column(200)
    model.draw(axes, Poses(np.zeros(3), np.array((1.0, 0.0, 0.0, 0.0))), (0.0, 0.0), 1.0, "#000000", whole=False)
    image = np.array(axes.images[0].get_array())
    seen = image[image[..., 3] > 0.0]
    assert np.count_nonzero(seen[:, 1]) > 0.95 * len(seen)
