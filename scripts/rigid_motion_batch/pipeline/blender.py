"""Orders in a Blender of the user's: one program for each, `BLENDER --background --python worker.py -- ORDER PATH...`.

Order and answer are pickled into a temporary folder that no one else may enter. The step's modules are found by path;
they may use the standard library, NumPy and bpy, which is what a Blender has.
"""

from __future__ import annotations

import os
import pickle
import re
import subprocess
import sys
import tempfile
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import cast

from rigid_motion_batch.places import EXTENSION, PACKAGE
from rigid_motion_batch.supervising import death, end_with_parent

from .performing import INTERVAL, Answer, ExecutorError, Order, Tell, last_words, progress_of
from .steps import Step

WORKER = str(Path(__file__).with_name("worker.py"))

STARTING = 120.0
"""Seconds that a Blender has to say which it is."""


def version_of(blender: str) -> str:
    """Return the version of a Blender program, "5.2.3". Raises ExecutorError if it cannot be run or is no Blender."""
    try:
        ended = subprocess.run(
            [blender, "--version"], capture_output=True, text=True, errors="replace", timeout=STARTING, check=False
        )
    except (OSError, ValueError, subprocess.TimeoutExpired) as error:
        said = getattr(error, "strerror", None) or str(error)
        raise ExecutorError(f"{blender}: {said}; give the path of a Blender program") from None
    result = re.search(r"^Blender (\d+\.\d+\.\d+)", ended.stdout, re.MULTILINE)
    if result is None:
        raise ExecutorError(f"{blender}: this does not say that it is Blender; give the path of a Blender program")
    return result[1]


def perform_in_blender(order: Order, tell: Tell | None) -> Answer:
    """Do an order in a Blender of its own, as `perform` does it here."""
    path = [os.fspath(place) for place in (PACKAGE.parent, EXTENSION.parent, *_of_module(order.step))]
    try:
        with tempfile.TemporaryDirectory() as folder:
            file, answer, log = (Path(folder, name) for name in ("order", "order.answer", "log"))
            file.write_bytes(pickle.dumps(replace(order, blender="")))
            command = [order.blender, "--background", "--factory-startup", "--python", WORKER, "--", str(file), *path]
            with (
                log.open("wb") as errors,
                subprocess.Popen(
                    command,
                    stdin=subprocess.PIPE,  # Whose end tells it that nobody waits any more.
                    stdout=subprocess.DEVNULL,
                    stderr=errors,
                    preexec_fn=end_with_parent if sys.platform == "linux" else None,
                ) as process,
            ):
                while _is_at_work(process):
                    if tell and (progress := progress_of(order)):
                        tell(*progress)
            if answer.exists():
                return pickle.loads(answer.read_bytes())
            return Answer(problem=f"Blender died ({death(process.returncode)}){last_words(log)}", lost=True)
    except OSError as error:
        return Answer(problem=f"{order.blender}: {error.strerror}")


def _is_at_work(process: subprocess.Popen) -> bool:
    with suppress(subprocess.TimeoutExpired):
        process.wait(INTERVAL)
    return process.returncode is None


def _of_module(step: Step) -> list[Path]:
    """Return what must be on the module path for the module of a step outside this package."""
    name = step.function.__module__
    if name.partition(".")[0] == PACKAGE.name:
        return []
    return [Path(cast(str, sys.modules[name].__file__)).resolve().parents[name.count(".")]]
