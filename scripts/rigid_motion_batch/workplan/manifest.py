"""The manifest: which tasks are done, from what, and which files came of them.

`manifest.json` is replaced whole. Between two such writes every task that is done leaves a small file of its own, a
record, so that many processes, on many machines, can finish tasks of one folder without waiting for one another, and a
run of ten thousand tasks does not write ten thousand manifests. Reading takes both; a record counts for more.

A manifest may be damaged, or a stranger's, so nothing that it says is believed before it has been looked at: of the
lines that hold a record each stands for itself, and one that makes no sense is a task that is not done. Records stay
where they are until somebody asks for one: in memory is only in which line of which file it is.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from rigid_motion_batch.files import replacing

from .hashing import FileState, is_regular

SCHEMA = 1

LONGEST_LINE = 1 << 26
"""Characters; what is longer is no record."""

APART = -1

DECODER = json.JSONDecoder()

END = b"}}\n"
"""The last line."""

UNREADABLE = (ValueError, TypeError, KeyError, AttributeError, RecursionError)
"""What reading JSON that is damaged, or made to do harm, comes to."""


class ManifestError(Exception):
    """A manifest that must not be replaced."""


@dataclass(frozen=True, slots=True)
class Record:
    """A task that is done, or with an empty key one whose outputs are on their way."""

    key: str
    """See `hashing.task_key`."""

    outputs: Mapping[str, FileState]

    seconds: float = 0.0
    """How long it took."""

    facts: Mapping[str, Any] = field(default_factory=dict)
    """What its function returned."""

    made_of: Mapping[str, Any] = field(default_factory=dict)
    """What the key is the digest of, in short: see `status.made_of`."""

    def as_json(self) -> dict[str, Any]:
        """Every field as plain data."""
        outputs = {path: state.as_json() for path, state in self.outputs.items()}
        plain = {"key": self.key, "outputs": outputs, "seconds": self.seconds, "facts": self.facts}
        return plain | ({"made_of": self.made_of} if self.made_of else {})

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Record:
        """The record of `as_json`. Raises one of `UNREADABLE` where it is none."""
        record = cls(**{**content, "outputs": {path: FileState(**one) for path, one in content["outputs"].items()}})
        if not (isinstance(record.key, str) and isinstance(record.seconds, int | float)):
            raise TypeError(f"{record.key!r} is no key, or {record.seconds!r} are no seconds")
        if not (isinstance(record.facts, dict) and isinstance(record.made_of, dict)):
            raise TypeError(f"{record.facts!r} and {record.made_of!r} are no facts")
        return record


class Manifest:
    """The records of an output folder.

    Parameters
    ----------
    path : Path
        Of manifest.json.
    records : Path
        The folder of the records that are not in it yet.
    only : iterable of str, optional
        The tasks that anybody will ask about; all unless given. There may be very many records.

    Raises
    ------
    ManifestError
        Where the manifest is of a newer program.
    OSError
        Where a file cannot be read.
    """

    def __init__(self, path: Path, records: Path, only: Iterable[str] | None = None) -> None:
        self._path, self._records = path, records
        self._lines: dict[str, int] = {}
        """Task to where its line begins in manifest.json, `APART` where it is in a file of its own."""
        self._stream: BinaryIO | None = None
        """The manifest, as long as records are read from it."""
        self.versions: dict[str, Mapping[str, str]] = {}
        """What the records call a version, to what it is of: see `Plan.versions`."""
        self.failures: dict[str, dict[str, str]] = {}
        """Of the last run: task to what was said, and the details."""
        self._changed = False
        self.is_whole = self._take(path)
        """Whether manifest.json is there, with every line that was written to it."""
        for record in map(records.joinpath, self._apart()) if only is None else map(self._place, only):
            self._take(record)
        self._changed = self._changed or not self.is_whole

    def __contains__(self, name: str) -> bool:
        return name in self._lines

    def __iter__(self) -> Iterator[str]:
        return iter(self._lines)

    def get(self, name: str) -> Record | None:
        """The record of a task; None where there is none that makes sense."""
        if name not in self._lines:
            return None
        try:
            return Record.from_json(json.loads(self._text_of(name)))
        except UNREADABLE:
            return None

    def add(self, name: str, record: Record) -> None:
        """Take down that a task is done, for good."""
        _write(self._place(name), [(name, json.dumps(record.as_json()))])
        self._lines[name] = APART
        self._changed = True

    def withdraw(self, name: str) -> None:
        """Take down that a task is not done, and that what lies under the names of its outputs is the program's."""
        if record := self.get(name):
            self.add(name, Record("", record.outputs))

    def forget(self, name: str) -> None:
        """Know no more of a task."""
        self._lines.pop(name, None)
        self._changed = True
        self._place(name).unlink(missing_ok=True)

    def write(self) -> None:
        """Write manifest.json with all records in it, if there is anything new to be said."""
        records = self._apart()
        if not (self._changed or records or self.failures) or not (self._lines or self.is_whole):
            return  # So a file of that name that is no manifest stays as it is, where nothing is to be said.
        known = ((name, text) for name in sorted(self._lines) if (text := self._text_of(name)).endswith("}"))
        _write(self._path, known, versions=self.versions, failures=self.failures, when_written=self.close)
        for record in records:
            (self._records / record).unlink(missing_ok=True)
        self._take(self._path)

    def close(self) -> None:
        """Let go of manifest.json."""
        if self._stream:
            self._stream.close()
            self._stream = None

    def _text_of(self, name: str) -> str:
        """The record of a task as JSON; empty where it has gone."""
        offset = self._lines[name]
        try:
            if offset == APART:
                with self._place(name).open("rb") as stream:
                    stream.readline(LONGEST_LINE)
                    found = _record(stream.readline(LONGEST_LINE))
            else:
                self._stream = self._stream or self._path.open("rb")
                self._stream.seek(offset)
                found = _record(self._stream.readline(LONGEST_LINE))
        except OSError:
            return ""
        return found[1] if found else ""

    def _apart(self) -> list[str]:
        """The names of the files of records that are not in manifest.json."""
        names = os.listdir(self._records) if self._records.is_dir() else ()
        return sorted(name for name in names if name.endswith(".json"))

    def _place(self, name: str) -> Path:
        """Where the record of a task is: its name is any line of text, and no name for a file."""
        return self._records / f"{hashlib.sha256(name.encode('utf-8', 'surrogatepass')).hexdigest()[:32]}.json"

    def _take(self, path: Path) -> bool:
        """Take what a file says, and return whether it is all that was written to it."""
        if not is_regular(path):
            return False
        with path.open("rb") as stream:
            header = _header(stream.readline(LONGEST_LINE))
            schema = header.get("schema")
            if isinstance(schema, int) and schema > SCHEMA:
                raise ManifestError(f"{path}: of schema {schema}, this program knows {SCHEMA}; choose another folder")
            if schema != SCHEMA or header.get("tasks") != {}:
                return False
            self.versions |= _versions(header.get("versions"))
            self._changed = self._changed or bool(header.get("failures"))
            is_whole, offset = False, stream.tell()
            for line in iter(lambda: stream.readline(LONGEST_LINE), b""):
                is_whole = line == END
                if not is_whole and (found := _record(line)):
                    if path == self._path:
                        self._lines[found[0]] = offset
                    elif path == self._place(found[0]):
                        self._lines[found[0]] = APART
                offset += len(line)
        return is_whole


def _header(line: bytes) -> Mapping[str, Any]:
    """The first line of a manifest, without the records: nothing where it is none."""
    for ending in (b"", b"}}"):
        try:
            header = json.loads(line + ending)
            return header if isinstance(header, dict) else {}
        except UNREADABLE:
            continue
    return {}


def _versions(content: object) -> dict[str, Mapping[str, str]]:
    return {name: of for name, of in content.items() if isinstance(of, dict)} if isinstance(content, dict) else {}


def _record(line: bytes) -> tuple[str, str] | None:
    """A task and its record, which is yet to be read; None where the line holds neither."""
    try:
        line = line.decode("utf-8")
        name, end = DECODER.raw_decode(line)
    except UNREADABLE:
        return None
    return (name, line[end:].lstrip(": ").rstrip(",\n")) if isinstance(name, str) else None


def _write(
    path: Path,
    records: Iterable[tuple[str, str]],
    when_written: Callable[[], None] = lambda: None,
    **header: Mapping[str, Any],
) -> None:
    """Write records, a line for each: of ten thousand there is never more than one in memory as text."""
    if path.is_symlink():
        path.unlink()  # Whoever put it there, what it leads to is not ours.
    with replacing(path) as stream:
        stream.write(json.dumps({"schema": SCHEMA, **header})[:-1] + ', "tasks": {')
        for number, (name, line) in enumerate(records):
            stream.write(f"{',' if number else ''}\n{json.dumps(name)}: {line}")
        stream.write(f"\n{END.decode()}")
        when_written()  # Windows replaces no file that is open.
