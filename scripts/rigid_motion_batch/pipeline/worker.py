"""One step, inside a Blender program: see `blender`. Standard library, NumPy and bpy alone."""

import json
import os
import sys
import threading
import time
import traceback
from pathlib import Path


def main() -> None:
    """Do what the request says that is named behind "--"."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # What Blender prints is no answer.
    request = json.loads(Path(sys.argv[sys.argv.index("--") + 1]).read_text(encoding="utf-8"))
    sys.path[:0] = request["path"]
    threading.Thread(target=_end_with_input, daemon=True).start()

    from rigid_motion_batch.pipeline.steps import Job, TaskError, step_named
    from rigid_motion_batch.pipeline.values import from_plain

    def say(**content: object) -> None:
        answers.write(f"rigid-motion: {json.dumps(content)}\n")
        answers.flush()

    said_at = 0.0

    def tell(share: float, doing: str) -> None:
        nonlocal said_at
        if time.monotonic() - said_at >= 0.2:
            said_at = time.monotonic()
            say(share=share, doing=doing)

    before = [None if folder is None else Path(folder) for folder in request["before"]]
    job = Job(Path(request["folder"]), before, [Path(path) for path in request["inputs"]], tell)
    try:
        step = step_named(request["step"])
        facts = step.function(job, from_plain(step.parameters, request["parameters"]))
        say(facts=dict(facts or {}), notes=job.notes)
    except TaskError as error:
        say(kind="TaskError", error=str(error), notes=job.notes)
    except OSError as error:
        say(kind="OSError", error=[error.errno, error.strerror, error.filename], notes=job.notes)
    except Exception as error:
        said, details = f"{type(error).__name__}: {error}", traceback.format_exc()
        say(kind="", error=said, details=details, notes=job.notes)
    answers.close()
    # Not sys.exit: Blender can wait for long while it is taken down.
    sys.stderr.flush()
    os._exit(0)


def _end_with_input() -> None:
    sys.stdin.buffer.read()
    os._exit(1)


main()
