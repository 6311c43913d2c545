"""The figures of whole bodies: on a small one, a hip that walks and turns with an arm of two bones."""

import itertools
from pathlib import Path

import bpy
import numpy as np
import pytest

from research import body_reduction, reduction
from research.bodies import Body, UnusableRigError, import_rig
from research.body_reduction import TOLERANCE
from tests.scripts.research.keeping import written

# Blender's BVH importer leaves closing the file to Python.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")

BVH = """HIERARCHY
ROOT Hip
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Knee
  {
    OFFSET 0 -50 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT Foot
    {
      OFFSET 0 -50 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET 0 0 10
      }
    }
  }
}
MOTION
"""


def made_up(folder: Path, frames: int = 24) -> Path:
    """A BVH file of a leg that stands for a while and then swings."""
    rows = []
    for frame in range(frames):
        swing = max(0.0, frame - frames / 3) / frames
        turn = 60.0 * np.sin(6.0 * swing)
        rows.append(f"{80.0 * swing} 100 0 0 {turn:.4f} {0.3 * turn:.4f} 0 {-0.7 * turn:.4f} 0 0 0 0")
    path = folder / "leg.bvh"
    path.write_text(f"{BVH}Frames: {frames}\nFrame Time: 0.0333333\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def body(tmp_path) -> Body:
    return import_rig(made_up(tmp_path)).body().of_size(1.7)


def test_a_body_is_where_blender_shows_it(tmp_path):
    rig = import_rig(made_up(tmp_path))
    body = rig.body()
    for sample in (0, 17):
        bpy.context.scene.frame_set(int(rig.frames[sample]))
        shown = rig.obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
        places = [shown.matrix_world @ shown.pose.bones[name].head for name in body.joints]
        assert np.allclose(body.truth.positions[:, sample], places, atol=1e-4)


def test_a_file_without_an_armature_is_refused(tmp_path):
    path = tmp_path / "none.fbx"
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.collection.objects.link(bpy.data.objects.new("empty", None))
    bpy.ops.export_scene.fbx(filepath=str(path))
    with pytest.raises(UnusableRigError, match=r"none\.fbx: it has no armature"):
        import_rig(path)


@pytest.mark.parametrize("mode", ["lerp_slerp", "dq_sclerp"])
def test_the_optimum_is_the_fewest_of_all_choices(body, mode):
    few = Body(body.name, body.rate, body.joints, body.parents, body.poses[:, 4:15], body.moving, body.turning)
    tolerance = 0.03

    def fewest() -> int:
        for count in range(few.frames - 1):
            for inner in itertools.combinations(range(1, few.frames - 1), count):
                keys = np.array((0, *inner, few.frames - 1))
                if few.errors(few.shown(keys, mode)).max() <= tolerance:
                    return len(keys)
        return few.frames

    best = body_reduction.optimum(few, mode, tolerance)
    assert best == fewest()
    assert best <= len(body_reduction.greedy(few, mode, tolerance))


def test_decimate_is_as_good_and_leaves_the_rig_as_it_was(tmp_path):
    rig = import_rig(made_up(tmp_path))
    body = rig.body().of_size(1.7)
    own, shared, decimated, imported = body_reduction.beside_decimate(rig, body)
    varying = int((body.moving + body.turning).sum())
    assert max(own.largest, shared.largest, decimated.largest) <= TOLERANCE * (1.0 + 1e-6)
    assert imported.largest < 1e-5
    assert imported.keys == varying * body.frames
    assert imported.numbers == 2 * imported.keys
    assert decimated.numbers == 6 * decimated.keys < 6 * imported.keys
    assert shared.numbers == shared.frames * (1 + varying)
    assert own.keys <= shared.keys


def test_a_foot_that_stands_is_found_and_its_slide_measured(body):
    ((joint, start, end),) = standing = body_reduction.contacts(body)
    assert (joint, start) == (2, 0)
    assert end <= body.frames / 3 + 1
    assert body_reduction.slide(body.truth.positions, standing)["largest_mm"] < 10.0
    slipped = body.truth.positions.copy()
    slipped[2, 3, 0] += 0.1
    assert body_reduction.slide(slipped, standing)["largest_mm"] == pytest.approx(100.0, abs=10.0)


def test_the_study_writes_what_the_page_reads(tmp_path, monkeypatch):
    path = made_up(tmp_path)
    recording = reduction.read(reduction.ASSETS / "reach.csv", 15.0)
    monkeypatch.setattr(reduction, "ASSETS", tmp_path)
    (tmp_path / "reach.csv").touch()
    monkeypatch.setattr(reduction, "read", lambda _path, _rate: recording)
    monkeypatch.setattr(body_reduction, "OZZ_BODY", "leg")
    monkeypatch.setattr(body_reduction, "TRIALS", 4)
    assert reduction.main(["--bodies", str(path), "--root", str(tmp_path)]) == 0
    result = written(tmp_path, "reduction")
    assert str(tmp_path) not in str(result)
    assert [row["how"] for row in result["feet"][1:4:2]] == ["each joint its own", "key poses"]
    own, decimate = result["decimate"][0], result["decimate"][2]
    assert result["decimate_means"][own["how"]]["numbers"] == pytest.approx(decimate["numbers"] / own["numbers"], 1e-5)
