"""Objects that are exported and imported again move as their modes have it, with nothing to be set for it."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion.animation import refresh, set_mode
from rigid_motion.gltf import read_document
from rigid_motion.gltf.tracks import read_clips
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import snapshot
from tests.animation.oracle import expected_worlds, shown_worlds
from tests.animation.scenes import FRAMES, enabled, give_own_deltas, key, new_object

PLAYED = np.arange(FRAMES[0], FRAMES[-1] + 1.0)
ORDERS = ("QUATERNION", "ZXY", "AXIS_ANGLE")

AS_SEEN = {"bake_anim_use_all_actions": False, "bake_anim_use_nla_strips": False, "bake_anim_simplify_factor": 0.0}
FORMATS: dict[str, tuple[Callable[..., object], Callable[..., object], dict[str, object], dict[str, object]]] = {
    "glb": (bpy.ops.export_scene.gltf, bpy.ops.import_scene.gltf, {}, {}),
    "scene.glb": (bpy.ops.export_scene.gltf, bpy.ops.import_scene.gltf, {"export_animation_mode": "SCENE"}, {}),
    "fbx": (bpy.ops.export_scene.fbx, bpy.ops.import_scene.fbx, AS_SEEN, {"anim_offset": 0.0}),
    "usdc": (bpy.ops.wm.usd_export, bpy.ops.wm.usd_import, {"export_animation": True}, {}),
    "abc": (bpy.ops.wm.alembic_export, bpy.ops.wm.alembic_import, *2 * ({"as_background_job": False},)),
}
"""How to export and import, and what is to be chosen: that there shall be animation, each object's own, as it is."""


def every_mode() -> tuple[list[bpy.types.Object], dict[str, np.ndarray]]:
    """A moving parent, objects of all modes with delta transforms or without, and where they have to be."""
    parent = key(new_object("Arm", "YXZ"), seed=77)
    objects, owns = [parent], {}
    for seed, (mode, order) in enumerate(in_turn(KEYFRAME_MODES, ORDERS)):
        obj = new_object(f"{mode} {order}", order)
        if seed % 2 and order != "AXIS_ANGLE":
            owns[obj.name] = give_own_deltas(obj, seed)
        obj.parent = parent if seed % 3 == 1 else None
        objects.append(key(obj, seed=seed, scale="even" if seed % 2 else None, interpolation="SINE"))
        set_mode(obj, mode)
    set_mode(parent, "dq_sclerp", [11.0])
    return objects, {obj.name: expected_worlds(obj, PLAYED, owns) for obj in objects}


def motions(worlds: np.ndarray) -> np.ndarray:
    """From where something was at first on: importers lay its axes as they like."""
    return worlds @ np.linalg.inv(worlds[:1])


@pytest.mark.parametrize("kind", FORMATS)
def test_what_is_exported_and_imported_moves_alike(live_file, tmp_path, kind):
    save, load, options, loading = FORMATS[kind]
    live_file.scene.frame_start, live_file.scene.frame_end = int(PLAYED[0]), int(PLAYED[-1])
    path = tmp_path / f"shot.{kind}"
    with enabled("io_scene_gltf2", "io_scene_fbx"):
        objects, expected = every_mode()
        keys, names, shown = [snapshot(obj) for obj in objects], list(expected), shown_worlds(objects, PLAYED)
        save(filepath=str(path), **options)
        assert [snapshot(obj) for obj in objects] == keys
        assert refresh() == 0, "exporting left the in-betweens alone"
        assert np.array_equal(shown_worlds(objects, PLAYED), shown)
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        bpy.context.scene.frame_start, bpy.context.scene.frame_end = int(PLAYED[0]), int(PLAYED[-1])
        load(filepath=str(path), **loading)
    if kind == "glb":
        assert len(read_clips(read_document(path))) == len(names), "one for each Action"
    found = [
        next(obj for obj in bpy.data.objects if obj.name.replace("_", " ") == name.replace("_", " ")) for name in names
    ]
    for data in (obj.animation_data for obj in found if obj.animation_data):
        # Importers of clips put them aside.
        for strip in (strip for track in data.nla_tracks for strip in track.strips):
            data.action, data.action_slot = strip.action, strip.action_slot
    for name, worlds in zip(names, shown_worlds(found, PLAYED), strict=True):
        error = np.abs(motions(worlds) - motions(expected[name])).max()
        assert error < 1e-5 * max(1.0, np.abs(motions(expected[name])).max()), f"{name} is off by {error}"
