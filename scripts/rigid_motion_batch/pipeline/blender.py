"""Steps in a Blender of the user's: a program for each job, `BLENDER --background --python worker.py -- PATH...`.

The step's modules are found by path; they may use the standard library, NumPy and bpy, which is what a Blender has.
"""

from __future__ import annotations

import os
import pickle
import re
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, cast

from rigid_motion_batch.places import EXTENSION, PACKAGE
from rigid_motion_batch.supervising import end_with_parent

from .performing import ExecutorError
from .steps import Job, Step

WORKER = str(Path(__file__).with_name("worker.py"))

STARTING = 120.0
"""Seconds that a Blender has to say which it is."""


def version_of(blender: str) -> str:
    """Return the version of a Blender program, "5.2.3". Raises ExecutorError if it cannot be run or is no Blender."""
    reason = "this does not say that it is Blender"
    try:
        ended = subprocess.run([blender, "--version"], capture_output=True, timeout=STARTING, check=False)
        if said := re.search(rb"^Blender (\d+\.\d+\.\d+)", ended.stdout, re.MULTILINE):
            return said[1].decode()
    except (OSError, ValueError, subprocess.TimeoutExpired) as error:
        reason = getattr(error, "strerror", None) or str(error)
    raise ExecutorError(f"{blender}: {reason}; give the path of a Blender program")


def call_in_blender(job: Job) -> Any:
    """Call a job's step in a Blender of its own. Raises what it raises, and CalledProcessError if Blender dies."""
    path = [os.fspath(place) for place in (PACKAGE.parent, EXTENSION.parent, *_of_module(job.task.step))]
    command = [job.blender, "--background", "--factory-startup", "--python", WORKER, "--", *path]
    with (
        tempfile.TemporaryFile() as answer,
        (job.place / "log").open("ab") as log,
        subprocess.Popen(
            command,
            stdin=subprocess.PIPE,  # Whose end tells it that nobody waits any more.
            stdout=answer,
            stderr=log,
            preexec_fn=end_with_parent if sys.platform == "linux" else None,
        ) as process,
    ):
        with suppress(BrokenPipeError):
            stream = cast(IO[bytes], process.stdin)
            pickle.dump(job, stream)
            stream.flush()
        if code := process.wait():
            raise subprocess.CalledProcessError(code, command)
        answer.seek(0)
        facts, error = pickle.load(answer)
    if error:
        raise error
    return facts


def _of_module(step: Step) -> list[Path]:
    """Return what must be on the module path for the module of a step outside this package."""
    name = step.function.__module__
    if name.partition(".")[0] == PACKAGE.name:
        return []
    return [Path(cast(str, sys.modules[name].__file__)).resolve().parents[name.count(".")]]
