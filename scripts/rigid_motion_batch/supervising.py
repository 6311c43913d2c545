"""Supervision of a command by two processes: a small parent that can always stop, and a child that does the work.

Python cannot interrupt an importer of Blender, the opening of a large file, or a long computation in NumPy. So the
started process runs its own command line again as a child, in the same terminal and with the same streams. It passes
signals on, gives the child a moment to end between two steps, then kills it, removes its half-written files, and prints
which files are complete. The parent imports neither Blender nor NumPy.

The child reports in a journal, a file in a temporary folder that both share: see `report`. The folder is deleted with
all of Blender's temporary files when the command ends.
"""

from __future__ import annotations

import ctypes
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from .command_line import path_line, printable

SESSION_VARIABLE = "RIGID_MOTION_SESSION"
"""Environment variable with the temporary folder of a child; empty if none could be created."""

JOURNAL = "journal"

GRACE_S = 1.2
"""Seconds that the child has to end by itself after a signal."""

LAST_WAIT_S = 1.7
"""Seconds after which the parent stops waiting for a killed child: the system may be reading from a disk that is
gone."""

LOOK_S = 0.1
"""Seconds between two checks of the child."""

STOPPED_TEXT = "Stopped. What was written by then is complete."
"""The message if the child left no better one."""

SHOW_CURSOR = "\x1b[?25h"
"""The escape sequence that shows a terminal's cursor."""

PR_SET_PDEATHSIG = 1
"""See prctl(2)."""

ASK_SIGNAL = getattr(signal, "SIGUSR1", None)
"""The signal with which the parent asks its child to end. Any other signal may reach both processes from a terminal or
a farm, and would ask twice. Windows lacks it: there the console sends Ctrl-C to both, and the parent waits."""

_session = ""
_journal: int | None = None
_is_child = False


def stop_signals() -> list[signal.Signals]:
    """Return the signals that stop this process, without signals that are already ignored, as under nohup."""
    if _is_child and ASK_SIGNAL:
        return [ASK_SIGNAL]
    names = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
    known = [getattr(signal, name) for name in names if hasattr(signal, name)]
    return [item for item in known if signal.getsignal(item) is not signal.SIG_IGN]


@contextmanager
def ended_at_once() -> Iterator[None]:
    """Let stop signals end the process at once within the block: half-loaded modules could not end it properly."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {item: signal.signal(item, signal.SIG_DFL) for item in stop_signals()}
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, signal.SIG_DFL if handler is None else handler)


def supervise(program: str) -> int:
    """Run this command line again as a child, and return its exit code, or 128 plus the signal that stopped it."""
    folder = _temporary_folder()
    received: list[tuple[int, float]] = []
    child: subprocess.Popen | None = None

    def handle(number: int, _: object) -> None:
        received.append((number, time.monotonic()))
        if len(received) == 1 and child is not None and ASK_SIGNAL:
            child.send_signal(ASK_SIGNAL)

    before = {item: signal.signal(item, handle) for item in stop_signals()}
    try:
        with held_back(before):
            early = bool(received)
            child = subprocess.Popen(_this_command(), env=_environment(folder))
        if early and ASK_SIGNAL:
            child.send_signal(ASK_SIGNAL)
        while child.poll() is None:
            with suppress(subprocess.TimeoutExpired):
                child.wait(LOOK_S)
            since = time.monotonic() - received[0][1] if received else 0.0
            if since > GRACE_S:
                child.kill()
            if since > LAST_WAIT_S:
                break
        code = -9 if child.returncode is None else child.returncode
        journal = _Journal(folder)
        by = received[0][0] if received else -code if -code in before else 0
        stopped = bool(by) and code != 0
        journal.remove_half_written()  # Workers that were killed may have left some, too.
        if code < 0 or (stopped and not journal.ended):
            journal.say_last_words(None if stopped else f"{program}: {_crash(code, journal.at)}")
        return 128 + by if stopped else 1 if code < 0 else code
    finally:
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)
        for one, handler in before.items():
            # A second signal must not change the exit code while the process ends.
            signal.signal(one, signal.SIG_IGN if received else signal.SIG_DFL if handler is None else handler)


def death(code: int) -> str:
    """Return how a process ended, given its exit code."""
    if -code not in {*signal.Signals}:
        return f"exit code {code}"
    name = signal.Signals(-code).name
    return f"{name}, perhaps for want of memory" if name == "SIGKILL" else name


@contextmanager
def held_back(signals: Iterable[int]) -> Iterator[None]:
    """Block signals within the block, and in processes started there until they unblock them."""
    if ASK_SIGNAL:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        if ASK_SIGNAL:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def begin_child() -> bool:
    """Set up this process as a child if it is one, and return whether it is.

    A child reports in the journal, relays signals to its parent, and does not outlive its parent.
    """
    global _is_child
    # Programs that the child starts must not take themselves for children.
    folder = os.environ.pop(SESSION_VARIABLE, None)
    if folder is None:
        return False
    join_session(folder)
    end_with_parent()
    if ASK_SIGNAL:
        parent, signals = os.getppid(), stop_signals()

        def relay(number: int, _: object) -> None:
            with suppress(OSError):
                os.kill(parent, number)

        for item in signals:
            signal.signal(item, relay)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, signals)
    # If this process is killed, the tracker of shared memory outlives it, and would print after the last message.
    sys.warnoptions.append("ignore:resource_tracker")
    _is_child = True
    return True


def blender_program() -> str:
    """Return the path of the Blender program that runs this; empty in plain Python, with or without bpy."""
    return getattr(getattr(sys.modules.get("bpy"), "app", None), "binary_path", "")


def session() -> str:
    """Return the temporary folder of this command, for `join_session`; empty if there is none."""
    return _session


def join_session(folder: str) -> None:
    """Let this process report in the journal of a command, as the child and its workers do."""
    global _session, _journal
    if folder:
        with suppress(OSError):
            _journal = os.open(Path(folder) / JOURNAL, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
            _session = folder


def end_with_parent() -> None:
    """Have the system kill this process when its parent ends in any way, where it can (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def report(**facts: Any) -> None:
    """Write facts into the journal, if there is one.

    Parameters
    ----------
    at : str
        The next input.
    making : str
        A file that is being written, or a folder created for one; it is removed if the process is killed.
    written : str
        A complete file, whose path is printed at the end.
    prints_paths : bool
        Whether standard output is for the paths of complete files.
    summary : str
        The message if the process were stopped now.
    ended : bool
        Whether all of this was printed.
    """
    if _journal is not None:
        with suppress(OSError):
            os.write(_journal, f"{json.dumps(facts)}\n".encode())


class _Journal:
    """The reports of the child."""

    def __init__(self, folder: str | None) -> None:
        self.at = ""
        self.summary = STOPPED_TEXT
        self.ended = False
        self.prints_paths = True
        self.written: list[str] = []
        self._making: list[Path] = []
        try:
            lines = (Path(folder or os.devnull) / JOURNAL).read_text(encoding="utf-8").splitlines()
        except OSError:
            return
        for line in lines:
            with suppress(ValueError):  # The last line may be cut off.
                facts = json.loads(line)
                self.at = facts.get("at", self.at)
                self.summary = facts.get("summary", self.summary)
                self.ended = facts.get("ended", self.ended)
                self.prints_paths = facts.get("prints_paths", self.prints_paths)
                self.written += [facts["written"]] if "written" in facts else []
                self._making += [Path(facts["making"])] if "making" in facts else []

    def remove_half_written(self) -> None:
        """Remove files that were being written, and empty folders that were created for them."""
        for place in reversed(self._making):
            with suppress(OSError):
                if place.is_dir():
                    place.rmdir()
                    continue
                # Blender itself writes to NAME@ first.
                place.with_name(f"{place.name}@").unlink(missing_ok=True)
                place.unlink(missing_ok=True)

    def say_last_words(self, crash: str | None) -> None:
        """Print the messages that the child can no longer print."""
        if self.ended:
            return
        errors = _writable(sys.stderr)
        if errors and sys.stderr.isatty():
            print(SHOW_CURSOR, file=sys.stderr, flush=True)  # The progress bar has hidden the cursor.
        if self.prints_paths and _writable(sys.stdout):
            for path in self.written:
                print(path_line(path), flush=True)
        if errors:
            for line in filter(None, (crash, self.summary.removeprefix("Stopped. ") if crash else self.summary)):
                print(line, file=sys.stderr, flush=True)


def _temporary_folder() -> str | None:
    try:
        return tempfile.mkdtemp(prefix="rigid-motion-")
    except OSError:  # Without it, Blender reports its own errors.
        return None


def _environment(folder: str | None) -> dict[str, str]:
    temporary = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder) if folder else {}
    # Matrices are small here: threads of NumPy's library would only wait for each other, and for other workers.
    return {"OPENBLAS_NUM_THREADS": "1", **os.environ, **temporary, SESSION_VARIABLE: folder or ""}


def _this_command() -> Sequence[str]:
    """Return the command line of this process: Python, or a Blender that runs a script."""
    blender = blender_program()
    return [blender, *sys.argv[1:]] if blender else [sys.executable, *sys.orig_argv[1:]]


def _crash(code: int, at: str) -> str:
    """Return a message about a child that crashed, with what to do."""
    if not at:
        return f"the process died ({death(code)}) before it had done anything"
    return f"the process died ({death(code)}) at {printable(at)}: leave that out, or see whether Blender opens it"


def _writable(stream: Any) -> bool:
    """Return whether a stream accepts a line now: the reader of a pipe may have stopped."""
    if stream is None:
        return False
    if os.name == "nt":
        return True
    try:
        return bool(select.select([], [stream], [], 0.1)[1])
    except (OSError, ValueError):
        return True
