"""A Blender without the extension: another process at factory settings, without this program."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

FARM = """
import sys
import bpy
import numpy as np
path, found, *names = sys.argv[1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.open_mainfile(filepath=path)
assert not hasattr(bpy.types.Object, "rigid_motion") and "rigid_motion" not in sys.modules
graph, scene = bpy.context.evaluated_depsgraph_get(), bpy.context.scene
worlds = lambda: [bpy.data.objects[name].evaluated_get(graph).matrix_world for name in names]
opened = np.array(worlds())
"""

PLAY = """
rigs = [name for name in names if bpy.data.objects[name].pose]
assert not hasattr(bpy.types.PoseBone, "rigid_motion")
poses = lambda: [bone.matrix for name in rigs for bone in bpy.data.objects[name].evaluated_get(graph).pose.bones]
played, played_poses = [], []
for frame in np.load(found):
    scene.frame_set(int(frame // 1), subframe=float(frame % 1))
    played.append(np.array(worlds()))
    played_poses.append(np.array(poses()))
worlds, poses = np.swapaxes(played, 0, 1), np.swapaxes(played_poses, 0, 1)
np.savez(found.replace(".npy", ".npz"), opened=opened, worlds=worlds, poses=poses)
"""

SAVE = "bpy.ops.wm.save_as_mainfile(filepath=found)"


class Played(NamedTuple):
    """World matrices of objects when the file is opened (n, 4, 4) and on all frames played (n, frames, 4, 4), and
    matrices of the bones of all rigs in armature space (., frames, 4, 4).
    """

    opened: np.ndarray
    worlds: np.ndarray
    poses: np.ndarray


def on_a_farm(program: str, *arguments: object) -> None:
    """Run a program in a Blender without the extension."""
    done = subprocess.run(
        [sys.executable, "-c", FARM + program, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        cwd=Path(str(arguments[0])).parent,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def played_on_a_farm(path: Path, names: Sequence[str], frames: np.ndarray) -> Played:
    """Play a file in a Blender without the extension."""
    found = path.with_suffix(".npy")
    np.save(found, frames)
    on_a_farm(PLAY, path, found, *names)
    with np.load(found.with_suffix(".npz")) as result:
        return Played(**result)
