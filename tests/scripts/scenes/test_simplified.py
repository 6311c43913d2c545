"""Tests of simplifying the object of a film to few triangles."""

import bpy
import numpy as np
import pytest

from rigid_motion_batch.report.data import MOST_TRIANGLES as MOST_IN_A_PAGE
from rigid_motion_batch.report.data import Mesh
from rigid_motion_batch.scenes.settings import MODELS
from rigid_motion_batch.scenes.subject import MOST_TRIANGLES, load_subject, simplified, vertices_of


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


def test_triangles_that_hang_on_nothing_are_kept_within_the_budget(empty_file, tmp_path):
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Dust", bpy.data.meshes.new("Dust")))
    dust = np.random.default_rng(1).normal(size=(3 * 2 * MOST_TRIANGLES, 3))
    bpy.data.objects["Dust"].data.from_pydata(dust.tolist(), [], np.arange(len(dust)).reshape(-1, 3).tolist())
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "dust.blend"))
    result = simplified(f"{tmp_path / 'dust.blend'}:Dust")
    assert 0 < len(result["triangles"]) <= MOST_TRIANGLES
    assert result["triangles"].max() < len(result["vertices"])
