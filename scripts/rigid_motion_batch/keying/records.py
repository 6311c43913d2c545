"""Records of results and their inputs: a repeated command continues, and never replaces files it did not make.

Every folder with results has a file with lines of JSON, `.rigid-motion/keyed.jsonl`. Before a file is moved into place,
its digest and its input are recorded. When an input is done, its key (that of its task) and the other files it read are
recorded. No Blender is needed here.
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
    """The record of the results made from one input.

    Parameters
    ----------
    folder : Path
        The folder that results go to, or one above it.
    source : path or str
        The file, and the body if the user named one.
    overwrite : bool
        Whether to replace files that were made from another input, or edited since.
    """

    def __init__(self, folder: Path, source: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        self.folder, self.overwrite = folder, overwrite
        self._file = folder / OWN_FOLDER / NAME
        self._source = _relative(folder, source)

    def refuse_to_replace(self, path: Path) -> None:
        """Raise `FileProblem` if the path exists and may not be replaced."""
        if os.path.isdir(path):
            raise FileProblem(f"{path} is a folder: rename it, or give another --output")
        if os.path.lexists(path) and not self._may_replace(path):
            raise FileProblem(f"{path} is there already: add --overwrite, or another --output")

    @contextmanager
    def writing(self, path: Path) -> Iterator[Path]:
        """Yield a temporary path for a file that moves to `path` when the block succeeds: see `written_beside`.

        Raises `FileProblem` if the file cannot be written, or another run has written `path` in the meantime.
        """
        try:
            with written_beside(path, overwrite=self._may_replace(path)) as beside:
                yield beside
                # Recorded before the move: even if this process is killed, the file is known to be the program's own.
                line = {"file": _relative(self.folder, path), "sha256": sha256_of(beside), "source": self._source}
                append_lines(self._file, [line])
        except OSError as error:
            if isinstance(error, FileExistsError) and error.filename == str(path):
                problem = "has come there meanwhile, from another run perhaps: add --overwrite, or another --output"
                raise FileProblem(f"{path} {problem}") from None
            raise not_written(path, error.strerror or error) from None

    def keep(
        self, key: str, written: Sequence[Path], beside: Iterable[Path], read: Iterable[Path], facts: Mapping[str, Any]
    ) -> None:
        """Record that the input is done: the files written, their companions, the files read, and facts for JSON."""
        line = {
            "source": self._source,
            "key": key,
            "written": [_relative(self.folder, path) for path in written],
            "files": {_relative(self.folder, path): sha256_in(path) for path in (*written, *beside, *read)},
            "facts": dict(facts),
        }
        with suppress(OSError):
            append_lines(self._file, [line])

    def done(self, key: str) -> tuple[list[Path], Mapping[str, Any]] | None:
        """Return the files recorded under a key, and their facts; None if any of them, or a file that was read, has
        changed.
        """
        with suppress(LookupError, TypeError, AttributeError):
            line = [line for line in self._lines if line.get("key") == key][-1]
            if all(sha256_in(self.folder / name) == digest for name, digest in line["files"].items()):
                return [self.folder / name for name in line["written"]], line["facts"]
        return None

    def _may_replace(self, path: Path) -> bool:
        """Return whether a file may be replaced: always with `overwrite`, else an unchanged result of this input."""
        return self.overwrite or _has_recorded_digest(path, _relative(self.folder, path), self._lines)

    @property
    def _lines(self) -> list[dict[str, Any]]:
        return [line for line in _record_lines(self._file) if line.get("source") == self._source]


def is_made(path: Path) -> bool:
    """Return whether this program wrote the file, unchanged since, according to the record of its folder."""
    return _has_recorded_digest(path, path.name, _record_lines(path.parent / OWN_FOLDER / NAME))


def _has_recorded_digest(path: Path, name: str, lines: Iterable[Mapping[str, Any]]) -> bool:
    """Return whether a file has a digest that the record has under its name."""
    digests = {line.get("sha256") for line in lines if line.get("file") == name}
    return bool(digests) and sha256_in(path) in digests


def _record_lines(file: Path) -> Sequence[dict[str, Any]]:
    """Return the lines of a record; cached until the file changes in size."""
    try:
        return _cached_lines(file, file.stat().st_size)
    except OSError:
        return ()


@lru_cache(maxsize=8)
def _cached_lines(file: Path, _size: int) -> Sequence[dict[str, Any]]:
    return tuple(lines_of(file))


def _relative(folder: Path, path: str | os.PathLike[str]) -> str:
    """Return a path relative to a folder, so that both can be moved together."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # On another drive.
        return Path(os.path.abspath(path)).as_posix()


class FileProblem(Exception):
    """Why a file cannot be processed, and what the user can do."""


class Unreadable(FileProblem):
    """Why a file cannot be opened, and what the user can do."""


def not_written(path: str | Path, reason: object) -> FileProblem:
    """Return the problem for a file that could not be written."""
    return FileProblem(f"{path} could not be written ({reason}): write elsewhere with --output")


def changed_at(path: Path) -> int | None:
    """Return when a file was last changed, in nanoseconds; None if there is no file."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return None


def refuse_read_only(path: Path) -> None:
    """Raise `FileProblem` if a file or its folder is read-only, before hours of work go into it."""
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
