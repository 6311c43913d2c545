"""An output folder: results by key, the files that are published from them, and a record of whose a file is.

Below `.rigid-motion/` of the folder:

    results/KEY/        what a task made, with an index of its files; there if and only if the task is done
    scratch/SESSION/    what is being made, by one process
    published/          what this program has put into the output folder: lines of JSON, a file for each folder
    inputs.json         digests of inputs, by size and times of change
    lock                held by a run that has the folder for itself

Whatever is written is written beside its place and moved there. So any process may be killed at any moment, and any
number may write at the same time.
"""

from __future__ import annotations

import json
import os
import shutil
import stat
import time
import uuid
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from filelock import FileLock, Timeout

from rigid_motion_batch.files import append_lines, lines_of, write_text

from .performing import Made
from .steps import OWN, Input, Task, sha256_in, sha256_of

INDEX = ".index.json"
"""Index of a result: its files with size, time of change and digest; what it was made of, in how long, and facts."""

KEPT = 7 * 86400.0
"""Seconds that a result is kept that the last plan did not ask for, and what a process was making that was killed."""

UNREADABLE = (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError)
"""Errors of a file of the store that is missing or damaged."""


class OutputError(Exception):
    """Error that says what must not be replaced or read, or who is at work there, and the way out, in one line."""


class Store:
    """An output folder, as a context.

    Parameters
    ----------
    output : Path
        Made where it is missing, and taken away again where nothing came of it.
    alone : bool
        Whether no other run may have the folder meanwhile; not for workers that do a part each.
    overwrite : bool
        Whether files that this program has not written may be replaced. Inputs and folders never are.

    Raises
    ------
    OutputError, OSError
        On entering, where another run has the folder, or there can be none.
    """

    def __init__(self, output: Path, *, alone: bool = True, overwrite: bool = False) -> None:
        self.output, self.overwrite = output.absolute(), overwrite
        self.own = self.output / OWN
        self._results, self._published = self.own / "results", self.own / "published"
        self._lock = FileLock(self.own / "lock", blocking=False) if alone else None
        self._missing = [folder for folder in (self.output, *self.output.parents) if not folder.exists()]
        self._digests = _digests_in(self.own / "inputs.json")
        """Path of an input to what was seen of it when it was hashed, and its digest."""
        self._inputs: dict[tuple[int, int], str] = {}
        """Identities of inputs in the file system, to their paths."""
        self._scratch = self.own / "scratch" / ("run" if alone else uuid.uuid4().hex[:8])
        self._number = 0

    # -- opening and closing ------------------------------------------------------------------------------------------

    def __enter__(self) -> Self:
        for folder in (self._results, self._published, self._scratch.parent):
            folder.mkdir(parents=True, exist_ok=True)
        try:
            if self._lock:
                self._lock.acquire()
        except Timeout:
            raise OutputError(
                f"{self.output}: another run is at work in this folder; wait for it, or choose another with --output"
            ) from None
        for session in self._scratch.parent.iterdir():
            with suppress(FileNotFoundError):  # Another process has ended.
                if session == self._scratch or _age(session) > KEPT:
                    shutil.rmtree(session, ignore_errors=True)
        self._scratch.mkdir()
        return self

    def __exit__(self, *_: object) -> None:
        shutil.rmtree(self._scratch, ignore_errors=True)
        with suppress(OSError):
            self.note("inputs.json", self._digests)
        for folder in (self._results, self._scratch.parent, self._published):
            _remove_if_empty(folder)
        if self._lock:
            if not self._results.exists():
                for name in ("inputs.json", "failures.json", "lock"):
                    (self.own / name).unlink(missing_ok=True)
            self._lock.release()
        for folder in (self.own, *self._missing):
            _remove_if_empty(folder)

    def new_scratch(self) -> Path:
        """Return a path for what is being made; nothing is there."""
        self._number += 1
        return self._scratch / str(self._number)

    def note(self, name: str, content: Any) -> None:
        """Write a file of the store's own, of JSON; of nothing there is none."""
        if content:
            write_text(self.own / name, json.dumps(content, indent=1))
        else:
            (self.own / name).unlink(missing_ok=True)

    # -- inputs -------------------------------------------------------------------------------------------------------

    def input(self, path: Path | str) -> Input:
        """Return a file as it is now.

        Raises
        ------
        OutputError
            Where this program has written it into this folder.
        """
        shown, place = os.fspath(path), os.path.abspath(path)
        try:
            status, link = os.stat(path), os.lstat(path)  # noqa: PTH116 - it may be text, and "" no folder
        except (OSError, ValueError):
            return Input(shown, "")
        self._require_no_output(shown)
        if not stat.S_ISREG(status.st_mode):
            return Input(shown, "")
        self._inputs[status.st_dev, status.st_ino] = self._inputs[link.st_dev, link.st_ino] = place
        seen = [status.st_size, status.st_mtime_ns, status.st_ctime_ns]
        *known, digest = self._digests.get(place, ("",))
        if known != seen:
            digest = sha256_in(path)
            self._digests[place] = [*seen, digest]
        return Input(shown, digest)

    def _require_no_output(self, shown: str) -> None:
        real, output = os.path.realpath(shown), os.path.realpath(self.output)
        if not real.startswith(output + os.sep):
            return
        path = Path(real).relative_to(output).as_posix()
        if path.partition("/")[0] == OWN:
            raise OutputError(f"{shown}: this input lies in {self.own}, where the program works; move it elsewhere")
        if self._digests_of(path):
            raise OutputError(f"{shown}: this input was written by a run into this folder; choose another --output")

    # -- results ------------------------------------------------------------------------------------------------------

    def folder_of(self, key: str) -> Path:
        """Return the folder where the result of a key is, if it is there."""
        return self._results / key

    def index_of(self, key: str, *, thoroughly: bool = False) -> Mapping[str, Any] | None:
        """Return the index of the result of a key; None where it is not there, or damaged.

        With `thoroughly` the content of all files is looked at, otherwise of those that changed since they were made.
        """
        folder = f"{self._results}/{key}"
        try:
            index = json.loads(Path(folder, INDEX).read_bytes())
            for name, (size, mtime, digest) in index["files"].items():
                status = os.lstat(f"{folder}/{name}")
                if not stat.S_ISREG(status.st_mode) or status.st_size != size:
                    return None
                if (status.st_mtime_ns != mtime or thoroughly) and sha256_of(f"{folder}/{name}") != digest:
                    return None
        except UNREADABLE:
            return None
        return index

    def keep(self, task: Task, key: str, made: Made) -> None:
        """Take what was made as the result of a task. Raises OSError where that cannot be."""
        folder, index = made["folder"], {name: made[name] for name in ("files", "seconds", "facts")}
        content = json.dumps({**index, "name": task.name, "made_of": task.made_of})
        (folder / INDEX).write_text(content, encoding="utf-8")
        try:
            folder.rename(self.folder_of(key))
        except OSError:
            if not self.index_of(key):  # Otherwise another worker was quicker.
                self.discard(key)
                self._results.mkdir(exist_ok=True)  # A worker that made nothing may have taken it away.
                folder.rename(self.folder_of(key))

    def discard(self, key: str) -> None:
        """Delete a result."""
        shutil.rmtree(self.folder_of(key), ignore_errors=True)

    def discard_damaged(self, keys: Iterable[str]) -> bool:
        """Delete those of these results that are damaged, and return whether there are any."""
        damaged = [key for key in keys if self.folder_of(key).exists() and not self.index_of(key, thoroughly=True)]
        for key in damaged:
            self.discard(key)
        return bool(damaged)

    def sweep(self, requested: Iterable[str]) -> None:
        """Delete results that are not among these, and older than a week."""
        requested = frozenset(requested)
        for folder in self._results.iterdir():
            if folder.name not in requested and _age(folder) > KEPT:
                self.discard(folder.name)

    def latest(self) -> dict[str, str]:
        """Return the key of the last result of each task, by the task's name, of all that are kept."""
        keys = [folder.name for folder in sorted(self._results.glob("*"), key=_age, reverse=True)]
        return {index["name"]: key for key in keys if (index := self.index_of(key))}

    # -- published files ----------------------------------------------------------------------------------------------

    def is_done(self, task: Task) -> bool:
        """Return whether the result of a task is there, and all files that it publishes are in place."""
        index = self.index_of(task.key)
        return index is not None and not self.unpublished(task, index)

    def unpublished(self, task: Task, index: Mapping[str, Any] | None) -> list[tuple[str, str]]:
        """Return the files of a result that are not in place, and where they belong."""
        files = index["files"] if index else {}
        return [(name, path) for name, path in task.published(files) if not self._is_same(files.get(name), path)]

    def strangers(self, task: Task, index: Mapping[str, Any] | None) -> list[str]:
        """Return paths where a result would replace what this program has not written, or was edited since.

        Raises
        ------
        OutputError
            Where there is an input, or a folder, or a file where a folder must be: nothing of that is ever replaced.
        """
        return [path for _, path in self.unpublished(task, index) if not self._is_own(path)]

    def require_none(self, strangers: list[str]) -> None:
        """Raise OutputError where there are such paths, unless they may be replaced."""
        if strangers and not self.overwrite:
            named = ", ".join(os.fspath(self.output / path) for path in strangers[:3])
            more = f" and {len(strangers) - 3} more" if len(strangers) > 3 else ""
            were, them = ("was", "it") if len(strangers) == 1 else ("were", "them")
            raise OutputError(
                f"{named}{more} {were} not written by this program, or edited since; choose another folder with "
                f"--output, or replace {them} with --overwrite"
            )

    def publish(self, task: Task, key: str) -> bool:
        """Put files of a result where they belong, and return whether there were any that were not there.

        Raises
        ------
        OutputError
            Where something is there that must not be replaced; what was put in place before that stays.
        OSError
        """
        index = self.index_of(key) or {}
        self.require_none(self.strangers(task, index))
        missing = self.unpublished(task, index)
        for name, path in missing:
            target, beside = self.output / path, self.new_scratch()
            target.parent.mkdir(parents=True, exist_ok=True)
            if not Path(os.path.realpath(target.parent)).is_relative_to(os.path.realpath(self.output)):
                raise OutputError(f"{target.parent}: this leads out of the output folder; choose another with --output")
            # Killed from here on, what was moved is known to be the program's own.
            append_lines(self._record_of(path), [{"path": path, "sha256": index["files"][name][-1]}])
            try:
                os.link(self.folder_of(key) / name, beside)
            except OSError:  # This file system has no links.
                shutil.copy2(self.folder_of(key) / name, beside)
            try:
                beside.replace(target)
            except OSError as error:
                raise OSError(error.errno, error.strerror, os.fspath(target)) from None
        return bool(missing)

    def withdraw(self, paths: Iterable[str]) -> None:
        """Delete files of this program that are needed no more, and folders that are empty then."""
        for path in paths:
            with suppress(OSError, OutputError):
                if self._is_own(path):
                    (self.output / path).unlink()
                    for folder in (self.output / path).parents:
                        if folder == self.output or not _remove_if_empty(folder):
                            break

    def _is_same(self, known: tuple[int, int, str] | None, path: str) -> bool:
        """Return whether a published file is one of a result, of this size and time of change, or a copy."""
        try:
            status = os.lstat(f"{self.output}/{path}")
        except OSError:
            return False
        same = known is not None and [status.st_size, status.st_mtime_ns] == [*known[:2]]
        return same and stat.S_ISREG(status.st_mode)

    def _is_own(self, path: str) -> bool:
        """Return whether a path has nothing, or what this program wrote. Raises OutputError for what always stays."""
        target = f"{self.output}/{path}"
        try:
            status = os.lstat(target)
        except FileNotFoundError:
            return True
        except NotADirectoryError:
            raise OutputError(_in_the_way(target, "a file where a folder")) from None
        if stat.S_ISDIR(status.st_mode):
            raise OutputError(_in_the_way(target, "a folder where a file"))
        if source := self._inputs.get((status.st_dev, status.st_ino)):
            raise OutputError(f"{source}: this input lies where {target} goes; choose another folder with --output")
        return stat.S_ISREG(status.st_mode) and sha256_of(target) in self._digests_of(path)

    def _record_of(self, path: str) -> Path:
        """Return the file of the record of what was published into the same folder."""
        folder = path.rpartition("/")[0].casefold()
        return self._published / f"{uuid.uuid5(uuid.NAMESPACE_URL, folder).hex[:16]}.jsonl"

    def _digests_of(self, path: str) -> set[str]:
        """Return digests of all that was put at a path, or one that differs in case, which file systems may ignore."""
        lines = lines_of(self._record_of(path))
        return {str(line.get("sha256")) for line in lines if str(line.get("path")).casefold() == path.casefold()}


def _in_the_way(target: str, kind: str) -> str:
    return f"{target}: there is {kind} goes; move it, or choose another folder with --output"


def _digests_in(file: Path) -> dict[str, list[Any]]:
    try:
        return {path: seen for path, seen in json.loads(file.read_bytes()).items() if isinstance(seen[-1], str)}
    except UNREADABLE:
        return {}


def _age(path: Path) -> float:
    """Return the seconds since a path was made or changed."""
    return time.time() - path.lstat().st_mtime


def _remove_if_empty(folder: Path) -> bool:
    with suppress(OSError):
        folder.rmdir()
        return True
    return False
