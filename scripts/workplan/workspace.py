"""The output folder of a plan, opened for a run: locked, with its manifest, and cleared of what dead runs left.

Beside the outputs it holds `manifest.json` and, as long as there is need, `.workplan/` with the lock, the records of
tasks that are done, the plan, and a scratch folder for each task at work.
"""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Iterable
from pathlib import Path
from typing import Self

from .lock import FolderLock
from .manifest import Manifest, Record
from .performing import Made, Order
from .tasks import places_of


class Workspace:
    """An output folder, as a context.

    Parameters
    ----------
    output : Path
        Made where it is missing, and taken away again where nothing came of it.
    shared : bool
        For a single task among others that run at the same time: nothing is cleared, and manifest.json is left to
        those who have the folder for themselves.
    only : iterable of str, optional
        The tasks that it will be asked about; all unless given.

    Raises
    ------
    FolderInUse
        On entering, where another run has the folder.
    ManifestError
        Where the manifest is of a newer program.
    OSError
        Where the folder cannot be written.
    """

    def __init__(self, output: Path, *, shared: bool = False, only: Iterable[str] | None = None) -> None:
        self.output = output.absolute()
        self.own = self.output / ".workplan"
        self.plan_path = self.own / "plan.json"
        self.done_here: set[str] = set()
        """The tasks that were done since it was opened."""
        self.manifest: Manifest
        self._shared, self._only = shared, only
        # Making and removing folders takes longer than all else on some file systems: these are empty, and used again.
        self._used: list[Path] = []
        self._lock = FolderLock(self.own / "lock", output, shared=shared)
        self._missing = [folder for folder in (self.output, *self.output.parents) if not folder.exists()]

    def __enter__(self) -> Self:
        self._lock.__enter__()
        try:
            self.manifest = Manifest(self.output / "manifest.json", self.own / "records", self._only)
            if not self._shared:
                self._clear_scratch()
                self.manifest.failures = {}
        except BaseException:
            self._lock.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        try:
            if self._shared:
                for scratch in self._used:
                    _removed(scratch)
            else:
                self._clear_scratch()
                self.manifest.write()
        finally:
            self._lock.__exit__()
            self._remove_if_empty()

    def scratch(self) -> Path:
        """A folder for the outputs of a task at work, where they will be: empty, or yet to be made."""
        return self._used.pop() if self._used else self.own / "scratch" / uuid.uuid4().hex[:12]

    def put_in_place(self, order: Order, key: str, made: Made) -> Record:
        """Move the outputs that an order asked for to where they belong, and take down that its task is done.

        Raises
        ------
        OSError
            Where that cannot be. What was moved is not counted as done.
        """
        there, beside = os.fspath(self.output), order.scratch
        for path, place in places_of(order.outputs).items():
            try:
                os.replace(f"{beside}/{place}", f"{there}/{path}")
            except FileNotFoundError:
                (self.output / path).parent.mkdir(parents=True, exist_ok=True)
                os.replace(f"{beside}/{place}", f"{there}/{path}")
        if os.listdir(beside):
            shutil.rmtree(beside, ignore_errors=True)
        else:
            self._used.append(Path(beside))
        record = Record(key, {path: made.outputs[path] for path in order.outputs}, made.seconds, made.facts)
        self.manifest.add(order.name, record)
        self.done_here.add(order.name)
        return record

    def discard(self, outputs: Iterable[str]) -> None:
        """Delete outputs that nobody wants any more, and the folders that are empty then."""
        for path in outputs:
            place = self.output / path
            place.unlink(missing_ok=True)
            for folder in place.parents:
                if folder == self.output or not _removed(folder):
                    break

    def _clear_scratch(self) -> None:
        shutil.rmtree(self.own / "scratch", ignore_errors=True)

    def _remove_if_empty(self) -> None:
        """Leave no trace of a run that made nothing."""
        made = (self.output / "manifest.json").exists() or self._shared
        if not made:
            self.plan_path.unlink(missing_ok=True)
        for folder in (self.own / "records", self.own / "scratch", self.own):
            _removed(folder)
        for folder in self._missing:
            if not _removed(folder):
                break


def _removed(folder: Path) -> bool:
    """Remove a folder if it is empty."""
    try:
        folder.rmdir()
    except OSError:
        return False
    return True
