"""A Blender that has never heard of the extension: another process at factory settings, without this program."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

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
played = []
for frame in np.load(found):
    scene.frame_set(int(frame))
    played.append(np.array(worlds()))
np.savez(found.replace(".npy", ".npz"), opened=opened, played=np.array(played))
"""


def on_a_farm(program: str, *arguments: object) -> None:
    """Run a program in a Blender that has never heard of the extension."""
    done = subprocess.run(
        [sys.executable, "-c", FARM + program, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        cwd=Path(str(arguments[0])).parent,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def played_on_a_farm(path: Path, names: Sequence[str], played: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """World matrices as the file is opened (objects, 4, 4), and on all frames played (objects, frames, 4, 4)."""
    frames = path.with_suffix(".npy")
    np.save(frames, played)
    on_a_farm(PLAY, path, frames, *names)
    with np.load(frames.with_suffix(".npz")) as result:
        return result["opened"], result["played"].swapaxes(0, 1)
