"""Exported and re-imported objects and rigs move as their modes say, with no export settings for modes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import refresh, set_mode
from rigid_motion.gltf import read_document
from rigid_motion.gltf.tracks import read_clips
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.poses import expected_poses, shown_poses
from tests.animation.bones.rigs import in_turn, key_all, new_rig
from tests.animation.keyed import snapshot
from tests.animation.oracle import assert_near, expected_worlds, shown_worlds
from tests.animation.scenes import FRAMES, enabled, give_own_deltas, key, new_object

PLAYED = np.arange(FRAMES[0], FRAMES[-1] + 1.0)
MODES = tuple(KEYFRAME_MODES)
ORDERS = ("QUATERNION", "ZXY", "AXIS_ANGLE")

AS_SEEN = {"bake_anim_use_all_actions": False, "bake_anim_use_nla_strips": False, "bake_anim_simplify_factor": 0.0}
Format = tuple[Callable[..., object], Callable[..., object], dict[str, object], dict[str, object]]
FORMATS: dict[str, Format] = {
    "glb": (bpy.ops.export_scene.gltf, bpy.ops.import_scene.gltf, {}, {}),
    "scene.glb": (bpy.ops.export_scene.gltf, bpy.ops.import_scene.gltf, {"export_animation_mode": "SCENE"}, {}),
    "fbx": (bpy.ops.export_scene.fbx, bpy.ops.import_scene.fbx, AS_SEEN, {"anim_offset": 0.0}),
    "usdc": (bpy.ops.wm.usd_export, bpy.ops.wm.usd_import, {"export_animation": True}, {}),
    "abc": (bpy.ops.wm.alembic_export, bpy.ops.wm.alembic_import, *2 * ({"as_background_job": False},)),
}
"""Exporter, importer and their options, which request animation, separate for each object and unsimplified."""


@pytest.fixture(autouse=True)
def exporters(live_file) -> Iterator[None]:
    """Switch on Blender's own exporters."""
    with enabled("io_scene_gltf2", "io_scene_fbx"):
        yield


def reimport(objects: list[bpy.types.Object], path: Path, how: Format) -> None:
    """Export everything without changing these objects, and import the file into a new one."""
    save, load, options, loading = how
    keys, shown = [snapshot(obj) for obj in objects], shown_worlds(objects, PLAYED)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = int(PLAYED[0]) - 3, int(PLAYED[-1]) + 3
    save(filepath=str(path), **options)
    assert [snapshot(obj) for obj in objects] == keys
    assert refresh() == 0, "exporting left the in-betweens alone"
    assert np.array_equal(shown_worlds(objects, PLAYED), shown)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = int(PLAYED[0]) - 3, int(PLAYED[-1]) + 3
    load(filepath=str(path), **loading)


def assert_alike(names: Iterable[str], shown: Iterable[np.ndarray], expected: Iterable[np.ndarray]) -> None:
    """Check for equal motion relative to the first frame: importers change axes as they like."""
    for name, one, other in zip(names, shown, expected, strict=True):
        moved, right = (worlds @ np.linalg.inv(worlds[:1]) for worlds in (one, other))
        assert_near(moved, right, name)


@pytest.mark.parametrize("kind", FORMATS)
def test_objects_that_are_exported_and_imported_move_alike(tmp_path, kind):
    parent = key(new_object("Arm", "YXZ"), seed=77)
    objects = [parent]
    for seed, (mode, order) in enumerate(in_turn(MODES, ORDERS)):
        obj = new_object(f"{mode} {order}", order)
        if seed % 2 and order != "AXIS_ANGLE":
            give_own_deltas(obj, seed)
        obj.parent = parent if seed % 3 == 1 else None
        objects.append(key(obj, seed=seed, scale="even" if seed % 2 else None, interpolation="SINE"))
        set_mode(obj, mode)
    set_mode(parent, "dq_sclerp", [11.0])
    expected = {obj.name: expected_worlds(obj, PLAYED) for obj in objects}
    path = tmp_path / f"shot.{kind}"
    reimport(objects, path, FORMATS[kind])
    if kind == "glb":
        assert len(read_clips(read_document(path))) == len(expected), "one for each Action"
    by_name = {obj.name.replace("_", " "): obj for obj in bpy.data.objects}
    found = [by_name[name.replace("_", " ")] for name in expected]
    for data in (obj.animation_data for obj in found if obj.animation_data):
        # Importers of clips put them into NLA strips.
        for strip in (strip for track in data.nla_tracks for strip in track.strips):
            data.action, data.action_slot = strip.action, strip.action_slot
    assert_alike(expected, shown_worlds(found, PLAYED), expected.values())


# Without this option, FBX omits keys and is off by up to 1e-3 of the reach, even with real keys.
OF_RIGS = {"glb": FORMATS["glb"], "fbx": (*FORMATS["fbx"][:2], {"bake_anim_simplify_factor": 0.0}, {})}


@pytest.mark.parametrize(("order", "kind"), in_turn(ORDERS, [*OF_RIGS]))
def test_a_rig_that_is_exported_has_its_modes_in_one_animation_of_the_actions_own_range(tmp_path, kind, order):
    rig = key_all(new_rig("Rig", rotation_mode=order))
    # Twelve bones in all orders: at least as many as there are modes.
    for number, bone in enumerate(rig.pose.bones, 4 * ORDERS.index(order)):
        set_mode(bone, MODES[number % len(MODES)])
    expected = expected_poses(rig, PLAYED)
    reimport([rig], tmp_path / f"rig.{kind}", OF_RIGS[kind])
    (action,), rig = bpy.data.actions, next(obj for obj in bpy.data.objects if obj.type == "ARMATURE")
    assert np.allclose(action.curve_frame_range, (PLAYED[0], PLAYED[-1]), atol=1e-3)
    shown = shown_poses([rig], PLAYED)[0]
    assert_alike(expected, (np.array(rig.matrix_world) @ shown[name] for name in expected), expected.values())
