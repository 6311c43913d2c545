"""Steps for tests of the pipeline, with effects that can be seen from outside, in files."""

import errno
import os
import signal
import time
from pathlib import Path

from rigid_motion_batch.pipeline.steps import Step, StepJob, TaskError

FILE = "out.txt"
"""The file that every result has."""


class Write(Step, stage="write"):
    """Writes a text, and notes that in a log."""

    text: str = ""
    log: str = ""
    seconds: float = 0.0
    files: tuple[str, ...] = ()
    """Further files with the same text."""

    def make(self, job: StepJob) -> dict[str, int]:
        _note(self.log, self.text)
        (job.folder / FILE).write_text("half")
        time.sleep(self.seconds)
        for name in (FILE, *self.files):
            place = job.folder / name
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(self.text)
        return {"characters": len(self.text)}


class Join(Step, stage="join"):
    """Writes the joined texts of the available results before it."""

    log: str = ""

    def make(self, job: StepJob) -> None:
        _note(self.log, "join")
        (job.folder / FILE).write_text("".join((folder / FILE).read_text() for folder in job.before if folder))


class Report(Join, stage="report", partial=True):
    """A `Join` that also runs if some results are missing."""


class Copy(Step):
    """Writes the content of an input file."""

    log: str = ""

    def make(self, job: StepJob) -> None:
        _note(self.log, "copy")
        (job.folder / FILE).write_text(Path(*job.task.inputs).read_text())


class Vanish(Copy):
    """Writes the content of an input file, which then disappears."""

    def make(self, job: StepJob) -> None:
        super().make(job)
        Path(*job.task.inputs).unlink()


class Fail(Step):
    """Writes half, and fails: as foreseen, by an unforeseen error, or as on a full disk."""

    why: str = "foreseen"

    def make(self, job: StepJob) -> None:
        (job.folder / FILE).write_text("half")
        match self.why:
            case "foreseen":
                raise TaskError("it cannot be made; make another")
            case "full disk":
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(job.folder / FILE))
        raise KeyError(self.why)


class Die(Step):
    """Writes half and dies of SIGKILL, the first `times` times; then writes everything."""

    marker: str
    times: int
    words: str = ""

    def make(self, job: StepJob) -> None:
        (job.folder / FILE).write_text("half")
        with Path(self.marker).open("a") as stream:
            stream.write("x")
        if len(Path(self.marker).read_text()) <= self.times:
            os.write(2, self.words.encode())
            os.kill(os.getpid(), signal.SIGKILL)
        (job.folder / FILE).write_text("whole")


class ProcessId(Step):
    """Writes the process id, after some seconds."""

    text: str
    seconds: float

    def make(self, job: StepJob) -> None:
        time.sleep(self.seconds)
        (job.folder / FILE).write_text(str(os.getpid()))


class Chatter(Step):
    """Prints to standard output as Blender does, from Python and from C, and reports progress."""

    def make(self, job: StepJob) -> None:
        print("Saved: 'x.png'", flush=True)
        os.write(1, b"Fra:1 Mem:1M\n")
        job.progress(1, 2)
        time.sleep(0.5)
        (job.folder / FILE).write_text("spoken")


def _note(log: str, text: str) -> None:
    if log:
        with Path(log).open("a") as stream:
            stream.write(f"{text}\n")


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
