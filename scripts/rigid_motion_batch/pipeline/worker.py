"""One order, inside a Blender program: see `blender`. Standard library, NumPy and bpy alone."""

import os
import pickle
import sys
import threading
from pathlib import Path


def main() -> None:
    """Do the order in the file that is named behind "--", and write beside it what came of it."""
    os.dup2(2, 1)  # What Blender prints goes where its errors go.
    threading.Thread(target=_end_with_input, daemon=True).start()
    file, *sys.path[:0] = sys.argv[sys.argv.index("--") + 1 :]

    from rigid_motion_batch.pipeline.performing import perform

    message = perform(pickle.loads(Path(file).read_bytes()))
    Path(f"{file}.answer").write_bytes(pickle.dumps(message))
    # Not sys.exit: Blender can wait for long while it is taken down.
    sys.stderr.flush()
    os._exit(0)


def _end_with_input() -> None:
    sys.stdin.buffer.read()
    os._exit(1)


main()
