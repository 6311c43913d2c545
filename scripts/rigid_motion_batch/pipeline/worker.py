"""A step inside a Blender program: see `blender`. Standard library, NumPy and bpy alone."""

import os
import pickle
import sys
import threading


def main() -> None:
    """Do the job that comes by the standard input, and put what came of it in the place of the standard output."""
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # What Blender prints goes where its errors go.
    sys.path[:0] = sys.argv[sys.argv.index("--") + 1 :]
    job, facts, problem = pickle.load(sys.stdin.buffer), None, None
    threading.Thread(target=_end_with_input, daemon=True).start()
    try:
        facts = job.task.step.function(job, job.task.parameters)
    except Exception as error:
        problem = error
    answer.truncate(0)  # Blender has said which it is.
    answer.seek(0)
    pickle.dump((facts, problem), answer)
    answer.flush()
    # Not sys.exit: Blender can wait for long while it is taken down.
    sys.stderr.flush()
    os._exit(0)


def _end_with_input() -> None:
    sys.stdin.buffer.read()
    os._exit(1)


main()
