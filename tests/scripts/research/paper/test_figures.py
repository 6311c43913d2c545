"""The figures: what they show, in numbers, and that it fits on the sheet."""

import bpy
import numpy as np
import pytest
from mathutils import Vector

from research.paper import picture, strips, triangle
from research.paper.catching import build
from rigid_motion_batch.scenes.film import render_still
from tests.scripts.research.paper.clips import thrown


def words_on(scene: bpy.types.Scene) -> dict[str, np.ndarray]:
    """Text to its left, right, foot and top, in pixels from the lower left corner."""
    bpy.context.view_layer.update()
    width, height = scene.render.resolution_x, scene.render.resolution_y
    frame = bpy.data.objects["Frame"].matrix_world.inverted()
    result = {}
    for obj in scene.objects:
        if obj.type == "FONT":
            corners = np.array([frame @ obj.matrix_world @ Vector(corner) for corner in obj.bound_box])
            left, foot = corners[:, :2].min(axis=0) * height + (width / 2.0, height / 2.0)
            right, top = corners[:, :2].max(axis=0) * height + (width / 2.0, height / 2.0)
            result[obj.data.body] = np.array((left, right, foot, top))
    return result


def test_the_tip_rests_under_screws_and_leaves_its_place_under_the_state_of_the_art():
    result = strips.figures()
    assert set(result) == set(strips.ENGINES)
    assert max(result["dq_sclerp"], result["pga_lerp"]) < 1e-9
    assert result["lerp_slerp"] > 0.05


@pytest.mark.parametrize("figure", ["triangle", "strips", "catching"])
def test_all_words_stand_on_the_sheet_and_are_large_enough_to_read(figure: str):
    scene = {
        "triangle": triangle.build,
        "strips": strips.build,
        "catching": lambda: build(thrown(), film=False),
    }[figure]()
    assert scene.render.resolution_x == picture.WIDTH
    words = words_on(scene)
    assert words
    for text, (left, right, foot, top) in words.items():
        assert left >= 0.0, text
        assert right <= scene.render.resolution_x, text
        assert foot >= 0.0, text
        assert top <= scene.render.resolution_y, text
    sizes = [obj.data.size * scene.render.resolution_y for obj in scene.objects if obj.type == "FONT"]
    assert min(sizes) >= 6.0 * picture.DOTS_PER_INCH / 72.0 - 1e-3


def test_a_picture_is_as_wide_as_a_column_and_has_both_colours(tmp_path):
    path = tmp_path / "triangle.png"
    scene = triangle.build()
    scene.display.render_aa = "OFF"
    render_still(scene, path)
    image = bpy.data.images.load(str(path))
    assert tuple(image.size) == (picture.WIDTH, scene.render.resolution_y)
    pixels = np.array(image.pixels[:]).reshape(-1, 4)[:, :3]
    for colour in triangle.COLOURS.values():
        expected = np.array([int(colour[start : start + 2], 16) / 255.0 for start in (1, 3, 5)])
        assert np.count_nonzero(np.abs(pixels - expected).max(axis=1) < 0.06) > 500
    assert np.all(pixels[:: picture.WIDTH] > 0.97)
