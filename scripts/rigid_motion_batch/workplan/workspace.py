"""The output folder of a plan, opened for a run: locked, with its manifest, and cleared of what dead runs left.

Beside the outputs it holds `manifest.json` and, as long as there is need, `.workplan/` with the lock, the records of
tasks that are done, the plan, and a scratch folder for each task at work.
"""

from __future__ import annotations

import os
import shutil
import stat
import uuid
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from rigid_motion_batch.files import clear_beside

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
        self.was_ours = self.own.is_dir()
        """Whether this program has worked in the folder before."""
        # Making and removing folders takes longer than all else on some file systems: these are empty, and used again.
        self._used: list[Path] = []
        self._lock = FolderLock(self.own / "lock", output, shared=shared)
        self._missing = [folder for folder in (self.output, *self.output.parents) if not folder.exists()]

    def __enter__(self) -> Self:
        self._mend()
        self._lock.__enter__()
        try:
            manifest = self.output / "manifest.json"
            self.manifest = Manifest(manifest, self.own / "records", self._only)
            if not self._shared:
                self._clear_scratch()
                clear_beside(manifest)
                clear_beside(self.plan_path)
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
            self.manifest.close()
            self._lock.__exit__()
            self._remove_if_empty()

    def scratch(self) -> Path:
        """A folder for the outputs of a task at work, where they will be: empty, or yet to be made."""
        return self._used.pop() if self._used else self.own / "scratch" / uuid.uuid4().hex[:12]

    def put_in_place(self, order: Order, key: str, made: Made, made_of: Mapping[str, Any] | None = None) -> None:
        """Move the outputs that an order asked for to where they belong, and take down that its task is done.

        Raises
        ------
        OSError
            Where that cannot be. What was moved is not counted as done.
        """
        there, beside = os.fspath(self.output), order.scratch
        outputs = {path: made.outputs[path] for path in order.outputs}
        # Killed from here on, what was moved is known to be the program's own.
        self.manifest.add(order.name, Record("", outputs))
        for path, place in places_of(order.outputs).items():
            try:
                os.replace(f"{beside}/{place}", f"{there}/{path}")
            except OSError:
                self._make_room(path)
                os.replace(f"{beside}/{place}", f"{there}/{path}")
        if os.listdir(beside):
            shutil.rmtree(beside, ignore_errors=True)
        else:
            self._used.append(Path(beside))
        self.manifest.add(order.name, Record(key, outputs, made.seconds, made.facts, made_of or {}))
        self.done_here.add(order.name)

    def withdraw(self, names: Iterable[str]) -> None:
        """Undo tasks: their outputs are deleted, and nothing is known of them any more."""
        for name in names:
            if record := self.manifest.get(name):
                self.discard(record.outputs)
            self.manifest.forget(name)

    def withdraw_damaged(self, names: Iterable[str]) -> Path | None:
        """Let tasks be done again whose outputs are not what was made, though they have its size and time.

        Returns
        -------
        Path or None
            The first such output; None where there is none.
        """
        first = None
        for name in names:
            record = self.manifest.get(name)
            states = record.outputs.items() if record else ()
            damaged = [place for path, state in states if not state.is_content_of(place := self.output / path)]
            if damaged:
                self.manifest.withdraw(name)
                first = first or damaged[0]
        return first

    def discard(self, outputs: Iterable[str]) -> None:
        """Delete outputs that nobody wants any more, and the folders that are empty then."""
        for path in outputs:
            place = self.output / path
            place.unlink(missing_ok=True)
            for folder in place.parents:
                if folder == self.output or not _removed(folder):
                    break

    def _make_room(self, path: str) -> None:
        """Make the folders for an output, and clear away what is no folder, or no file, where one must be.

        Only below names that begin with a dot, which are the program's own: anything else is left for the error that
        comes of it.
        """
        place = self.output / path
        for folder in [*reversed(place.parents)][len(self.output.parents) + 1 :]:
            if path.startswith(".") and os.path.lexists(folder) and not folder.is_dir():
                folder.unlink()
        place.parent.mkdir(parents=True, exist_ok=True)
        if place.is_dir() and not place.is_symlink():
            shutil.rmtree(place) if path.startswith(".") else place.rmdir()

    def _mend(self) -> None:
        """Clear away what damage has put where the program keeps its own files and folders."""
        for folder in (self.own, self.own / "records", self.own / "scratch"):
            if os.path.lexists(folder) and not folder.is_dir():
                folder.unlink()
        for file in (self._lock.path, self.plan_path):
            with suppress(FileNotFoundError):
                kind = file.lstat().st_mode
                if stat.S_ISDIR(kind):
                    shutil.rmtree(file)
                elif not stat.S_ISREG(kind):
                    file.unlink()

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
