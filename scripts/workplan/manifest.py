"""The manifest: which tasks are done, from what, and which files came of them.

`manifest.json` is replaced whole. Between two such writes every task that is done leaves a small file of its own, a
record, so that many processes, on many machines, can finish tasks of one folder without waiting for one another, and a
run of ten thousand tasks does not write ten thousand manifests. Reading takes both; a record counts for more.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scripts.files import replacing

from .hashing import FileState

SCHEMA = 1


class ManifestError(Exception):
    """A manifest that must not be replaced."""


@dataclass(frozen=True)
class Record:
    """A task that is done."""

    key: str
    """See `hashing.task_key`."""

    outputs: Mapping[str, FileState]

    seconds: float = 0.0
    """How long it took."""

    facts: Mapping[str, Any] = field(default_factory=dict)
    """What its function returned."""

    def as_json(self) -> dict[str, Any]:
        """Every field as plain data."""
        return vars(self) | {"outputs": {path: state.as_json() for path, state in self.outputs.items()}}

    def holds(self, key: str, output: Path) -> bool:
        """Whether these outputs are what the key asks for, and are all there, whole."""
        return self.key == key and all(state.still(output / path) for path, state in self.outputs.items())


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
        self.tasks: dict[str, Record] = {}
        self.failures: dict[str, dict[str, str]] = {}
        """Of the last run: task to what was said, and the details."""
        if path.is_file():
            self._take(path)
        for record in sorted(records.glob("*.json")) if only is None else filter(Path.is_file, map(self._place, only)):
            self._take(record)

    def add(self, name: str, record: Record) -> None:
        """Take down that a task is done, for good."""
        _write(self._place(name), [(name, record)], {})
        self.tasks[name] = record

    def write(self) -> None:
        """Write manifest.json with all records in it."""
        records = list(self._records.glob("*.json")) if self._records.is_dir() else []
        if not self.tasks and not self._path.exists():
            return
        _write(self._path, sorted(self.tasks.items()), self.failures)
        for record in records:
            record.unlink(missing_ok=True)

    def _place(self, name: str) -> Path:
        """Where the record of a task is: its name is any line of text, and no name for a file."""
        return self._records / f"{hashlib.sha256(name.encode('utf-8', 'surrogatepass')).hexdigest()[:32]}.json"

    def _take(self, path: Path) -> None:
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            schema = content["schema"]
            tasks = {
                name: Record(**{**record, "outputs": {at: FileState(**one) for at, one in record["outputs"].items()}})
                for name, record in (content["tasks"] if schema == SCHEMA else {}).items()
            }
        except (ValueError, TypeError, KeyError, AttributeError):
            return  # Damaged, or not ours: what it may have said is done again.
        if schema != SCHEMA:
            raise ManifestError(f"{path}: of schema {schema}, this program knows {SCHEMA}; choose another folder")
        self.tasks |= tasks


def _write(path: Path, tasks: Iterable[tuple[str, Record]], failures: Mapping[str, Mapping[str, str]]) -> None:
    """Write records, a line for each: of ten thousand there is never more than one in memory as text."""
    with replacing(path) as stream:
        stream.write(f'{{"schema": {SCHEMA}, "failures": {json.dumps(failures)}, "tasks": {{')
        for number, (name, record) in enumerate(tasks):
            stream.write(f"{',' if number else ''}\n{json.dumps(name)}: {json.dumps(record.as_json())}")
        stream.write("\n}}\n")
