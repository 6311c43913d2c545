"""Exports that sample have the in-betweens in them: what a glTF file says frame by frame, and what imports show."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import refresh, set_exact, set_mode
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.keyed import snapshot
from tests.animation.oracle import assert_shown, expected_worlds, matrices, shown_worlds
from tests.animation.scenes import FRAMES, enabled, give_own_deltas, key, new_object

PLAYED = np.arange(FRAMES[0], FRAMES[-1] + 1.0)
PATHS = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}

Y_UP = np.array(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)), dtype=float)
"""From Blender's axes to those of glTF."""


@pytest.fixture
def exporter(live_file) -> Iterator[None]:
    """The frames to export, and Blender's own glTF importer and exporter switched on."""
    live_file.scene.frame_start, live_file.scene.frame_end = int(PLAYED[0]), int(PLAYED[-1])
    with enabled("io_scene_gltf2"):
        yield


def export(path: Path, **options: object) -> Path:
    bpy.ops.export_scene.gltf(
        filepath=str(path),
        export_format="GLTF_SEPARATE",
        export_force_sampling=True,
        export_frame_range=False,
        **options,
    )
    return path


def worlds_in(path: Path, name: str) -> np.ndarray:
    """A node's world matrices in Blender's axes, on all frames played, as glTF's own rules give them."""
    document = json.loads(path.read_text(encoding="utf-8"))
    nodes = document["nodes"]
    place = next(place for place, node in enumerate(nodes) if node.get("name") == name)
    world = np.tile(np.eye(4), (len(PLAYED), 1, 1))
    while place is not None:
        world = _locals(document, path, place) @ world
        place = next((i for i, node in enumerate(nodes) if place in node.get("children", ())), None)
    return np.linalg.inv(Y_UP) @ world @ Y_UP


def _locals(document: dict, path: Path, place: int) -> np.ndarray:
    """A node's own matrices on all frames played; its sampled channels must have a sample on each."""
    node, at = document["nodes"][place], {}
    assert "matrix" not in node
    for channel_path, rest in PATHS.items():
        at[channel_path] = np.tile(node.get(channel_path, rest), (len(PLAYED), 1))
    for animation in document.get("animations", ()):
        for channel in animation["channels"]:
            if channel["target"]["node"] == place:
                sampler = animation["samplers"][channel["sampler"]]
                frames = _accessor(document, path, sampler["input"])[:, 0] * bpy.context.scene.render.fps
                result = np.abs(frames[:, None] - PLAYED)
                if len(frames) > 1:
                    assert result.min(axis=0).max() < 1e-3, f"{node['name']} has samples on {frames}"
                values = _accessor(document, path, sampler["output"])
                at[channel["target"]["path"]] = values[result.argmin(axis=0)]
    x, y, z, w = at["rotation"].T
    return matrices(at["translation"], np.stack((w, x, y, z), axis=1), at["scale"])


def _accessor(document: dict, path: Path, index: int) -> np.ndarray:
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
    assert accessor["componentType"] == 5126, "numbers are in single precision"
    data = (path.parent / document["buffers"][view["buffer"]]["uri"]).read_bytes()
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    return np.frombuffer(data, "<f4", accessor["count"] * width, start).reshape(-1, width).astype(float)


def assert_near(result: np.ndarray, expected: np.ndarray) -> None:
    """To 1e-4 of the size."""
    assert np.abs(result - expected).max() < 1e-4 * max(1.0, np.abs(expected).max())


@pytest.mark.parametrize("animation_mode", ["ACTIONS", "ACTIVE_ACTIONS", "SCENE"])
def test_a_sampled_gltf_file_has_every_mode_on_every_frame(exporter, tmp_path, animation_mode):
    parent = key(new_object("Arm", "YXZ"), seed=77)
    objects, owns = [], {}
    for seed, mode in enumerate(KEYFRAME_MODES):
        for order in ("QUATERNION", "ZXY"):
            obj = new_object(f"{mode} {order}", order)
            if seed % 2:
                owns[obj.name] = give_own_deltas(obj, seed)
            obj.parent = parent if seed % 3 == 1 else None
            objects.append(key(obj, seed=seed, scale="even" if seed % 2 else None, interpolation="SINE"))
            set_mode(obj, mode)
    set_mode(parent, "dq_sclerp", [11.0])
    expected = {obj.name: expected_worlds(obj, PLAYED, owns) for obj in objects}
    keys, shown = [snapshot(obj) for obj in objects], shown_worlds(objects, PLAYED)
    path = export(tmp_path / "shot.gltf", export_animation_mode=animation_mode)
    for name, worlds in expected.items():
        assert_near(worlds_in(path, name), worlds)
    assert [snapshot(obj) for obj in objects] == keys
    assert refresh() == 0, "exporting left the in-betweens alone"
    assert np.array_equal(shown_worlds(objects, PLAYED), shown)
    for obj in objects:
        set_mode(obj, "BLENDER")
    assert max(np.abs(worlds_in(path, obj.name) - shown_worlds([obj], PLAYED)[0]).max() for obj in objects) > 0.1


@pytest.mark.parametrize("animation_mode", ["ACTIONS", "SCENE"])
def test_what_is_exact_between_frames_is_exported_as_it_is_seen(exporter, tmp_path, animation_mode):
    parent = new_object("Arm", "YXZ")
    parent.location, parent.rotation_euler, parent.scale = (1.0, 2.0, 3.0), (0.4, -0.2, 0.9), (2.0, 2.0, 2.0)
    objects, owns = [], {}
    for seed, order in enumerate(("QUATERNION", "ZXY", "QUATERNION", "XYZ")):
        obj = new_object(f"{seed} {order}", order)
        owns[obj.name] = give_own_deltas(obj, seed)
        obj.parent = parent if seed > 1 else None
        objects.append(key(obj, seed=seed, scale="even"))
    set_mode(objects, "motor_spline")
    set_exact(objects)
    bpy.context.view_layer.update()
    assert_shown(objects, PLAYED, owns)
    path = export(tmp_path / "shot.gltf", export_animation_mode=animation_mode)
    for obj in objects:
        assert_near(worlds_in(path, obj.name), expected_worlds(obj, PLAYED, owns))
    clips = json.loads(path.read_text(encoding="utf-8"))["animations"]
    assert len(clips) == len(objects), "none of differences"


@pytest.mark.parametrize("kind", ["alembic", "usd"])
def test_what_is_exported_to_a_cache_and_imported_again_moves_alike(exporter, tmp_path, kind):
    triangle = bpy.data.meshes.new("Triangle")
    triangle.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    obj = new_object("Tool", "XZY", triangle)
    give_own_deltas(obj)
    set_mode(key(obj, scale="even"), "cga_slerp")
    expected = shown_worlds([obj], PLAYED)[0]
    path = str(tmp_path / {"alembic": "shot.abc", "usd": "shot.usdc"}[kind])
    if kind == "alembic":
        bpy.ops.wm.alembic_export(filepath=path)
    else:
        bpy.ops.wm.usd_export(filepath=path, export_animation=True)
    assert refresh() == 0
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    if kind == "alembic":
        bpy.ops.wm.alembic_import(filepath=path, as_background_job=False)
    else:
        bpy.ops.wm.usd_import(filepath=path)
    (result,) = bpy.data.objects
    assert_near(shown_worlds([result], PLAYED)[0], expected)
