"""The figures of whole bodies: on a small one, a hip that walks and turns with an arm of two bones."""

from __future__ import annotations

import itertools
from pathlib import Path

import bpy
import numpy as np
import pytest

from research import reduction
from research.whole_bodies import against_decimate, against_greedy, against_published, feet, rigs, timing
from research.whole_bodies import section as page
from research.whole_bodies.bodies import Body, repeated
from research.whole_bodies.optimum import optimum, optimum_of_four
from rigid_motion.motion import Poses, reduce_skeleton_keys

# Blender's BVH importer leaves closing the file to Python.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")

TOLERANCE = 0.01

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
    return rigs.import_rig(made_up(tmp_path)).body().of_size(1.7)


def test_a_body_is_where_blender_shows_it(tmp_path):
    rig = rigs.import_rig(made_up(tmp_path))
    body = rig.body()
    for sample in (0, 17):
        bpy.context.scene.frame_set(int(rig.frames[sample]))
        shown = rig.obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
        places = [shown.matrix_world @ shown.pose.bones[name].head for name in body.joints]
        assert np.allclose(body.truth.positions[:, sample], places, atol=1e-4)


def test_a_body_is_scaled_and_its_channels_are_counted(body):
    assert body.extent == pytest.approx(1.7)
    assert body.joints == ("Hip", "Knee", "Foot")
    assert body.moving.tolist() == [1, 0, 0]
    assert body.turning.min() == 0
    assert body.rate == pytest.approx(30.0, abs=0.01)


def test_a_long_recording_is_cut_off(tmp_path):
    rig = rigs.import_rig(made_up(tmp_path), most_frames=10)
    assert rig.body().frames == 10
    assert max(max(keys) for keys in rig.keys().values()) == 10.0


def test_a_file_without_an_armature_is_refused(tmp_path):
    path = tmp_path / "none.fbx"
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.collection.objects.link(bpy.data.objects.new("empty", None))
    bpy.ops.export_scene.fbx(filepath=str(path))
    with pytest.raises(rigs.UnusableRigError, match=r"none\.fbx: it has no armature"):
        rigs.import_rig(path)


@pytest.mark.parametrize(
    ("mode", "programme"),
    [("lerp_slerp", optimum), ("dq_sclerp", optimum), ("motor_spline", optimum_of_four)],
)
def test_the_optimum_is_the_fewest_of_all_choices(body, mode, programme):
    few = Body(body.name, body.rate, body.joints, body.parents, body.poses[:, 4:15], body.moving, body.turning)
    tolerance = 0.03

    def fewest() -> int:
        for count in range(few.frames - 1):
            for inner in itertools.combinations(range(1, few.frames - 1), count):
                keys = np.array((0, *inner, few.frames - 1))
                if few.errors(few.shown_by_key_poses(keys, mode)).max() <= tolerance:
                    return len(keys)
        return few.frames

    best = programme(few, mode, tolerance)
    assert best == fewest()
    assert best <= len(against_greedy.greedy(few, mode, tolerance))


def test_each_optimum_is_of_modes_that_depend_on_as_many_keys(body):
    with pytest.raises(ValueError, match="depends on others"):
        optimum(body, "motor_spline", TOLERANCE)
    with pytest.raises(ValueError, match="does not depend on four"):
        optimum_of_four(body, "lerp_slerp", TOLERANCE)


def test_greedy_keys_keep_to_the_tolerance_and_none_can_go(body):
    keys = against_greedy.greedy(body, "lerp_slerp", TOLERANCE)
    assert body.errors(body.shown_by_key_poses(keys, "lerp_slerp")).max() <= TOLERANCE
    for key in keys[1:-1]:
        assert body.errors(body.shown_by_key_poses(keys[keys != key], "lerp_slerp")).max() > TOLERANCE


def test_decimate_is_as_good_and_leaves_the_rig_as_it_was(tmp_path):
    rig = rigs.import_rig(made_up(tmp_path))
    body = rig.body().of_size(1.7)
    own, shared, decimated, imported = against_decimate.measure(rig, body, "motor_spline", TOLERANCE)
    varying = int((body.moving + body.turning).sum())
    assert max(own.largest, shared.largest, decimated.largest) <= TOLERANCE * (1.0 + 1e-6)
    assert imported.largest < 1e-5
    assert imported.keys == varying * body.frames
    assert imported.numbers == 2 * imported.keys
    assert decimated.numbers == 6 * decimated.keys < 6 * imported.keys
    assert shared.numbers == shared.frames * (1 + varying)
    assert own.keys <= shared.keys


def test_tracks_are_counted_apart(body):
    keys = reduce_skeleton_keys(body.times, body.poses, body.parents, tolerance=TOLERANCE)
    hip, knee, _ = (len(own) for own in keys)
    # The hip moves and turns, the knee turns; the foot does neither, and is not at its identity.
    varying, everything = against_published.track_keys(body, keys)
    assert varying == 2 * hip + knee
    assert 0 < everything - varying <= 3


def test_a_foot_that_stands_is_found_and_its_slide_measured(body):
    standing = feet.contacts(body)
    assert [contact.joint for contact in standing] == [2]
    assert standing[0].start == 0
    assert standing[0].end <= body.frames / 3 + 1
    assert feet.slide(body.truth.positions, standing).largest < 0.01
    slipped = body.truth.positions.copy()
    slipped[2, 3, 0] += 0.1
    assert feet.slide(slipped, standing).largest == pytest.approx(0.1, abs=0.01)


def test_a_cycle_goes_on(body):
    on = repeated(body, 60)
    assert on.frames == 60
    steps = np.linalg.norm(np.diff(on.truth.positions[0], axis=0), axis=1)
    assert steps.max() < 1.5 * np.linalg.norm(np.diff(body.truth.positions[0], axis=0), axis=1).max()
    assert np.allclose(on.poses.positions[:, : body.frames - 1], body.poses.positions[:, :-1])


def test_the_page_has_a_section_of_bodies(tmp_path, monkeypatch):
    path = made_up(tmp_path)
    clip = Poses(np.linspace(0.0, 1.0, 20)[:, None] ** 2 * (1.0, 0.0, 0.0), np.tile((1.0, 0.0, 0.0, 0.0), (20, 1)))
    monkeypatch.setattr(reduction, "files", lambda _folder: [])
    monkeypatch.setattr(reduction, "report", lambda *_: [])
    monkeypatch.setattr(page, "CYCLE", "leg")
    monkeypatch.setattr(page, "CYCLE_FRAMES", 12)
    monkeypatch.setattr(page, "LONG", "leg")
    monkeypatch.setattr(against_greedy, "SHORT", 0)
    monkeypatch.setattr(against_decimate, "TRIALS", 4)
    monkeypatch.setattr(timing, "RUNS", 1)
    monkeypatch.setattr(against_published, "OZZ_BODY", "leg")
    lines = list(page.section([path], [("clip", 30.0, clip)]))
    assert "## Whole bodies" in lines
    assert not [line for line in lines if len(line) > 120 and not line.startswith("|")]
    assert str(tmp_path) not in "\n".join(lines)
    assert len([line for line in lines if line.startswith("### ")]) == 6
    output = tmp_path / "reduction.md"
    monkeypatch.setattr(reduction, "section", lambda bodies, _recordings: [f"{len(bodies)} bodies"])
    assert reduction.main(["--bodies", str(tmp_path), "--output", str(output)]) == 0
    assert "--bodies ...`" in output.read_text(encoding="utf-8")
    assert "1 bodies" in output.read_text(encoding="utf-8")
