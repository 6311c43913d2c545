"""A Blender that has never heard of the extension, and plays one file after another: poses of rigs, frame by frame."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from types import TracebackType

import numpy as np

PLAYER = """
import json
import sys
import bpy
import numpy as np
bpy.ops.wm.read_factory_settings(use_empty=True)
for line in sys.stdin:
    wish = json.loads(line)
    bpy.ops.wm.open_mainfile(filepath=wish["path"])
    assert not hasattr(bpy.types.Object, "rigid_motion") and "rigid_motion" not in sys.modules
    graph, scene = bpy.context.evaluated_depsgraph_get(), bpy.context.scene
    worlds, poses = [], []
    for frame in wish["frames"]:
        scene.frame_set(int(frame // 1), subframe=frame % 1)
        rig = bpy.data.objects[wish["rig"]].evaluated_get(graph)
        worlds.append(np.array(rig.matrix_world))
        poses.append([np.array(bone.matrix) for bone in rig.pose.bones])
    np.savez(wish["found"], worlds=np.array(worlds), poses=np.array(poses))
    print("played", flush=True)
"""


class Player:
    """The process. To be used in a `with` statement."""

    def __enter__(self) -> Player:
        self._process = subprocess.Popen(
            [sys.executable, "-c", PLAYER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait(timeout=30)

    def play(self, path: Path, rig: str, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where a rig (n, 4, 4) and its bones in the rig's space (n, bones, 4, 4) are on frames (n,) of a file."""
        result = path.with_suffix(".npz")
        wish = {"path": str(path), "rig": rig, "frames": frames.tolist(), "found": str(result)}
        self._process.stdin.write(json.dumps(wish) + "\n")
        self._process.stdin.flush()
        while (line := self._process.stdout.readline().strip()) != "played":
            assert line or self._process.poll() is None, "the player has ended"
        with np.load(result) as arrays:
            return arrays["worlds"], arrays["poses"]
