"""The figures of whole bodies: on a small one, a hip that walks and turns with an arm of two bones."""

from pathlib import Path

import numpy as np
import pytest

from research import body_reduction, reduction
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
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
def body(tmp_path) -> Clip:
    clip, *_ = read_clips([str(made_up(tmp_path))])[0]
    return body_reduction.of_height(clip)


def test_greedy_insertion_leaves_no_key_that_can_go(body):
    keys = body_reduction.greedy(body)
    assert body_reduction.errors_of(body, keys, body_reduction.MODE).max() <= 0.01
    for key in keys[1:-1]:
        assert body_reduction.errors_of(body, keys[keys != key], body_reduction.MODE).max() > 0.01


def test_decimate_is_as_good(body):
    own, decimated, shared, as_shared = (row for way in body_reduction.WAYS for row in body_reduction.beside(body, way))
    assert max(own["error_mm"], shared["error_mm"]) <= 10.0 + 1e-6
    assert decimated["error_mm"] <= own["error_mm"]
    assert as_shared["error_mm"] <= shared["error_mm"]
    assert own["key_count"] <= shared["key_count"]
    assert decimated["numbers"] == 6 * decimated["key_count"]


def test_the_study_writes_what_the_page_reads(tmp_path, monkeypatch):
    path = made_up(tmp_path)
    recording = reduction.read(reduction.ASSETS / "reach.csv", 15.0)
    monkeypatch.setattr(reduction, "ASSETS", tmp_path)
    (tmp_path / "reach.csv").touch()
    monkeypatch.setattr(reduction, "read", lambda _path, _rate: recording)
    assert reduction.main(["--bodies", str(path), "--root", str(tmp_path)]) == 0
    result = written(tmp_path, "reduction")
    assert str(tmp_path) not in str(result)
    own, decimate = result["decimate"][:2]
    assert result["decimate_means"][own["how"]]["numbers"] == pytest.approx(decimate["numbers"] / own["numbers"], 1e-5)
