"""Exports that sample have the in-betweens in them: what a glTF file says frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import refresh, set_exact, set_mode
from rigid_motion.gltf import read_document
from rigid_motion.gltf.nodes import Nodes, by_target
from rigid_motion.gltf.tracks import read_clips
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.keyed import snapshot
from tests.animation.oracle import assert_shown, expected_worlds, shown_worlds
from tests.animation.scenes import FRAMES, enabled, give_own_deltas, key, new_object

PLAYED = np.arange(FRAMES[0], FRAMES[-1] + 1.0)


Y_UP = np.array(((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)))
"""From Blender's axes to those of glTF."""

FROM_Y_UP = np.block([[Y_UP.T, np.zeros((3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]])


@pytest.fixture
def exporter(live_file) -> Iterator[None]:
    """The frames to export, and Blender's own glTF importer and exporter switched on."""
    live_file.scene.frame_start, live_file.scene.frame_end = int(PLAYED[0]), int(PLAYED[-1])
    with enabled("io_scene_gltf2"):
        yield


def export(path: Path, animation_mode: str) -> Path:
    bpy.ops.export_scene.gltf(
        filepath=str(path),
        export_format="GLTF_SEPARATE",
        export_force_sampling=True,
        export_frame_range=False,
        export_animation_mode=animation_mode,
    )
    return path


def assert_exported(path: Path, expected: dict[str, np.ndarray]) -> None:
    """In a file these objects, parents first, move as expected, to 1e-4 of the size."""
    document = read_document(path)
    tracks = [track for clip in read_clips(document) for track in clip.tracks]
    times = PLAYED / bpy.context.scene.render.fps
    names = [node.get("name") for node in document.json["nodes"]]
    maps = Nodes(document).worlds(np.array([names.index(name) for name in expected]), by_target(tracks), times)
    for worlds, axes, origins in zip(expected.values(), maps.axes, maps.origins, strict=True):
        placed = np.concatenate((axes, origins[..., None]), axis=2)
        error = np.abs(placed - Y_UP @ worlds[:, :3] @ FROM_Y_UP).max()
        assert error < 1e-4 * max(1.0, np.abs(worlds).max())


@pytest.mark.parametrize("animation_mode", ["ACTIONS", "SCENE"])
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
    keys, shown = [snapshot(obj) for obj in objects], shown_worlds(objects, PLAYED)
    expected = {obj.name: expected_worlds(obj, PLAYED, owns) for obj in (parent, *objects)}
    path = export(tmp_path / "shot.gltf", animation_mode)
    assert [snapshot(obj) for obj in objects] == keys
    assert refresh() == 0, "exporting left the in-betweens alone"
    assert np.array_equal(shown_worlds(objects, PLAYED), shown)
    assert_exported(path, expected)


def test_what_is_exact_between_frames_is_exported_as_it_is_seen_in_one_clip_for_each(exporter, tmp_path):
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
    expected = {obj.name: expected_worlds(obj, PLAYED, owns) for obj in objects}
    path = export(tmp_path / "shot.gltf", "ACTIONS")
    assert len(read_clips(read_document(path))) == len(objects), "none of differences"
    assert_exported(path, expected)
