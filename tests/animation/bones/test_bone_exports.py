"""Rigs that are exported in the exporters' default settings and imported again move as their modes have it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, reduce_keys_of, refresh, set_mode
from rigid_motion.gltf import read_document
from rigid_motion.gltf.tracks import read_clips
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.poses import Poses, assert_same_poses, expected_poses, shown_poses
from tests.animation.bones.rigs import ARM, FRAMES, PLAYED, Rest, key_all, moving_rig, new_rig
from tests.animation.keyed import snapshot
from tests.animation.scenes import enabled

EXPORTED = np.arange(FRAMES[0], FRAMES[-1] + 1.0)


@pytest.fixture
def exporter(live_file) -> Iterator[None]:
    """The frames to export, and Blender's own exporters switched on."""
    live_file.scene.frame_start, live_file.scene.frame_end = int(PLAYED[0]), int(PLAYED[-1])
    with enabled("io_scene_gltf2", "io_scene_fbx"):
        yield


def export(kind: str, path: Path, **options: object) -> Path:
    (bpy.ops.export_scene.gltf if kind == "glb" else bpy.ops.export_scene.fbx)(filepath=str(path), **options)
    return path


def imported(kind: str, path: Path) -> bpy.types.Object:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    (bpy.ops.import_scene.gltf if kind == "glb" else bpy.ops.import_scene.fbx)(filepath=str(path))
    return next(obj for obj in bpy.data.objects if obj.type == "ARMATURE")


def relative(poses: Poses) -> Poses:
    """Each bone's matrices from where it was on the first frame on: importers lay the axes of bones as they like."""
    return {name: matrices @ np.linalg.inv(matrices[0]) for name, matrices in poses.items()}


def every_mode(order: str) -> bpy.types.Object:
    """An arm for each mode in one rig."""
    bones = [
        Rest(f"{mode} {rest.name}", rest.head, rest.tail, f"{mode} {rest.parent}" if rest.parent else "", rest.roll)
        for mode in KEYFRAME_MODES
        for rest in ARM
    ]
    rig = key_all(new_rig("Rig", bones, order))
    for pose_bone in rig.pose.bones:
        set_mode(pose_bone, pose_bone.name.split()[0])
    return rig


EXACT = {"glb": {}, "fbx": {"bake_anim_simplify_factor": 0.0}}
"""Besides the defaults: without it, FBX leaves keys out, and is off by up to 1e-3 of the reach with real keys too."""


@pytest.mark.parametrize("kind", EXACT)
@pytest.mark.parametrize("order", ["QUATERNION", "ZXY", "AXIS_ANGLE"])
def test_an_export_has_every_mode_in_one_animation_of_the_actions_own_range(exporter, tmp_path, kind, order):
    rig = every_mode(order)
    keys, expected = snapshot(rig), relative(expected_poses(rig, EXPORTED))
    path = export(kind, tmp_path / f"rig.{kind}", **EXACT[kind])
    assert snapshot(rig) == keys
    assert refresh() == 0, "exporting left the in-betweens alone"
    result = imported(kind, path)
    assert len(bpy.data.actions) == 1
    assert np.allclose(result.animation_data.action.curve_frame_range, (FRAMES[0], FRAMES[-1]), atol=1e-3)
    world, (shown,) = np.array(result.matrix_world), shown_poses([result], EXPORTED)
    moved = relative({name: world @ matrices for name, matrices in shown.items()})
    assert_same_poses(result, EXPORTED, moved, expected)


def clips(path: Path) -> list[str]:
    """The names of the animations in a GLB file."""
    return sorted(clip.name for clip in read_clips(read_document(path)))


def test_each_action_of_a_rig_is_one_clip(exporter, tmp_path):
    rig = moving_rig("dq_sclerp")
    rig.animation_data.action.name, rig.animation_data.action.use_fake_user = "Walk", True
    rig.animation_data.action = None
    key_all(rig, seed=3)
    set_mode(list(rig.pose.bones), "motor_spline")
    rig.animation_data.action.name = "Run"
    assert clips(export("glb", tmp_path / "rig.glb")) == ["Run", "Walk"]
    bake(list(rig.pose.bones))
    reduce_keys_of(list(rig.pose.bones), "dq_sclerp", 0.01)
    assert clips(export("glb", tmp_path / "reduced.glb")) == ["Run", "Walk"]
