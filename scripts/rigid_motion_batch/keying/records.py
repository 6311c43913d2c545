"""What was made of an input, beside it: so a command that is run again goes on, and replaces nothing of others.

A folder that something was written to has a file with lines of JSON, `.rigid-motion/keyed.jsonl`: of every file its
digest and the input that it was made of, before it is moved into place; and of every input that is done its key, which
is that of a task, and what else was read for it. No Blender is needed here.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from rigid_motion_batch.files import append_lines, lines_of, written_beside
from rigid_motion_batch.pipeline.steps import OWN_FOLDER, sha256_in, sha256_of

NAME = "keyed.jsonl"


class InputRecord:
    """What was made of an input.

    Parameters
    ----------
    folder : Path
        Where to, or above it.
    source : path or str
        The file, and the body where one is meant.
    overwrite : bool
        Whether files may be replaced that were not made of it, or edited since.
    """

    def __init__(self, folder: Path, source: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        self.folder, self.overwrite = folder, overwrite
        self._file = folder / OWN_FOLDER / NAME
        self._source = _from(folder, source)

    def refuse_to_replace(self, path: Path) -> None:
        """Raise `FileProblem` where there is something already that is not to be replaced."""
        if os.path.isdir(path):
            raise FileProblem(f"{path} is a folder: rename it, or give another --output")
        if os.path.lexists(path) and not self._may_replace(path):
            raise FileProblem(f"{path} is there already: add --overwrite, or another --output")

    @contextmanager
    def writing(self, path: Path) -> Iterator[Path]:
        """Yield a path for a file that takes its place at `path` when the block ends well: see `written_beside`.

        Raises `FileProblem` where it cannot be written, or another run has put something there meanwhile.
        """
        try:
            with written_beside(path, overwrite=self._may_replace(path)) as beside:
                yield beside
                # Killed from here on, what was moved is known to be the program's own.
                line = {"file": _from(self.folder, path), "sha256": sha256_of(beside), "source": self._source}
                append_lines(self._file, [line])
        except OSError as error:
            if isinstance(error, FileExistsError) and error.filename == str(path):
                problem = "has come there meanwhile, from another run perhaps: add --overwrite, or another --output"
                raise FileProblem(f"{path} {problem}") from None
            raise not_written(path, error.strerror or error) from None

    def keep(
        self, key: str, written: Sequence[Path], beside: Iterable[Path], read: Iterable[Path], facts: Mapping[str, Any]
    ) -> None:
        """Note that the input is done: what was written, and beside that, what was read, and facts for JSON."""
        line = {
            "source": self._source,
            "key": key,
            "written": [_from(self.folder, path) for path in written],
            "files": {_from(self.folder, path): sha256_in(path) for path in (*written, *beside, *read)},
            "facts": dict(facts),
        }
        with suppress(OSError):
            append_lines(self._file, [line])

    def done(self, key: str) -> tuple[list[Path], Mapping[str, Any]] | None:
        """Return the files that were made under a key, and facts; None where one, or what was read,
        is not as it was.
        """
        with suppress(LookupError, TypeError, AttributeError):
            line = [line for line in self._lines if line.get("key") == key][-1]
            if all(sha256_in(self.folder / name) == digest for name, digest in line["files"].items()):
                return [self.folder / name for name in line["written"]], line["facts"]
        return None

    def _may_replace(self, path: Path) -> bool:
        """Return whether a file may be replaced: as a rule, where it is as it was made of this input."""
        return self.overwrite or _is_among(path, _from(self.folder, path), self._lines)

    @property
    def _lines(self) -> list[dict[str, Any]]:
        return [line for line in _lines_of(self._file) if line.get("source") == self._source]


def is_made(path: Path) -> bool:
    """Return whether a file is as this program has written it, by the record of its folder."""
    return _is_among(path, path.name, _lines_of(path.parent / OWN_FOLDER / NAME))


def _is_among(path: Path, name: str, lines: Iterable[Mapping[str, Any]]) -> bool:
    """Return whether a file is as lines of a record say under its name."""
    digests = {line.get("sha256") for line in lines if line.get("file") == name}
    return bool(digests) and sha256_in(path) in digests


def _lines_of(file: Path) -> Sequence[dict[str, Any]]:
    """Return the lines of a record, read anew when it has grown."""
    try:
        return _read(file, file.stat().st_size)
    except OSError:
        return ()


@lru_cache(maxsize=8)
def _read(file: Path, _size: int) -> Sequence[dict[str, Any]]:
    return tuple(lines_of(file))


def _from(folder: Path, path: str | os.PathLike[str]) -> str:
    """Return a path as it counts from a folder, so that both can be moved."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # On another drive.
        return Path(os.path.abspath(path)).as_posix()


class FileProblem(Exception):
    """Why a file cannot be done, and the way out."""


class Unreadable(FileProblem):
    """Why a file cannot be opened, and the way out."""


def not_written(path: str | Path, reason: object) -> FileProblem:
    """Return why a file was begun, and is not there."""
    return FileProblem(f"{path} could not be written ({reason}): write elsewhere with --output")


def changed_at(path: Path) -> int | None:
    """Return when a file was changed last, in nanoseconds; None where there is none."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return None


def refuse_read_only(path: Path) -> None:
    """Raise `FileProblem` where a file or its folder cannot be written: better said before hours go into it."""
    place = Path(os.path.realpath(path))
    if not os.path.exists(place):
        place = next(parent for parent in place.parents if os.path.exists(parent))
        if not os.path.isdir(place):
            raise FileProblem(f"{place} is a file, and {path} cannot be written in it: give another --output")
    elif os.access(place, os.W_OK):
        place = place.parent
    if not os.access(place, os.W_OK):
        raise FileProblem(
            f"{path} cannot be written, for {place} is read-only: allow it, or write elsewhere with --output"
        )
