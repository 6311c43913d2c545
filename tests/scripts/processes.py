"""Helpers for tests of processes: running Python, and starting a command that gets stuck in a call."""

import os
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def run_python(*arguments: object, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run Python with further variables of the environment, and return its exit code and outputs."""
    line, variables = [sys.executable, *map(str, arguments)], os.environ | environment
    return subprocess.run(line, capture_output=True, text=True, timeout=240, cwd=cwd, env=variables)


STUCK = """
import ctypes, io, os, pathlib, signal

def stick(what):
    if {where!r} in os.path.basename(os.fspath(what)) and os.path.exists({marker!r}) is False:
        pathlib.Path({marker!r}).write_bytes(b"")
        {act}

real_open, real_link = io.open, os.link

def open_and_stick(file, *arguments, **options):
    if isinstance(file, (str, os.PathLike)):
        stick(file)
    return real_open(file, *arguments, **options)

def stick_and_link(source, target, **options):
    stick(target)
    return real_link(source, target, **options)

io.open, os.link = open_and_stick, stick_and_link
"""
"""A sitecustomize.py: the process gets stuck when a file of that name is opened, or moved into place."""

HANG = "lock, mutex = ctypes.PyDLL(None).pthread_mutex_lock, ctypes.create_string_buffer(64); lock(mutex); lock(mutex)"
"""Hangs like a busy Blender: it keeps the interpreter's lock, and no signal wakes it."""

CRASH = "signal.signal(signal.SIGSEGV, signal.SIG_DFL); os.kill(os.getpid(), signal.SIGSEGV)"


@dataclass
class Started:
    """A running command."""

    process: subprocess.Popen
    temporary: Path
    """The command's folder for temporary files."""

    marker: Path
    """A file that exists once the command is stuck."""

    def wait_until_stuck(self) -> None:
        deadline = time.monotonic() + 60.0
        while not self.marker.exists():
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < deadline, "it was never stuck"
            time.sleep(0.01)

    def end(self) -> tuple[str, str, float]:
        """Return its standard output and standard error, and the seconds until it ended."""
        started = time.monotonic()
        printed, said = self.process.communicate(timeout=60)
        return printed, said, time.monotonic() - started


def start(folder: Path, command: str, *arguments: object, where: str, act: str = HANG) -> Started:
    """Start a script that gets stuck when it opens a file, or moves one into place, with `where` in its name."""
    own = folder / "stuck"
    temporary, marker = own / "temporary", own / "marker"
    temporary.mkdir(parents=True)
    content = STUCK.format(where=where, marker=str(marker), act=act)
    (own / "sitecustomize.py").write_text(content, encoding="utf-8")
    line = [sys.executable, str(ROOT / "scripts" / command), *map(str, arguments)]
    environment = os.environ | {"PYTHONPATH": str(own), "TMPDIR": str(temporary)}
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen(line, env=environment, cwd=folder, start_new_session=True, text=True, **streams)
    return Started(process, temporary, marker)


def descendants(process: int) -> list[int]:
    """Return the processes that a process has started, and their descendants."""
    texts = []
    with suppress(FileNotFoundError, ProcessLookupError):
        texts = [path.read_text() for path in Path(f"/proc/{process}/task").glob("*/children")]
    children = [int(child) for text in texts for child in text.split()]
    return [result for child in children for result in (child, *descendants(child))]


def alive(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"
