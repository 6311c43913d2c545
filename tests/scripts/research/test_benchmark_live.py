"""The scenes of the benchmark of live in-betweens are what it says, and its figures what the page reads."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from research import benchmark_live
from research.benchmark_live import MODE, MOTIONS, NativeBaking, Size, add_skin, rig_of, scene_of, set_modes
from rigid_motion import animation
from rigid_motion.animation import channelbag_of, read_poses
from tests.scripts.research.keeping import written

SMALL = Size(3, 5, 40)
SMALL_RIG = Size(12, 5, 40, vertices=400)
FRAMES = np.arange(1, SMALL.frames + 1)

SAMPLE, KEY = 16, 72
"""Bytes in a file, as the page says."""


@pytest.fixture
def live_file(empty_file):
    animation.register()
    yield
    animation.set_enabled(True)
    animation.unregister()


@pytest.mark.usefixtures("live_file")
@pytest.mark.parametrize(
    ("rotation", "motion", "components"),
    [
        ("QUATERNION", "about general axes", 7),
        ("XYZ", "about general axes", 6),
        ("QUATERNION", "in a plane", 4),
        ("XYZ", "in a plane", 3),
    ],
)
def test_a_planar_motion_has_samples_of_fewer_components(rotation, motion, components):
    objects = scene_of(SMALL, rotation, MOTIONS[motion])

    def samples() -> list[int]:
        return [len(fcurve.sampled_points) for obj in objects for fcurve in channelbag_of(obj).fcurves]

    assert set(samples()) == {0}
    set_modes(objects, MODE)
    assert [count for count in samples() if count] == [SMALL.frames] * components * SMALL.objects


@pytest.mark.usefixtures("live_file")
def test_a_file_is_larger_by_its_samples_and_keys():
    (obj,) = scene_of(Size(1, 2, 5001), "QUATERNION")
    before = benchmark_live.file_sizes()["uncompressed"]
    set_modes([obj], MODE)
    assert benchmark_live.file_sizes()["uncompressed"] - before == pytest.approx(7 * 5001 * SAMPLE, rel=0.02)
    set_modes([obj], "BLENDER")
    channelbag_of(obj).fcurves.find("location").keyframe_points.add(10_000)
    assert benchmark_live.file_sizes()["uncompressed"] - before == pytest.approx(10_000 * KEY, rel=0.02)


@pytest.mark.usefixtures("live_file")
def test_native_baking_keys_what_is_shown_and_gives_it_back():
    objects = scene_of(SMALL, "QUATERNION")
    set_modes(objects, MODE)
    actions = [obj.animation_data.action for obj in objects]
    shown = read_poses(objects[1], FRAMES)
    native = NativeBaking(objects)
    animation.set_enabled(False)
    native.bake()
    assert len(channelbag_of(objects[1]).fcurves.find("location", index=2).keyframe_points) == SMALL.frames
    objects[1].delta_location, objects[1].delta_rotation_quaternion = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(read_poses(objects[1], FRAMES).positions, shown.positions, atol=1e-5)
    native.restore()
    assert [obj.animation_data.action for obj in objects] == actions
    np.testing.assert_allclose(read_poses(objects[1], FRAMES).positions, shown.positions, atol=1e-6)


@pytest.mark.usefixtures("live_file")
def test_native_baking_of_bones_keys_what_they_show():
    rig = rig_of(SMALL_RIG)
    bone = rig.pose.bones["Bone 3"]
    set_modes([bone], MODE)
    shown = shown_matrices(bone)
    animation.set_enabled(False)
    NativeBaking([rig], every_channel=True, bones=True).bake()
    fcurve = channelbag_of(rig).fcurves.find(bone.path_from_id("location"), index=2)
    assert len(fcurve.keyframe_points) == SMALL_RIG.frames
    bone.constraints[0].mute = True
    np.testing.assert_allclose(shown_matrices(bone), shown, atol=1e-5)


def shown_matrices(bone) -> np.ndarray:
    """Where a bone is on every frame, in the space of its armature (frames, 4, 4)."""
    result = []
    for frame in FRAMES.tolist():
        bpy.context.scene.frame_set(frame)
        result.append(np.array(bone.matrix))
    return np.array(result)


@pytest.mark.usefixtures("live_file")
def test_the_rig_is_chains_of_bones_and_its_skin_follows_two_for_each_vertex():
    rig = rig_of(SMALL_RIG)
    roots = [bone for bone in rig.data.bones if bone.parent is None]
    assert [len(root.children_recursive) for root in roots] == [9, 1]
    assert len(channelbag_of(rig).fcurves) == 12 * 7
    skin = add_skin(rig, SMALL_RIG.vertices)
    assert len(skin.data.vertices) == SMALL_RIG.vertices
    for vertex in skin.data.vertices:
        assert len(vertex.groups) == 2
        assert sum(group.weight for group in vertex.groups) == pytest.approx(1.0)
    still = np.array([vertex.co for vertex in skin.data.vertices])
    moved = skin.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices
    assert np.linalg.norm(np.array([vertex.co for vertex in moved]) - still, axis=1).min() > 1e-3


def test_the_study_writes_what_the_page_reads(tmp_path, empty_file):
    assert benchmark_live.main(["--rounds", "1", "--scale", "0.01", "--root", str(tmp_path)]) == 0
    result = written(tmp_path, "benchmark_live")
    assert [shot["components"] for shot in result["shots"]] == [7, 6, 4, 3]
    assert len(result["rigs"]) == 9
    assert all(row["ms"] >= row["fastest_ms"] > 0.0 for row in result["rigs"])
