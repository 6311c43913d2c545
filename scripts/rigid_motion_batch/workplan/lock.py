"""The lock on an output folder: one run at a time, or any number of single tasks.

The operating system holds it for the process that took it, and lets go when that ends, however it ends: a lock that
was left behind by a dead process is no lock. The file says who has it.
"""

from __future__ import annotations

import json
import os
import socket
import sys
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Self

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl


class FolderInUse(Exception):
    """Another run works in the folder. The message says which, in one line."""


class FolderLock:
    """A lock on a file, as a context.

    Parameters
    ----------
    path : Path
        Of the file. It goes when the lock does.
    folder : Path
        What is locked, for the message.
    shared : bool
        Let others have it too that share it. (On Windows nothing is locked then.)

    Raises
    ------
    FolderInUse
        On entering, where somebody else has it.
    OSError
        Where the file cannot be made.
    """

    def __init__(self, path: Path, folder: Path, *, shared: bool = False) -> None:
        self.path, self._folder, self._shared = path, folder, shared
        self._file: int | None = None

    def __enter__(self) -> Self:
        while self._file is None:
            # Who had the folder before may be taking it away.
            self.path.parent.mkdir(parents=True, exist_ok=True)
            try:
                opened = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
            except FileNotFoundError:
                continue
            try:
                _lock(opened, self._shared)
            except OSError:
                holder = self._holder()
                os.close(opened)
                raise FolderInUse(
                    f"{self._folder}: another run is at work in this folder{holder}; wait for it, or choose another"
                ) from None
            # Who had it before may have taken the file away with it; then another one lies there now, or none.
            if _same_file(opened, self.path):
                self._file = opened
            else:
                os.close(opened)
        if not self._shared:
            self._sign(self._file)
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is None:
            return
        last = not self._shared or self._is_alone(self._file)
        if last and sys.platform != "win32":
            self.path.unlink(missing_ok=True)
        os.close(self._file)
        if last and sys.platform == "win32":
            with suppress(PermissionError):  # Somebody else has it open.
                self.path.unlink(missing_ok=True)
        self._file = None

    @staticmethod
    def _is_alone(opened: int) -> bool:
        try:
            _lock(opened, shared=False)
        except OSError:
            return False
        return True

    def _sign(self, opened: int) -> None:
        holder = {"process": os.getpid(), "host": socket.gethostname(), "since": f"{datetime.now():%Y-%m-%d %H:%M}"}
        os.ftruncate(opened, 0)
        os.write(opened, json.dumps(holder).encode())

    def _holder(self) -> str:
        try:
            holder = json.loads(self.path.read_text(encoding="utf-8"))
            return f" (process {holder['process']} on {holder['host']}, since {holder['since']})"
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return ""


def _lock(opened: int, shared: bool) -> None:
    """Lock, or raise OSError."""
    if sys.platform == "win32":
        if not shared:
            # A byte far behind the text, so that others can still read who it is.
            os.lseek(opened, 1 << 20, os.SEEK_SET)
            msvcrt.locking(opened, msvcrt.LK_NBLCK, 1)
            os.lseek(opened, 0, os.SEEK_SET)
    else:
        fcntl.flock(opened, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)


def _same_file(opened: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(opened), path.stat())
    except FileNotFoundError:
        return False
