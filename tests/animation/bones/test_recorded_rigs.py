"""Rigs that people really have: each imports, takes a mode on all of its bones, and plays."""

from __future__ import annotations

import warnings

import bpy
import numpy as np
import pytest

from rigid_motion.animation import Refused, key_frames, problem_of, reduce_keys_of, set_mode, total_reduction
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.poses import assert_same_poses, expected_poses, shown_poses
from tests.animation.bones.rigs import in_turn
from tests.animation.bones.test_rig_reducing import largest, matrices
from tests.animation.keyed import curves_of
from tests.animation.scenes import enabled
from tests.recordings import RECORDINGS
from tests.thoroughness import sample, tried

RIGS = RECORDINGS.with_name("rigs")

pytestmark = [
    pytest.mark.recordings,
    pytest.mark.skipif(not RIGS.is_dir(), reason="the rigs are not beside the checkout"),
]

FILES = {
    "cmu_01_01.bvh": (RIGS / "cmu_01_01.bvh", 24),
    "freebvh.bvh": (RIGS / "freebvh.bvh", 8),
    "pab_walk.fbx": (RIGS / "pab_walk.fbx", 8),
    "pab_run.fbx": (RIGS / "pab_run.fbx", 5),
    "beat_saber_body.bvh": (RECORDINGS / "beat_saber_body.bvh", 12),
}
"""Each file, and the frames from one key to the next that a mode is given to fill in."""


@pytest.fixture
def importers(live_file):
    with enabled("io_anim_bvh", "io_scene_fbx"):
        yield


def imported(name: str) -> bpy.types.Object:
    """The rig in this file, as Blender's importer makes it."""
    path = str(FILES[name][0])
    if path.endswith(".bvh"):
        with warnings.catch_warnings():
            # Blender's importer leaves the file to be closed by whoever collects it.
            warnings.simplefilter("ignore", ResourceWarning)
            bpy.ops.import_anim.bvh(filepath=path, update_scene_duration=True)
    else:
        bpy.ops.import_scene.fbx(filepath=path)
    return next(obj for obj in bpy.context.scene.objects if obj.type == "ARMATURE")


def thin_out(rig: bpy.types.Object, every: int) -> None:
    """Keep a key out of so many, and the last one."""
    for fcurve in curves_of(rig).values():
        keys = fcurve.keyframe_points
        points = np.empty(2 * len(keys), np.float32)
        keys.foreach_get("co", points)
        points = points.reshape(-1, 2)
        kept = np.unique(np.append(np.arange(0, len(points), every), len(points) - 1))
        keys.clear()
        keys.add(len(kept))
        keys.foreach_set("co", points[kept].ravel())
        fcurve.update()
    bpy.context.view_layer.update()


def some_frames(rig: bpy.types.Object, count: int) -> np.ndarray:
    """Whole frames from the first key to the last, spread evenly, the ends included."""
    times = np.concatenate([key_frames(pose_bone) for pose_bone in rig.pose.bones])
    return np.unique(np.linspace(np.ceil(times.min()), np.floor(times.max()), count).round())


@pytest.mark.parametrize(("name", "mode"), in_turn(FILES, [*KEYFRAME_MODES]))
def test_a_rig_takes_a_mode_on_all_of_its_bones_and_plays(importers, name, mode):
    rig = imported(name)
    thin_out(rig, FILES[name][1])
    assert len(rig.pose.bones) >= 20
    set_mode(list(rig.pose.bones), mode)
    assert {problem_of(pose_bone) for pose_bone in rig.pose.bones} == {""}
    frames = some_frames(rig, tried(40))
    (shown,) = shown_poses([rig], frames)
    assert_same_poses(rig, frames, shown, expected_poses(rig, frames))


@pytest.mark.parametrize("shared", [False, True], ids=["own keys", "key poses"])
@pytest.mark.parametrize("name", sample(["pab_walk.fbx", "freebvh.bvh", "pab_run.fbx"]))
def test_no_bone_of_a_rig_with_fewer_keys_is_off_by_more_than_the_tolerance(importers, name, shared):
    rig = imported(name)
    bones = list(rig.pose.bones)
    times = np.concatenate([key_frames(bone) for bone in bones if len(key_frames(bone))])
    frames = np.arange(8.0 * np.ceil(times.min()), 8.0 * np.floor(times.max()) + 1.0) / 8.0
    truth = matrices(rig, frames)
    unit = max(np.ptp([rows[0, :3, 3] for rows in truth.values()], axis=0)) / 1.7
    refused: list[Refused] = []
    reduce_keys_of(bones, "motor_spline", 0.02 * unit, 0.03 * unit, shared=shared, refused=refused)
    total = total_reduction(bones)
    assert total.after < 0.8 * total.before
    for bone, shown in matrices(rig, frames).items():
        # Rotations without the size of the rig.
        pair = [rows.copy() for rows in (shown, truth[bone])]
        for rows in pair:
            rows[:, :3, :3] /= np.cbrt(np.linalg.det(rows[:, :3, :3]))[:, None, None]
        assert largest(*pair, 0.03 * unit).max() <= 0.02 * unit * (1.0 + 2e-3), bone
