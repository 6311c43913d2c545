"""Steps in a Blender of the user's: one program for each task, `BLENDER --background --python worker.py -- REQUEST`.

The request is JSON, and so are the lines that come back: how far it is, and what came of it. The step's modules are
found by path; they may use the standard library, NumPy and bpy, which is what a Blender has.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rigid_motion_batch.places import EXTENSION, PACKAGE
from rigid_motion_batch.supervising import end_with_parent

from .performing import ExecutorError
from .steps import Job, Step, TaskError
from .values import to_plain

WORKER = Path(__file__).with_name("worker.py")

STARTING = 120.0
"""Seconds that a Blender has to say which it is."""


def version_of(blender: str) -> str:
    """The version of a Blender program: "5.2.3". Raises ExecutorError where that cannot be run, or is none."""
    try:
        ended = subprocess.run(
            [blender, "--version"], capture_output=True, text=True, errors="replace", timeout=STARTING, check=False
        )
    except (OSError, ValueError, subprocess.TimeoutExpired) as error:
        said = getattr(error, "strerror", None) or str(error)
        raise ExecutorError(f"{blender}: {said}; give the path of a Blender program") from None
    found = re.search(r"^Blender (\d+\.\d+\.\d+)", ended.stdout, re.MULTILINE)
    if found is None:
        raise ExecutorError(f"{blender}: this does not say that it is Blender; give the path of a Blender program")
    return found[1]


def in_blender(blender: str, step: Step, job: Job, parameters: Any) -> Mapping[str, Any]:
    """Do a step in a Blender of its own.

    Returns
    -------
    mapping
        What the step returned.

    Raises
    ------
    TaskError, OSError, RuntimeError
        As the step did; the last for what nobody foresaw, with the traceback as a note.
    ChildProcessError
        Where that Blender died.
    """
    request = {
        "path": [os.fspath(place) for place in (PACKAGE.parent, EXTENSION.parent, *_of_module(step))],
        "step": step.name,
        "parameters": to_plain(parameters),
        "before": [None if before is None else os.path.abspath(before) for before in job.before],
        "inputs": [os.path.abspath(path) for path in job.inputs],
        "folder": os.path.abspath(job.folder),
    }
    stem = job.folder.with_name(f"{job.folder.name}.request")
    stem.write_text(json.dumps(request), encoding="utf-8")
    log = stem.with_suffix(".log")
    command = [blender, "--background", "--factory-startup", "--python", os.fspath(WORKER), "--", os.path.abspath(stem)]
    answer: dict[str, Any] = {}
    try:
        with (
            log.open("wb") as errors,
            subprocess.Popen(
                command,
                stdin=subprocess.PIPE,  # Whose end tells it that nobody waits any more.
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                encoding="utf-8",
                errors="replace",
                preexec_fn=end_with_parent if sys.platform == "linux" else None,
            ) as process,
        ):
            for line in process.stdout:
                if line.startswith("rigid-motion: "):
                    answer = json.loads(line.removeprefix("rigid-motion: "))
                    if "share" in answer:
                        job.progress(answer["share"], 1.0, answer["doing"])
            process.stdin.close()
        said = next((line for line in reversed(log.read_text(errors="replace").splitlines()) if line.strip()), "")
    finally:
        stem.unlink(missing_ok=True)
        log.unlink(missing_ok=True)
    if "share" in answer or not answer:
        raise ChildProcessError(f"Blender died (exit code {process.returncode}){f': {said[:200]}' if said else ''}")
    job.notes += answer["notes"]
    if "facts" in answer:
        return answer["facts"]
    if answer["kind"] == "TaskError":
        raise TaskError(answer["error"])
    if answer["kind"] == "OSError":
        raise OSError(*answer["error"])
    error = RuntimeError(answer["error"])
    error.add_note(answer["details"])
    raise error


def _of_module(step: Step) -> list[Path]:
    """What must be on the module path for the module of a step that is not of this package."""
    name = step.function.__module__
    if name.partition(".")[0] == PACKAGE.name:
        return []
    return [Path(sys.modules[name].__file__).resolve().parents[name.count(".")]]
