"""Digests: what tells whether a result is still that of its task. SHA-256, in hexadecimal."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .tasks import ROOT, Task


@dataclass(frozen=True, slots=True)
class FileState:
    """What a file was when it was looked at."""

    size: int
    mtime_ns: int
    sha256: str

    @classmethod
    def of(cls, path: Path) -> FileState:
        """Read a file. Raises OSError where there is none."""
        before = path.stat()
        return cls(before.st_size, before.st_mtime_ns, file_digest(path))

    def as_json(self) -> dict[str, int | str]:
        """Every field, for `FileState(**fields)`."""
        return {"size": self.size, "mtime_ns": self.mtime_ns, "sha256": self.sha256}

    def still(self, path: Path) -> bool:
        """Whether the file is there as it was. It is read again only where its time of change is another."""
        try:
            now = path.stat()
            if now.st_size != self.size:
                return False
            return now.st_mtime_ns == self.mtime_ns or file_digest(path) == self.sha256
        except OSError:
            return False


def file_digest(path: Path) -> str:
    """Of a file's content."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def task_key(task: Task, inputs: Mapping[str, str | None], before: Mapping[str, str], version: str) -> str:
    """The digest of all that a task's outputs depend on.

    Parameters
    ----------
    task : Task
    inputs : mapping
        Path to the digest of its content, None where the file is missing.
    before : mapping
        The tasks that it reads from, those that are done, to their keys.
    version : str
        Of the program.
    """
    content = {
        "function": task.function,
        "arguments": task.arguments,
        "inputs": [inputs[path] for path in task.inputs],
        "outputs": task.outputs,
        "before": before,
        "version": version,
    }
    return hashlib.sha256(_canonical(content).encode("ascii")).hexdigest()


def code_version(*paths: str) -> str:
    """The digest of source files: what changes when the program does.

    Parameters
    ----------
    *paths : str
        Modules and packages, relative to the checkout: "addon/motion", "scripts/compare.py". Of a package, all modules
        and the files beside them.
    """
    digest = hashlib.sha256()
    for file in sorted({file for path in paths for file in _sources(ROOT / path)}):
        digest.update(file.relative_to(ROOT).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()


def _sources(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    return [file for file in path.rglob("*") if file.is_file() and "__pycache__" not in file.parts]


def _canonical(content: Any) -> str:
    return json.dumps(content, sort_keys=True, separators=(",", ":"))
