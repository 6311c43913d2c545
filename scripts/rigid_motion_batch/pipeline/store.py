"""The output folder: results stored by key, files published from them, and a record of which files the program wrote.

Below `.rigid-motion/` of the folder:

    results/KEY/        the result of a task, with an index of its files; exists if and only if the task is done
    scratch/SESSION/    files being written by one process
    published/          files that this program put into the output folder: lines of JSON, one file per folder
    inputs.json         digests of inputs, by size and modification times
    lock                held by a run that has the folder for itself

Every file is written next to its place and moved there. So any process may be killed at any moment, and any number may
write at the same time.
"""

from __future__ import annotations

import json
import os
import shutil
import stat
import time
import uuid
from collections.abc import Container, Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from filelock import FileLock, Timeout

from rigid_motion_batch.command_line import listed
from rigid_motion_batch.files import append_lines, lines_of, write_text

from .executors import Made
from .steps import OWN_FOLDER, RunError, Task, sha256_in, sha256_of

INDEX = ".index.json"
"""Index of a result: its files with size, modification time and digest, and the name of its task."""

KEPT_S = 7 * 86400.0
"""Seconds for which results are kept that the last plan did not need, and scratch files of a killed process."""

UNREADABLE = (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError)
"""Errors from a file of the store that is missing or damaged."""


class Store:
    """An output folder, as a context: created if missing, and removed again if it stays empty.

    With `alone`, no other run may use the folder at the same time; workers that do a part each are not alone. With
    `overwrite`, files of other programs may be replaced, but never inputs or folders. Entering raises RunError or
    OSError if another run has the folder, or it cannot be created.
    """

    def __init__(self, output: Path, *, alone: bool = True, overwrite: bool = False) -> None:
        self.output, self.alone, self.overwrite = output.absolute(), alone, overwrite
        self.own = self.output / OWN_FOLDER
        self.results, self._published, self._scratches = map(self.own.joinpath, ("results", "published", "scratch"))
        self._lock = FileLock(self.own / "lock", blocking=False)
        self._missing = [folder for folder in (self.output, *self.output.parents) if not folder.exists()]
        self._digests = self.noted("inputs.json")
        """Path of an input to its size and times when it was hashed, and its digest."""
        self._inputs: dict[tuple[int, int], str] = {}
        """File-system identity (device, inode) of an input to its path."""
        self._scratch = self._scratches / ("run" if alone else uuid.uuid4().hex[:8])

    # -- opening and closing ------------------------------------------------------------------------------------------

    def __enter__(self) -> Self:
        self.results.mkdir(parents=True, exist_ok=True)
        try:
            if self.alone:
                self._lock.acquire()
        except Timeout:
            raise RunError(
                f"{self.output}: another run is at work in this folder; wait for it, or choose another with --output"
            ) from None
        for session in (self._scratch, *_expired(self._scratches)):
            shutil.rmtree(session, ignore_errors=True)
        self._scratch.mkdir(parents=True)
        return self

    def __exit__(self, *_: object) -> None:
        shutil.rmtree(self._scratch, ignore_errors=True)
        with suppress(OSError):
            self.note("inputs.json", self._digests)
        if self.alone and not any(self.own.glob("*/*")):
            shutil.rmtree(self.own, ignore_errors=True)
        self._lock.release()
        for folder in (self.own, *self._missing):  # Windows cannot delete a lock that is held.
            with suppress(OSError):  # The folder is not empty.
                folder.rmdir()

    def new_scratch(self) -> Path:
        """Return a new path for files being written; nothing exists there."""
        return self._scratch / uuid.uuid4().hex[:8]

    def note(self, name: str, content: Mapping[str, Any]) -> None:
        """Write a file of the store's own, as JSON."""
        write_text(self.own / name, json.dumps(content, indent=1))

    def noted(self, name: str) -> dict[str, Any]:
        """Return the content of a file of the store's own; empty if it is missing or damaged."""
        with suppress(*UNREADABLE):
            return dict(json.loads((self.own / name).read_bytes()))
        return {}

    # -- inputs -------------------------------------------------------------------------------------------------------

    def inputs(self, *paths: Path | str) -> dict[str, str]:
        """Return the digests of files as they are now; "" for a file that cannot be read.

        Raises RunError if this program has written one of them into this folder.
        """
        return {os.fspath(path): self._digest_of(os.fspath(path)) for path in paths}

    def _digest_of(self, path: str) -> str:
        try:
            status, link = os.stat(path), os.lstat(path)  # noqa: PTH116 - it may be "", which is not a folder
        except (OSError, ValueError):
            return ""
        inside = os.path.realpath(path).removeprefix(os.path.realpath(self.output) + os.sep).replace(os.sep, "/")
        if inside.startswith(f"{OWN_FOLDER}/") or self._digests_at(inside):
            raise RunError(f"{path}: this input was written by a run into this folder; choose another --output")
        place, seen = os.path.abspath(path), [status.st_size, status.st_mtime_ns, status.st_ctime_ns]
        self._inputs |= dict.fromkeys([(status.st_dev, status.st_ino), (link.st_dev, link.st_ino)], place)
        known = self._digests.get(place)
        if not (isinstance(known, list) and known[:-1] == seen):
            self._digests[place] = known = [*seen, sha256_in(path)]
        return str(known[-1])

    # -- results ------------------------------------------------------------------------------------------------------

    def index_of(self, key: str) -> Mapping[str, Any] | None:
        """Return the index of the result of a key; None if the result is missing, or one of its files was changed."""
        try:
            index = json.loads((self.results / key / INDEX).read_bytes())
            for name, (size, mtime, digest) in index["files"].items():
                path = f"{self.results}/{key}/{name}"
                seen = _size_and_time(path)
                if seen[0] != size or (seen[1] != mtime and sha256_of(path) != digest):
                    return None
        except UNREADABLE:
            return None
        return index

    def keep(self, task: Task, key: str, made: Made) -> None:
        """Store the files of a job as the result of a task. Raises OSError if that fails."""
        folder, index = made["folder"], {"name": task.name, "files": made["files"]}
        (folder / INDEX).write_text(json.dumps(index), encoding="utf-8")
        try:
            folder.rename(self.results / key)
        except OSError:
            if not self.index_of(key):  # Otherwise another worker was faster.
                self.discard(key)
                folder.rename(self.results / key)

    def discard(self, key: str) -> None:
        """Delete a result."""
        shutil.rmtree(self.results / key, ignore_errors=True)

    def sweep(self, requested: Container[str | None]) -> None:
        """Delete results that are older than a week, except these."""
        for folder in _expired(self.results):
            if folder.name not in requested:
                self.discard(folder.name)

    # -- published files ----------------------------------------------------------------------------------------------

    def unpublished(self, task: Task, index: Mapping[str, Any] | None) -> list[tuple[str, str]]:
        """Return the files of a result that are not in place, and where they belong."""
        files, result = index["files"] if index else {}, []
        for name, path in task.publish.items():
            for file in [file for file in files if file.startswith(name)] if name.endswith("/") else [name]:
                place = path + file.removeprefix(name)
                # A link or a copy has the size and modification time of the original.
                if file not in files or _size_and_time(f"{self.output}/{place}") != files[file][:2]:
                    result.append((file, place))
        return result

    def refuse(self, unpublished: Iterable[tuple[str, str]]) -> None:
        """Raise RunError if such files would replace files of other programs without `overwrite`."""
        foreign = [path for _, path in unpublished if not self.is_own(path)]
        if foreign and not self.overwrite:
            named = listed((os.fspath(self.output / path) for path in foreign), 3)
            raise RunError(
                f"{named} {'was' if len(foreign) == 1 else 'were'} not written by this program, or edited since; "
                "choose another folder with --output, or replace that with --overwrite"
            )

    def publish(self, task: Task, key: str) -> bool:
        """Put the files of a result in place, and return whether any were missing.

        Raises OSError, or RunError if a file is in the way that must stay; files published before the error stay.
        """
        index = self.index_of(key) or {}
        missing = self.unpublished(task, index)
        self.refuse(missing)
        for name, path in missing:
            target, beside = self.output / path, self.new_scratch()
            if not Path(os.path.realpath(target.parent)).is_relative_to(os.path.realpath(self.output)):
                raise RunError(f"{target.parent}: this leads out of the output folder; choose another with --output")
            target.parent.mkdir(parents=True, exist_ok=True)
            # From here on, a moved file is known as the program's own, even if the process is killed.
            append_lines(self._record_of(path), [{"path": path, "sha256": index["files"][name][-1]}])
            try:
                os.link(self.results / key / name, beside)
            except OSError:  # This file system has no hard links.
                shutil.copy2(self.results / key / name, beside)
            beside.replace(target)
        return bool(missing)

    def withdraw(self, paths: Iterable[str]) -> None:
        """Delete files of this program that are no longer needed, and folders that become empty."""
        for path in paths:
            with suppress(OSError, RunError):
                if self.is_own(path):
                    (self.output / path).unlink()
                    os.removedirs((self.output / path).parent)

    def is_own(self, path: str) -> bool:
        """Return whether a path is free, or holds a file of this program. Raises RunError for inputs and folders."""
        target, another = f"{self.output}/{path}", "choose another folder with --output"
        try:
            status = os.lstat(target)
        except FileNotFoundError:
            return True
        except NotADirectoryError:
            raise RunError(f"{target}: there is a file where a folder goes; move it, or {another}") from None
        if stat.S_ISDIR(status.st_mode):
            raise RunError(f"{target}: there is a folder where a file goes; move it, or {another}")
        if source := self._inputs.get((status.st_dev, status.st_ino)):
            raise RunError(f"{source}: this input lies where {target} goes; {another}")
        return stat.S_ISREG(status.st_mode) and sha256_of(target) in self._digests_at(path)

    def _record_of(self, path: str) -> Path:
        """Return the record file for files published into the same folder."""
        folder = path.rpartition("/")[0].casefold()
        return self._published / f"{uuid.uuid5(uuid.NAMESPACE_URL, folder).hex[:16]}.jsonl"

    def _digests_at(self, path: str) -> set[str]:
        """Return the digests of all files that were published at a path, ignoring case, as some file systems do."""
        lines = lines_of(self._record_of(path))
        return {str(line.get("sha256")) for line in lines if str(line.get("path")).casefold() == path.casefold()}


def _size_and_time(path: str) -> list[int]:
    """Return the size and modification time of a file; [-1], which no file has, if there is no regular file."""
    with suppress(OSError):
        status = os.lstat(path)
        return [status.st_size, status.st_mtime_ns] if stat.S_ISREG(status.st_mode) else [-1]
    return [-1]


def _expired(folder: Path) -> Iterator[Path]:
    """Yield the paths in a folder that are too old to be kept."""
    for path in folder.glob("*"):
        with suppress(FileNotFoundError):  # Another process has removed it.
            if time.time() - path.lstat().st_mtime > KEPT_S:
                yield path
