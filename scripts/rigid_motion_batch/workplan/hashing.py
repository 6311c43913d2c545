"""Digests: what tells whether a result is still that of its task. SHA-256, in hexadecimal."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import stat
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigid_motion_batch.places import name_of, place_of

from .tasks import Task


@dataclass(frozen=True, slots=True)
class FileState:
    """What a file was when it was looked at."""

    size: int
    mtime_ns: int
    sha256: str

    @classmethod
    def of(cls, path: Path) -> FileState:
        """Read a file. Raises OSError where there is none, or what is there never ends: a pipe, a device."""
        before = path.stat()
        if not stat.S_ISREG(before.st_mode):
            raise OSError(errno.EINVAL, "this is no file", os.fspath(path))
        return cls(before.st_size, before.st_mtime_ns, file_digest(path))

    def as_json(self) -> dict[str, int | str]:
        """Every field, for `FileState(**fields)`."""
        return {"size": self.size, "mtime_ns": self.mtime_ns, "sha256": self.sha256}

    def still(self, path: Path | str) -> bool:
        """Whether the file is there as it was. It is read again only where its time of change is another."""
        try:
            now = os.stat(path)
            if now.st_size != self.size or not stat.S_ISREG(now.st_mode):
                return False
        except (OSError, ValueError):
            return False
        return now.st_mtime_ns == self.mtime_ns or self.is_content_of(Path(path))

    def is_content_of(self, path: Path) -> bool:
        """Whether the content of the file is what it was, which reads all of it."""
        try:
            return is_regular(path) and file_digest(path) == self.sha256
        except OSError:
            return False


def is_regular(path: Path) -> bool:
    """Whether a path is that of a file with an end: no pipe, no device, no folder. Any text may be asked about."""
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except (OSError, ValueError):
        return False


def file_digest(path: Path) -> str:
    """Of a file's content."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def task_key(task: Task, inputs: Mapping[str, str | None], before: Iterable[tuple[str, str]], version: str) -> str:
    """The digest of all that a task's outputs depend on.

    Parameters
    ----------
    task : Task
    inputs : mapping
        Path to the digest of its content, None where the file is missing.
    before : iterable of (str, str)
        The tasks that it reads from, those that are done, with their keys; sorted.
    version : str
        Of what the function uses.
    """
    rest = {
        "function": task.function,
        "inputs": [inputs[path] for path in task.inputs],
        "outputs": [*task.outputs],
        "version": version,
    }
    # The digest of it all as canonical JSON, without ever having as text what may be the keys of ten thousand tasks.
    digest = hashlib.sha256(f'{{"arguments":{_canonical(task.arguments)},"before":{{'.encode())
    for number, (name, key) in enumerate(before):
        digest.update(f'{"," if number else ""}{json.dumps(name)}:"{key}"'.encode())
    digest.update(f"}},{_canonical(rest)[1:]}".encode())
    return digest.hexdigest()


def digest_of(text: str) -> str:
    """Of text."""
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def version_from(parts: Mapping[str, str]) -> str:
    """The version of what has these parts, each with a version of its own."""
    return digest_of(_canonical(dict(parts)))


def code_version(*paths: str) -> str:
    """The digest of source files: what changes when the program does.

    Parameters
    ----------
    *paths : str
        Modules and packages, as `places` names them: "rigid_motion/motion", "rigid_motion_batch/cli/compare.py". Of a
        package, all modules and the files beside them.
    """
    digest = hashlib.sha256()
    for file in sorted({file for path in paths for file in sources_below(place_of(path))}):
        digest.update(name_of(file).encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()


def sources_below(path: Path) -> list[Path]:
    """A file, or the files in a folder but for those that Python keeps there."""
    if path.is_file():
        return [path]
    return [file for file in path.rglob("*") if file.is_file() and "__pycache__" not in file.parts]


def _canonical(content: Any) -> str:
    return json.dumps(content, sort_keys=True, separators=(",", ":"))
