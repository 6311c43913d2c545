"""The object of a film as few triangles."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion_batch.report.mesh import MOST_TRIANGLES as MOST_IN_A_PAGE
from rigid_motion_batch.report.mesh import Mesh
from rigid_motion_batch.scenes.settings import MODELS
from rigid_motion_batch.scenes.simplified import MOST_TRIANGLES, simplified
from rigid_motion_batch.scenes.subject import load_subject, vertices_of


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cube, a round surface of many triangles, and as many triangles that hang on nothing."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for name in ("Cube", "Ball", "Dust"):
        bpy.data.objects.new(name, bpy.data.meshes.new(name))
        bpy.context.scene.collection.objects.link(bpy.data.objects[name])
    bpy.data.objects["Cube"].data.from_pydata(
        [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], [],
        [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)],
    )  # fmt: skip
    steps = 100
    along, around = np.meshgrid(np.linspace(0.0, np.pi, steps), np.linspace(0.0, 2.0 * np.pi, steps), indexing="ij")
    ball = np.stack((np.sin(along) * np.cos(around), np.sin(along) * np.sin(around), 2.0 * np.cos(along)), axis=-1)
    faces = [
        (row * steps + column, row * steps + column + 1, (row + 1) * steps + column + 1, (row + 1) * steps + column)
        for row in range(steps - 1)
        for column in range(steps - 1)
    ]
    bpy.data.objects["Ball"].data.from_pydata(ball.reshape(-1, 3).tolist(), [], faces)
    dust = np.random.default_rng(1).normal(size=(3 * 2 * MOST_TRIANGLES, 3))
    bpy.data.objects["Dust"].data.from_pydata(dust.tolist(), [], np.arange(len(dust)).reshape(-1, 3).tolist())
    path = tmp_path_factory.mktemp("models") / "models.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.mark.parametrize("name", MODELS)
def test_our_models_keep_their_shape_and_what_has_the_colour_of_the_mode(name):
    whole = vertices_of(load_subject(name))
    result = simplified(name)
    assert MOST_TRIANGLES / 2 < len(result["triangles"]) <= MOST_TRIANGLES <= MOST_IN_A_PAGE
    used = result["vertices"][np.unique(result["triangles"])]
    for end in (np.min, np.max):
        assert np.abs(end(used, axis=0) - end(whole, axis=0)).max() < 0.02 * np.ptp(whole, axis=0).max()
    assert {*result["tints"]} == {0.0, 1.0}
    assert Mesh(**result).size == pytest.approx(np.linalg.norm(np.ptp(whole, axis=0)), rel=0.02)


def test_triangles_that_hang_on_nothing_are_kept_within_the_budget(models):
    result = simplified(f"{models}:Dust")
    assert 0 < len(result["triangles"]) <= MOST_TRIANGLES
    assert result["triangles"].max() < len(result["vertices"])
