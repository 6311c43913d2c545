"""Test steps that need Blender, using only the standard library and bpy."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from rigid_motion_batch.pipeline.steps import Step, StepJob


class Save(Step, blender=True):
    """Write a .blend file with a scene of this name, and note whether bpy ran in a Blender program."""

    name: str
    frames: tuple[int, ...] = ()
    fate: str = ""

    def make(self, job: StepJob) -> dict[str, int]:
        import bpy

        print("Fra:1 Mem:1M")
        job.progress(1, 2)
        match self.fate:
            case "full":
                raise OSError(28, "No space left on device", str(job.folder / "scene.blend"))
            case "killed":
                os.kill(os.getpid(), signal.SIGKILL)
            case "slow":
                (job.folder / "begun").touch()
                time.sleep(600)
        bpy.context.scene.name = self.name
        bpy.context.scene.frame_end = self.frames[-1]
        bpy.ops.wm.save_as_mainfile(filepath=str(job.folder / "scene.blend"))
        before = "".join((folder / "out.txt").read_text() for folder in job.before)
        inputs = "".join(path.read_text() for path in map(Path, job.task.inputs))
        (job.folder / "out.txt").write_text(f"{bool(bpy.app.binary_path)} {before}{inputs}")
        return {"frames": len(self.frames)}
