"""A worker process: reads orders from its standard input, does them, answers on its standard output.

Started by `processes`, with Python or with Blender. Whatever else is printed in it, by Blender or by a library, goes to
the standard error.
"""

from __future__ import annotations

import faulthandler
import json
import os
import queue
import signal
import sys
import threading
import time
from pathlib import Path

PROGRAM = str(Path(__file__).resolve().parents[2])
if PROGRAM not in sys.path:
    sys.path.insert(0, PROGRAM)

from rigid_motion_batch.supervising import end_with_parent
from rigid_motion_batch.workplan.performing import Message, Noted, Order, Told, as_json, perform

PREFIX = "work plan: "
"""Begins every line that is an answer."""

INTERVAL = 0.1
"""Seconds between two messages about how far a task is."""


def main() -> None:
    """Work until the input ends; then end at once, whatever is being done: nobody waits for it any more."""
    answers = os.fdopen(os.dup(1), "w", encoding="ascii")
    os.dup2(2, 1)
    faulthandler.enable()
    # Ctrl-C goes to all processes of a terminal. What becomes of it is the parent's to decide.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # The end of the input is not seen while Blender is at work.
    end_with_parent()
    orders: queue.SimpleQueue[Order] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(orders,), daemon=True).start()

    def say(message: Message, **more: int) -> None:
        answers.write(PREFIX + json.dumps(as_json(message) | more) + "\n")
        answers.flush()

    while True:
        order = orders.get()
        said_at = 0.0

        def tell(message: Told | Noted) -> None:
            nonlocal said_at
            if isinstance(message, Noted) or time.monotonic() - said_at >= INTERVAL:
                said_at = time.monotonic()
                say(message)

        say(perform(order, tell), peak=peak_memory())


def peak_memory_of(process: int | str) -> int:
    """The most memory, in bytes, that a process has had; 0 where it is gone, or the system does not tell."""
    try:
        status = Path(f"/proc/{process}/status").read_text(encoding="ascii", errors="replace")
    except OSError:
        return 0
    return next((int(line.split()[1]) << 10 for line in status.splitlines() if line.startswith("VmHWM:")), 0)


def peak_memory() -> int:
    """The most memory, in bytes, that this process has had; 0 where the system does not tell."""
    # Not getrusage, where that can be: there a process begins with the peak of the one that started it.
    if found := peak_memory_of("self"):
        return found
    try:
        import resource
    except ImportError:
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def _read(orders: queue.SimpleQueue[Order]) -> None:
    for line in sys.stdin:
        orders.put(Order(**json.loads(line)))
    # Not sys.exit: Blender 4.5's module can wait forever while it is taken down.
    os._exit(0)


if __name__ == "__main__":
    main()
