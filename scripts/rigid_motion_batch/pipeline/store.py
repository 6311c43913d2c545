"""An output folder: results by key, the files that are published from them, and a record of whose a file is.

Below `.rigid-motion/` of the folder:

    results/KEY/        what a task made, with an index of its files; there if and only if the task is done
    scratch/SESSION/    what is being made, by one process
    published/          what this program has put into the output folder: lines of JSON, a file for each folder
    inputs.json         digests of inputs, by size, time of change and inode
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
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Self

from filelock import FileLock, Timeout

from rigid_motion_batch.files import append_lines, lines_of, write_text

from .steps import OWN, Input, Task, sha256_of

INDEX = ".index.json"
"""Index of a result: its files with size, time of change and digest; what it was made of, in how long, and facts."""

UNSETTLED = 2.0
"""Seconds since its last change, by which a file that was hashed may have changed again without a trace in its time."""

KEPT = 7 * 86400.0
"""Seconds that a result is kept that the last plan did not ask for, and what a process was making that was killed."""

ALONE = "run"
"""The session of a run that has the folder for itself."""

Files = Mapping[str, tuple[int, int, str]]
"""Name to size, time of change in ns and SHA-256."""


class FolderInUse(Exception):
    """Another run works in the folder, in one line."""


class OutputError(Exception):
    """Error that says what must not be replaced or read, and the way out, in one line."""


@dataclass(frozen=True)
class Result:
    """Result of a task."""

    folder: Path
    index: Mapping[str, Any]


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
    FolderInUse, OSError
        On entering.
    """

    def __init__(self, output: Path, *, alone: bool = True, overwrite: bool = False) -> None:
        self.output, self.overwrite = output.absolute(), overwrite
        self.own = self.output / OWN
        self._results, self._scratch = self.own / "results", self.own / "scratch"
        self._lock = FileLock(self.own / "lock", blocking=False) if alone else None
        self._missing = [folder for folder in (self.output, *self.output.parents) if not folder.exists()]
        self._cache = _inputs_known(self.output)
        self._identities: dict[tuple[int, int], str] = {}
        """Identities of inputs in the file system, to their paths."""
        self._real = cache(os.path.realpath)
        """Real paths of folders: asking the system for those of all inputs takes long."""
        self.scratch = self._scratch / (ALONE if alone else uuid.uuid4().hex[:8])
        """The folder of this process for what is being made."""
        self._number = 0

    # -- opening and closing ------------------------------------------------------------------------------------------

    def __enter__(self) -> Self:
        for folder in (self.own, self._results, self._scratch, self.own / "published"):
            folder.mkdir(parents=True, exist_ok=True)
        if self._lock:
            try:
                self._lock.acquire()
            except Timeout:
                raise FolderInUse(
                    f"{self.output}: another run is at work in this folder; wait for it, or choose another"
                ) from None
        for session in self._scratch.glob("*"):
            with suppress(FileNotFoundError):  # Another process has ended.
                if session == self.scratch or time.time() - session.stat().st_mtime > KEPT:
                    shutil.rmtree(session, ignore_errors=True)
        self.scratch.mkdir(parents=True)
        return self

    def __exit__(self, *_: object) -> None:
        shutil.rmtree(self.scratch, ignore_errors=True)
        if self._identities:
            with suppress(OSError):
                self.note("inputs.json", self._cache)
        for name in ("results", "scratch", "published"):
            _remove_if_empty(self.own / name)
        if self._lock:
            if not self._results.exists():
                for name in ("inputs.json", "failures.json", "lock"):
                    (self.own / name).unlink(missing_ok=True)
            self._lock.release()
        for folder in (self.own, *self._missing):
            if not _remove_if_empty(folder):
                break

    def new_scratch(self) -> Path:
        """Return a path for the result of a task that is begun; nothing is there."""
        self._number += 1
        return self.scratch / str(self._number)

    def note(self, name: str, content: Any) -> None:
        """Write a file of the store's own, of JSON; of nothing there is none."""
        if (self.own / name).is_dir():
            shutil.rmtree(self.own / name)
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
        shown = os.fspath(path)
        try:
            result, link = os.stat(path), os.lstat(path)  # noqa: PTH116 - it may be text, and "" no folder
        except (OSError, ValueError):
            return Input(shown, "")
        place = os.path.abspath(path)
        self._require_no_output(shown, place, is_link=stat.S_ISLNK(link.st_mode))
        if not stat.S_ISREG(result.st_mode):
            return Input(shown, "")
        self._identities[result.st_dev, result.st_ino] = self._identities[link.st_dev, link.st_ino] = place
        seen = [result.st_size, result.st_mtime_ns, result.st_ctime_ns, result.st_ino]
        known = self._cache.get(place)
        if known and known[:-1] == seen:
            digest = known[-1]
        else:
            try:
                digest = sha256_of(path)
            except OSError:
                return Input(shown, "", result.st_size, result.st_mtime_ns)
            settled = time.time() - max(result.st_mtime, result.st_ctime) > UNSETTLED
            self._cache[place] = [*(seen if settled else [0, 0, 0, 0]), digest]
        return Input(shown, digest, result.st_size, result.st_mtime_ns)

    def _require_no_output(self, path: str, place: str, *, is_link: bool) -> None:
        folder, name = os.path.split(os.path.realpath(place) if is_link else place)
        real, output = self._real(folder), self._real(os.fspath(self.output))
        if real != output and not real.startswith(output + os.sep):
            return
        inside = Path(real, name).relative_to(output)
        if inside.parts[0] == OWN:
            raise OutputError(f"{path}: this input lies in {self.own}, where the program works; move it elsewhere")
        if any(self._published(inside.as_posix())):
            raise OutputError(f"{path}: this input was written by a run into this folder; choose another with --output")

    # -- results ------------------------------------------------------------------------------------------------------

    def result(self, key: str, *, thoroughly: bool = False) -> Result | None:
        """Return what the task of a key made; None where it is not there, or damaged.

        With `thoroughly` the content of all files is looked at, otherwise of those that changed since they were made.
        """
        folder = f"{self._results}/{key}"
        try:
            index = json.loads(Path(folder, INDEX).read_bytes())
            for name, (size, mtime, digest) in index["files"].items():
                matches = os.lstat(f"{folder}/{name}")
                if not stat.S_ISREG(matches.st_mode) or matches.st_size != size:
                    return None
                if (matches.st_mtime_ns != mtime or thoroughly) and sha256_of(f"{folder}/{name}") != digest:
                    return None
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
            return None
        return Result(Path(folder), index)

    def folder_of(self, key: str) -> Path:
        """Return the folder where the result of a key is, if it is there."""
        return self._results / key

    def keep(self, task: Task, key: str, made: Path, index: Mapping[str, Any]) -> Result:
        """Take a folder as the result of a task. Raises OSError where that cannot be."""
        content = {**index, "name": task.name, "made_of": task.made_of}
        (made / INDEX).write_text(json.dumps(content), encoding="utf-8")
        target = self._results / key
        try:
            made.rename(target)
        except OSError:
            if self.result(key):  # Another worker was quicker.
                shutil.rmtree(made, ignore_errors=True)
            else:
                self.discard(key)
                self._results.mkdir(exist_ok=True)  # A worker that made nothing may have taken it away.
                made.rename(target)
        return Result(target, content)

    def discard(self, key: str) -> None:
        """Delete a result."""
        place, away = self._results / key, self.new_scratch()
        if not os.path.lexists(place):
            return
        with suppress(FileNotFoundError):
            place.rename(away)
        shutil.rmtree(away, ignore_errors=True)
        with suppress(OSError):
            away.unlink()

    def discard_damaged(self, keys: Iterable[str]) -> bool:
        """Delete those of these results that are damaged, and return whether there are any."""
        kept = (key for key in keys if os.path.lexists(self._results / key))
        damaged = [key for key in kept if not self.result(key, thoroughly=True)]
        for key in damaged:
            self.discard(key)
        return bool(damaged)

    def sweep(self, requested: Iterable[str]) -> None:
        """Delete results that are not among these, and older than a week."""
        requested = frozenset(requested)
        for entry in os.scandir(self._results):
            if entry.name not in requested and time.time() - entry.stat(follow_symlinks=False).st_mtime > KEPT:
                self.discard(entry.name)

    def latest(self) -> dict[str, Result]:
        """Return the last result of each task, by the task's name, of all that are kept."""
        results = sorted(self._results.glob("*"), key=lambda folder: folder.stat().st_mtime)
        matches = (self.result(folder.name) for folder in results)
        return {result.index["name"]: result for result in matches if result}

    # -- published files ----------------------------------------------------------------------------------------------

    def is_published(self, task: Task, result: Result) -> bool:
        """Return whether all files that a task publishes are in place, and are those of this result."""
        files = task.published(result.index["files"])
        return all(self._is_same(f"{result.folder}/{name}", path) for name, path in files)

    def strangers(self, task: Task, result: Result | None) -> list[str]:
        """Return paths where a task would replace a file that this program has not written, or that was edited since.

        Raises
        ------
        OutputError
            Where there is an input, or a folder, or a file where a folder must be: nothing of that is ever replaced.
        """
        return [
            path
            for name, path in task.published(result.index["files"] if result else ())
            if not (result and self._is_same(f"{result.folder}/{name}", path)) and not self._is_set_here(path)
        ]

    def publish(self, task: Task, result: Result) -> None:
        """Put files of a result where they belong.

        Raises
        ------
        OutputError
            Where something is there that must not be replaced; what was put in place before that stays.
        OSError
        """
        if not self.overwrite and (matches := self.strangers(task, result)):
            raise OutputError(not_written([os.fspath(self.output / path) for path in matches]))
        for name, path in task.published(result.index["files"]):
            original, target = result.folder / name, self.output / path
            if self._is_same(os.fspath(original), path):
                continue
            self._is_set_here(path)  # Raises OutputError for inputs and folders.
            target.parent.mkdir(parents=True, exist_ok=True)
            if not Path(os.path.realpath(target.parent)).is_relative_to(os.path.realpath(self.output)):
                raise OutputError(f"{target.parent}: this leads out of the output folder; choose another with --output")
            status, (_, _, digest) = os.lstat(original), result.index["files"][name]
            line = {"path": path, "size": status.st_size, "mtime_ns": status.st_mtime_ns, "sha256": digest}
            # Killed from here on, what was moved is known to be the program's own.
            append_lines(self._record_of(path), [line])
            beside = self.new_scratch()
            try:
                os.link(original, beside)
            except OSError:  # This file system has no links.
                shutil.copy2(original, beside)
            try:
                beside.replace(target)
            except OSError as error:
                beside.unlink(missing_ok=True)
                raise OSError(error.errno, error.strerror, os.fspath(target)) from None

    def withdraw(self, paths: Iterable[str]) -> None:
        """Delete files of this program that are needed no more, and folders that are empty then."""
        for path in paths:
            with suppress(OSError, OutputError):
                if not self._is_set_here(path) or not (self.output / path).is_file():
                    continue
                (self.output / path).unlink()
                for folder in (self.output / path).parents:
                    if folder == self.output or not _remove_if_empty(folder):
                        break

    def _is_same(self, original: str, path: str) -> bool:
        """Return whether a published file is that of a result: the same, or a copy."""
        try:
            requested, result = os.lstat(original), os.lstat(f"{self.output}/{path}")
        except OSError:
            return False
        return stat.S_ISREG(result.st_mode) and (
            (requested.st_size, requested.st_mtime_ns) == (result.st_size, result.st_mtime_ns)
        )

    def _is_set_here(self, path: str) -> bool:
        """Return whether a path has nothing, or what this program wrote. Raises OutputError for what always stays."""
        target = f"{self.output}/{path}"
        try:
            result = os.lstat(target)
        except FileNotFoundError:
            return True
        except NotADirectoryError:
            result = None
        if result is None or stat.S_ISDIR(result.st_mode):
            kind = "a folder where a file" if result else "a file where a folder"
            raise OutputError(f"{target}: there is {kind} goes; move it, or choose another folder with --output")
        if source := self._identities.get((result.st_dev, result.st_ino)):
            raise OutputError(f"{source}: this input lies where {target} goes; choose another folder with --output")
        if not stat.S_ISREG(result.st_mode):
            return False
        lines = [line for line in self._published(path) if line["size"] == result.st_size]
        if any(line["mtime_ns"] == result.st_mtime_ns for line in lines):
            return True
        return bool(lines) and sha256_of(target) in {line["sha256"] for line in lines}

    def _record_of(self, path: str) -> Path:
        """Return the file of the record of what was published into the same folder."""
        folder = path.rpartition("/")[0].casefold()
        return self.own / "published" / f"{uuid.uuid5(uuid.NAMESPACE_URL, folder).hex[:16]}.jsonl"

    def _published(self, path: str) -> Iterator[dict[str, Any]]:
        """Yield what was ever published at a path, or at one that differs in case, which file systems may ignore."""
        requested = {"path": str, "size": int, "mtime_ns": int, "sha256": str}
        for line in lines_of(self._record_of(path)):
            is_whole = all(isinstance(line.get(name), kind) for name, kind in requested.items())
            if is_whole and line["path"].casefold() == path.casefold():
                yield line


def not_written(paths: list[str]) -> str:
    """Return what to say of files in the way that this program has not written."""
    some = ", ".join(paths[:3]) + (f" and {len(paths) - 3} more" if len(paths) > 3 else "")
    were, them = ("was", "it") if len(paths) == 1 else ("were", "them")
    return (
        f"{some} {were} not written by this program, or edited since; choose another folder with --output, or replace "
        f"{them} with --overwrite"
    )


def _inputs_known(output: Path) -> dict[str, list[Any]]:
    try:
        content = json.loads((output / OWN / "inputs.json").read_bytes())
        return {path: seen for path, seen in content.items() if len(seen) == 5 and isinstance(seen[-1], str)}
    except (OSError, ValueError, TypeError, AttributeError, RecursionError):
        return {}


def _remove_if_empty(folder: Path) -> bool:
    try:
        folder.rmdir()
    except OSError:
        return False
    return True
